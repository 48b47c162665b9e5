"""Ports, gains and samples that the attitude laws and their Lyapunov function share."""

from __future__ import annotations

import random
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from lie_codegen.exact.positive_matrix import body_inertia, positive_matrix, positive_number
from lie_codegen.kernel.kernel import Port
from lie_codegen.kernel.parameter import Parameter, parameter

ATTITUDE = Port("X", (3, 3), description="attitude error: body to reference, R_d' R")
BODY = Port("X", (3, 3), description="attitude, body to inertial")
RATE = Port("omega", (3,), "rad/s", description="body angular velocity")
DESIRED = (
    Port("X_d", (3, 3), description="desired attitude"),
    Port("xi_d", (3,), "rad/s", description="its body velocity, X_d' = X_d hat(xi_d)"),
    Port("xi_d_dot", (3,), "rad/s^2", description="the rate of that"),
)


def units_of_gains(parameters: Mapping[str, Any]) -> Mapping[str, str]:
    """Of the gains: the kinds that command a velocity, and the one that commands a torque."""
    if parameters.get("kind", "pd") != "pd":
        return {"k_p": "1/s"}
    return {"inertia": "kg m^2", "k_p": "N m/rad", "k_d": "N m s/rad"}


def attitude_gain(port: Port, value: Any, tunable: bool) -> Parameter:
    """A positive number; or, given as one, a diagonal or a symmetric positive definite matrix."""
    listed = not isinstance(value, str) and (isinstance(value, Sequence) or hasattr(value, "shape"))
    if listed and np.ndim(value):
        return parameter(
            replace(port, shape=(3, 3)), value, lambda given, what: positive_matrix(given, 3, what), tunable=tunable
        )
    return parameter(port, value, positive_number, tunable=tunable)


def body_inertia_parameter(value: Any, tunable: bool) -> Parameter:
    """The inertia of a rigid body as a number or an input; see `body_inertia`."""
    port = Port("inertia", (3, 3), "kg m^2", description="inertia of the body, symmetric")
    return parameter(port, value, body_inertia, tunable=tunable)


def random_reference(rng: random.Random) -> tuple[Any, ...]:
    """X_d, xi_d, xi_d_dot."""
    return random_rotation(rng), *([rng.uniform(-1, 1) for _ in range(3)] for _ in range(2))


def random_rotation(rng: random.Random) -> list[list[float]]:
    """A rotation by a random unit quaternion."""
    q = np.array([rng.gauss(0, 1) for _ in range(4)])
    a, b, c, d = q / np.linalg.norm(q)
    R = [
        [a * a + b * b - c * c - d * d, 2 * (b * c - a * d), 2 * (b * d + a * c)],
        [2 * (b * c + a * d), a * a - b * b + c * c - d * d, 2 * (c * d - a * b)],
        [2 * (b * d - a * c), 2 * (c * d + a * b), a * a - b * b - c * c + d * d],
    ]
    return [[float(entry) for entry in row] for row in R]
