"""In which frames the Wei-Norman equations M(g)^{-1} g' = u are solved.

With E_k = exp(-g_k ad_k), u = sum_j E_n ... E_{j+1} e_j g_j'. Seen from frame m, between the m-th factor of
exp(g_1 A_1) ... exp(g_n A_n) and the next, the same equations read, for every m = 0..n,

    sum_{j <= m} E_m ... E_{j+1} e_j g_j' + sum_{j > m} E_{m+1}^{-1} ... E_{j-1}^{-1} e_j g_j' = E_{m+1}^{-1} ... E_n^{-1} u,

as the Jacobian of a manipulator is shortest in a frame half way along the arm. A diagonal block of any frame has a
determinant that divides det M(g)^{-1} (up to an exponential of traces), so blocks of several frames may be mixed without a
division that fails inside the chart.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from lie_codegen.exact.exponential import MatrixExponential
from lie_codegen.groups.wei_norman.conjugation import Conjugation
from lie_codegen.groups.wei_norman.products import times_vector
from lie_codegen.kernel.arithmetic import Scalar
from lie_codegen.kernel.block_solve import SparseMatrix, blocks_of, solve
from lie_codegen.kernel.structural_zeros import is_zero, product

#: (k, forward) -> exp(g_k ad_k) if forward, else exp(-g_k ad_k), sparse.
Factors = Callable[[int, bool], SparseMatrix]


@dataclass(frozen=True)
class Step:
    """Unknowns solved together, from their rows in one frame; all else in these rows is known before."""

    frame: int
    block: tuple[int, ...]


class Frames:
    """The columns of the equations in every frame, computed when first asked for."""

    def __init__(self, factors: Factors, size: int) -> None:
        self.factors = factors
        self.size = size
        self._columns: dict[tuple[int, int], dict[int, Scalar]] = {}

    def column(self, frame: int, j: int) -> dict[int, Scalar]:
        """Column j (counted from 0) in a frame, sparse."""
        if (frame, j) not in self._columns:
            if frame in (j, j + 1):
                value: dict[int, Scalar] = {j: 1}
            elif frame > j:
                value = times_vector(self.factors(frame - 1, False), self.column(frame - 1, j))
            else:
                value = times_vector(self.factors(frame, True), self.column(frame + 1, j))
            self._columns[frame, j] = value
        return self._columns[frame, j]

    def matrix(self, frame: int) -> dict[tuple[int, int], Scalar]:
        """All of a frame, (row, column) -> entry."""
        return {(i, j): entry for j in range(self.size) for i, entry in self.column(frame, j).items()}

    def solve(self, steps: Sequence[Step], u: Mapping[int, Scalar]) -> dict[int, Scalar]:
        """g' for one right-hand side, given in the last frame; all sparse."""
        seen: dict[int, Mapping[int, Scalar]] = {self.size: u}
        for frame in reversed(range(min(step.frame for step in steps), self.size)):
            seen[frame] = times_vector(self.factors(frame, True), seen[frame + 1])
        known: dict[int, Scalar] = {}
        for step in steps:
            size = len(step.block)
            right = {row: seen[step.frame].get(i, 0) for row, i in enumerate(step.block)}
            for j, value in known.items():
                column = self.column(step.frame, j)
                for row, i in enumerate(step.block):
                    right[row] = _minus(right[row], product(column.get(i, 0), value))
            right = {row: value for row, value in right.items() if not is_zero(value)}
            columns = [self.column(step.frame, j) for j in step.block]
            inside = {
                (row, position): column[i]
                for position, column in enumerate(columns)
                for row, i in enumerate(step.block)
                if i in column
            }
            [solution] = solve(inside, [right], size)
            known.update((step.block[position], value) for position, value in solution.items())
        return known


