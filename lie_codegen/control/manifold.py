"""Configuration manifolds: coordinates or embedded in R^N, with any inertia M(q).

Q = {c(q) = 0} in R^N, J = dc/dq, M(q) positive on TQ; P = 1 - M^-1 J^T (J M^-1 J^T)^-1 J is the M-orthogonal projection onto TQ, and

    Gamma(x, y) = M^-1 [(dM.x) y + (dM.y) x - grad_q(x^T M y)]/2,   x, y frozen;   nabla_x Y = P (DY.x + Gamma(x, Y))

is the Levi-Civita connection of the metric that M leaves on Q. Without constraints P = 1, and Gamma is that of (5). Where M is singular across Q,
M + J^T J stands for it: it agrees with M on TQ, and the connection depends on nothing else. Bullo and Murray, CIT-CDS 97-003, (4) to (6), (9).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.control.manifold_formulas import read_formula, read_rows, symbols_of
from lie_codegen.control.manifold_plant import ManifoldPlant, manifold_plant
from lie_codegen.control.positive_solve import is_absent, solve_positive
from lie_codegen.errors import InputError
from lie_codegen.exact.budget import current_budget, over
from lie_codegen.exact.positive_matrix import real_number
from lie_codegen.identifiers import shown
from lie_codegen.kernel.arithmetic import Arithmetic
from lie_codegen.kernel.definition import record_factory
from lie_codegen.kernel.expressions import ExpressionEvaluator
from lie_codegen.kernel.linear import Matrix, Vector, dot, matvec, minus, plus, scaled
from lie_codegen.kernel.parameter import refuse_input
from lie_codegen.kernel.saved import Saved
from lie_codegen.on_demand import sympy as sp

#: Places at which a manifold and what lives on it are tried.
PLACES = 50
_ON, _RANK = 1e-15, 1e-8


@dataclass(frozen=True, eq=False, repr=False)
class Manifold(Saved):
    """A manifold with its kinetic energy.

    Attributes:
        name: C identifier, prefix of the symbols.
        size: N.
        constraints: (m) expressions c(q) that vanish on it; none for coordinates.
        inertia: (N, N) M(q).
        potential: V(q), whose force acts on the body.
        singular: whether M is singular across Q, so that M + J^T J stands for it.
    """

    name: str
    size: int
    constraints: tuple[sp.Expr, ...]
    inertia: sp.ImmutableMatrix
    potential: sp.Expr
    singular: bool = False

    @property
    def dim(self) -> int:
        """Of the manifold."""
        return self.size - len(self.constraints)

    @cached_property
    def q(self) -> tuple[sp.Symbol, ...]:
        """(N) q1 .. qN."""
        return symbols_of("q", self.size)

    @cached_property
    def metric(self) -> sp.ImmutableMatrix:
        """M, or M + J^T J."""
        if not self.singular:
            return self.inertia
        J = self.jacobian
        return sp.ImmutableMatrix(self.inertia + J.T * J)

    @cached_property
    def jacobian(self) -> sp.ImmutableMatrix:
        """(m, N) dc/dq."""
        return sp.ImmutableMatrix([[sp.diff(c, x) for x in self.q] for c in self.constraints] or sp.zeros(0, self.size))

    @cached_property
    def slopes(self) -> tuple[sp.ImmutableMatrix, ...]:
        """(N) dM/dq_k."""
        return tuple(sp.ImmutableMatrix(self.metric.diff(x)) for x in self.q)

    def at(self, ops: Arithmetic, q: Vector) -> ManifoldPoint:
        """What is needed of it at a point."""
        return ManifoldPoint(self, ops, q)

    @cached_property
    def numeric(self) -> tuple[Any, Any]:
        """c and J as functions of (N,) arrays."""
        return sp.lambdify([self.q], list(self.constraints)), sp.lambdify([self.q], self.jacobian)

    def projected(self, q: Array, steps: int = 60) -> Array | None:
        """The point of Q that Gauss-Newton steps reach from q; None where they reach none."""
        c, J = self.numeric
        point = np.array(q, dtype=float)
        for _ in range(steps if self.constraints else 0):
            value = np.array(c(point), dtype=float)
            if not np.all(np.isfinite(value)):
                return None
            if np.max(np.abs(value)) <= _ON * max(1.0, float(np.max(np.abs(point)))):
                break
            point = point - np.linalg.pinv(np.array(J(point), dtype=float).reshape(-1, self.size)) @ value
        worst = np.max(np.abs(np.array(c(point), dtype=float))) if self.constraints else 0.0
        return point if worst <= 1e-9 else None

    def places(self, count: int, rng: np.random.Generator) -> Array:
        """(count, N) points of Q.

        Raises:
            InputError: none are found.
        """
        found: list[Array] = []
        for _ in range(20 * count):
            point = self.projected(rng.normal(size=self.size))
            if point is not None:
                found.append(point)
            if len(found) == count:
                return np.array(found)
        raise InputError(f"manifold {self.name}: no points with all constraints zero were found near the origin")

    def along(self, q: Array, x: Array) -> Array:
        """The part of x that is tangent at q, in the plain metric."""
        if not self.constraints:
            return x
        J = np.array(self.numeric[1](q), dtype=float).reshape(-1, self.size)
        return np.asarray(x - np.linalg.pinv(J) @ (J @ x))

    def loop_plant(self, inertia: Any = None) -> ManifoldPlant:
        """The body that a closed loop moves.

        Raises:
            InputError: an inertia beside that of the manifold.
        """
        if inertia is not None:
            raise InputError(f"closed_loop: the inertia is that of the manifold {self.name}: leave inertia= away")
        return manifold_plant(self)


class ManifoldPoint:
    """M, J and the projection at one point, in one arithmetic."""

    def __init__(self, manifold: Manifold, ops: Arithmetic, q: Vector) -> None:
        self.manifold, self.ops, self.q = manifold, ops, q
        self.evaluate = ExpressionEvaluator(ops, dict(zip(manifold.q, q, strict=True)))
        self.M = self._matrix(manifold.metric)
        self.J = self._matrix(manifold.jacobian)
        # columns of M^-1 J^T, and S = J M^-1 J^T
        self.W = [solve_positive(self.M, row) for row in self.J]
        self.S = [[dot(row, column) for column in self.W] for row in self.J]

    def _matrix(self, matrix: sp.MatrixBase) -> Matrix:
        return [[0 if entry == 0 else self.evaluate(entry) for entry in row] for row in matrix.tolist()]

    def tangent(self, x: Vector) -> Vector:
        """P x."""
        if not self.J:
            return list(x)
        weights = solve_positive(self.S, matvec(self.J, x))
        return minus(x, plus(*[scaled(w, column) for w, column in zip(weights, self.W, strict=True)]))

    def cotangent(self, f: Vector) -> Vector:
        """P^T f."""
        if not self.J:
            return list(f)
        weights = solve_positive(self.S, [dot(column, f) for column in self.W])
        return minus(f, plus(*[scaled(w, row) for w, row in zip(weights, self.J, strict=True)]))

    def returned(self) -> Vector:
        """The place one Newton step nearer to c(q) = 0, along M^-1 J^T."""
        if not self.J:
            return list(self.q)
        off = solve_positive(self.S, [self.evaluate(c) for c in self.manifold.constraints])
        return minus(self.q, plus(*[scaled(w, column) for w, column in zip(off, self.W, strict=True)]))

    def christoffel(self, x: Vector, y: Vector) -> Vector:
        """M Gamma(x, y)."""
        slopes = [None if not any(m) else self._matrix(m) for m in self.manifold.slopes]
        total: Vector = [0] * len(x)
        for k, slope in enumerate(slopes):
            if slope is None:
                continue
            along_x, along_y = matvec(slope, y), matvec(slope, x)
            total = plus(total, scaled(x[k], along_x), scaled(y[k], along_y))
            total[k] = total[k] - dot(x, along_x)
        return [entry / 2 if not is_absent(entry) else 0 for entry in total]

    def bend(self, v: Vector) -> Vector:
        """(m,) (dJ.v) v."""
        q, m = self.manifold.q, self.manifold
        result = []
        for c in m.constraints:
            terms = [
                self.evaluate(second) * v[i] * v[j]
                for i, x in enumerate(q)
                for j, y in enumerate(q)
                if (second := sp.diff(c, x, y)) != 0
            ]
            result.append(sum(terms[1:], terms[0]) if terms else 0)
        return result

    def acceleration(self, v: Vector, force: Vector) -> Vector:
        """q'' of nabla_v v = M^-1 (F - dV), its part across Q by c(q) = 0."""
        gradient = [self.evaluate(sp.diff(self.manifold.potential, x)) for x in self.manifold.q]
        free = solve_positive(self.M, minus(minus(force, gradient), self.christoffel(v, v)))
        if not self.J:
            return free
        missing = [-b - a for a, b in zip(matvec(self.J, free), self.bend(v), strict=True)]
        weights = solve_positive(self.S, missing)
        return plus(free, *[scaled(w, column) for w, column in zip(weights, self.W, strict=True)])


@record_factory()
def manifold(
    size: int,
    constraints: Sequence[Any] = (),
    inertia: Any = 1,
    *,
    potential: Any = 0,
    parameters: Mapping[str, Any] | None = None,
    name: str = "manifold",
) -> Manifold:
    """A configuration manifold in coordinates q1 .. qN, or embedded by constraints.

    Args:
        size: N.
        constraints: texts in q1 .. qN that vanish on it, as "q1^2+q2^2+q3^2-1"; none for coordinates.
        inertia: M(q): a number, N entries of a diagonal, or rows of numbers and texts. It may be singular across the manifold.
        potential: V(q).
        parameters: numbers by name.
        name: C identifier.

    Raises:
        InputError: an inertia that is not symmetric, or not positive on the tangent spaces, with a place; constraints that depend on each
            other or vanish nowhere.
        ShapeError, ExpressionError: shapes, or texts outside the grammar.
    """
    if isinstance(size, bool) or not isinstance(size, int | np.integer) or size < 1:
        raise InputError(f"manifold: the number of coordinates is 1, 2, ..., not {shown(size)}")
    if size > current_budget().dimension:
        raise InputError(over("dimension", f"manifold: {shown(size)} coordinates"))
    n, q = int(size), symbols_of("q", int(size))
    names: dict[str, sp.Expr] = {symbol.name: symbol for symbol in q} | {"pi": sp.pi}
    for key, value in (parameters or {}).items():
        refuse_input(value, key, "the plant of a manifold is made of numbers; of laws on it they may be inputs")
    names |= {key: real_number(value, key) for key, value in (parameters or {}).items()}
    listed = [constraints] if isinstance(constraints, str) else list(constraints)
    c = tuple(read_formula(entry, names, f"constraints[{k}]") for k, entry in enumerate(listed))
    M = read_rows(inertia, n, names, "inertia")
    if any(sp.simplify(M[i, j] - M[j, i]) != 0 for i in range(n) for j in range(i)):
        raise InputError("manifold: the inertia is not symmetric")
    made = Manifold(name, n, c, M, read_formula(potential, names, "potential"))
    return Manifold(name, n, c, M, made.potential, singular=_singular(made))


def _singular(made: Manifold) -> bool:
    """Whether M must be completed across Q.

    Raises:
        InputError: constraints or inertia are not what they must be.
    """
    rng, singular = np.random.default_rng(0), False
    values = sp.lambdify([made.q], made.inertia)
    _, jacobian = made.numeric
    for point in made.places(PLACES, rng):
        J = np.array(jacobian(point), dtype=float).reshape(-1, made.size)
        M = np.array(values(point), dtype=float)
        basis = np.eye(made.size)
        if len(J):
            _, s, V = np.linalg.svd(J)
            if np.sum(s > _RANK * max(1.0, float(s[0]))) < len(J):
                raise InputError(f"manifold: the constraints depend on each other at q = {np.round(point, 6).tolist()}")
            basis = V[len(J) :].T
        size = max(1e-300, float(np.max(np.abs(M))))
        if not np.all(np.isfinite(M)) or np.linalg.eigvalsh(basis.T @ M @ basis)[0] <= 1e-12 * size:
            raise InputError(
                f"manifold: the inertia is not positive on the tangent space at q = {np.round(point, 6).tolist()}"
            )
        singular = singular or bool(np.linalg.eigvalsh(M)[0] <= 1e-9 * size)
    return singular
