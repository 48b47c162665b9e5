"""Equilibria of the averaged rigid body: limit cycles on the momentum sphere (35), (36), and fixed spins."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.averaging.orbit_kernels import kernel_orbit_kernels
from lie_codegen.errors import InputError
from lie_codegen.groups.build import build
from lie_codegen.kernel.elliptic import LARGEST_MODULUS, jacobi, ladder
from lie_codegen.kernel.numpy_arithmetic import NumpyArithmetic
from lie_codegen.kernel.saved import Saved
from lie_codegen.mechanics.relative_equilibria import NewtonMethod
from lie_codegen.rigid_body.euler_average import EulerAverage
from lie_codegen.rigid_body.free_rigid_body import check_slow
from lie_codegen.rigid_body.principal_body import TAU
from lie_codegen.shapes import entries_of


@dataclass(frozen=True, eq=False, repr=False)
class LimitCycle(Saved):
    """A root k of the averaged Fbar_k: a closed curve on the momentum sphere that the motion keeps or leaves.

    Attributes:
        k: the root.
        Omega: where Fbar_k was evaluated.
        slope: dFbar_k / dk there, per unit eps [1/s].
        growth: Fbar_Omega / Omega, the relative growth of the spin per unit eps [1/s].
        stable: slope < 0.
    """

    k: float
    Omega: float
    slope: float
    growth: float

    @property
    def stable(self) -> bool:
        """Whether neighbouring motions approach the cycle."""
        return self.slope < 0


def limit_cycles(
    flow: EulerAverage, *, Omega: float = 1.0, largest_k: float = 0.9999, tau: float = 0.0
) -> tuple[LimitCycle, ...]:
    """Roots of Fbar_k(Omega, k) in 0 < k < largest_k at a fixed Omega.

    For g homogeneous in omega (linear feedback, drag) the roots do not depend on Omega: the cycle exists on the momentum
    sphere whether or not the spin grows, (35). It is an equilibrium of the averaged flow when `growth` is 0, (36).

    Args:
        flow: of `euler_average`.
        Omega: the spin. [rad/s]
        largest_k: of the search; at most 0.999999.
        tau: the slow time at which. [s]

    Raises:
        InputError: largest_k or Omega where the average is not known.
    """
    from scipy.optimize import brentq

    def drift(k: float) -> float:
        return float(flow.averaged(Omega, k, tau).F_k)

    grid = np.concatenate([np.linspace(1e-4, 0.99, 160), 1 - np.geomspace(0.0098, 1 - largest_k, 40)])
    values = np.array(flow.averaged(Omega, grid, tau).F_k)
    size = float(np.abs(np.stack(flow.averaged(Omega, grid, tau)[:2])).max())
    found = []
    if size > 0 and np.abs(values).max() > 1e-12 * size:
        for left, right, a, b in zip(grid, grid[1:], values, values[1:], strict=False):
            if a * b < 0 or a == 0:
                found.append(left if a == 0 else brentq(drift, left, right, xtol=1e-14, rtol=1e-14))
    field = _slow_field(flow, tau)
    cycles = []
    for k in found:
        slope = float(field.slope(np.array([Omega, k]))[1, 1])
        growth = float(flow.averaged(Omega, k, tau).F_Omega) / Omega
        cycles.append(LimitCycle(float(k), Omega, slope, growth))
    return tuple(cycles)


@dataclass(frozen=True, eq=False, repr=False)
class SlowEquilibrium(Saved):
    """A zero of (Fbar_Omega, Fbar_k) with the eigenvalues [1/s] of the slow flow there, per unit eps."""

    Omega: float
    k: float
    eigenvalues: tuple[complex, complex]

    @property
    def stable(self) -> bool:
        """Both eigenvalues have negative real part."""
        return max(value.real for value in self.eigenvalues) < 0


def slow_equilibria(
    flow: EulerAverage,
    Omega_range: tuple[float, float],
    *,
    k_range: tuple[float, float] = (1e-3, 0.999),
    tau: float = 0.0,
    eps: float | None = None,
) -> tuple[SlowEquilibrium, ...]:
    """Isolated equilibria of the averaged flow in a box: Newton from a 24 x 24 grid, near-duplicates dropped.

    Derivatives are exact. `lc.floquet(flow, guess=, parameters={"eps": ...})` finds its limit cycles in (Omega, k).

    Args:
        flow: of lc.euler_average.
        Omega_range, k_range: the box.
        tau: slow time at which a g that depends on it is held.
        eps: equilibria of F1 + eps F2, the second order; of F1 if None.

    Raises:
        InputError: the flow is degenerate there, as for homogeneous g: use `limit_cycles`.
    """
    run = _slow_field(flow, tau, eps)
    slowest, fastest = (float(each) for each in entries_of(Omega_range, 2, "slow_equilibria: Omega_range"))
    least, most = (float(each) for each in entries_of(k_range, 2, "slow_equilibria: k_range"))
    spins, moduli = np.meshgrid(np.linspace(slowest, fastest, 24), np.linspace(least, most, 24), indexing="ij")
    values = np.stack(flow.averaged(spins, moduli, tau)[:2])
    if eps is not None:
        values = values + eps * np.stack(flow.second_order(spins, moduli, tau)[:2])
    change = np.logical_and.reduce([_changes_sign(component) for component in values])
    found: list[SlowEquilibrium] = []
    for i, j in zip(*np.nonzero(change), strict=True):
        x = run.from_guess(np.array([spins[i : i + 2, j].mean(), moduli[i, j : j + 2].mean()]))
        if x is None or not (slowest <= x[0] <= fastest and least <= x[1] <= most):
            continue
        if any(abs(e.Omega - x[0]) + abs(e.k - x[1]) < 1e-7 for e in found):
            continue
        matrix = run.slope(x)
        if abs(np.linalg.det(matrix)) < 1e-9 * np.linalg.norm(matrix) ** 2:
            raise InputError("the slow flow has a line of equilibria (homogeneous g): use limit_cycles")
        first, second = (complex(v) for v in np.linalg.eigvals(matrix))
        found.append(SlowEquilibrium(float(x[0]), float(x[1]), (first, second)))
    return tuple(found)


def _slow_field(flow: EulerAverage, tau: float, eps: float | None = None) -> NewtonMethod:
    """(Omega', k') per unit eps of the averaged flow, to first order if eps is None, with its exact derivative."""
    small, order = (1.0, 1) if eps is None else (eps, 2)
    library = build(kernel_orbit_kernels(flow.slow_field(), {"eps": small, "order": order}))
    slow = [] if flow.perturbation.is_autonomous else [tau]

    def inside(x: Array) -> Array:
        """NaN where there is no motion, which ends a search there."""
        return np.array([*x, *slow] if x[0] > 0 and 0 < x[1] <= LARGEST_MODULUS else [np.nan, np.nan, *slow])

    return NewtonMethod(
        lambda x: np.asarray(library["rate"](inside(x), 0.0))[:2] / small,
        lambda x: np.asarray(library["jacobian"](inside(x), 0.0))[:2, :2] / small,
    )


def _changes_sign(values: Array) -> Any:
    corners = np.stack([values[:-1, :-1], values[1:, :-1], values[:-1, 1:], values[1:, 1:]])
    return (corners.min(axis=0) <= 0) & (corners.max(axis=0) >= 0)


def limit_cycle_gains(k: float, first: float) -> tuple[float, float]:
    """(N_2, N_3) that make k a limit cycle without change of spin, given N_1, (36).

    Args:
        k: modulus of the cycle, from 0 up to but not 1.
        first: N_1 [1/s]; the other two are in its unit.

    Raises:
        InputError: k is no modulus: below 0, 1 or more.

    Coded without cancellation: E - (1 - k^2) K = k^2 K (1 - S), E - K = -k^2 K S, E = K (1 - k^2 S).
    """
    if not 0 <= k < 1:
        raise InputError(f"limit_cycle_gains: k is a modulus, 0 <= k < 1, given {k!r}")
    mean = ladder(NumpyArithmetic(), np.float64(k)).S
    return float(-(1 - mean) / mean * first), float(k**2 * (1 - mean) / (1 - k**2 * mean) * first)


def momentum_directions(flow: EulerAverage, k: float, count: int = 200) -> Array:
    """(count, 3) unit vectors: points of the curve of modulus k on the momentum sphere, (12), along the paper's axes.

    Args:
        flow: of which body.
        k: the modulus, from 0 up to but not 1.
        count: points, at equal phases, the first and the last the same.

    Raises:
        InputError: k outside [0, 0.999999].
        ArgumentError: a count that is no whole number.
    """
    check_slow(1.0, float(k))
    body = flow.body.model
    ops = NumpyArithmetic()
    at = jacobi(ops, np.linspace(0, 1, count), ladder(ops, np.float64(k)))
    g13, g23 = float(body.small_gamma(1, 3).subs(TAU, 0)), float(body.small_gamma(2, 3).subs(TAU, 0))
    s1, s2, s3 = body.signs
    third = 1 / np.sqrt(1 + g13**2 * k**2)
    points: Array = third * np.stack([s1 * g13 * k * at.cn, s2 * g23 * k * at.sn, s3 * at.dn], axis=-1)
    return points
