"""Formulas to trigonometric polynomials: sums, products and integer powers of sines and cosines, exactly."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

from lie_codegen.errors import PeriodError
from lie_codegen.exact.budget import Meter
from lie_codegen.on_demand import sympy as sp
from lie_codegen.signals import trigonometric as trig
from lie_codegen.signals.coefficients import CoefficientRing
from lie_codegen.signals.trig_signal import TrigSignal

#: Multiples of a phase unit beyond this start a unit of their own.
_LARGEST_MULTIPLE = 1000
#: Oscillations a period that leave room for the sums of an expansion of order 16 and more.
_LARGEST_FREQUENCY = 2**18


#: A decimal period this near a common one (relatively) is meant to be it: 6.283185307179586 is 2 pi.
_SNAP = 4e-15


class NotTrigonometricError(Exception):
    """A formula is not a trigonometric polynomial in the time; the caller falls back to quadrature."""


@dataclass
class Census:
    """What a first walk over the formulas finds."""

    time: sp.Symbol
    coefficients: list[sp.Expr] = field(default_factory=list)
    rates: dict[sp.Expr, None] = field(default_factory=dict)
    units: dict[sp.Expr, int] = field(default_factory=dict)

    def visit(self, node: sp.Expr) -> None:
        """Note frequencies, phases and coefficients below a node."""
        if isinstance(node, sp.Add | sp.Mul):
            for argument in node.args:
                self.visit(argument)
        elif isinstance(node, sp.Pow) and node.exp.is_Integer and node.exp > 0:
            self.visit(node.base)
        elif isinstance(node, sp.cos | sp.sin):
            self._angle(node.args[0])
        elif node.has(self.time):
            raise NotTrigonometricError(str(node))
        else:
            self.coefficients.append(node)

    def _angle(self, angle: sp.Expr) -> None:
        rate, turns, phases = split_angle(angle, self.time)
        if rate != 0:
            self.rates[rate] = None
        self.coefficients.extend(_turn(turns))
        for unit, multiple in phases.items():
            self.units[unit] = math.lcm(self.units.get(unit, 1), int(multiple.q))


def split_angle(angle: sp.Expr, time: sp.Symbol) -> tuple[sp.Expr, sp.Rational, dict[sp.Expr, sp.Rational]]:
    """angle = rate time + turns pi + sum multiple unit."""
    expanded = sp.expand(angle)
    rate = expanded.coeff(time)
    rest = sp.expand(expanded - rate * time)
    if rest.has(time) or rate.has(time):
        raise NotTrigonometricError(str(angle))
    turns: sp.Rational = sp.S.Zero
    phases: dict[sp.Expr, sp.Rational] = {}
    for term in sp.Add.make_args(rest):
        multiple, unit = term.as_coeff_Mul()
        if unit != sp.pi and max(abs(int(multiple.p)), int(multiple.q)) > _LARGEST_MULTIPLE:
            multiple, unit = sp.S.One, term
        if unit == sp.pi:
            turns += multiple
        elif multiple != 0:
            phases[unit] = phases.get(unit, sp.S.Zero) + multiple
    return rate, turns, phases


def _turn(turns: sp.Rational) -> tuple[sp.Expr, sp.Expr]:
    return sp.expand(sp.cos(turns * sp.pi)), sp.expand(sp.sin(turns * sp.pi))


def base_rate(rates: Sequence[sp.Expr], period: sp.Expr | None, where: str) -> sp.Expr:
    """omega = 2 pi / T with every rate an integer multiple of it.

    Raises:
        PeriodError: if the rates are incommensurate, or T is not a common period; offers one that is.
    """
    if not rates:
        return 2 * sp.pi / period if period is not None else sp.S.One
    first = rates[0]
    ratios = [
        sp.nsimplify(sp.cancel(rate / first)) if (rate / first).is_number else sp.cancel(rate / first) for rate in rates
    ]
    for rate, ratio in zip(rates, ratios, strict=True):
        if not ratio.is_Rational:
            raise PeriodError(
                f"{where}: the frequencies {first} and {rate} have no common period (their ratio {ratio} is not "
                "rational); replace them by nearby commensurate ones"
            )
    # The greatest common divisor of fractions p/q in lowest terms is gcd(p) / lcm(q).
    numerator = math.gcd(*(int(ratio.p) for ratio in ratios))
    denominator = math.lcm(*(int(ratio.q) for ratio in ratios))
    common = first * sp.Rational(numerator, denominator)
    # The first rate may be negative, or a symbol with a minus sign.
    if common.could_extract_minus_sign():
        common = -common
    if period is None:
        return common
    multiple = sp.cancel(common * period / (2 * sp.pi))
    # A period typed as a decimal, 6.283185307179586, is no exact multiple of 2 pi / common; one within its rounding is meant.
    if multiple.is_number and not multiple.is_Integer and period.is_Rational:
        nearest = round(float(multiple))
        if nearest and abs(float(multiple) / nearest - 1) < _SNAP:
            return common / nearest
    if not (multiple.is_Integer and multiple > 0):
        raise PeriodError(
            f"{where}: {period} is not a period of the input; its frequencies have the common period "
            f"{sp.cancel(2 * sp.pi / common)} (and its multiples)"
        )
    return 2 * sp.pi / period


@dataclass(frozen=True)
class TrigForm:
    """Formulas as one TrigSignal in tau = omega t.

    Attributes:
        signal: component i is the i-th formula.
        ring: of its coefficients.
        units: the phases of the keys are multiples of these expressions.
        omega: 2 pi / T.
        dim: number of formulas.
    """

    signal: TrigSignal
    ring: CoefficientRing
    units: tuple[sp.Expr, ...]
    omega: sp.Expr
    dim: int


def trig_form(formulas: Sequence[sp.Expr], time: sp.Symbol, period: sp.Expr | None, where: str) -> TrigForm:
    """The formulas as trigonometric polynomials with the given (or their smallest common) period.

    Raises:
        NotTrigonometricError: if one of them is none.
        PeriodError: see `base_rate`.
    """
    census = Census(time)
    for formula in formulas:
        census.visit(formula)
    omega = base_rate(list(census.rates), period, where)
    ring = CoefficientRing.holding(census.coefficients)
    units = tuple(sp.Mul(sp.Rational(1, q), unit) for unit, q in census.units.items())
    reader = Reader(time, ring, dict(zip(census.units, range(len(units)), strict=True)), census.units, omega)
    waves = [reader.read(formula) for formula in formulas]
    common = math.lcm(1, *(d for _, d in waves))
    components = {}
    for i, (wave, d) in enumerate(waves):
        scaled: trig.Wave = {}
        trig.add_scaled(scaled, wave, common // d, ring.multiply)
        if scaled := trig.clean(scaled):
            components[i] = {0: scaled}
    return TrigForm(TrigSignal(components, common), ring, units, omega, len(formulas))


@dataclass(frozen=True)
class Reader:
    time: sp.Symbol
    ring: CoefficientRing
    position: dict[sp.Expr, int]
    denominators: dict[sp.Expr, int]
    omega: sp.Expr
    meter: Meter = field(default_factory=lambda: Meter("an input's Fourier form"))

    def read(self, node: sp.Expr) -> tuple[trig.Wave, int]:
        """(wave, denominator) of a formula."""
        if isinstance(node, sp.Add):
            return self._sum([self.read(argument) for argument in node.args])
        if isinstance(node, sp.Mul):
            factors = [self.read(argument) for argument in node.args]
            result = factors[0]
            for factor in factors[1:]:
                result = self._product(result, factor)
            return result
        if isinstance(node, sp.Pow) and node.exp.is_Integer and node.exp > 0:
            # one factor after another: a product with the short base is cheaper than that of two long powers
            base = self.read(node.base)
            result = base
            for _ in range(int(node.exp) - 1):
                result = self._product(result, base)
            return result
        if isinstance(node, sp.cos | sp.sin):
            return self._harmonic(node)
        value, denominator = self.ring.element(node)
        return ({0: [value, 0]} if value else {}), denominator

    def _sum(self, terms: list[tuple[trig.Wave, int]]) -> tuple[trig.Wave, int]:
        common = math.lcm(*(d for _, d in terms))
        total: trig.Wave = {}
        for wave, d in terms:
            trig.add_scaled(total, wave, common // d, self.ring.multiply)
        return trig.clean(total), common

    def _product(self, x: tuple[trig.Wave, int], y: tuple[trig.Wave, int]) -> tuple[trig.Wave, int]:
        # cos a cos b = (cos(a + b) + cos(a - b))/2: twice the product has integer coefficients, the 2 goes to the denominator.
        total: trig.Wave = {}
        self.meter.spend(trig.products(x[0], y[0]))
        trig.add_twice_product(total, x[0], y[0], 1, self.ring.multiply)
        return trig.clean(total), 2 * x[1] * y[1]

    def _harmonic(self, node: sp.Expr) -> tuple[trig.Wave, int]:
        # angle = frequency tau + sum multiple unit + turns pi: the first two are the key, the last is put in by the sum formula,
        # for its sine and cosine are exact numbers: cos(key + turn) = cos turn cos key - sin turn sin key.
        rate, turns, phases = split_angle(node.args[0], self.time)
        frequency = int(sp.cancel(rate / self.omega))
        multiples = [0] * len(self.position)
        for unit, multiple in phases.items():
            multiples[self.position[unit]] = int(multiple * self.denominators[unit])
        if max(map(abs, [frequency, *multiples])) > _LARGEST_FREQUENCY:
            raise PeriodError(
                f"{node} has {frequency} oscillations in a period, beyond the {_LARGEST_FREQUENCY} that are kept exactly; "
                "the frequencies of the input are too far apart or too nearly incommensurate"
            )
        key = trig.pack(frequency, tuple(multiples))
        (c, cd), (s, sd) = (self.ring.element(value) for value in _turn(turns))
        common = math.lcm(cd, sd)
        c, s = c * (common // cd), s * (common // sd)
        wave: trig.Wave = {}
        if isinstance(node, sp.cos):
            trig.add_term(wave, key, c, -s)
        else:
            trig.add_term(wave, key, s, c)
        return trig.clean(wave), common
