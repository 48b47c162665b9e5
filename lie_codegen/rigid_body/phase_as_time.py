"""Third order: the phase as time. dx/dphi = eps F / (Lambda + eps G), ds/dphi = eps / (Lambda + eps G), s = eps t, is periodic in phi.

The averages in time of order 3 then serve, with no theory of their own; t comes out one order lower than x. Where Lambda < 0 the phase
runs backwards, and so does the integration.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.averaging.near_identity import to_mean
from lie_codegen.averaging.time_kernels import time_kernels
from lie_codegen.averaging.time_routine import time_routine
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.definition import kernel_factory
from lie_codegen.kernel.elliptic import LARGEST_MODULUS
from lie_codegen.kernel.kernel import Kernel
from lie_codegen.rigid_body.euler_second_order import MARGIN, inside, phase_system
from lie_codegen.rigid_body.euler_variational import EulerPerturbation
from lie_codegen.runtime.library import Library
from lie_codegen.runtime.ode import EVENT, REACHED, Motion, integrate
from lie_codegen.runtime.ode_field import Field

ORDER, NODES = 3, 64
_ROUNDS = 40


@kernel_factory()
def phase_time_kernels(perturbation: EulerPerturbation, namespace: str) -> tuple[Kernel, ...]:
    """terms, near_identity, mean_rate and actual_rate of (Omega, k, s) over phi, to order 3; s = eps t is the tau of the body."""
    node, clock, n = phase_system(perturbation)

    def field(ops: Arithmetic, y: Sequence[Scalar], others: Sequence[Scalar]) -> list[Scalar]:
        x = list(y[:n])  # (Omega, k), or with s where the body or its perturbation depends on tau
        F, G = node(ops, x, others[0])
        speed = clock(ops, x) + y[3] * G
        return [F[0] / speed, F[1] / speed, ops.constant(1) / speed]

    body = perturbation.body
    key = f"phase as time {body.inertia} {body.axes} {body.signs} {perturbation.terms}"
    routine = time_routine(f"{namespace}_third", namespace, field, 3, 1.0, ORDER, NODES, key)
    return time_kernels(routine, field, 3, ORDER, 1.0, namespace)


def third_order_motion(
    library: Library, x0: Array, phi0: float, rate: float, t: Array, eps: float, rtol: float
) -> tuple[Array, Array, Array, str, float]:
    """(times, mean (N, 4), osculating (N, 4), status, end) with columns Omega, k, s, phi, from the osculating x0, phi0.

    Args:
        library: of `phase_time_kernels`.
        x0: (Omega, k, s).
        phi0: phase at the start.
        rate: Lambda there; its sign says which way phi runs.
        t: times.
        eps: the small number.
        rtol: of the integration.
    """
    function = library["near_identity"]

    def shift(z: Array, phi: float) -> Array:
        return np.asarray([eps, eps**2] @ np.asarray(function(inside(z), float(phi))))

    z0, _, status = to_mean(lambda z, _: (shift(z, phi0), 0.0), x0, 0.0, 1.0, inside)
    last = eps * t[-1]

    def ends(phi: float, z: Array) -> Array:
        return np.array([z[2] + shift(z, phi)[2] - last, MARGIN - z[1]])

    way = np.sign(rate)
    mean_rate = Field(library["mean_rate"], 3, state="z", time=None, constants={"eps": eps})
    # long enough in phase for any drift of Lambda that leaves the motion bounded: the event in s ends it
    far = phi0 + way * (20 * abs(rate) * (t[-1] - t[0]) + 10)
    motion = integrate(mean_rate, z0, phi0, far, rtol=rtol, atol=1e-13, events=Field(ends, 3), directions=(1, -1))
    end = float(t[-1])
    if motion.status == EVENT and motion.event == 1:
        status, end = "separatrix", (motion.y[-1, 2] + shift(motion.y[-1], motion.t[-1])[2]) / eps
    elif motion.status not in (REACHED, EVENT):
        status, end = f"the averaged system has no solution beyond phi = {motion.t[-1]:.9g}", motion.y[-1, 2] / eps
    kept = t[t <= end * (1 + 1e-14)]
    phi = _phases(motion, shift, eps * kept, eps)
    mean = np.column_stack([motion.at(phi), phi])
    full = mean.copy()
    full[:, :3] += np.array([shift(z, p) for z, p in zip(mean[:, :3], phi, strict=True)])
    full[:, 1] = np.clip(full[:, 1], 0, LARGEST_MODULUS)
    return kept, mean, full, status, end


def _phases(motion: Motion, shift: Any, wanted: Array, eps: float) -> Array:
    """Phases at which the osculating s has the wanted values: steps of ds/dphi, which the periodic part changes by O(eps)."""
    order = np.argsort(motion.y[:, 2])
    phi = np.interp(wanted, motion.y[order, 2], motion.t[order])
    low, high = np.min(motion.t), np.max(motion.t)
    slope = np.interp(phi, np.sort(motion.t), np.gradient(motion.y[:, 2], motion.t)[np.argsort(motion.t)])
    for _ in range(_ROUNDS):
        z = motion.at(phi)
        missing = wanted - np.array([state[2] + shift(state, p)[2] for state, p in zip(z, phi, strict=True)])
        phi = np.clip(phi + missing / slope, low, high)
        if np.max(np.abs(missing), initial=0.0) < 1e-13:
            break
    return phi


def cycle_growth(library: Library, k: float) -> tuple[float, float]:
    """(c3, dk): on a limit cycle Omega' = c3 eps^3 / Omega, and the cycle lies at k + dk eps^2 / Omega^2.

    c3 = (F3_Omega - dF1_Omega/dk F3_k / (dF1_k/dk)) / F1_s at Omega = 1, for g linear in omega.
    """
    terms = library["terms"]
    F1, _, F3 = np.asarray(terms([1.0, k, 0.0]))
    h = 1e-5
    above, below = (np.asarray(terms([1.0, k + step, 0.0]))[0] for step in (h, -h))
    slope = (above - below) / (2 * h)
    return float((F3[0] - slope[0] * F3[1] / slope[1]) / F1[2]), float(-F3[1] / slope[1])
