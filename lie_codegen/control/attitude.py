"""Attitude stabilisation on SO(3): the laws of Geyer as data, where they converge, and gains for a wanted response.

First order   omega = -k_p theta                                                       (17), theta = log R
Second order  tau = c' omega x I omega - k_p theta - k_d omega                         (18)
with I omega' = -omega x I omega + tau, so that I omega' = c omega x I omega - k_p theta - k_d omega, c = c' - 1:

    gyroscopic "cancel"  c' =  1, c =  0: the gyroscopic torque is cancelled, as the text intends;
    gyroscopic "none"    c' =  0, c = -1: it is left alone, which needs no inertia;
    gyroscopic "double"  c' = -1, c = -2: (18) as printed, which has the sign of the printed (3) and doubles it.

All three are stable: V_0 = k_p |theta|^2/2 + omega' I omega/2 has the rate -k_d |omega|^2 for any c.

No continuous law stabilises a rotation from everywhere (Corollaries 16 and 17: SO(3) is compact and without
boundary, so not contractible). Here the exception is the turn by 180 degrees, where log R jumps between theta and
-theta: the law is then discontinuous, takes the axis described in `groups/maps/rotation_log.py`, and still moves away
from there. The way it takes is the short one: it depends on R alone, so there is no unwinding.
"""

from __future__ import annotations

from dataclasses import dataclass
from math import pi, sqrt
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.errors import InputError, NotFiniteError
from lie_codegen.exact.positive_matrix import as_floats, eigenvalues, positive_matrix, positive_number
from lie_codegen.kernel.saved import Saved
from lie_codegen.shapes import shaped

#: c' of the torque's gyroscopic term, by name.
GYROSCOPIC = {"cancel": 1, "none": 0, "double": -1}


@dataclass(frozen=True, eq=False, repr=False)
class AttitudeRegion(Saved):
    """Whether an initial state lies in the proved region of attraction.

    Attributes:
        value: |theta_0|^2/2 + omega_0' I omega_0/(2 k_p); of a matrix k_p theta_0' k_p theta_0/2 + omega_0' I omega_0/2.
        bound: pi^2/2; of a matrix k_p its least eigenvalue times that; inside means value < bound, strictly.
        inside: whether convergence is proved. Outside nothing is claimed: many such states converge too.
    """

    value: float
    bound: float
    inside: bool


def attitude_region(theta: ArrayLike, omega: ArrayLike, *, inertia: Any, k_p: Any) -> AttitudeRegion:
    """The region of attraction of the law (18), whatever the gyroscopic term and k_d > 0.

        |theta_0|^2/2 + omega_0' I omega_0/(2 k_p) < pi^2/2

    On it V_0 keeps |theta| < pi. Printed (19), |theta_0|^2/2 + lambda_max |omega_0|^2 <= pi^2/2, is sufficient for
    k_p >= 1/2 only: with k_p = 0.05, k_d = 0.1, theta_0 = 0, omega_0 = (0.9, 0, 0), I = diag(6, 3, 1) it holds and
    |theta| reaches pi. Geyer, The Attitude Control Problem, Proposition 21. A diagonal or a matrix k_p goes with the torque -J' k_p theta (see
    `attitude_law`), and theta_0' k_p theta_0/2 + omega_0' I omega_0/2 < lambda_min(k_p) pi^2/2 keeps |theta| < pi.

    Raises:
        ShapeError, NotFiniteError: theta or omega is not three finite numbers.
        InputError: indefinite inertia, k_p not positive.
    """
    I = as_floats(positive_matrix(inertia, 3, "inertia"))  # noqa: E741
    w, a = _three(omega, "omega"), _three(theta, "theta")
    if np.ndim(k_p) and not isinstance(k_p, str):
        K = as_floats(positive_matrix(k_p, 3, "k_p"))
        value, bound = float(a @ K @ a / 2 + w @ I @ w / 2), float(np.linalg.eigvalsh(K)[0] * pi**2 / 2)
        return AttitudeRegion(value, bound, value < bound)
    value = float(a @ a / 2 + w @ I @ w / (2 * float(positive_number(k_p, "k_p"))))
    return AttitudeRegion(value, pi**2 / 2, value < pi**2 / 2)


