"""The entries of exp(x A) over any arithmetic, without cancellation near x = 0."""

from __future__ import annotations

import operator
from collections.abc import Callable
from functools import partial, reduce
from typing import Any

from lie_codegen.exact.exponential import MatrixExponential, Mode
from lie_codegen.exact.numbers import Number
from lie_codegen.groups.wei_norman.divided_differences import DividedDifferences
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar

#: |x| * (largest eigenvalue) below which an entry that cancels is summed as its Taylor series.
_SWITCH = 1.0

#: order of the zero at x = 0, coefficient, value
_Piece = tuple[int, Number, Callable[[], Scalar]]


class ExponentialEntries:
    """exp(x A) for one scalar x; modes are computed once and shared between entries.

    An entry that vanishes at x = 0 while the modes it combines do not would lose its digits there. The common cases
    have closed forms without cancellation: 1 - cos bx = 2 sin^2(bx/2), e^{ax} - 1 = expm1(ax), sinh, cosh - 1; any other
    (x - sin bx, say) is summed as its Taylor series for small x.
    """

    def __init__(self, ops: Arithmetic, x: Scalar, data: MatrixExponential, *, printed: bool = False) -> None:
        """`printed` keeps the textbook form (sums of cos, sin, exp), for exact display."""
        self.ops = ops
        self.x = x
        self.data = data
        self.printed = printed
        self._modes: dict[int, Scalar] = {}
        self._cache: dict[tuple[Any, ...], Scalar] = {}
        self._differences: DividedDifferences | None = None

    def sparse(self) -> dict[tuple[int, int], Scalar]:
        """(i, j) -> entry, the structural zeros left out."""
        return {position: self.entry(position) for position in self.data.entries}

    def entry(self, position: tuple[int, int]) -> Scalar:
        """One entry; equal functions (up to sign) are computed once."""
        newton = self.data.newton
        if newton is not None and not self.printed:
            if self._differences is None:
                self._differences = DividedDifferences(self.ops, self.x, newton.nodes)
            return self._differences.combined(newton.entries[position])
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
        if self.printed or len(terms) < 2:
            return self._sum(terms)
        leading = next(order for order, value in enumerate(taylor) if value != 0)
        if all(_order_at_zero(self.data.modes[m]) >= leading for m in terms):
            return self._sum(terms)
        pieces = self._vanishing(terms)
        if all(order >= leading for order, _, _ in pieces):
            return reduce(operator.add, (_times(self.ops, factor, value()) for _, factor, value in pieces))
        scale = _SWITCH / self.data.radius
        near = self.ops.less(self.x * self.x, scale * scale)
        return self.ops.where(near, self._series(taylor), self._sum(terms))

    def _vanishing(self, terms: dict[int, Number]) -> list[_Piece]:
        """The entry, zero at x = 0, as a sum of functions that vanish there: (order, coefficient, value).

        Its even modes of power 0 add up to 0 at x = 0, so each may lose the constant 1; e^{ax} - 1 and e^{-ax} - 1 become
        sinh ax and cosh ax - 1.
        """
        pieces: list[_Piece] = []
        growth: dict[Number, Number] = {}
        for m, coefficient in terms.items():
            mode = self.data.modes[m]
            if mode.power or mode.odd:
                pieces.append((_order_at_zero(mode), coefficient, partial(self._mode, m)))
            elif mode.frequency == 0:
                if mode.rate != 0:
                    growth[mode.rate] = coefficient
            elif mode.rate == 0:
                pieces.append((2, -2 * coefficient, partial(self._square, "sin", mode.frequency / 2)))
            else:
                pieces.append((1, coefficient, partial(self._spiral, m)))
        for rate, coefficient in growth.items():
            opposite = growth.get(-rate)
            if opposite is None:
                pieces.append((1, coefficient, partial(self._function, "expm1", rate)))
            elif rate > 0:
                if coefficient != opposite:
                    pieces.append((1, coefficient - opposite, partial(self._function, "sinh", rate)))
                if coefficient != -opposite:
                    pieces.append((2, 2 * (coefficient + opposite), partial(self._square, "sinh", rate / 2)))
        return pieces

    def _function(self, name: str, rate: Number) -> Scalar:
        """One function of rate x, computed once."""
        key = (name, rate)
        if key not in self._cache:
            self._cache[key] = getattr(self.ops, name)(_times(self.ops, rate, self.x))
        return self._cache[key]

    def _square(self, name: str, rate: Number) -> Scalar:
        value = self._function(name, rate)
        return value * value

    def _spiral(self, m: int) -> Scalar:
        """e^{ax} cos bx - 1."""
        mode = self.data.modes[m]
        cosine = self._function("cos", mode.frequency)
        return self._function("expm1", mode.rate) * cosine - 2 * self._square("sin", mode.frequency / 2)

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


def _times(ops: Arithmetic, coefficient: Number, value: Scalar) -> Scalar:
    if coefficient == 1:
        return value
    if coefficient == -1:
        return -value
    return ops.constant(coefficient) * value
