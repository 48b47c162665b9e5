"""An error function at many places at once: phi, its differential and its second derivatives, as arrays.

    slope_a = A_a phi = d/ds phi(X exp(s A_a), X_d),   hessian_ab = A_a(A_b phi),

the second by a dual number through the first; it is symmetric at critical points alone, as A_a A_b - A_b A_a = [A_a, A_b].
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any, cast

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.control.error_derivatives import ErrorDerivatives
from lie_codegen.control.error_function import ErrorFunction
from lie_codegen.flow.batched_exponential import expm
from lie_codegen.groups.derivation import GroupDerivation, derivation_of
from lie_codegen.groups.maps.exponential import exp_matrix
from lie_codegen.groups.maps.matrices import GroupMatrices, matrix_port
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernel.arithmetic import Arithmetic
from lie_codegen.kernel.dual import DualArithmetic, tangent_of
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.linear import Matrix, matmul


@dataclass(frozen=True)
class Samples:
    """Values at N places.

    Attributes:
        phi: (N,).
        slope: (N, n) differential in body coordinates.
        hessian: (N, n, n) A_a(A_b phi).
    """

    phi: Array
    slope: Array
    hessian: Array


class _Batch:
    """A CasADi Function over N columns at once, without copies: called a thousand times with a handful of columns by a search."""

    def __init__(self, kernel: Kernel) -> None:
        from lie_codegen.kernel.casadi_arithmetic import function_of

        self.function: Any = function_of(kernel)  # CasADi declares its buffers otherwise than they are
        self.opened: dict[int, Any] = {}

    def __call__(self, *arguments: Array) -> list[Array]:
        """(N, size) inputs -> (N, size) outputs."""
        count = len(arguments[0])
        if count not in self.opened:
            whole = self.function.map(count)
            # CasADi stores by columns: the columns of (size, N) are the rows of (N, size).
            given = [np.empty((count, self.function.size1_in(i))) for i in range(self.function.n_in())]
            made = [np.empty((count, self.function.size1_out(i))) for i in range(self.function.n_out())]
            buffer, evaluate = whole.buffer()
            for place, array in enumerate(given):
                buffer.set_arg(place, cast(Any, memoryview)(array))
            for place, array in enumerate(made):
                buffer.set_res(place, cast(Any, memoryview)(array))
            self.opened[count] = whole, buffer, evaluate, given, made
        *_, evaluate, given, made = self.opened[count]
        for array, values in zip(given, arguments, strict=True):
            array[...] = values
        evaluate()
        return [array.copy() for array in made]


class ErrorSamples:
    """One pair, its formulas derived once."""

    def __init__(self, pair: ErrorFunction) -> None:
        self.pair, self.group = pair, pair.group
        self.real = derivation_of(pair.group).real
        self._first: _Batch | None = None
        self._second: _Batch | None = None
        self._transport: _Batch | None = None
        self._moved: _Batch | None = None
        derivation = derivation_of(pair.group)
        if derivation.matrix_pattern is not None:
            self._moved = _Batch(_move_kernel(derivation))

    def at(self, X: Array, X_d: Array | None = None) -> Samples:
        """phi and its derivatives at (N, d, d) configurations, for one reference each; the identity if not given."""
        if self._second is None:
            self._second = _Batch(self._kernel())
        n = self.group.dim
        phi, slope, hessian = self._second(*self._flat(X, X_d))
        return Samples(phi[:, 0], slope, hessian.reshape(-1, n, n))

    def first(self, X: Array, X_d: Array | None = None) -> tuple[Array, Array]:
        """phi and slope alone, whose formulas are found sooner."""
        if self._first is None:
            self._first = _Batch(self._first_kernel())
        phi, slope = self._first(*self._flat(X, X_d))
        return phi[:, 0], slope

    def transport(self, X: Array, X_d: Array | None = None) -> tuple[Array, Array]:
        """P, (N, n, n), and its derivatives along the basis at X_d fixed: rates[:, a] = A_a P, (N, n, n, n)."""
        if self._transport is None:
            self._transport = _Batch(self._transport_kernel())
        n = self.group.dim
        P, rates = self._transport(*self._flat(X, X_d))
        return P.reshape(-1, n, n), rates.reshape(-1, n, n, n)

    def moved(self, X: Array, x: Array) -> Array:
        """X exp(hat x), (N, d, d)."""
        if self._moved is None:
            return np.asarray(X @ expm(self.group.hat(x)))
        kind = self.group.basis.dtype
        [moved] = self._moved(np.ascontiguousarray(X, dtype=kind).view(float).reshape(len(x), -1), x)
        return moved.view(kind).reshape(len(x), self.group.degree, self.group.degree)

    def _flat(self, X: Array, X_d: Array | None) -> tuple[Array, Array]:
        d = self.group.degree
        kind = self.group.basis.dtype
        Y = np.broadcast_to(np.eye(d), X.shape) if X_d is None else np.broadcast_to(X_d, X.shape)
        rows = [np.ascontiguousarray(each, dtype=kind).view(float).reshape(len(X), -1) for each in (X, Y)]
        return rows[0], rows[1]

    def _read(self, ops: Arithmetic, X: Any, X_d: Any) -> tuple[Matrix, Matrix]:
        read = GroupMatrices(ops, self.real).read
        return read(X), read(X_d)

    def _moving(self, ops: Arithmetic, X: Matrix) -> tuple[DualArithmetic, Matrix]:
        """X with the tangents X A_a."""
        dual = DualArithmetic(ops)
        n, size = self.group.dim, self.real.size
        hat = GroupMatrices(ops, self.real).hat
        turns = [matmul(X, hat([int(a == b) for b in range(n)])) for a in range(n)]
        rows = [
            [dual.variable(X[i][j], {a: turns[a][i][j] for a in range(n)}) for j in range(size)] for i in range(size)
        ]
        return dual, [[entry if entry.tangent else entry.value for entry in row] for row in rows]

    def _kernel(self) -> Kernel:
        n = self.group.dim

        def body(ops: Arithmetic, X: Any, X_d: Any) -> tuple[Any, ...]:
            plain, reference = self._read(ops, X, X_d)
            phi, slope = ErrorDerivatives(ops, self.pair, self.real, plain, reference).differential(1)
            dual, moving = self._moving(ops, plain)
            _, rates = ErrorDerivatives(dual, self.pair, self.real, moving, reference).differential(1)
            return phi, slope, [[tangent_of(rates[b], a, dual.level) for b in range(n)] for a in range(n)]

        outputs = (Port("phi", ()), Port("slope", (n,)), Port("hessian", (n, n)))
        return Kernel("error_samples", self.group.name, self._ports(), outputs, body)

    def _first_kernel(self) -> Kernel:
        def body(ops: Arithmetic, X: Any, X_d: Any) -> tuple[Any, ...]:
            return ErrorDerivatives(ops, self.pair, self.real, *self._read(ops, X, X_d)).differential(1)

        outputs = (Port("phi", ()), Port("slope", (self.group.dim,)))
        return Kernel("error_slopes", self.group.name, self._ports(), outputs, body)

    def _transport_kernel(self) -> Kernel:
        n = self.group.dim

        def body(ops: Arithmetic, X: Any, X_d: Any) -> tuple[Any, ...]:
            plain, reference = self._read(ops, X, X_d)
            P = ErrorDerivatives(ops, self.pair, self.real, plain, reference).transport_matrix()
            dual, moving = self._moving(ops, plain)
            turned = ErrorDerivatives(dual, self.pair, self.real, moving, reference).transport_matrix()
            rates = [[tangent_of(x, a, dual.level) for row in turned for x in row] for a in range(n)]
            return P, rates

        outputs = (Port("P", (n, n)), Port("rates", (n, n * n)))
        return Kernel("transport_samples", self.group.name, self._ports(), outputs, body)

    def _ports(self) -> tuple[Port, ...]:
        return matrix_port(self.group, "X"), matrix_port(self.group, "X_d")


def _move_kernel(derivation: GroupDerivation) -> Kernel:
    group = derivation.group

    def body(ops: Arithmetic, X: Any, x: Any) -> tuple[Any, ...]:
        return (matmul(X, exp_matrix(ops, derivation, x)),)

    inputs = (matrix_port(group, "X"), Port("x", (group.dim,)))
    return Kernel("moved_sample", group.name, inputs, (matrix_port(group, "X_next"),), body)


@lru_cache(maxsize=32)
def error_samples(pair: ErrorFunction) -> ErrorSamples:
    """The same, derived once a process for equal pairs."""
    return ErrorSamples(pair)


def basis_scales(group: MatrixGroup) -> Array:
    """(n,) s_a such that exp(s_a A_a) is a move of size one, whatever the units: over the largest |eigenvalue|, or entry if nilpotent."""
    largest = np.array([np.max(np.abs(np.linalg.eigvals(matrix))) for matrix in group.basis])
    entries = np.max(np.abs(group.basis), axis=(1, 2))
    return np.asarray(1 / np.where(largest > 1e-6 * entries, largest, entries))


def random_elements(group: MatrixGroup, count: int, rng: np.random.Generator, reach: float = 3.0) -> Array:
    """(count, d, d): products of two exponentials of vectors of lengths up to `reach`, so that compact parts are covered."""
    scale, n = basis_scales(group), group.dim
    X = np.broadcast_to(np.eye(group.degree), (count, group.degree, group.degree))
    for _ in range(2):
        x = rng.normal(size=(count, n))
        x *= rng.uniform(0, reach, (count, 1)) / np.linalg.norm(x, axis=1, keepdims=True)
        X = X @ expm(group.hat(x * scale))
    return np.asarray(X)
