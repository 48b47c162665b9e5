"""The compiled step of the retuning: w, not xi, is integrated, for it is smooth and needs no derivative of the torques."""

from __future__ import annotations

import random
from functools import lru_cache
from typing import Any

from lie_codegen.groups.derivation import derivation_of
from lie_codegen.groups.maps.element_pattern import pack, packed_size, unpack
from lie_codegen.groups.maps.matrices import random_element
from lie_codegen.groups.maps.rkmk import TAYLOR_DEGREE, times_taylor_exp
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.brackets import ad_star, dexp_inverse
from lie_codegen.kernel.definition import kernel_factory
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.linear import Matrix, Vector, matvec, plus, scaled, transpose
from lie_codegen.kernel.runge_kutta import CLASSICAL, increment, vectors
from lie_codegen.runtime.build import build_kernels
from lie_codegen.runtime.library import Library


@kernel_factory()
def oscillation_step(group: MatrixGroup, forces: int) -> Kernel:
    """(state, numbers, P, J, J^-1, D, Y, split, compensation, T, N, x, h) -> (state_next,): RKMK4 of X' = X hat(w + U^a Y_a), w' = ...

    The state is the varying entries of X, then w; x = t/T is where the step begins and h how much of x it takes.
    """
    n, m, size = group.dim, forces, packed_size(group)
    pairs = [(a, b) for a in range(m) for b in range(a + 1, m)]

    def body(
        ops: Arithmetic, state: Vector, numbers: Vector, balance: Vector, J: Matrix, inverse: Matrix, D: Matrix, Y: Matrix, split: Matrix,
        compensation: Matrix, T: Scalar, cycles: Scalar, x: Scalar, h: Scalar,
    ) -> tuple[Any, ...]:  # fmt: skip
        X, w = unpack(group, state[:size]), list(state[size:])
        xi_d, nu = numbers[:n], numbers[n:]
        # -<xi : xi>/2 = J^-1 ad*_xi J xi
        turned = scaled(-1, matvec(inverse, ad_star(ops, group.algebra, xi_d, matvec(J, xi_d))))
        drag = matvec(inverse, matvec(D, xi_d))
        lifted, over = transpose(Y), 1 / T

        def inputs(at: Scalar) -> tuple[Vector, Vector]:
            """v and U at x, in the basis of the algebra."""
            z = at * (1 - at)
            eta = plus(
                scaled(420 * (1 - 2 * at) * over * over, xi_d), scaled(19600 * over * over * z * z * z * z, turned),
                scaled(140 * over * z, drag), scaled(30 * over, nu),
            )  # fmt: skip
            parts = matvec(split, eta)
            v, U = scaled(z * z, parts[:m]), [0] * m
            angle = 6.283185307179586 * cycles * at
            c, s = ops.cos(angle), ops.sin(angle)
            wave, beside = s, c
            twice_c, twice_s = c * c - s * s, 2 * s * c
            for i, (a, b) in enumerate(pairs):
                if i:  # sin and cos of the next odd multiple: turned by twice the angle, with no sine of its own
                    wave, beside = wave * twice_c + beside * twice_s, beside * twice_c - wave * twice_s
                p, q = balance[i] * z, -2 * parts[m + i] * z / balance[i]
                for force, amplitude in ((a, p), (b, q)):
                    U[force] = U[force] + amplitude * wave
                    v = plus(v, scaled(amplitude * amplitude / 4, compensation[force]))
            return matvec(lifted, v), matvec(lifted, U)

        at_stages = {part: inputs(x + part * h) for part in (0.0, 0.5, 1.0)}
        step = h * T

        def slope(part: float, moved: Vector) -> Vector:
            v, U = at_stages[part]
            theta, change = moved[:n], moved[n:]
            xi = plus(w, change, U)
            force = plus(ad_star(ops, group.algebra, xi, matvec(J, xi)), scaled(-1, matvec(D, xi)))
            return [*dexp_inverse(ops, group.algebra, theta, xi), *plus(matvec(inverse, force), v)]

        total = increment(vectors(ops), CLASSICAL, slope, [0] * (2 * n), step)
        return ([*pack(group, times_taylor_exp(group, ops, X, total[:n], TAYLOR_DEGREE)), *plus(w, total[n:])],)

    data = derivation_of(group).wei_norman
    square = (n, n)
    inputs = (
        Port("state", (size + n,), description="varying entries of X, then w"), Port("numbers", (2 * n,)), Port("balance", (max(1, len(pairs)),)),
        Port("inertia", square), Port("inverse", square), Port("damping", square), Port("lifts", (m, n)), Port("split", (m + len(pairs), n)),
        Port("compensation", (m, m)), Port("duration", (), "s"), Port("cycles", ()), Port("x", ()), Port("h", ()),
    )  # fmt: skip

    def sampler(rng: random.Random) -> tuple[Any, ...]:
        def table(shape: tuple[int, ...]) -> Any:
            return [rng.uniform(-1, 1) if len(shape) == 1 else table(shape[1:]) for _ in range(shape[0])]

        state = [*pack(group, random_element(group, data, rng)), *table((n,))]
        rest = [table(port.shape) for port in inputs[1:9]]
        rest[1] = [rng.uniform(0.5, 1) for _ in rest[1]]
        return state, *rest, rng.uniform(1, 10), rng.uniform(1, 4), rng.uniform(0, 1), rng.uniform(0.001, 0.01)

    return Kernel(
        "oscillation_step", group.name, inputs, (Port("state_next", (size + n,)),), body, "w' = J^-1 (ad*_xi J xi - D xi) + v^a Y_a, xi = w + U^a Y_a",
        "Bullo, Leonard and Lewis, IEEE TAC 45 (2000) 1437", sampler,
    )  # fmt: skip


@lru_cache(maxsize=16)
def step_library(group: MatrixGroup, forces: int) -> Library:
    """The compiled step of a group and a number of forces: inertia and forces are inputs of it."""
    return build_kernels(
        lambda: [oscillation_step(group, forces)],
        namespace=group.name,
        definition=f"oscillation {forces}\n{group.definition_text}",
    )
