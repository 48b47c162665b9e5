"""Solutions of perturbed Euler's equations: averaged, direct, and the explicit one (32)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
import sympy as sp
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.errors import ComputationError, InputError
from lie_codegen.kernel.elliptic import LARGEST_MODULUS
from lie_codegen.kernel.expressions import ExpressionEvaluator
from lie_codegen.kernel.numpy_arithmetic import NumpyArithmetic
from lie_codegen.rigid_body.euler_average import EulerAverage
from lie_codegen.rigid_body.principal_body import TAU, PrincipalBody


@dataclass(frozen=True)
class SlowSolution:
    """The averaged system at times t.

    Attributes:
        t: (N,) [s].
        Omega, k: (N,) the slow variables, within O(eps) of the actual ones over times of order 1/eps.
        phi: (N,) the averaged phase; to first order in averaging it is known only to O(1) over such times.
        evaluations: right-hand sides taken.
    """

    t: Array
    Omega: Array
    k: Array
    phi: Array
    evaluations: int


def solve_averaged(
    flow: EulerAverage, Omega0: float, k0: float, t: ArrayLike, eps: float, *, phi0: float = 0.0, rtol: float = 1e-11
) -> SlowSolution:
    """(21): Omega' = eps Fbar_Omega, k' = eps Fbar_k, phi' = Lambda + eps Gbar, from t[0].

    Raises:
        InputError: as `EulerAverage.averaged`, for the start.
        ComputationError: k leaves the range in which averaging is valid: in one period of the fast phase the slow
            drift would cover the rest of the way to the separatrix, or the spin dies out.
    """
    from scipy.integrate import solve_ivp

    times = _times(t)
    flow.averaged(Omega0, max(k0, 1e-12))
    functions, autonomous = flow.library, flow.perturbation.is_autonomous
    closed = functions["averaged"] if flow.is_closed else None

    def means(spin: float, k: float, tau: float) -> Any:
        if closed is None:
            return flow.averaged(spin, k, tau)
        return closed(spin, k) if autonomous else closed(spin, k, tau)

    def fast(spin: float, k: float, tau: float) -> float:
        return float(flow.body.frequency(spin, min(k, LARGEST_MODULUS), tau))

    def slope(time: float, state: Any) -> list[float]:
        spin, k, _ = (float(x) for x in state)
        mean = means(spin, min(max(k, 1e-12), LARGEST_MODULUS), eps * time)
        return [eps * mean[0], eps * mean[1], fast(spin, k, eps * time) + eps * mean[2]]

    def leaving(time: float, state: Any) -> float:
        spin, k = float(state[0]), min(max(float(state[1]), 1e-12), LARGEST_MODULUS)
        drift = max(eps * float(means(spin, k, eps * time)[1]), 0.0) / abs(fast(spin, k, eps * time))
        return min(1 - float(state[1]) - drift, float(state[0]))

    leaving.terminal = True  # type: ignore[attr-defined]
    if leaving(times[0], (Omega0, k0)) <= 0:
        raise ComputationError(_leaves(times[0], Omega0, k0))
    result = solve_ivp(
        slope, (times[0], times[-1]), [Omega0, k0, phi0], method="DOP853", t_eval=times, rtol=rtol, atol=rtol,
        events=leaving,
    )  # fmt: skip
    if result.status == 1:
        spin, k, _ = result.y_events[0][0]
        raise ComputationError(_leaves(result.t_events[0][0], spin, k))
    if not result.success:
        raise ComputationError(f"the averaged system could not be integrated: {result.message}")
    spin, k, phi = result.y
    return SlowSolution(times, spin, k, phi, result.nfev)


def _leaves(t: float, spin: float, k: float) -> str:
    return (
        f"averaging is not valid at t = {t:.6g}, Omega = {spin:.6g}, k = {k:.6g}: the drift of k over one period would "
        "reach the separatrix, or the spin dies out; use a smaller eps or integrate the full equations"
    )


def solve_actual(flow: EulerAverage, omega0: ArrayLike, t: ArrayLike, eps: float, *, rtol: float = 1e-11) -> Array:
    """omega (N, 3) [rad/s] of the full equations (3) at times t, by an explicit method of order 8.

    Raises:
        ComputationError: the integration fails.
    """
    from scipy.integrate import solve_ivp

    times = _times(t)
    rate = flow.library["rate"]
    if flow.perturbation.is_autonomous:
        slope: Callable[..., Any] = lambda time, w: rate(w, eps)  # noqa: E731
    else:
        slope = lambda time, w: rate(w, eps, eps * time)  # noqa: E731
    start = np.asarray(omega0, dtype=np.float64)
    result = solve_ivp(
        slope, (times[0], times[-1]), start, method="DOP853", t_eval=times, rtol=rtol, atol=rtol * np.abs(start).max()
    )
    if not result.success:
        raise ComputationError(f"the full equations could not be integrated: {result.message}")
    motion: Array = result.y.T
    return motion


@dataclass(frozen=True)
class ExplicitSolution:
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
