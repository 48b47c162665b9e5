"""Signals with values in a Lie algebra and exact Fourier coefficients, polynomial in the time where they are secular.

    x(tau) = sum_i A_i sum_p tau^p w_ip(tau) / denominator,   w_ip trigonometric polynomials.

The Floquet-Magnus recursion never leaves p = 0; the Magnus series and inputs with a mean need p > 0.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

from lie_codegen.algebra.lie_algebra import Sparse
from lie_codegen.exact.budget import Meter
from lie_codegen.signals import trigonometric as trig
from lie_codegen.signals.coefficients import Coefficient, CoefficientRing

#: For i < j, (i, j) -> {k: c}: [A_i, A_j] = sum_k c A_k.
Brackets = Mapping[tuple[int, int], Sparse]

#: power of tau -> trigonometric polynomial
Component = dict[int, trig.Wave]


@dataclass(frozen=True)
class TrigSignal:
    """Components (basis index -> power of tau -> wave), all over one integer denominator; no zeros stored."""

    components: dict[int, Component]
    denominator: int = 1

    @property
    def is_zero(self) -> bool:
        """Whether every coefficient vanishes identically."""
        return not self.components


@dataclass(frozen=True)
class TrigCalculus:
    """The operations of an averaging recursion on TrigSignals.

    Attributes:
        brackets: structure constants, for i < j; empty where only linear operations are meant.
        ring: of the coefficients of the signals and of the structure constants.
    """

    brackets: Brackets
    ring: CoefficientRing

    @cached_property
    def _scaled(self) -> tuple[dict[tuple[int, int], list[tuple[int, Coefficient]]], int]:
        """The structure constants in the ring, times their common denominator, and that denominator."""
        rows = {
            pair: [(k, *self.ring.element(value)) for k, value in row.items()] for pair, row in self.brackets.items()
        }
        common = math.lcm(1, *(d for row in rows.values() for _, _, d in row))
        return {pair: [(k, c * (common // d)) for k, c, d in row] for pair, row in rows.items()}, common

    @cached_property
    def meter(self) -> Meter:
        """What has been spent on products so far."""
        return Meter("the average to this order")

    def bracket(self, x: TrigSignal, y: TrigSignal, *, mean_only: bool = False) -> TrigSignal:
        """[x, y], or its mean over a period (for signals without powers of tau)."""
        multiply = self.ring.multiply
        product = trig.add_twice_product_mean if mean_only else trig.add_twice_product
        constants, scale = self._scaled
        total: dict[int, Component] = {}
        for (i, j), rows in constants.items():
            wedge: Component = {}
            for a, b, sign in ((i, j, 1), (j, i, -1)):
                for p, u in x.components.get(a, {}).items():
                    for q, v in y.components.get(b, {}).items():
                        self.meter.spend(trig.products(u, v))
                        product(wedge.setdefault(p + q, {}), u, v, sign, multiply)
            for k, c in rows:
                for p, wave in wedge.items():
                    trig.add_scaled(total.setdefault(k, {}).setdefault(p, {}), wave, c, multiply)
        return self.reduced(total, 2 * scale * x.denominator * y.denominator)

    def combine(self, terms: Iterable[tuple[Fraction | int, TrigSignal]]) -> TrigSignal:
        """sum of factor * signal."""
        chosen = [(Fraction(f), s) for f, s in terms if f and not s.is_zero]
        if not chosen:
            return TrigSignal({})
        denominator = math.lcm(*(s.denominator * f.denominator for f, s in chosen))
        multiply = self.ring.multiply
        total: dict[int, Component] = {}
        for factor, signal in chosen:
            integer = factor.numerator * (denominator // (signal.denominator * factor.denominator))
            for i, component in signal.components.items():
                for p, wave in component.items():
                    trig.add_scaled(total.setdefault(i, {}).setdefault(p, {}), wave, integer, multiply)
        return self.reduced(total, denominator)

    def mean(self, x: TrigSignal) -> TrigSignal:
        """(1 / 2 pi) int_0^{2 pi} x d tau, for a signal without powers of tau."""
        total = {i: {0: trig.mean(component.get(0, {}))} for i, component in x.components.items()}
        return self.reduced(total, x.denominator)

    def primitive(self, x: TrigSignal) -> TrigSignal:
        """int_0^tau x."""
        divisor = math.lcm(1, *(p + 1 for c in x.components.values() for p in c), *self._frequency_powers(x))
        total: dict[int, Component] = {}
        for i, component in x.components.items():
            target = total.setdefault(i, {})
            for p, wave in component.items():
                for key, (cosine, sine) in wave.items():
                    _integrate_term(target, p, key, cosine * divisor, sine * divisor)
            start: trig.Wave = {}
            for key, (cosine, sine) in target.get(0, {}).items():
                at_zero = key - trig.frequency_of(key)
                trig.add_term(start, at_zero, -cosine, -sine)
            for key, (cosine, sine) in start.items():
                trig.add_term(target.setdefault(0, {}), key, cosine, sine)
        return self.reduced(total, x.denominator * divisor)

    def times_tau(self, x: TrigSignal) -> TrigSignal:
        """tau x."""
        moved = {i: {p + 1: wave for p, wave in component.items()} for i, component in x.components.items()}
        return TrigSignal(moved, x.denominator)

    def _frequency_powers(self, x: TrigSignal) -> set[int]:
        powers: set[int] = set()
        for component in x.components.values():
            for p, wave in component.items():
                powers.update(f ** (p + 1) for f in trig.frequencies(wave))
        return powers

    def reduced(self, total: dict[int, Component], denominator: int) -> TrigSignal:
        """Zeros dropped, common factors cancelled."""
        components: dict[int, Component] = {}
        for i, component in total.items():
            kept = {p: wave for p, raw in component.items() if (wave := trig.clean(raw))}
            if kept:
                components[i] = kept
        common = denominator
        entries = [e for c in components.values() for wave in c.values() for e in wave.values()]
        for entry in entries:
            for coefficient in entry:
                if common == 1:
                    break
                if coefficient:
                    common = math.gcd(common, self.ring.content(coefficient))
        if common > 1:
            divide = self.ring.divide
            for entry in entries:
                entry[:] = [divide(c, common) if c else 0 for c in entry]
        return TrigSignal(components, denominator // common)


def _integrate_term(target: Component, power: int, key: int, cosine: Coefficient, sine: Coefficient) -> None:
    """target += a primitive of tau^p (a cos + b sin); the coefficients are divisible by what divides them here."""
    frequency = trig.frequency_of(key)
    if frequency == 0:
        trig.add_term(target.setdefault(power + 1, {}), key, _over(cosine, power + 1), _over(sine, power + 1))
        return
    trig.add_term(target.setdefault(power, {}), key, -_over(sine, frequency), _over(cosine, frequency))
    if power:
        _integrate_term(target, power - 1, key, _over(sine * power, frequency), -_over(cosine * power, frequency))


def _over(value: Coefficient, divisor: int) -> Coefficient:
    """Exact division by an integer."""
    if isinstance(value, int):
        return value // divisor
    return value.quo_ground(divisor) if divisor > 0 else -(value.quo_ground(-divisor))
