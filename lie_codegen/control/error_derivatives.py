"""What a tracking law needs of a pair (phi, transport), derived by dual numbers along left-invariant directions.

    d_1 phi_a = d/ds phi(X exp(s A_a), X_d),   d_2 phi_a = d/ds phi(X, X_d exp(s A_a)),
    nu = P(X, X_d) xi_d,   nu' = d/dt nu along X' = X hat(xi), X_d' = X_d hat(xi_d).

X -> X A_a and X^{-1} -> -A_a X^{-1} are the only rules; nothing is differenced or simplified.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from lie_codegen.control.error_function import ErrorFunction, ErrorSymbols
from lie_codegen.groups.derivation import GroupDerivation, derivation_of
from lie_codegen.groups.maps.checked_log import log_coordinates
from lie_codegen.groups.maps.exponential import jacobian
from lie_codegen.groups.maps.log_routine import closed_log
from lie_codegen.groups.maps.matrices import GroupMatrices
from lie_codegen.groups.matrix_pattern import RealMatrices
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.brackets import bracket
from lie_codegen.kernel.dual import DualArithmetic, split, tangent_of, value_of
from lie_codegen.kernel.expressions import ExpressionEvaluator
from lie_codegen.kernel.linear import Matrix, Vector, matmul, matvec, minus, negative
from lie_codegen.kernel.parameter import symbol_values
from lie_codegen.on_demand import sympy as sp


class ErrorDerivatives:
    """One pair at one point (X, X_d), in one arithmetic; `inputs` are the values of the gains that are inputs."""

    def __init__(
        self,
        ops: Arithmetic,
        error: ErrorFunction,
        real: RealMatrices,
        X: Matrix,
        X_d: Matrix,
        inputs: Sequence[Any] = (),
    ) -> None:
        self.ops = ops
        self.error = error
        self.real = real
        self.group = GroupMatrices(ops, real)
        self.X, self.X_d = X, X_d
        self.inputs = symbol_values(error.inputs, inputs)
        self.X_inverse, self.X_d_inverse = self.group.inverse(X), self.group.inverse(X_d)
        self.dual = DualArithmetic(ops)

    def differential(self, argument: int = 1) -> tuple[Scalar, Vector]:
        """phi and its differential in the first or the second argument, in body coordinates."""
        basis = [self.group.hat([int(a == b) for b in range(self.real.group.dim)]) for a in range(self.real.group.dim)]
        first = argument == 1
        X, Xi = (self._moved(self.X, self.X_inverse, basis)) if first else (self.X, self.X_inverse)
        Xd, Xdi = (self.X_d, self.X_d_inverse) if first else self._moved(self.X_d, self.X_d_inverse, basis)
        phi = self._evaluator(X, Xi, Xd, Xdi)(self.error.phi)
        level = self.dual.level
        return value_of(phi, level), [tangent_of(phi, a, level) for a in range(self.real.group.dim)]

    def transport_matrix(self) -> Matrix:
        """P with nu = P xi_d, row by row."""
        n = self.real.group.dim
        columns = [self.transported([int(a == b) for b in range(n)]) for a in range(n)]
        return [list(row) for row in zip(*columns, strict=True)]

    def transported(self, xi_d: Sequence[Scalar]) -> Vector:
        """nu = P xi_d."""
        return self._transport(self.group, self.X, self.X_inverse, self.X_d, self.X_d_inverse, xi_d)

    def transported_rates(
        self, xi: Sequence[Scalar], xi_d: Sequence[Scalar], xi_d_dot: Sequence[Scalar]
    ) -> tuple[Vector, Vector, Vector]:
        """nu, nu' and nu' + [xi, nu]; the last is Ad_{X^-1 X_d} xi_d' for the right transport."""
        algebra = self.real.group.algebra
        if self.error.transport == "left":
            nu, nu_dot = list(xi_d), list(xi_d_dot)
            return nu, nu_dot, [a + b for a, b in zip(nu_dot, bracket(self.ops, algebra, xi, nu), strict=True)]
        if self.error.transport == "right":
            # nu = Ad_(X^-1 X_d) xi_d: X moves it by -[xi, nu]; X_d by Ad [xi_d, xi_d] = 0
            nu, turned = self.transported(xi_d), self.transported(xi_d_dot)
            return nu, minus(turned, bracket(self.ops, algebra, xi, nu)), turned
        X, Xi = self._moved(self.X, self.X_inverse, [self.group.hat(xi)])
        Xd, Xdi = self._moved(self.X_d, self.X_d_inverse, [self.group.hat(xi_d)])
        velocity = [self.dual.variable(v, {0: a}) for v, a in zip(xi_d, xi_d_dot, strict=True)]
        moving = self._transport(GroupMatrices(self.dual, self.real), X, Xi, Xd, Xdi, velocity)
        level = self.dual.level
        nu = [value_of(entry, level) for entry in moving]
        nu_dot = [tangent_of(entry, 0, level) for entry in moving]
        return nu, nu_dot, [a + b for a, b in zip(nu_dot, bracket(self.ops, algebra, xi, nu), strict=True)]

    def _moved(self, X: Matrix, X_inverse: Matrix, directions: Sequence[Matrix]) -> tuple[Matrix, Matrix]:
        """X and X^{-1} with the tangents X B and -B X^{-1} for each direction B."""
        forward = [matmul(X, B) for B in directions]
        backward = [[negative(row) for row in matmul(B, X_inverse)] for B in directions]
        return self._with_tangents(X, forward), self._with_tangents(X_inverse, backward)

    def _with_tangents(self, matrix: Matrix, tangents: Sequence[Matrix]) -> Matrix:
        size = range(len(matrix))
        result: Matrix = []
        for i in size:
            row: list[Scalar] = []
            for j in size:
                entry = self.dual.variable(matrix[i][j], {a: t[i][j] for a, t in enumerate(tangents)})
                row.append(entry if entry.tangent else entry.value)
            result.append(row)
        return result

    def _evaluator(self, X: Matrix, Xi: Matrix, Xd: Matrix, Xdi: Matrix) -> ExpressionEvaluator:
        return ExpressionEvaluator(self.dual, self._values(X, Xi, Xd, Xdi))

    def _values(self, X: Matrix, Xi: Matrix, Xd: Matrix, Xdi: Matrix) -> dict[sp.Symbol, Scalar]:
        names = ErrorSymbols(self.real.group)
        symbols = names.matrices
        values = dict(self.inputs)
        if self.error.uses_log:
            for coordinates, E in ((names.log_right, (Xdi, X)), (names.log_left, (X, Xdi))):
                if any(
                    expression.has(*coordinates)
                    for expression in (self.error.phi, self.error.tau, self.error.P)
                    if expression is not None
                ):
                    values.update(
                        zip(coordinates, logarithm(self.dual, derivation_of(self.real.group), matmul(*E)), strict=True)
                    )
        for prefix, numbers in (("X", X), ("Xi", Xi), ("Xd", Xd), ("Xdi", Xdi)):
            matrix = symbols[prefix]
            for i, row in enumerate(numbers):
                for j, entry in enumerate(row):
                    if isinstance(matrix[i, j], sp.Symbol):
                        values[matrix[i, j]] = entry
        return values

    def _transport(
        self, group: GroupMatrices, X: Matrix, Xi: Matrix, Xd: Matrix, Xdi: Matrix, xi_d: Sequence[Scalar]
    ) -> Vector:
        if self.error.transport == "left":
            return list(xi_d)
        if self.error.transport == "right":
            return group.Ad(matmul(Xi, Xd), matmul(Xdi, X), xi_d)
        evaluate = ExpressionEvaluator(self.dual, self._values(X, Xi, Xd, Xdi))
        if self.error.tau is not None:
            tau = [[evaluate(entry) for entry in row] for row in self.error.tau.tolist()]
            return group.Ad(tau, group.inverse(tau), xi_d)
        rows = self.error.P.tolist() if self.error.P is not None else []
        return matvec([[evaluate(entry) for entry in row] for row in rows], xi_d)


