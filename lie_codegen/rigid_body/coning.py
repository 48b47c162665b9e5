"""Coning and spin angles (7), the bounds of the coning angle (16), and the modulus of a momentum parameter (18)."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.errors import InputError
from lie_codegen.rigid_body.free_rigid_body import FreeRigidBody, check_slow
from lie_codegen.rigid_body.principal_body import TAU
from lie_codegen.shapes import shaped


class ConingAngles(NamedTuple):
    """theta in [0, pi], between the body's third (paper's) axis and L, and psi in (-pi, pi] [rad], each (...)."""

    theta: Array
    psi: Array


class ConingBounds(NamedTuple):
    """Smallest and largest coning angle of a motion [rad], each (...)."""

    theta_min: Array
    theta_max: Array


def coning_angles(body: FreeRigidBody, omega: ArrayLike) -> ConingAngles:
    """(theta, psi) with l = (sin psi sin theta, cos psi sin theta, cos theta), l = J omega / L along the paper's axes.

    Args:
        body: of lc.free_rigid_body; its third (paper's) axis is the one that cones.
        omega: (..., 3) [rad/s] in the user's axes.

    Raises:
        InputError: omega = 0.
        ShapeError: the last axis of omega is not 3.

    Source: Coppola, The method of averaging for Euler's equations of rigid body motion, (6), (7).
    """
    w = shaped(omega, (..., 3), "coning_angles: omega")
    momentum = np.stack([sign * w[..., i] for i, sign in body.model.axes], axis=-1) * _moments(body)
    if np.any(np.linalg.norm(momentum, axis=-1) == 0):
        raise InputError("coning_angles: a body at rest has no angular momentum")
    across = np.hypot(momentum[..., 0], momentum[..., 1])
    return ConingAngles(np.arctan2(across, momentum[..., 2]), np.arctan2(momentum[..., 0], momentum[..., 1]))


def coning_bounds(body: FreeRigidBody, k: ArrayLike) -> ConingBounds:
    """(theta_min, theta_max) of the torque-free motion of modulus k; of a spin of sign s3 = -1 they are measured from -x3.

    cos theta_min = 1 / sqrt(1 + gamma_13^2 k^2), cos theta_max = sqrt((1 - k^2) / (1 + gamma_13^2 k^2)), (16).

    Args:
        body: of `free_rigid_body`.
        k: (...) moduli.

    Returns:
        Two arrays (...). [rad]

    Raises:
        InputError: k outside [0, 0.999999].
    """
    check_slow(1.0, k)
    modulus = np.asarray(k, dtype=float)
    g13, g23 = (float(body.model.small_gamma(n, 3).subs(TAU, 0)) for n in (1, 2))
    # by the tangent: an arc cosine near 1 loses half of the digits; gamma_23^2 = 1 + gamma_13^2
    return ConingBounds(
        np.arctan(g13 * modulus), np.arctan2(g23 * modulus, np.sqrt((1 - modulus) * (1 + modulus)))
    )  # fmt: skip


def modulus_squared(body: FreeRigidBody, inertia: ArrayLike) -> Array:
    """k^2 = (I1 - I2)(I - I3) / ((I2 - I3)(I1 - I)) of the momentum parameter I = L^2 / 2T, (18).

    Args:
        body: of `free_rigid_body`.
        inertia: (...) values of I. [kg m^2]

    Raises:
        InputError: I on the other side of the middle moment, or outside the moments, where no motion circles this axis.
    """
    I1, I2, I3 = _moments(body)
    parameter = np.asarray(inertia, dtype=float)
    square = (I1 - I2) * (parameter - I3) / ((I2 - I3) * (I1 - parameter))
    if not np.all((square >= 0) & (square < 1)):
        low, high = sorted((I2, I3))
        raise InputError(
            f"modulus_squared: I = L^2 / 2T must lie from {I3:g} to the middle moment {I2:g} (not on it) for a motion that circles "
            f"this axis, given values outside [{low:g}, {high:g}]; make the body with the other axis"
        )
    return np.asarray(square)[()]


def _moments(body: FreeRigidBody) -> Array:
    return np.array([float(value.subs(TAU, 0)) for value in body.model.moments])
