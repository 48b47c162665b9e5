"""exp and its Jacobians beyond the depth of `spectral_functions`, as routines: the matrices themselves are doubled (`matrix_doubling`).

The error is eps |hat x| where the group is compact. The derivative is the same function of [[A, dA], [0, A]], whose upper right block it is;
so is the derivative of that, at four times the size.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.groups.derivation import GroupDerivation
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.complex_scalar import Complex
from lie_codegen.kernel.linear import Matrix
from lie_codegen.kernel.matrix_doubling import MOST, MOST_SINGLE, RADIUS, TERMS, TERMS_SINGLE, doubled, doubling_graph
from lie_codegen.kernel.routine import Routine, call_routine
from lie_codegen.kernel.structural_zeros import is_zero


@dataclass(frozen=True)
class _Family:
    """M(x) = sum_e weight_e x[input_e] e_(row, column), of which the rows 0 .. rows - 1 and `columns` columns from `start` of f(M) are wanted.

    Attributes:
        entries: (row, column, input, weight).
        size: of M.
        inputs: numbers in x.
    """

    entries: tuple[tuple[int, int, int, float], ...]
    size: int
    inputs: int
    rows: int
    columns: int
    start: int

    def with_rate(self) -> _Family:
        """M(x, dx) = [[M(x), M(dx)], [0, M(x)]]; of f(M) the part of the upper right block that was wanted."""
        m, n = self.size, self.inputs
        blocks = ((0, 0, 0), (m, m, 0), (0, m, n))
        entries = tuple((i + p, j + q, k + r, w) for p, q, r in blocks for i, j, k, w in self.entries)
        return replace(self, entries=entries, size=2 * m, inputs=2 * n, start=self.start + m)

    def matrix(self, x: Sequence[float]) -> Array:
        """M(x)."""
        result = np.zeros((self.size, self.size))
        for i, j, k, weight in self.entries:
            result[i, j] += weight * x[k]
        return result

    def table(self) -> Array:
        """(size^2, inputs): M(x), column by column, is the table times x."""
        result = np.zeros((self.size**2, self.inputs))
        for i, j, k, weight in self.entries:
            result[j * self.size + i, k] += weight
        return result

    def wanted(self, value: Any) -> Any:
        """The wanted part of f(M)."""
        return value[: self.rows, self.start : self.start + self.columns]


@lru_cache(maxsize=64)
def far_exponential(data: GroupDerivation) -> Routine:
    """x -> exp(hat x) flat; of a complex group the real parts, then the imaginary parts."""
    entries = tuple(
        (i, j, k, float(matrix[i, j]))
        for k, matrix in enumerate(data.real.basis)
        for i in range(data.real.size)
        for j in range(data.real.size)
        if matrix[i, j] != 0
    )
    family = _Family(entries, data.real.size, data.group.dim, data.real.size, data.group.degree, 0)
    return _routine(f"{data.group.name}_exp_far", "exp", family)


@lru_cache(maxsize=64)
def far_jacobian(data: GroupDerivation, sign: int, *, inverse: bool) -> Routine:
    """x -> (e^a - 1)/a at a = sign ad x, or its inverse, flat."""
    n = data.group.dim
    entries = tuple((k, j, i, sign * float(c)) for i, j, k, c in data.group.algebra.constants())
    name = f"{data.group.name}_{'ljac' if sign > 0 else 'rjac'}{'_inv' if inverse else ''}_far"
    return _routine(name, "inverse" if inverse else "jacobian", _Family(entries, n, n, n, n, 0))


def chosen(ops: Arithmetic, near: Any, value: Matrix, routine: Callable[[], Routine], x: Sequence[Scalar]) -> Matrix:
    """`value` where `near` holds, else what the routine makes of x; NaN where the arithmetic runs none. Plain zeros stay.

    Exact arithmetic, which compares no sizes, leaves the value as it is.
    """
    routines = getattr(ops, "routines", None)
    if near is True or routines is None:
        return value
    size, columns = len(value), len(value[0])
    if routines:
        far = call_routine(ops, routine(), x, ops.where(near, 0, 1))
    else:
        far = [ops.constant(math.nan)] * (2 * size * columns)

    def part(entry: Scalar, place: int) -> Scalar:
        return entry if is_zero(entry) else ops.where(near, entry, far[place])

    result: Matrix = []
    for i, row in enumerate(value):
        result.append([])
        for j, entry in enumerate(row):
            place = i * columns + j
            if isinstance(entry, Complex):
                result[-1].append(Complex(part(entry.re, place), part(entry.im, size * columns + place)))
            else:
                result[-1].append(part(entry, place))
    return result


def _routine(name: str, kind: str, family: _Family) -> Routine:
    def tangent(
        ops: Arithmetic, inputs: Sequence[Scalar], outputs: Sequence[Scalar], rates: Sequence[Scalar]
    ) -> list[Scalar]:
        return call_routine(ops, _routine(f"{name}_rate", kind, family.with_rate()), [*inputs, *rates])

    return Routine(
        name,
        family.inputs,
        family.rows * family.columns,
        "far_routine.c.jinja",
        (
            ("kind", kind),
            ("entries", family.entries),
            ("size", family.size),
            ("rows", family.rows),
            ("columns", family.columns),
            ("start", family.start),
            ("outputs", family.rows * family.columns),
            ("radius", RADIUS),
            ("terms", TERMS + 1),
            ("most", MOST),
        ),
        (),
        lambda x: np.asarray(family.wanted(doubled(kind, family.matrix(x), family.rows))).ravel(),
        tangent,
        (("most", MOST_SINGLE), ("terms", TERMS_SINGLE + 1)),
        graph=lambda: doubling_graph(kind, family.table(), family.rows, family.start, family.columns),
    )
