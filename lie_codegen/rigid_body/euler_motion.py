"""Motions of perturbed Euler's equations by averaging: to first and second order, and to third with the phase as time."""

from __future__ import annotations

from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.averaging.near_identity import GOOD
from lie_codegen.errors import InputError
from lie_codegen.kernel.elliptic import LARGEST_MODULUS
from lie_codegen.rigid_body.euler_second_order import MARGIN, EulerSolution, MeanMotion
from lie_codegen.rigid_body.free_rigid_body import FreeRigidBody, SlowState
from lie_codegen.rigid_body.phase_as_time import third_order_motion
from lie_codegen.runtime.library import Library
from lie_codegen.runtime.ode import EVENT, REACHED, integrate
from lie_codegen.runtime.ode_field import Field


class AveragedEuler(Protocol):
    """What a motion needs of lc.euler_average: its body, its kernels, and the map between mean and osculating variables."""

    @property
    def body(self) -> FreeRigidBody: ...
    @property
    def second_order_library(self) -> Library: ...
    @property
    def third_order_library(self) -> Library: ...
    def mean_point(self, Omega: float, k: float, phi: float, eps: float, tau: float) -> tuple[SlowState, str]: ...
    def stacked(self, *columns: ArrayLike) -> Array: ...
    def to_osculating(
        self, Omega: ArrayLike, k: ArrayLike, phi: ArrayLike, eps: float, tau: ArrayLike
    ) -> SlowState: ...


def averaged_motion(
    flow: AveragedEuler, omega0: Array, t: Array, eps: float, order: int, start: str, rtol: float
) -> EulerSolution:
    """The motion from omega0 (3,) at t[0], whose axes are those of the flow's body.

    Raises:
        InputError: times that do not increase.
    """
    if np.any(np.diff(t) <= 0) or not np.all(np.isfinite(t)):
        raise InputError("t: finite, increasing times; the first is the start")
    t = np.array([0.0, t[0]]) if len(t) == 1 else t
    first, tau = flow.body.to_slow(omega0, eps * t[0]), eps * float(t[0])
    if order == 3:
        return _third(flow, first, tau, t, eps, rtol)
    mean, status = first, GOOD
    if start == "mean":
        mean, status = flow.mean_point(float(first.Omega), float(first.k), float(first.phi), eps, tau)
    state = np.append(flow.stacked(mean.Omega, mean.k, tau), mean.phi)
    rate = Field(flow.second_order_library["mean_rate"], len(state), time=None, constants={"eps": eps, "order": order})
    ends = Field(lambda _, y: np.array([MARGIN - y[1], y[0] - 1e-9 * first.Omega]), len(state))
    motion = integrate(rate, state, t[0], t[-1], rtol=rtol, atol=1e-13, events=ends, directions=[-1, -1])
    if motion.status == EVENT:
        status = ("separatrix", "the spin dies out")[motion.event]
    elif motion.status != REACHED:
        status = f"the averaged system has no solution beyond t = {motion.t[-1]:.9g}"
    kept = t[t <= motion.t[-1]]
    y = motion.at(kept)
    means = MeanMotion(y[:, 0], y[:, 1], y[:, -1])
    found = flow.to_osculating(means.Omega, means.k, means.phi, eps, eps * kept)
    omega = flow.body.from_slow(found.Omega, np.clip(found.k, 0, LARGEST_MODULUS), found.phi, eps * kept)
    return EulerSolution(kept, *found, omega, means, status, float(motion.t[-1]), order)


def _third(flow: AveragedEuler, first: SlowState, tau: float, t: Array, eps: float, rtol: float) -> EulerSolution:
    x0 = np.array([float(first.Omega), float(first.k), tau])
    rate = float(flow.body.frequency(first.Omega, first.k, tau))
    kept, mean, full, status, end = third_order_motion(
        flow.third_order_library, x0, float(first.phi), rate, t, eps, rtol
    )
    omega = flow.body.from_slow(full[:, 0], full[:, 1], full[:, 3], eps * kept)
    means = MeanMotion(mean[:, 0], mean[:, 1], mean[:, 3])
    return EulerSolution(kept, full[:, 0], full[:, 1], full[:, 3], omega, means, status, end, 3)
