"""Exact signals in pieces: on each interval a polynomial in t with sines and cosines, exact at the joints.

The inner time is tau = omega t; piece m covers [start_m, start_m + length_m] and is a TrigSignal in tau - start_m.
Products are taken piece by piece; primitives carry the value at the end of a piece to the next, which needs cos and sin of
the lengths: they are in the ring of coefficients.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

from lie_codegen.on_demand import sympy as sp
from lie_codegen.signals import trigonometric as trig
from lie_codegen.signals.coefficients import Coefficient, CoefficientRing
from lie_codegen.signals.trig_signal import Brackets, TrigCalculus, TrigSignal

#: One signal for each piece.
Pieces = tuple[TrigSignal, ...]


@dataclass(frozen=True)
class PiecewiseCalculus:
    """The operations of an averaging recursion on signals in pieces.

    Attributes:
        brackets: structure constants.
        ring: holds the coefficients, the lengths, their cosines and sines, and 1 / sum of lengths.
        lengths: of the pieces, in tau.
    """

    brackets: Brackets
    ring: CoefficientRing
    lengths: tuple[sp.Expr, ...]

    @cached_property
    def _inner(self) -> TrigCalculus:
        return TrigCalculus(self.brackets, self.ring)

    @cached_property
    def _ends(self) -> tuple[tuple[tuple[Coefficient, int], ...], ...]:
        """(length, cos length, sin length) of each piece, as (numerator, denominator)."""
        return tuple(
            (self.ring.element(h), self.ring.element(sp.cos(h)), self.ring.element(sp.sin(h))) for h in self.lengths
        )

    @cached_property
    def _inverse_period(self) -> tuple[Coefficient, int]:
        return self.ring.element(sp.expand(1 / sp.Add(*self.lengths)))

    def bracket(self, x: Pieces, y: Pieces, *, mean_only: bool = False) -> Pieces:
        """[x, y], or its mean."""
        product = tuple(self._inner.bracket(a, b) for a, b in zip(x, y, strict=True))
        return self.mean(product) if mean_only else product

    def combine(self, terms: Iterable[tuple[Fraction | int, Pieces]]) -> Pieces:
        """sum of factor * signal."""
        listed = list(terms)
        return tuple(
            self._inner.combine([(factor, signal[m]) for factor, signal in listed]) for m in range(len(self.lengths))
        )

    def primitive(self, x: Pieces) -> Pieces:
        """int_0^tau x, continuous."""
        result = []
        carried = TrigSignal({})
        for m, piece in enumerate(x):
            inner = self._inner.combine([(1, self._inner.primitive(piece)), (1, carried)])
            result.append(inner)
            carried = self._end_value(inner, m)
        return tuple(result)

    def integral(self, x: Pieces) -> TrigSignal:
        """int over the whole period, as a constant."""
        return self._end_value(self.primitive(x)[-1], len(self.lengths) - 1)

    def mean(self, x: Pieces) -> Pieces:
        """The mean over the period on every piece."""
        constant = self._times(self.integral(x), *self._inverse_period)
        return (constant,) * len(self.lengths)

    def _times(self, x: TrigSignal, numerator: Coefficient, denominator: int) -> TrigSignal:
        total: dict[int, dict[int, trig.Wave]] = {}
        for i, component in x.components.items():
            for p, wave in component.items():
                trig.add_scaled(total.setdefault(i, {}).setdefault(p, {}), wave, numerator, self.ring.multiply)
        return self._inner.reduced(total, x.denominator * denominator)

    def _end_value(self, x: TrigSignal, m: int) -> TrigSignal:
        """The value of a piece at its end, as a constant signal."""
        (h, h_den), (c, c_den), (s, s_den) = self._ends[m]
        terms = [TrigSignal({})]
        for i, component in x.components.items():
            for p, wave in component.items():
                for key, (cosine, sine) in wave.items():
                    frequency = trig.frequency_of(key)
                    power = _power(self.ring, h, p)
                    ck, sk, den = self._multiple(c, c_den, s, s_den, abs(frequency))
                    if frequency < 0:
                        sk = -sk
                    mul = self.ring.multiply
                    target: trig.Wave = {}
                    a = mul(cosine, ck) + mul(sine, sk)
                    b = mul(sine, ck) - mul(cosine, sk)
                    trig.add_term(target, key - frequency, mul(power, a), mul(power, b))
                    terms.append(self._inner.reduced({i: {0: target}}, x.denominator * den * h_den**p))
        return self._inner.combine([(1, term) for term in terms])

    def _multiple(
        self, c: Coefficient, c_den: int, s: Coefficient, s_den: int, k: int
    ) -> tuple[Coefficient, Coefficient, int]:
        """cos(k h), sin(k h) over a common denominator."""
        mul = self.ring.multiply
        x, y, den = 1, 0, 1
        for _ in range(k):
            both = c_den * s_den
            x, y = mul(x, c) * s_den - mul(y, s) * c_den, mul(y, c) * s_den + mul(x, s) * c_den
            den *= both
        return x, y, den


def _power(ring: CoefficientRing, value: Coefficient, exponent: int) -> Coefficient:
    result: Coefficient = 1
    for _ in range(exponent):
        result = ring.multiply(result, value)
    return result


def ring_values(lengths: Sequence[sp.Expr]) -> list[sp.Expr]:
    """What the ring must hold beside the coefficients of the pieces."""
    values = [sp.expand(1 / sp.Add(*lengths))]
    for h in lengths:
        values += [h, sp.cos(h), sp.sin(h)]
    return values
