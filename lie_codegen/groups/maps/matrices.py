"""Elements of a group over any arithmetic: inverse, product, hat, coordinates and Ad, with the known zeros left out."""

from __future__ import annotations

import random
from collections.abc import Sequence
from typing import Any

from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.groups.matrix_pattern import RealMatrices
from lie_codegen.groups.wei_norman.data import WeiNormanData
from lie_codegen.kernel.arithmetic import Arithmetic, FloatArithmetic, Scalar
from lie_codegen.kernel.block_solve import solve
from lie_codegen.kernel.complex_scalar import Complex
from lie_codegen.kernel.kernel import Port
from lie_codegen.kernel.linear import Matrix, Vector, cross, dot, matmul, matvec, minus, number, plus, scaled
from lie_codegen.kernel.structural_zeros import add, product
from lie_codegen.on_demand import sympy as sp


class GroupMatrices:
    """Matrix operations of one group in one arithmetic; matrices are real m x m (see `RealMatrices`)."""

    def __init__(self, ops: Arithmetic, real: RealMatrices) -> None:
        self.ops = ops
        self.real = real

    def read(self, port_value: Sequence[Sequence[Any]]) -> Matrix:
        """A port's matrix: entries that are 0 or 1 in every element of the group are not looked at."""
        rows = real_rows(port_value) if self.real.group.is_complex else port_value
        size = range(self.real.size)
        return [[rows[i][j] if (i, j) in self.real.varying else int(i == j) for j in size] for i in size]

    def write(self, matrix: Matrix) -> list[list[Any]]:
        """The port's form of a matrix of the group."""
        if not self.real.group.is_complex:
            return matrix
        d = self.real.group.degree
        return [[Complex(matrix[i][j], matrix[i + d][j]) for j in range(d)] for i in range(d)]

    def inverse(self, X: Matrix) -> Matrix:
        """X^{-1} by blocks; a block that keeps a form S by S^{-1} X^T S, an orthogonal one by its transpose: whatever its entries, nothing cancels."""
        size = self.real.size
        rows: dict[int, Vector] = {}
        for (block, _), form in zip(self.real.blocks, self.real.kept, strict=True):
            right = []
            for i in block:
                row: Vector = [int(i == j) for j in range(size)]
                for other, solved in rows.items():
                    row = minus(row, scaled(X[i][other], solved))
                right.append(row)
            inverse = self._block_inverse([[X[i][j] for j in block] for i in block], form)
            for i, row in zip(block, matmul(inverse, right), strict=True):
                rows[i] = row
        return [rows[i] for i in range(size)]

    def hat(self, x: Sequence[Scalar]) -> Matrix:
        """sum_k x_k A_k."""
        size = range(self.real.size)
        result: Matrix = [[0 for _ in size] for _ in size]
        for component, matrix in zip(x, self.real.basis, strict=True):
            for i in size:
                for j in size:
                    if matrix[i, j] != 0:
                        result[i][j] = add(result[i][j], product(number(self.ops, matrix[i, j]), component))
        return result

    def vee(self, A: Matrix) -> Vector:
        """The x with hat(x) = A, for A in the algebra."""
        return [
            dot([number(self.ops, c) for c in row.values()], [A[i][j] for i, j in row]) for row in self.real.coordinates
        ]

    def Ad(self, X: Matrix, X_inverse: Matrix, x: Sequence[Scalar]) -> Vector:
        """Ad_X x, coordinates of X hat(x) X^{-1}."""
        rigid = self.real.rigid
        if rigid is not None:
            return self._rigid_adjoint(X, [x[index] for index in rigid], rigid)
        return self.vee(matmul(X, matmul(self.hat(x), X_inverse)))

    def _rigid_adjoint(self, X: Matrix, x: Sequence[Scalar], places: Sequence[int]) -> Vector:
        """Ad_(R, p) (w, v) = (R w, R v + p x R w), put back in the order of the basis."""
        R = [row[:3] for row in X[:3]]
        value = matvec(R, x[:3])
        if len(x) == 6:
            value = value + plus(matvec(R, x[3:]), cross([row[3] for row in X[:3]], value))
        result: Vector = [0] * len(x)
        for place, entry in zip(places, value, strict=True):
            result[place] = entry
        return result

    def _block_inverse(self, block: Matrix, form: sp.ImmutableMatrix | None) -> Matrix:
        size = len(block)
        if form is not None:
            place = [next(j for j in range(size) if form[i, j] != 0) for i in range(size)]
            # (S^{-1} X^T S)_{s(i) s(j)} = S_{j s(j)} / S_{i s(i)} X_{j i}
            rows: Matrix = [[0] * size for _ in range(size)]
            for i in range(size):
                for j in range(size):
                    weight = sp.radsimp(form[j, place[j]] / form[i, place[i]])
                    rows[place[i]][place[j]] = product(number(self.ops, weight), block[j][i])
            return rows
        sparse = {(i, j): block[i][j] for i in range(size) for j in range(size) if not _is_zero(block[i][j])}
        columns = solve(sparse, [{j: 1} for j in range(size)], size)
        return [[column.get(i, 0) for column in columns] for i in range(size)]


def _is_zero(x: Any) -> bool:
    return isinstance(x, int) and x == 0


def real_rows(rows: Sequence[Sequence[Any]]) -> Matrix:
    """[[Re, -Im], [Im, Re]] of complex scalars."""
    upper = [[Complex.of(z).re for z in row] + [product(-1, Complex.of(z).im) for z in row] for row in rows]
    lower = [[Complex.of(z).im for z in row] + [Complex.of(z).re for z in row] for row in rows]
    return upper + lower


def matrix_port(group: MatrixGroup, name: str, description: str = "") -> Port:
    """The port of an element of the group."""
    return Port(name, (group.degree, group.degree), is_complex=group.is_complex, description=description)


def velocity_units(group: MatrixGroup, per: str = "s") -> str:
    """Units of a body velocity, component by component."""
    return ", ".join(f"{unit or '1'}/{per}" for unit in group.units)


def random_element(group: MatrixGroup, data: WeiNormanData, rng: random.Random, reach: float = 1.0) -> list[list[Any]]:
    """exp(g_1 A_1) ... exp(g_n A_n) with g uniform in [-reach, reach]."""
    from lie_codegen.groups.wei_norman.body import product_exp

    return product_exp(FloatArithmetic(), data, [rng.uniform(-reach, reach) for _ in range(group.dim)])