def cheapest_steps(exponentials: Sequence[MatrixExponential | Conjugation]) -> tuple[Step, ...]:
    """The order of solution that takes the fewest operations among those that prefer one frame each."""
    size = len(exponentials)
    patterns = [set(data.entries) for data in exponentials]
    candidates = list(_candidates(patterns, size))
    plans = dict.fromkeys(plan for preferred in range(size + 1) if (plan := _steps(candidates, preferred, size)))
    return min(plans, key=lambda plan: _cost(exponentials, plan))


@dataclass(frozen=True)
class _Candidate:
    frame: int
    block: frozenset[int]
    needs: frozenset[int]


def _candidates(patterns: Sequence[set[tuple[int, int]]], size: int) -> Iterator[_Candidate]:
    """The diagonal blocks of every frame, with the unknowns outside that their rows hold."""
    # Only which entries are zero matters here: any scalar that is no plain zero stands for the others.
    entry = _OperationCount()
    frames = Frames(lambda k, _: dict.fromkeys(patterns[k], entry), size)
    for frame in range(size + 1):
        matrix = frames.matrix(frame)
        for block in map(frozenset, blocks_of(matrix, size)):
            yield _Candidate(frame, block, frozenset(j for i, j in matrix if i in block) - block)


def _steps(candidates: Sequence[_Candidate], preferred: int, size: int) -> tuple[Step, ...]:
    """Small blocks first, then those near the preferred frame; empty if the blocks of several frames lock each other."""
    solved: set[int] = set()
    steps: list[Step] = []
    while len(solved) < size:
        open_ = [c for c in candidates if c.needs <= solved and not c.block & solved]
        if not open_:
            return ()
        best = min(open_, key=lambda c: (len(c.block), abs(c.frame - preferred), len(c.needs)))
        steps.append(Step(best.frame, tuple(sorted(best.block))))
        solved |= best.block
    return tuple(steps)


def _minus(a: Scalar, b: Scalar) -> Scalar:
    return a if is_zero(b) else -b if is_zero(a) else a - b


class _OperationCount:
    """A stand-in for a scalar that remembers what it was made of, so that the operations a result needs can be counted.

    A sum, a difference and a product weigh 1, a quotient 4, about what they take in C; a change of sign is free. What two
    results share is one object, and counts once.
    """

    __slots__ = ("parts", "weight")

    def __init__(self, weight: int = 0, *parts: Any) -> None:
        self.weight = weight
        self.parts = tuple(part for part in parts if isinstance(part, _OperationCount))

    def __add__(self, other: Any) -> _OperationCount:
        return _OperationCount(1, self, other)

    def __radd__(self, other: Any) -> _OperationCount:
        return _OperationCount(1, other, self)

    def __sub__(self, other: Any) -> _OperationCount:
        return _OperationCount(1, self, other)

    def __rsub__(self, other: Any) -> _OperationCount:
        return _OperationCount(1, other, self)

    def __mul__(self, other: Any) -> _OperationCount:
        return _OperationCount(1, self, other)

    def __rmul__(self, other: Any) -> _OperationCount:
        return _OperationCount(1, other, self)

    def __neg__(self) -> _OperationCount:
        return _OperationCount(0, self)

    def __truediv__(self, other: Any) -> _OperationCount:
        return _OperationCount(4, self, other)


def _cost(exponentials: Sequence[MatrixExponential | Conjugation], steps: Sequence[Step]) -> int:
    """Weighted operations to solve for one right-hand side; a division counts four."""
    size = len(exponentials)
    factors = [
        {place: 1 if data.is_one(place) else _OperationCount() for place in data.entries} for data in exponentials
    ]
    solution = Frames(lambda k, _: factors[k], size).solve(steps, {i: _OperationCount() for i in range(size)})
    seen: set[int] = set()
    stack = [value for value in solution.values() if isinstance(value, _OperationCount)]
    total = 0
    while stack:
        node = stack.pop()
        if id(node) not in seen:
            seen.add(id(node))
            total += node.weight
            stack.extend(node.parts)
    return total
