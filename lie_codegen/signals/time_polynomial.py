"""Functions sum c_{p,n} tau^p e^{i n w tau}, exact: products, integrals from 0, means over a period."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import TypeAlias

from lie_codegen.errors import InputError
from lie_codegen.exact.expression import time_symbol
from lie_codegen.on_demand import sympy as sp
from lie_codegen.signals.periodic_input import PeriodicInput

#: (power of tau, harmonic) -> coefficient.
Terms: TypeAlias = "Mapping[tuple[int, int], sp.Expr]"


@dataclass(frozen=True)
class TimePolynomial:
    """An exact function of the fast time; secular terms are the powers of tau.

    Attributes:
        terms: (p, n) -> c, nothing stored where c = 0.
        period: T = 2 pi / w.
    """

    terms: Terms
    period: sp.Expr

    @property
    def frequency(self) -> sp.Expr:
        """w = 2 pi / T."""
        return 2 * sp.pi / self.period

    def __add__(self, other: TimePolynomial) -> TimePolynomial:
        return _collect([*self.terms.items(), *other.terms.items()], self.period)

    def __sub__(self, other: TimePolynomial) -> TimePolynomial:
        return self + other.scaled(sp.S.NegativeOne)

    def __mul__(self, other: TimePolynomial) -> TimePolynomial:
        pairs = [((p + q, n + m), a * b) for (p, n), a in self.terms.items() for (q, m), b in other.terms.items()]
        return _collect(pairs, self.period)

    def scaled(self, factor: sp.Expr) -> TimePolynomial:
        """factor times the function."""
        return _collect([(key, factor * value) for key, value in self.terms.items()], self.period)

    def integral(self) -> TimePolynomial:
        """int_0^tau."""
        w = self.frequency
        pairs: list[tuple[tuple[int, int], sp.Expr]] = []
        for (power, n), value in self.terms.items():
            if n == 0:
                pairs.append(((power + 1, 0), value / (power + 1)))
                continue
            # int tau^p e^{a tau} = e^{a tau} sum_j (-1)^j p! / (p - j)! tau^(p - j) / a^(j + 1)
            a, factor = sp.I * n * w, sp.S.One
            for j in range(power + 1):
                pairs.append(((power - j, n), value * factor / a ** (j + 1)))
                if j == power:
                    pairs.append(((0, 0), -value * factor / a ** (j + 1)))
                factor = -factor * (power - j)
        return _collect(pairs, self.period)

    def mean(self) -> sp.Expr:
        """(1/T) int_0^T."""
        total = sp.S.Zero
        for (power, _), value in self.integral().terms.items():
            total += value * self.period**power
        return sp.expand(total / self.period)

    def without_mean(self) -> TimePolynomial:
        """The function less its mean."""
        return self - constant(self.mean(), self.period)

    def primitive(self) -> TimePolynomial:
        """The integral of zero mean, of a function of zero mean: periodic."""
        return self.integral().without_mean()

    def expression(self, time: sp.Symbol) -> sp.Expr:
        """The function in sines and cosines."""
        w, result = self.frequency, sp.S.Zero
        for (power, n), value in self.terms.items():
            re, im = sp.expand(value).as_real_imag()
            result += time**power * (re * sp.cos(n * w * time) - im * sp.sin(n * w * time))
        return sp.expand(result)


def constant(value: sp.Expr, period: sp.Expr) -> TimePolynomial:
    """A constant function."""
    return _collect([((0, 0), value)], period)


def fourier_terms(u: PeriodicInput) -> tuple[TimePolynomial, ...]:
    """The components of an exact periodic input.

    Raises:
        InputError: an input that is not a trigonometric polynomial.
    """
    if not u.exact:
        raise InputError(
            "vibrational averages take sums of sines and cosines; approximate the input first, as with "
            "PeriodicInput.from_samples(values, period)"
        )
    period = u.period
    return tuple(_parse(sp.expand(entry), period) for entry in u.expressions)


def _parse(expression: sp.Expr, period: sp.Expr) -> TimePolynomial:
    pairs: list[tuple[tuple[int, int], sp.Expr]] = []
    for term in sp.Add.make_args(expression):
        factor, wave = term.as_independent(time_symbol(), as_Add=False)
        if not wave.has(time_symbol()):
            pairs.append(((0, 0), factor * wave))  # SymPy splits 0 into 0 * 0, anything else constant into itself * 1
            continue
        if not isinstance(wave, sp.sin | sp.cos):
            raise InputError(f"{wave} is no sine or cosine")
        argument = sp.expand(wave.args[0])
        phase = argument.xreplace({time_symbol(): sp.S.Zero})
        ratio = sp.simplify((argument - phase) / time_symbol() * period / (2 * sp.pi))
        if not ratio.is_Integer:
            raise InputError(f"{wave} is not periodic with period {period}")
        n, half = int(ratio), factor / 2
        turn, back = (sp.cos(phase) + sign * sp.I * sp.sin(phase) for sign in (1, -1))
        if isinstance(wave, sp.cos):
            pairs += [((0, n), half * turn), ((0, -n), half * back)]
        else:
            pairs += [((0, n), -sp.I * half * turn), ((0, -n), sp.I * half * back)]
    return _collect(pairs, period)


def _collect(pairs: Iterable[tuple[tuple[int, int], sp.Expr]], period: sp.Expr) -> TimePolynomial:
    sums: dict[tuple[int, int], sp.Expr] = {}
    for key, value in pairs:
        sums[key] = sums.get(key, sp.S.Zero) + value
    expanded = {key: sp.expand(value) for key, value in sums.items()}
    return TimePolynomial({key: value for key, value in expanded.items() if value != 0}, period)
