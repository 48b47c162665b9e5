"""Kernels of a connection: A(r), and the step by which a gait moves the body."""

from __future__ import annotations

import random
from typing import Any

from lie_codegen.averaging.shape_form import ShapeForm
from lie_codegen.errors import InputError
from lie_codegen.groups.derivation import derivation_of
from lie_codegen.groups.maps.matrices import matrix_port, random_element
from lie_codegen.groups.maps.rkmk import TAYLOR_DEGREE, times_taylor_exp
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.block_solve import solve
from lie_codegen.kernel.brackets import bracket
from lie_codegen.kernel.definition import kernel_factory
from lie_codegen.kernel.expressions import ExpressionEvaluator
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.linear import Matrix, Vector, dot, plus, scaled
from lie_codegen.kernel.structural_zeros import add, is_zero, product
from lie_codegen.on_demand import sympy as sp

NAMESPACE = "shape"
SOURCE = "TR 93-59, section 6; Hatton and Choset, IEEE T-RO 29 (2013)"


@kernel_factory()
def connection_kernels(connection: ShapeForm, harmonics: int = 3, namespace: str = NAMESPACE) -> tuple[Kernel, ...]:
    """connection: r -> A(r); shape_velocity: (r, v) -> xi = -A(r) v, for lc.ocp; gait_step: (X, gait, t, h) -> X_next, one Magnus step of order 4 along a Fourier series of period 2 pi.

    Raises:
        InputError: a connection with a changed frame; generate the original one, X(T) differs by the constant h_0.
    """
    if connection.frame is not None:
        raise InputError(
            "kernels: generate the connection as it was given; a change of frame turns X(T) by the constant h(r_0) alone"
        )
    group, n, k = connection.group, connection.group.dim, connection.size
    symbols = sp.symbols(" ".join(connection.shape), real=True, seq=True)
    data = derivation_of(group).wei_norman

    def at(ops: Arithmetic, r: Vector) -> Matrix:
        evaluate = ExpressionEvaluator(ops, dict(zip(symbols, r, strict=True)))
        if connection.exact_A is not None:
            return [[evaluate(entry) for entry in row] for row in connection.exact_A.tolist()]
        # No momentum means M_gg xi + M_gr r' = 0, and so A = M_gg^-1 M_gr: solved at each r, sparse, where a metric is given.
        M = sp.ImmutableMatrix(connection.exact_metric)
        block = {(i, j): evaluate(M[i, j]) for i in range(n) for j in range(n) if M[i, j] != 0}
        columns = [{i: evaluate(M[i, n + j]) for i in range(n) if M[i, n + j] != 0} for j in range(k)]
        solved = solve(block, columns, n)
        return [[solved[j].get(i, 0) for j in range(k)] for i in range(n)]

    def rate(ops: Arithmetic, gait: Matrix, t: Scalar) -> Vector:
        """-A(r) r' at time t."""
        c, s = ops.cos(t), ops.sin(t)
        waves: list[tuple[Scalar, Scalar]] = [(1, 0), (c, s)]
        # cos m t and sin m t by turning the pair of m - 1: one sine and one cosine a call.
        for _ in range(harmonics - 1):
            x, y = waves[-1]
            waves.append((x * c - y * s, y * c + x * s))
        r: Vector = [row[0] for row in gait]
        moving: Vector = [0] * k
        for i, row in enumerate(gait):
            for m in range(1, harmonics + 1):
                a, b, (x, y) = row[m], row[harmonics + m], waves[m]
                r[i] = add(r[i], a * x + b * y)
                moving[i] = add(moving[i], m * (b * x - a * y))
        return [product(-1, dot(row, moving)) for row in at(ops, r)]

    def step(ops: Arithmetic, X: Any, gait: Matrix, t: Scalar, h: Scalar) -> tuple[Any, ...]:
        # Two Gauss-Legendre nodes; the bracket's sign is that of X' = X hat(xi), the opposite of the one printed for Y' = A Y.
        offset = 3**0.5 / 6
        first, second = (rate(ops, gait, t + h * (0.5 + sign * offset)) for sign in (-1, 1))
        turned = bracket(ops, group.algebra, first, second)
        omega = plus(scaled(h / 2, plus(first, second)), scaled(h * h * (3**0.5 / 12), turned))
        moved = times_taylor_exp(group, ops, X, omega, TAYLOR_DEGREE)
        return ([[0.0 if is_zero(entry) else entry for entry in row] for row in moved],)

    def sampler(rng: random.Random) -> tuple[Any, ...]:
        table = [[rng.uniform(-0.5, 0.5) for _ in range(2 * harmonics + 1)] for _ in range(k)]
        return random_element(group, data, rng), table, rng.uniform(0, 6), rng.uniform(0.01, 0.1)

    r = Port("r", (k,), description=", ".join(connection.shape))
    gait = Port("gait", (k, 2 * harmonics + 1), description="mean, cosines, sines of each shape")
    return (
        Kernel("connection", namespace, (r,), (Port("A", (n, k)),),
               lambda ops, r: (at(ops, r),), "xi = -A(r) r'", SOURCE),
        Kernel("shape_velocity", namespace, (r, Port("v", (k,), description="shape velocities")), (Port("xi", (n,)),),
               lambda ops, r, v: ([product(-1, dot(row, v)) for row in at(ops, r)],), "xi = -A(r) v", SOURCE),
        Kernel("gait_step", namespace, (matrix_port(group, "X"), gait, Port("t", ()), Port("h", ())), (matrix_port(group, "X_next"),),
               step, "X' = X hat(-A(r) r'), one Magnus step of order 4", SOURCE, sampler),
    )  # fmt: skip
