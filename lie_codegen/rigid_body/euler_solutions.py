"""Solutions of perturbed Euler's equations: averaged, direct, and the explicit one (32)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.errors import ComputationError, InputError
from lie_codegen.kernel.elliptic import LARGEST_MODULUS
from lie_codegen.kernel.expressions import ExpressionEvaluator
from lie_codegen.kernel.numpy_arithmetic import NumpyArithmetic
from lie_codegen.kernel.saved import Saved
from lie_codegen.on_demand import sympy as sp
from lie_codegen.rigid_body.euler_average import EulerAverage
from lie_codegen.rigid_body.principal_body import TAU, PrincipalBody
from lie_codegen.runtime.ode import REACHED, integrate
from lie_codegen.runtime.ode_field import Field
from lie_codegen.shapes import shaped

#: k of a start in the polar coordinates (k, phi).
_LEAST = 1e-12


@dataclass(frozen=True, eq=False, repr=False)
class SlowSolution(Saved):
    """The averaged system at times t.

    Attributes:
        t: (N,) [s]; fewer than were asked for where the status is not "ok".
        Omega, k: (N,) the slow variables, within O(eps) of the actual ones over times of order 1/eps.
        phi: (N,) the averaged phase; to first order in averaging it is known only to O(1) over such times.
        evaluations: right-hand sides taken.
        status: "ok", or why and when it ends.
    """

    t: Array
    Omega: Array
    k: Array
    phi: Array
    evaluations: int
    status: str = "ok"


def solve_averaged(
    flow: EulerAverage, Omega0: float, k0: float, t: ArrayLike, eps: float, *, phi0: float = 0.0, rtol: float = 1e-11
) -> SlowSolution:
    """(21): Omega' = eps Fbar_Omega, k' = eps Fbar_k, phi' = Lambda + eps Gbar, from t[0], in compiled steps.

    Where k leaves the range in which averaging is valid (in one period of the fast phase the slow drift would cover the rest
    of the way to the separatrix) or the spin dies out, what was computed before is returned, and the status says so. This
    is the paper's way to start, at the osculating point; `EulerAverage.solve` starts at the mean point.

    Args:
        flow: of `euler_average`.
        Omega0, k0, phi0: spin [rad/s], modulus and phase at t[0].
        t: (N,) increasing times. [s]
        eps: the small parameter.
        rtol: local relative error.

    Raises:
        InputError: as `EulerAverage.averaged`, for the start; times that do not increase.
        ComputationError: averaging is not valid at the start.
    """
    times = _times(t)
    flow.averaged(Omega0, max(k0, _LEAST), eps * times[0])
    rate, size = _averaged_field(flow, eps)

    def leaving(time: float, state: Array) -> Array:
        y = np.array([state[0], min(max(state[1], _LEAST), LARGEST_MODULUS), *state[2:]])
        slope = rate(time, y)
        return np.array([1 - state[1] - max(slope[1], 0.0) / abs(slope[-1]), state[0] - 1e-9 * Omega0])

    slow = [eps * times[0]] if size == 4 else []
    start = np.array([Omega0, k0 if flow.is_closed else max(k0, _LEAST), *slow, phi0])
    if np.any(leaving(times[0], start) <= 0):
        raise ComputationError(_leaves(times[0], Omega0, k0))
    motion = integrate(
        rate, start, times[0], times[-1], rtol=rtol, atol=rtol, events=Field(leaving, size), directions=(-1, -1)
    )
    status = "ok" if motion.status == REACHED else _leaves(motion.t[-1], *motion.y[-1, :2])
    kept = times[times <= motion.t[-1]]
    found = motion.at(kept)
    return SlowSolution(kept, found[:, 0], found[:, 1], found[:, -1], motion.evaluations, status)


def _averaged_field(flow: EulerAverage, eps: float) -> tuple[Field, int]:
    """The averaged system as C calls it: by Table 3 where it applies, else by the loop over phases."""
    if flow.is_closed:
        return Field(flow.library["averaged_rate"], 3, constants={"eps": eps}), 3
    size = 3 if flow.perturbation.is_autonomous else 4
    return Field(flow.second_order_library["mean_rate"], size, time=None, constants={"eps": eps, "order": 1}), size


def _leaves(t: float, spin: float, k: float) -> str:
    return (
        f"averaging is not valid at t = {t:.6g}, Omega = {spin:.6g}, k = {k:.6g}: the drift of k over one period would "
        "reach the separatrix, or the spin dies out; use a smaller eps or integrate the full equations"
    )


def solve_actual(flow: EulerAverage, omega0: ArrayLike, t: ArrayLike, eps: float, *, rtol: float = 1e-11) -> Array:
    """omega (N, 3) [rad/s] of the full equations (3) at times t, by compiled steps of order 8.

    Args:
        flow: of `euler_average`: its body and its perturbation.
        omega0: (3,) at t[0]. [rad/s]
        t: (N,) increasing times. [s]
        eps: the small parameter.
        rtol: local relative error.

    Raises:
        InputError: times that do not increase.
        ShapeError: omega0 is not (3,).
        ComputationError: the integration fails.
    """
    times, function = _times(t), flow.library["rate"]
    start = shaped(omega0, (3,), "solve_actual: omega0")
    if flow.perturbation.is_autonomous:
        rate = Field(function, 3, state="omega", time=None, constants={"eps": eps})
    else:
        rate = Field(lambda time, w: function(w, eps, eps * time), 3)
    motion = integrate(rate, start, times[0], times[-1], rtol=rtol, atol=rtol * np.abs(start).max())
    if motion.status != REACHED:
        raise ComputationError(f"the full equations have no solution beyond t = {motion.t[-1]:.9g}")
    return motion.at(times)


@dataclass(frozen=True, eq=False, repr=False)
class ExplicitSolution(Saved):
    """(32): the algebraic approximation for pure inertia change.

        r1 = r0 (j1 / j2)^(1/4),  k^2 = r0^2 g31 g32 / (1 - r0^2 g12),  Omega = L sqrt(1 - r0^2 g12) / I3.

    Attributes:
        k, Omega, T: at the slow times asked for.
    """

    k: Array
    Omega: Array
    T: Array


def explicit_inertia_change(body: PrincipalBody, L: float, k0: float, tau: ArrayLike) -> ExplicitSolution:
    """(32) from k = k0 at tau = 0, for g_n = -(dI_n/dtau) w_n / I_n alone and no internal angular momentum.

    It replaces 1 - E/K by k^2 / 2: a small-k model whose error does not vanish with eps. Use `solve_averaged` where k is
    not small.

    Args:
        body: with moments that are formulas in tau.
        L: the angular momentum, which stays. [kg m^2/s]
        k0: the modulus at tau = 0.
        tau: (...) slow times eps t. [s]

    Raises:
        InputError: r0^2 gamma_12 reaches 1, where the model has no motion.
    """
    slow = np.asarray(tau, dtype=np.float64)
    value = function_of_tau(slow)
    ratios = [value(body.small_gamma(*pair)) for pair in ((1, 2), (3, 1), (3, 2))]
    first, second, third = ratios
    g12, g31, g32 = (float(body.small_gamma(*pair).subs(TAU, 0)) for pair in ((1, 2), (3, 1), (3, 2)))
    start = k0**2 / (g31 * g32 + k0**2 * g12)
    rest = 1 - start * first
    if np.any(rest <= 0):
        raise InputError("r0^2 gamma_12 reaches 1: (32) describes no motion there")
    inertia = value(body.moments[2])
    # gamma_32 Gamma_13 of (32e) is gamma_12 times (I3/I1): from (17a) and (32c)
    factor = value(body.small_gamma(3, 2) * body.gamma(1, 3))
    return ExplicitSolution(
        np.sqrt(start * second * third / rest),
        L / inertia * np.sqrt(rest),
        L**2 / (2 * inertia) * (1 - start * (first - factor)),
    )


def function_of_tau(tau: Array) -> Callable[[sp.Expr], Array]:
    """The values (N,) of expressions in tau at slow times tau (N,)."""
    evaluate = ExpressionEvaluator(NumpyArithmetic(), {TAU: tau})
    return lambda expression: np.broadcast_to(np.asarray(evaluate(expression), dtype=np.float64), tau.shape)


def _times(t: ArrayLike) -> Array:
    times = np.atleast_1d(np.asarray(t, dtype=np.float64))
    if times.ndim != 1 or len(times) < 2 or np.any(np.diff(times) <= 0) or not np.isfinite(times).all():
        raise InputError("t: at least two finite, increasing times; the first is the start")
    return times