def logarithm(ops: Arithmetic, data: GroupDerivation, E: Matrix) -> Vector:
    """log(E), and its derivatives by D log(E)[E hat v] = rjac_inv(log E) v: exact on every branch, at the identity too."""
    group = GroupMatrices(ops, data.real)
    if not isinstance(ops, DualArithmetic):
        # X and X_d are checked at the door of every kernel, so the closed form needs no guard of its own.
        closed = closed_log(ops, data, group.write(E))
        return log_coordinates(ops, data, group.write(E)) if closed is None else closed
    level, size = ops.level, range(data.real.size)
    plain = [[value_of(entry, level) for entry in row] for row in E]
    x = logarithm(ops.ops, data, plain)
    directions = sorted({a for row in E for entry in row for a in split(entry, level)[1]})
    if not directions:
        return x
    below = GroupMatrices(ops.ops, data.real)
    inverse, columns = below.inverse(plain), jacobian(ops.ops, data, x, "right", inverse=True)
    rates = {}
    for a in directions:
        moved = [[tangent_of(E[i][j], a, level) for j in size] for i in size]
        rates[a] = matvec(columns, below.vee(matmul(inverse, moved)))
    return [ops.variable(x[k], {a: rate[k] for a, rate in rates.items()}) for k in range(data.group.dim)]
