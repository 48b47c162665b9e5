"""A variational integrator of Lagrangian systems: second order, symplectic without forces, cyclic momenta kept to rounding.

The midpoint rule L_d(q0, q1) = h L((q0 + q1)/2, (q1 - q0)/h), in position and momentum,

    p_0 = -D_1 L_d - h F/2,     p_1 = D_2 L_d + h F/2,     F the force at the midpoint, f(q, v) - dD/dv + B(q) u.

The first equation is solved for q_1 by Newton's method; the second is explicit. Sanyal, Bloch and McClamroch integrate the actual system of their Fig. 3 by a
scheme of this kind; Marsden and West, Acta Numerica 10 (2001) 357.
"""

from __future__ import annotations

import random
from typing import Any

from lie_codegen.errors import InputError
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.block_solve import solve
from lie_codegen.kernel.definition import kernel_factory
from lie_codegen.kernel.dual import DualArithmetic, tangent_of, value_of
from lie_codegen.kernel.expressions import ExpressionEvaluator
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.linear import Vector
from lie_codegen.kernel.structural_zeros import add, is_zero, product
from lie_codegen.mechanics.lagrangian import LagrangianSystem
from lie_codegen.on_demand import sympy as sp

_NEWTON = 4


@kernel_factory()
def lagrangian_variational_step(
    system: LagrangianSystem, name: str = "variational_step", namespace: str = "lagrangian"
) -> Kernel:
    """The step (state, u, h, parameters..) -> (state_next, energy); the state is q, then p = dL/dv; u holds over the step.

    Args:
        system: of `lc.lagrangian_system`, or the `system` of `lc.routh_reduce`.
        name, namespace: C identifiers.

    Raises:
        InputError: not a Lagrangian system.
    """
    if not isinstance(system, LagrangianSystem):
        raise InputError(f"lagrangian_variational_step: a Lagrangian system is needed, got {type(system).__name__}")
    n, m = len(system.q), len(system.inputs)
    v = sp.Matrix(system.v)
    momentum = [sp.diff(system.lagrangian, w) for w in system.v]
    slope = [sp.diff(system.lagrangian, x) for x in system.q]
    force = [f - sp.diff(system.dissipation, w) for f, w in zip(system.force, system.v, strict=True)]
    energy = (v.T * system.mass * v)[0] / 2 + system.potential

    def body(ops: Arithmetic, state: Vector, *rest: Any) -> tuple[Any, ...]:
        u, h, given = (rest[0], rest[1], rest[2:]) if m else ([], rest[0], rest[1:])
        parameters = dict(zip(system.parameter_symbols, given, strict=True))
        q0, p0 = list(state[:n]), list(state[n:])

        def sides(arithmetic: Any, q1: Vector) -> tuple[Vector, Vector]:
            """-D_1 L_d - h F/2 and D_2 L_d + h F/2."""
            middle = [(a + b) * 0.5 for a, b in zip(q0, q1, strict=True)]
            rate = [(b - a) / h for a, b in zip(q0, q1, strict=True)]
            values = dict(zip((*system.q, *system.v), (*middle, *rate), strict=True))
            evaluate = ExpressionEvaluator(arithmetic, {**parameters, **values})
            left, right = [], []
            for i in range(n):
                applied = add(evaluate(slope[i]), evaluate(force[i]))
                for a in range(m):
                    applied = add(applied, product(evaluate(system.input_matrix[i, a]), u[a]))
                half, p = product(applied, h * 0.5), evaluate(momentum[i])
                left.append(add(p, product(-1, half)))
                right.append(add(p, half))
            return left, right

        # the start of Newton's method: the velocity that belongs to p_0 at q_0
        at = ExpressionEvaluator(ops, {**parameters, **dict(zip(system.q, q0, strict=True))})
        mass = {(i, j): at(system.mass[i, j]) for i in range(n) for j in range(n) if system.mass[i, j] != 0}
        [v0] = solve(mass, [{i: p - at(system.gyroscopic[i]) for i, p in enumerate(p0)}], n)
        q1 = [a + h * v0.get(i, 0) for i, a in enumerate(q0)]
        dual = DualArithmetic(ops)
        for _ in range(_NEWTON):
            left, _ = sides(dual, [dual.variable(x, {k: 1}) for k, x in enumerate(q1)])
            rows = [[tangent_of(entry, k, dual.level) for k in range(n)] for entry in left]
            sparse = {(i, k): rows[i][k] for i in range(n) for k in range(n) if not is_zero(rows[i][k])}
            residual = {i: p - value_of(entry, dual.level) for i, (p, entry) in enumerate(zip(p0, left, strict=True))}
            [change] = solve(sparse, [residual], n)
            q1 = [x + change.get(i, 0) for i, x in enumerate(q1)]
        _, p1 = sides(ops, q1)
        there = ExpressionEvaluator(ops, {**parameters, **dict(zip(system.q, q1, strict=True))})
        mass = {(i, j): there(system.mass[i, j]) for i in range(n) for j in range(n) if system.mass[i, j] != 0}
        [v1] = solve(mass, [{i: p - there(system.gyroscopic[i]) for i, p in enumerate(p1)}], n)
        values = {**dict(zip(system.q, q1, strict=True)), **{w: v1.get(i, 0) for i, w in enumerate(system.v)}}
        final: Scalar = ExpressionEvaluator(ops, {**parameters, **values})(energy)
        return [*q1, *p1], final

    def sampler(rng: random.Random) -> tuple[Any, ...]:
        state = [rng.uniform(0.3, 1.0) for _ in range(2 * n)]
        return (
            state,
            *([[rng.uniform(-1, 1) for _ in range(m)]] if m else []),
            0.01,
            *(rng.uniform(0.5, 1) for _ in system.parameters),
        )

    port = Port("state", (2 * n,), description=f"{', '.join(system.coordinates)}, then the momenta dL/dv")
    inputs = (port, *((Port("u", (m,), description=", ".join(system.inputs)),) if m else ()), Port("h", (), "s"))
    return Kernel(
        name, namespace, (*inputs, *(Port(p, ()) for p in system.parameters)),
        (Port("state_next", (2 * n,)), Port("energy", (), description="kinetic plus potential")), body,
        "p_0 = -D_1 L_d - h F/2, p_1 = D_2 L_d + h F/2, L_d the midpoint rule", "Marsden and West, Acta Numerica 10 (2001) 357", sampler,
    )  # fmt: skip
