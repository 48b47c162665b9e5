"""Control laws of the benchmark: a tracker of SE(3) with a logarithm, and those of the package."""

from __future__ import annotations

import random
from typing import Any

from lie_codegen.control.attitude_law import attitude_law
from lie_codegen.control.tracking_law import tracking_law
from lie_codegen.groups.catalogue_load import group as load
from lie_codegen.groups.kernels import group_kernel
from lie_codegen.kernel.arithmetic import Arithmetic
from lie_codegen.kernel.brackets import ad_star, bracket
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.linear import Vector, matvec, minus, plus


def log_tracker() -> Kernel:
    """PD plus feedforward on SE(3), E = X_d^-1 X, nu = Ad(E^-1) xi_d:

    f = -K_p log E - K_d (xi - nu) + J (Ad(E^-1) xi_d' + [nu, xi]) - ad*_xi J xi,

    gains and inertia diagonal: what a method developer would write, not a law with a proof.
    """
    se3 = load("se3")
    log, compose, inverse, adjoint = (group_kernel(se3, name).body for name in ("log", "compose", "inverse", "Ad"))

    def body(
        ops: Arithmetic, X: Any, xi: Vector, X_d: Any, xi_d: Vector, rate: Vector, K_p: Vector, K_d: Vector, J: Vector
    ) -> tuple[Any, ...]:
        [back] = inverse(ops, X_d)
        [error] = compose(ops, back, X)
        [other] = inverse(ops, error)
        [turn] = adjoint(ops, other)
        [x] = log(ops, error)
        nu = matvec(turn, xi_d)
        wanted = plus(matvec(turn, rate), bracket(ops, se3.algebra, nu, xi))
        gyroscopic = ad_star(ops, se3.algebra, xi, [j * v for j, v in zip(J, xi, strict=True)])
        feedback = plus(
            [k * e for k, e in zip(K_p, x, strict=True)], [k * e for k, e in zip(K_d, minus(xi, nu), strict=True)]
        )
        return (minus(minus([j * a for j, a in zip(J, wanted, strict=True)], gyroscopic), feedback),)

    exp = group_kernel(se3, "exp")

    def sampler(rng: random.Random) -> tuple[Any, ...]:
        from lie_codegen.kernel.arithmetic import FloatArithmetic

        def vector(low: float, high: float) -> Vector:
            return [rng.uniform(low, high) for _ in range(6)]

        poses = [exp.body(FloatArithmetic(), vector(-1, 1))[0] for _ in range(2)]
        return poses[0], vector(-1, 1), poses[1], *(vector(-1, 1) for _ in range(2)), *(vector(1, 4) for _ in range(3))

    vectors = [Port(name, (6,)) for name in ("xi_d", "xi_d_dot", "K_p", "K_d", "J")]
    inputs = (Port("X", (4, 4)), Port("xi", (6,)), Port("X_d", (4, 4)), *vectors)
    return Kernel("log_tracker", "se3", inputs, (Port("force", (6,)),), body, sampler=sampler)


def package_tracker() -> Kernel:
    """`lc.tracking_law` on SE(3) with the error se3_1 (no logarithm), its energy and its rate."""
    gains = {"K_1": 4.0, "K_2": 3.0, "K_d": [2.0, 2, 2, 3, 3, 3]}
    return tracking_law(load("se3"), inertia=[2, 3, 4, 5, 6, 8], error="se3_1", gains=gains)


def package_attitude() -> Kernel:
    """`lc.attitude_law("pd")`."""
    return attitude_law("pd", inertia=[1, 2, 3], k_p=4, k_d=6, gyroscopic="cancel")