def cross_term_bound(*, inertia: Any, k_p: Any, k_d: Any) -> float:
    """Largest epsilon proved for V = V_0 + epsilon theta' I omega to be positive with a negative definite rate.

        epsilon < min(k_p k_d/(k_d^2/4 + k_p (pi/2) lambda_max), sqrt(k_p/lambda_max))

    for gyroscopic "none", whose chain is the printed one. Printed omega' A(-theta)' I omega <= (pi/2) omega' I omega
    fails for diag(6, 3, 1); (pi/2) lambda_max |omega|^2 holds.

    Raises:
        InputError: indefinite inertia or a gain that is not positive.
    """
    largest = float(eigenvalues(positive_matrix(inertia, 3, "inertia"))[-1])
    p, d = float(positive_number(k_p, "k_p")), float(positive_number(k_d, "k_d"))
    return min(p * d / (d**2 / 4 + p * (pi / 2) * largest), sqrt(p / largest))


def attitude_linearisation(*, inertia: Any, k_p: Any, k_d: Any) -> np.ndarray:
    """(6,) eigenvalues of theta' = omega, I omega' = -k_p theta - k_d omega, the same for every gyroscopic term.

    Raises:
        InputError: indefinite inertia or a gain that is not positive.
    """
    I = as_floats(positive_matrix(inertia, 3, "inertia"))  # noqa: E741
    p, d = float(positive_number(k_p, "k_p")), float(positive_number(k_d, "k_d"))
    zero, one = np.zeros((3, 3)), np.eye(3)
    below = np.linalg.solve(I, np.hstack([-p * one, -d * one]))
    return np.linalg.eigvals(np.vstack([np.hstack([zero, one]), below]))


@dataclass(frozen=True, eq=False, repr=False)
class ResponseGains(Saved):
    """Gains for a wanted response of the linearised loop I x'' + K_d x' + H x = 0.

    Attributes:
        stiffness: (n, n) H = bandwidth^2 I, the Hessian the error function must have.
        K_d: (n, n) 2 damping bandwidth I.
        K_p: (3, 3) with Hessian (tr(K_p) - K_p)/2 = H, for tr(K_p (1 - R))/2; only for three dimensions.
    """

    stiffness: np.ndarray
    K_d: np.ndarray
    K_p: np.ndarray | None


def gains_for_response(inertia: Any, *, bandwidth: Any, damping: Any = 0.7, size: int = 3) -> ResponseGains:
    """Gains such that every mode of the linearised loop has the given natural frequency and damping ratio.

    Args:
        inertia: symmetric positive definite.
        bandwidth: natural frequency [rad/s].
        damping: damping ratio, 0.7 for a quick response with 5 % overshoot.
        size: n.

    Raises:
        InputError: indefinite inertia, bandwidth or damping not positive, or an inertia whose K_p would be degenerate.
    """
    I = as_floats(positive_matrix(inertia, size, "inertia"))  # noqa: E741
    w, zeta = float(positive_number(bandwidth, "bandwidth")), float(positive_number(damping, "damping"))
    stiffness = w**2 * I
    K_p = np.trace(stiffness) * np.eye(3) - 2 * stiffness if size == 3 else None
    return ResponseGains(stiffness, 2 * zeta * w * I, K_p)


def _three(value: ArrayLike, what: str) -> np.ndarray:
    array = shaped(value, (3,), what)
    if not np.all(np.isfinite(array)):
        raise NotFiniteError(f"{what} holds NaN or infinity")
    return array


def gyroscopic_factor(name: str) -> int:
    """c' of the torque's term c' omega x I omega.

    Raises:
        InputError: no such name.
    """
    if name not in GYROSCOPIC:
        raise InputError(f"gyroscopic {name!r} is not known; choose one of {', '.join(GYROSCOPIC)}")
    return GYROSCOPIC[name]
