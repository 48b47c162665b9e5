"""One extremal, from its costate at t = 0: controls, costate, conjugate points; numpy, any group.

u_i = <mu, A_i> / w_i, mu' = ad*_u mu, unit time. Along X' = X hat(u) the momentum is constant in space,
<mu(t), A> = <mu(0), Ad_X(t) A>, so that mu at a few nodes follows from X there, and near each node from its Taylor series.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernel.runge_kutta import propagators
from lie_codegen.kernel.saved import Saved
from lie_codegen.steering.shooting.bracket_lengths import bracket_lengths

_ORDER = 12
_STEPS = 256
_SKIPPED = 16
_RESOLVED = 1e-8
_NOISE = 1e-12


@dataclass(frozen=True, eq=False, repr=False)
class Extremal(Saved):
    """The extremal of the costate mu0 for the cost int sum_i w_i u_i^2 in unit time.

    Attributes:
        group, controls, weights: the problem; controls are positions.
        mu0: (n,) the costate at t = 0.
        X: (k + 1, d, d) its trajectory at t = 0, 1/k, ... 1.
    """

    group: MatrixGroup = field(repr=False)
    controls: tuple[int, ...]
    weights: Array
    mu0: Array
    X: Array = field(repr=False)

    @property
    def nodes(self) -> int:
        """Number of intervals."""
        return len(self.X) - 1

    @cached_property
    def _ad(self) -> Array:
        """(m, n, n): (ad*_u mu)_j = sum_i u_i ad[i, j, k] mu_k."""
        return np.asarray(self.group.algebra.structure_constants[list(self.controls)])

    @cached_property
    def costates(self) -> Array:
        """(k + 1, n) mu at the nodes."""
        moved = self.X[:, None] @ self.group.basis @ np.linalg.inv(self.X)[:, None]
        return self.group.project(moved) @ self.mu0

    @cached_property
    def _series(self) -> Array:
        """(order + 1, k, n) Taylor coefficients of mu over each interval, in powers of its fraction."""
        h = 1.0 / self.nodes
        mu = self.costates[:-1][None]
        for order in range(_ORDER):
            # mu' is quadratic in mu: what the power s^order of it is made of are the pairs of coefficients of powers p and order - p
            u = mu[..., list(self.controls)] / self.weights
            total = np.einsum("pti,ptk,ijk->tj", u, mu[::-1], self._ad, optimize=True)
            mu = np.concatenate([mu, (h / (order + 1)) * total[None]])
        return np.asarray(mu)

    def costate(self, t: Array) -> Array:
        """(k, n) mu at the times t, (k,), in [0, 1]."""
        place = np.clip((t * self.nodes).astype(int), 0, self.nodes - 1)
        s = (t * self.nodes - place)[:, None]
        value = self._series[-1][place]
        for coefficient in self._series[-2::-1]:
            value = value * s + coefficient[place]
        return np.asarray(value)

    def control(self, t: Array) -> Array:
        """(k, m) the controls at the times t."""
        return self.costate(t)[:, list(self.controls)] / self.weights

    @cached_property
    def sensitivities(self) -> Array:
        """(256, n, n) vee(X^-1 dX / d mu0) at t = 1/256, ... 1: psi' = ad*_du mu + ad*_u psi, xi' = du + [xi, u]."""
        n, m = self.group.dim, len(self.controls)
        mu = self.costate(np.linspace(0, 1, 2 * _STEPS + 1))
        u = mu[:, list(self.controls)] / self.weights
        select = np.zeros((m, n))
        select[np.arange(m), list(self.controls)] = 1 / self.weights
        flow = np.zeros((2 * _STEPS + 1, 2 * n, 2 * n))
        flow[:, :n, :n] = np.einsum("ti,ijk->tjk", u, self._ad)
        flow[:, :n, :n] += np.einsum("ijk,tk,il->tjl", self._ad, mu, select)
        flow[:, n:, :n] = np.eye(n)[:, list(self.controls)] @ select
        flow[:, n:, n:] = -np.einsum("ti,ikj->tjk", u, self._ad)
        steps = propagators(flow, 1.0 / _STEPS)
        state = np.vstack([np.eye(n), np.zeros((n, n))])
        xi = []
        for step in steps:
            state = step @ state
            xi.append(state[n:])
        return np.array(xi)

    @cached_property
    def _scaled(self) -> tuple[Array, Array, Array]:
        """xi measured by bracket lengths at t = 1/256, ...: directions of l brackets have moved like r^l, r the length so far.

        With its singular values, (256, n), and what rounding may make of the least of them, relative to the largest.
        """
        lengths = np.array(bracket_lengths(self.group, self.controls))
        speed = float(np.linalg.norm(self.mu0[list(self.controls)] / self.weights))
        r = np.minimum(1.0, max(speed, 1e-12) * np.arange(1, _STEPS + 1) / _STEPS)
        # xi[k, c] says how a costate of size r^(2 - l_c) moves a direction of size r^l_k: divided by its natural size it is of order one
        scaled = self.sensitivities * r[:, None, None] ** (2.0 - lengths[:, None] - lengths)
        noise = np.maximum(_RESOLVED, _NOISE * r ** (2.0 - 2 * lengths.max()))
        return scaled, np.linalg.svd(scaled, compute_uv=False), noise

    def conjugate_times(self) -> tuple[float, ...]:
        """Times in (0, 1) at which det xi changes sign: past the first one the extremal is no local minimum.

        Times at which rounding alone could change the sign do not count; nor do two conjugate points at one time, where det xi touches
        zero without changing its sign.
        """
        scaled, sizes, noise = self._scaled
        known = np.flatnonzero(sizes[:, -1] > noise * sizes[:, 0])
        known = known[(known >= _SKIPPED) & (known < _STEPS - 1)]
        sign = np.linalg.slogdet(scaled[known])[0]
        changes = np.flatnonzero(sign[1:] != sign[:-1])
        return tuple(float((known[k] + known[k + 1] + 2) / (2 * _STEPS)) for k in changes)

    def conjugacy(self) -> float:
        """The least singular value of xi at the end over the largest, measured by bracket lengths: 0 at a conjugate point."""
        sizes = self._scaled[1][-1]
        return float(sizes[-1] / sizes[0])

    def singular_values(self) -> Array:
        """(n,) of vee(X^-1 dX(1) / d mu0), largest first; the last is 0 where the target is a conjugate point."""
        return np.asarray(np.linalg.svd(self.sensitivities[-1], compute_uv=False))
