"""Explicit Runge-Kutta methods as data, and the one driver of their steps: numpy arrays, or vectors of scalars over any arithmetic."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from itertools import groupby
from math import gcd, lcm
from operator import add, itemgetter, mul
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.kernel.arithmetic import Arithmetic
from lie_codegen.kernel.linear import plus, scaled
from lie_codegen.kernel.structural_zeros import product


@dataclass(frozen=True)
class Tableau:
    """k_i = f(t + c_i h, y + h sum_j a_ij k_j), y(t + h) = y + h sum_i b_i k_i, c_i = sum_j a_ij.

    Attributes:
        a: row i has i entries.
        b: weights.
    """

    a: tuple[tuple[Fraction, ...], ...]
    b: tuple[Fraction, ...]

    @cached_property
    def stages(self) -> tuple[tuple[float, WeightedSum], ...]:
        """c_i and the sum of each stage."""
        return tuple((float(sum(row)), WeightedSum.of(row)) for row in self.a)

    @cached_property
    def end(self) -> WeightedSum:
        """The sum over all stages."""
        return WeightedSum.of(self.b)


@dataclass(frozen=True)
class WeightedSum:
    """unit (n_1 (k_p + .. ) + n_2 (..) + ..) with integers n: neighbours of equal weight are added first, so few products are left.

    Attributes:
        unit: the greatest common divisor of the weights; rounded: as a double.
        spans: (n, first, last): n times the sum of the values first .. last - 1.
    """

    unit: Fraction
    rounded: float
    spans: tuple[tuple[int, int, int], ...]

    @classmethod
    def of(cls, weights: Sequence[Fraction]) -> WeightedSum:
        """From the weights; zeros are left out."""
        unit = Fraction(gcd(*(w.numerator for w in weights)), lcm(*(w.denominator for w in weights)))
        runs = [(w, [k for k, _ in run]) for w, run in groupby(enumerate(weights), itemgetter(1)) if w]
        return cls(unit, float(unit), tuple((int(w / unit), places[0], places[-1] + 1) for w, places in runs))


@dataclass(frozen=True)
class Space:
    """What states are: times(factor, state), plus(a, b), and factor(total, h), h times the unit of a sum."""

    times: Callable[[Any, Any], Any]
    plus: Callable[[Any, Any], Any]
    factor: Callable[[WeightedSum, Any], Any] = lambda total, h: h * total.rounded


#: Numbers and arrays; several arrays of different shapes.
ARRAYS = Space(mul, add)
TUPLES = Space(lambda factor, a: tuple(factor * x for x in a), lambda a, b: tuple(map(add, a, b)))


def vectors(ops: Arithmetic) -> Space:
    """Vectors of scalars of an arithmetic; plain zeros and ones leave no operation."""
    return Space(scaled, plus, lambda total, h: h if total.unit == 1 else product(ops.constant(total.unit), h))


def combined(space: Space, total: WeightedSum, values: Sequence[Any], h: Any) -> Any:
    """h times the weighted sum of the values."""
    result = None
    for n, first, last in total.spans:
        part = values[first]
        for value in values[first + 1 : last]:
            part = space.plus(part, value)
        part = part if n == 1 else space.times(n, part)
        result = part if result is None else space.plus(result, part)
    return space.times(space.factor(total, h), result)


def increment(space: Space, tableau: Tableau, rate: Callable[[float, Any], Any], zero: Any, h: Any) -> Any:
    """h sum_i b_i k_i, by which the state changes over a step.

    Args:
        space: what states are.
        tableau: the method.
        rate: (c, change) -> f at the time t + c h and at the state's own change since t, the classical method's c being 0, 1/2, 1/2, 1.
        zero: the change at the first stage.
        h: the step; 1 where `rate` has it already.
    """
    slopes: list[Any] = []
    for c, total in tableau.stages:
        slopes.append(rate(c, combined(space, total, slopes, h) if total.spans else zero))
    return combined(space, tableau.end, slopes, h)


_HALF, _THIRD, _SIXTH = Fraction(1, 2), Fraction(1, 3), Fraction(1, 6)
_NONE, _ONE = Fraction(0), Fraction(1)
#: The classical method, of order 4.
CLASSICAL = Tableau(((), (_HALF,), (_NONE, _HALF), (_NONE, _NONE, _ONE)), (_SIXTH, _THIRD, _THIRD, _SIXTH))
#: Those of order 2 and 1.
MIDPOINT, EULER = Tableau(((), (_HALF,)), (_NONE, _ONE)), Tableau(((),), (_ONE,))
#: The classical method's state half way, to third order: weights of its four slopes.
HALF_WAY = WeightedSum.of([Fraction(k, 24) for k in (5, 4, 4, -1)])
#: A commutator-free step of order 4: its exponents as weights of u at t, t + h/2 and t + h, for u of t alone.
COMMUTATOR_FREE = tuple(
    WeightedSum.of(row) for row in ((_HALF / 2, _THIRD, -_SIXTH / 2), (-_SIXTH / 2, _THIRD, _HALF / 2))
)


def propagators(A: Array, h: float) -> Array:
    """(K, ..., n, n) Phi with y(t + h) = Phi y(t) for y' = A(t) y by classical steps, A (2K + 1, ..., n, n) at their ends and middles."""
    at, identity = {0.0: A[:-1:2], 0.5: A[1::2], 1.0: A[2::2]}, np.eye(A.shape[-1])
    return np.asarray(identity + increment(ARRAYS, CLASSICAL, lambda c, change: at[c] @ (identity + change), 0.0, h))
