"""The entries of exp(x A) over any arithmetic, without cancellation near x = 0."""

from __future__ import annotations

import operator
from functools import reduce
from typing import Any

from lie_codegen.algebra.exact import Number
from lie_codegen.algebra.exponential import MatrixExponential, Mode
from lie_codegen.kernels.arithmetic import Arithmetic, Scalar

#: |x| * (largest eigenvalue) below which an entry that cancels is summed as its Taylor series.
_SWITCH = 1.0


class ExponentialEntries:
    """exp(x A) for one scalar x; modes are computed once and shared between entries.

    An entry that vanishes at x = 0 while the modes it combines do not would lose its digits there. The common cases
    have closed forms without cancellation: 1 - cos bx = 2 sin^2(bx/2), e^{ax} - 1 = expm1(ax), sinh and cosh; any other is
    summed as its Taylor series for small x.
    """

    def __init__(self, ops: Arithmetic, x: Scalar, data: MatrixExponential, *, printed: bool = False) -> None:
        """`printed` keeps the textbook form (sums of cos, sin, exp), for exact display."""
        self.ops = ops
        self.x = x
        self.data = data
        self.printed = printed
        self._modes: dict[int, Scalar] = {}
        self._cache: dict[tuple[Any, ...], Scalar] = {}

    def sparse(self) -> dict[tuple[int, int], Scalar]:
        """(i, j) -> entry, the structural zeros left out."""
        return {position: self.entry(position) for position in self.data.entries}

    def entry(self, position: tuple[int, int]) -> Scalar:
        """One entry; equal functions (up to sign) are computed once."""
        terms = self.data.entries[position]
        key = tuple(sorted(terms.items(), key=lambda item: item[0]))
        if key in self._cache:
            return self._cache[key]
        negated = tuple((m, -value) for m, value in key)
        if negated in self._cache:
            return -self._cache[negated]
        value = self._compute(terms, self.data.taylor[position])
        self._cache[key] = value
        return value

    def _compute(self, terms: dict[int, Number], taylor: tuple[Number, ...]) -> Scalar:
        if self.printed or not self._cancels(terms, taylor):
            return self._sum(terms)
        closed = self._without_cancellation(terms)
        if closed is not None:
            return closed
        scale = _SWITCH / self.data.radius
        near = self.ops.less(self.x * self.x, scale * scale)
        return self.ops.where(near, self._series(taylor), self._sum(terms))

    def _cancels(self, terms: dict[int, Number], taylor: tuple[Number, ...]) -> bool:
        if len(terms) < 2:
            return False
        leading = next(order for order, value in enumerate(taylor) if value != 0)
        return any(_order_at_zero(self.data.modes[m]) < leading for m in terms)

    def _without_cancellation(self, terms: dict[int, Number]) -> Scalar | None:
        """c (cos bx - 1), c (e^{ax} - 1) and c (e^{ax} - e^{-ax})."""
        if len(terms) != 2:
            return None
        (first, a), (second, b) = terms.items()
        modes = self.data.modes
        if a != -b or modes[first].power or modes[second].power:
            return None
        if _is_one(modes[first]):
            return self._minus_one(modes[second], b)
        if _is_one(modes[second]):
            return self._minus_one(modes[first], a)
        if modes[first].rate == -modes[second].rate and modes[first].frequency == 0 == modes[second].frequency:
            return _times(self.ops, 2 * b, self.ops.sinh(_times(self.ops, modes[second].rate, self.x)))
        return None

    def _minus_one(self, mode: Mode, coefficient: Number) -> Scalar | None:
        if mode.odd or (mode.rate != 0 and mode.frequency != 0):
            return None
        if mode.frequency != 0:
            half = self.ops.sin(_times(self.ops, mode.frequency / 2, self.x))
            return _times(self.ops, -2 * coefficient, half * half)
        return _times(self.ops, coefficient, self.ops.expm1(_times(self.ops, mode.rate, self.x)))

    def _sum(self, terms: dict[int, Number]) -> Scalar:
        total: Any = None
        for m, coefficient in terms.items():
            term = _times(self.ops, coefficient, self._mode(m))
            total = term if total is None else total + term
        return total

    def _mode(self, m: int) -> Scalar:
        if m not in self._modes:
            self._modes[m] = self._evaluate(self.data.modes[m])
        return self._modes[m]

    def _evaluate(self, mode: Mode) -> Scalar:
        factors: list[Scalar] = [self.x] * mode.power
        if mode.rate != 0:
            factors.append(self.ops.exp(_times(self.ops, mode.rate, self.x)))
        if mode.frequency != 0:
            angle = _times(self.ops, mode.frequency, self.x)
            factors.append(self.ops.sin(angle) if mode.odd else self.ops.cos(angle))
        return reduce(operator.mul, factors) if factors else 1

    def _series(self, taylor: tuple[Number, ...]) -> Scalar:
        total: Any = self.ops.constant(taylor[-1])
        for value in reversed(taylor[:-1]):
            total = total * self.x + self.ops.constant(value)
        return total


def _order_at_zero(mode: Mode) -> int:
    return mode.power + (1 if mode.odd else 0)


def _is_one(mode: Mode) -> bool:
    return mode.power == 0 and mode.rate == 0 and mode.frequency == 0


def _times(ops: Arithmetic, coefficient: Number, value: Scalar) -> Scalar:
    if coefficient == 1:
        return value
    if coefficient == -1:
        return -value
    return ops.constant(coefficient) * value
