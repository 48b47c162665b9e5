"""The logarithm of `log_routine` without a compiler: the same candidate, Newton's steps, certificate and lattice, in NumPy.

Step by step what templates/log_routine.c.jinja does in C; tests hold the two against each other.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lie_codegen.arrays import Array
from lie_codegen.groups.derivation import GroupDerivation
from lie_codegen.groups.maps.log_iterations import matrix_log, rotation_log, unitary_log
from lie_codegen.groups.maps.log_lattice import lattice_log
from lie_codegen.groups.maps.log_structure import LogBlock
from lie_codegen.kernel.arithmetic import FloatArithmetic
from lie_codegen.kernel.complex_scalar import Complex
from lie_codegen.kernel.kernel import Kernel
from lie_codegen.on_demand import scipy

#: Newton's steps at most; a candidate from the blocks needs none or one, for they are exact but for rounding.
STEPS = 3
#: |hat u| <= RESIDUAL W is a logarithm, |hat u| <= SETTLED W cannot be bettered: a few units in the last place.
RESIDUAL, SETTLED = 1e-12, 4e-15


class NumpyLog:
    """X flat (complex entries as pairs) -> x, or NaN: steps 1 to 4 of `log_routine`, for one X at a time."""

    def __init__(
        self, data: GroupDerivation, first: Kernel, second: Kernel, distance: float, residual: float = RESIDUAL
    ) -> None:
        self.data = data
        self.distance = distance
        self.residual = residual
        self.first = first
        self.second = second
        self.ops = FloatArithmetic()

    def __call__(self, values: Sequence[float]) -> Array:
        group = self.data.group
        flat = np.array(values, dtype=np.float64)
        d = group.degree
        X: NDArray[Any] = (flat[::2] + 1j * flat[1::2] if group.is_complex else flat).reshape(d, d)
        nothing = np.full(group.dim, np.nan)
        if not np.all(np.isfinite(flat)):
            return nothing
        with np.errstate(all="ignore"):
            x = self._candidate(X)
            if x is not None and self._certified(x, X):
                return x
            if self.data.log_structure.is_onto:
                return nothing
            try:
                found = lattice_log(self.data.group, X, lambda x: self._certified(x, X))
            except (ValueError, np.linalg.LinAlgError):
                found = None
        return nothing if found is None else found

    def _candidate(self, X: NDArray[Any]) -> Array | None:
        try:
            logs = [value for block in self.data.log_structure.iterated for value in self._block(block, X)]
            arguments = [logs] if logs else []
            (x,) = self.first.evaluate(self.ops, self._scalars(X), *arguments)
        except (ValueError, ZeroDivisionError, OverflowError, np.linalg.LinAlgError):
            return None
        return np.array([float(value) for value in x])

    def _block(self, block: LogBlock, X: NDArray[Any]) -> list[float]:
        part = X[np.ix_(block.indices, block.indices)]
        if block.kind == "rotation":
            A: NDArray[Any] = rotation_log(part)
        else:
            A = unitary_log(part, special=block.special) if block.kind == "unitary" else matrix_log(part)
        if not self.data.group.is_complex:
            return [float(value) for value in A.real.ravel()]
        return [float(value) for value in A.ravel().view(np.float64)]

    def _scalars(self, X: NDArray[Any]) -> list[list[Any]]:
        if self.data.group.is_complex:
            return [[Complex(float(z.real), float(z.imag)) for z in row] for row in X]
        return [[float(entry) for entry in row] for row in X]

    def _certified(self, x: Array, X: NDArray[Any]) -> bool:
        """Newton's steps in place; whether x is then a logarithm."""
        scalars = self._scalars(X)

        def error(x: Array) -> tuple[Array, float, float]:
            try:
                u, (distance, size) = self.second.evaluate(self.ops, x.tolist(), scalars)
            except (ValueError, ZeroDivisionError, OverflowError):
                return np.full(len(x), np.nan), np.nan, np.nan
            return np.array([float(value) for value in u]), float(distance), float(size)

        u, distance, size = error(x)
        for _ in range(STEPS):
            if size <= SETTLED:
                break
            y = x + np.linalg.solve(right_jacobian(self.data, x), u)
            v, *fresh = error(y)
            if not fresh[1] < size:
                break
            x[:] = y
            u, (distance, size) = v, fresh
        return bool(size <= self.residual and distance <= self.distance)


def right_jacobian(data: GroupDerivation, x: Array) -> Array:
    """(1 - e^{-ad x})/ad x, from the exponential of [[-ad, 1], [0, 0]]."""
    n = len(x)
    both = np.zeros((2 * n, 2 * n))
    for i, j, k, value in data.group.algebra.constants():
        both[k, j] -= x[i] * float(value)
    both[:n, n:] = np.eye(n)
    return np.asarray(scipy.linalg.expm(both)[:n, n:])
