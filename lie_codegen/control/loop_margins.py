"""How slowly a law may be sampled and how late its force may come: margins of the linearised loop.

Second order, I x'' + K_d x' + S x = 0 with the force held over a period h and d whole samples late: the spectral radius of the sampled system is
below 1. Continuous delay: the force of time t - tau; the first tau with a root of det(-w^2 I + (i w K_d + S) z) = 0, |z| = 1, z = exp(-i w tau).

First order, x' = -k x, held: x scales by 1 - k h, stable for k h < 2. Delayed by d: stable iff k d < pi/2, rate -Re W_0(-k d)/d.

These say nothing of regions: hold and delay void the certificate, and margins stand beside it, never in it.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.control.compatibility import check_compatibility
from lie_codegen.control.error_catalogue import as_error, gain
from lie_codegen.errors import InputError
from lie_codegen.exact.positive_matrix import as_floats, positive_matrix, positive_number, symmetric_matrix
from lie_codegen.groups.catalogue_load import GroupLike, as_group
from lie_codegen.kernel.saved import Saved
from lie_codegen.on_demand import scipy


@dataclass(frozen=True, eq=False, repr=False)
class LoopMargins(Saved):
    """Margins of I x'' + K_d x' + S x = 0.

    Attributes:
        inertia, stiffness, damping: (n, n).
        delay: the continuous delay [s] at which the loop stops to decay; infinite where there is none.
    """

    inertia: Array
    stiffness: Array
    damping: Array
    delay: float

    def sample_period(self, delay: int = 0) -> float:
        """The period [s] below which the sampled and held loop decays, its force `delay` whole samples late.

        Raises:
            InputError: a delay that is no whole number of samples, 0 or more.
        """
        if isinstance(delay, bool) or not isinstance(delay, int | np.integer) or delay < 0:
            raise InputError(f"sample_period: delay = {delay!r} must be a whole number of samples, 0 or more")
        slowest = np.sqrt(np.max(np.abs(scipy.linalg.eig(self.stiffness, self.inertia, right=False))))
        fastest = np.max(np.abs(scipy.linalg.eig(self.damping, self.inertia, right=False)))
        step = 0.02 / max(slowest, fastest)
        h = step
        # The first period at which it is not stable: there may be stable islands beyond, which no one should fly on.
        while self._radius(h, int(delay)) < 1:
            h += step
            if h > 1e6 * step:
                return float("inf")
        low, high = h - step, h
        for _ in range(60):
            middle = (low + high) / 2
            low, high = (middle, high) if self._radius(middle, int(delay)) < 1 else (low, middle)
        return float(low)

    def _radius(self, h: float, delay: int) -> float:
        return float(np.max(np.abs(np.linalg.eigvals(self.sampled(h, delay)))))

    def sampled(self, step: float, delay: int = 0) -> Array:
        """(2n + delay n) matrix of (x, x', the accelerations under way) from sample to sample."""
        n = len(self.inertia)
        one, zero = np.eye(n), np.zeros((n, n))
        law = -np.linalg.solve(self.inertia, np.hstack([self.stiffness, self.damping]))
        held = np.vstack([one * step**2 / 2, one * step])
        drift = np.block([[one, step * one], [zero, one]])
        if delay == 0:
            return np.asarray(drift + held @ law)
        size = (2 + delay) * n
        whole = np.zeros((size, size))
        whole[: 2 * n, : 2 * n] = drift
        whole[: 2 * n, 2 * n : 3 * n] = held  # the oldest acceleration acts now
        for k in range(delay - 1):
            whole[(2 + k) * n : (3 + k) * n, (3 + k) * n : (4 + k) * n] = one
        whole[size - n :, : 2 * n] = law
        return whole

    def covariance(self, step: float, *, X: float = 0.0, xi: float = 0.0) -> Array:
        """(2n, 2n) steady covariance of (x, x') with measurement noise of standard deviations X and xi at each sample.

        Raises:
            InputError: the loop does not decay at this period.
        """
        n = len(self.inertia)
        F = self.sampled(step)
        if np.max(np.abs(np.linalg.eigvals(F))) >= 1:
            raise InputError(
                f"covariance: the loop does not decay with step = {step:g}; the margin is {self.sample_period():g} s"
            )
        law = -np.linalg.solve(self.inertia, np.hstack([self.stiffness, self.damping]))
        G = np.vstack([np.eye(n) * step**2 / 2, np.eye(n) * step]) @ law
        noise = np.diag([X**2] * n + [xi**2] * n)
        return np.asarray(scipy.linalg.solve_discrete_lyapunov(F, G @ noise @ G.T))


@dataclass(frozen=True, eq=False, repr=False)
class FirstOrderMargins(Saved):
    """Margins of X' = X hat(-k log(X_d^-1 X)): on the group itself, not by linearisation.

    Attributes:
        k: gain [1/s].
    """

    k: float

    def sample_period(self, delay: int = 0) -> float:
        """2/k without delay; with d whole samples of it the first h at which z^(d+1) - z^d + k h has a root of size 1: 2 sin(pi/(4 d + 2))/k."""
        if isinstance(delay, bool) or not isinstance(delay, int | np.integer) or delay < 0:
            raise InputError(f"sample_period: delay = {delay!r} must be a whole number of samples, 0 or more")
        return float(2 * np.sin(np.pi / (4 * int(delay) + 2)) / self.k)

    @property
    def delay(self) -> float:
        """pi/(2 k) [s]."""
        return float(np.pi / (2 * self.k))

    def rate(self, delay: float = 0.0) -> float:
        """-Re W_0(-k d)/d, k without delay; negative where the loop grows."""
        return self.k if delay == 0 else float(-scipy.special.lambertw(-self.k * delay).real / delay)

    def deviation(self, step: float, noise: float) -> float:
        """Steady standard deviation of an axis under noise s at each sample: s sqrt(k h/(2 - k h)).

        Raises:
            InputError: k h is not below 2.
        """
        if not 0 < self.k * step < 2:
            raise InputError(f"deviation: with step = {step:g} k h = {self.k * step:g} is not below 2")
        return float(noise * np.sqrt(self.k * step / (2 - self.k * step)))


def loop_margins(
    group: GroupLike | None = None,
    *,
    inertia: Any = None,
    stiffness: Any = None,
    damping: Any = None,
    error: Any = None,
    gains: Mapping[str, Any] | None = None,
    rate: Any = None,
) -> LoopMargins | FirstOrderMargins:
    """Margins of period and delay.

    Args:
        group, inertia, error, gains: of a tracking law, whose linearisation is taken; or
        inertia, stiffness, damping: I, S, K_d of I x'' + K_d x' + S x = 0, each (n, n), or numbers and diagonals beside one matrix; or
        rate: k of the first-order law X' = X hat(-k log(X_d^-1 X)).

    Raises:
        InputError: none of these; matrices that are not positive.
    """
    if rate is not None:
        return FirstOrderMargins(float(positive_number(rate, "rate")))
    if group is not None and error is not None and gains is not None:
        space = as_group(group, "loop_margins")
        H = np.array(check_compatibility(as_error(space, error, gains)).hessian)
        return _margins(inertia, (H + H.T) / 2, gain(gains, "K_d", "loop_margins"), space.dim)
    if inertia is None or stiffness is None or damping is None:
        raise InputError(
            "loop_margins: give inertia, stiffness and damping; or a group with inertia, error and gains; or rate"
        )
    size = max((len(each) for each in (inertia, stiffness, damping) if hasattr(each, "__len__")), default=1)
    return _margins(inertia, stiffness, damping, size)


def _margins(inertia: Any, stiffness: Any, damping: Any, size: int) -> LoopMargins:
    I = as_floats(positive_matrix(inertia, size, "inertia"))  # noqa: E741
    S = as_floats(positive_matrix(stiffness, size, "stiffness"))
    D = as_floats(symmetric_matrix(damping, size, "damping"))
    if np.linalg.eigvalsh(D)[0] <= 0:
        raise InputError(
            "loop_margins: damping is not positive definite, so the loop does not decay even without delay"
        )
    return LoopMargins(I, S, D, _delay_margin(I, S, D))


def _delay_margin(I: Array, S: Array, D: Array) -> float:  # noqa: E741
    """The least tau > 0 with exp(-i w tau) = z, |z| = 1, z an eigenvalue of (w^2 I, i w K_d + S)."""

    def values(w: float) -> Array:
        return np.asarray(np.linalg.eigvals(np.linalg.solve(1j * w * D + S, w**2 * I)))

    # Each |z| rises from 0 at w = 0 to infinity as w grows: crossings lie where the ratio of w^2 I to the law's force is one.
    top = 4 * max(
        np.max(np.linalg.eigvals(np.linalg.solve(I, D)).real),
        np.sqrt(np.max(np.linalg.eigvals(np.linalg.solve(I, S)).real)),
    )
    grid = np.linspace(0, top, 4001)[1:]
    best = float("inf")
    sizes = np.array([np.sort(np.abs(values(w))) for w in grid])
    for column in range(sizes.shape[1]):
        for k in np.flatnonzero((sizes[:-1, column] - 1) * (sizes[1:, column] - 1) <= 0):
            low, high = grid[k], grid[k + 1]
            rising = sizes[k, column] < 1
            for _ in range(60):
                middle = (low + high) / 2
                below = np.sort(np.abs(values(middle)))[column] < 1
                low, high = (middle, high) if below == rising else (low, middle)
            w = (low + high) / 2
            found = values(w)
            z = found[np.argsort(np.abs(found))[column]]
            best = min(best, float(-np.angle(z) / w) if np.angle(z) < 0 else float((2 * np.pi - np.angle(z)) / w))
    return best
