"""The shooting solver in numpy, where there is no C compiler: all starts at once, plainer than the generated C.

The same first guesses, Levenberg-Marquardt and polishing; guesses are not relaxed, errors not measured by bracket lengths,
and what is not solved is not searched again, so that deep brackets and very small targets need the compiler.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernel.runge_kutta import CLASSICAL, TUPLES, increment, propagators
from lie_codegen.steering.seeds import coordinates, seed_controls
from lie_codegen.steering.shooting.defaults import Defaults
from lie_codegen.steering.shooting.extremals import Extremals

_SEED_STEPS = 16
_KEPT = 8
_MOST_STEPS = 4096


class NumpyShooting:
    """solve and sample as the compiled machine has them."""

    def __init__(self, group: MatrixGroup, controls: tuple[int, ...], depth: int, defaults: Defaults) -> None:
        self._group = group
        self._controls = list(controls)
        self._depth = depth
        self._defaults = defaults
        self._c = group.algebra.structure_constants
        self._ad = self._c[self._controls]

    def solve(self, targets: Array, weights: Array, starts: int) -> Extremals:
        """As `Shooter.solve`."""
        rows = [self._solve_one(target, weights, starts) for target in targets]
        return Extremals(**{name: np.array([row[name] for row in rows]) for name in Extremals.__dataclass_fields__})

    def sample(self, mu0: Array, weights: Array, count: int) -> Array:
        """(count, d, d) X on a uniform grid of [0, 1]."""
        parts = int(np.ceil((4 + 2 * np.linalg.norm(mu0)) * 32 / (count - 1)))
        mu, X = mu0[None], np.eye(self._group.degree, dtype=self._group.basis.dtype)[None]
        states = [X[0]]
        for _ in range(count - 1):
            mu, X, _, _ = self._flow(mu, weights, parts, X=X, length=1.0 / (count - 1))
            states.append(X[0])
        return np.array(states)

    def _solve_one(self, target: Array, weights: Array, starts: int) -> dict[str, Any]:
        options, n = self._defaults, self._group.dim
        u = seed_controls(self._group, self._controls, self._depth, coordinates(self._group, target), starts)
        p = self._nearest_costate(u, weights)
        found, F, done, spent = self._descend(
            p, target, weights, options.search_steps, options.search_iterations, False
        )
        row: dict[str, Any] = {
            "mu0": np.zeros(n),
            "cost": np.inf,
            "residual": np.inf,
            "jacobian": np.zeros((n, n)),
            "status": 0,
            "starts": starts,
            "converged": int(np.sum(done)),
            "agreeing": 0,
            "linearisations": spent,
        }
        if not np.any(done):
            return row
        energies = np.sum(found[:, self._controls] ** 2 / weights, axis=1)
        kept = np.flatnonzero(done)[np.argsort(energies[done])][:_KEPT]
        steps = self._fine_steps(found[kept], target, weights)
        polished, F, good, spent = self._descend(found[kept], target, weights, steps, options.polish_iterations, True)
        costs = np.where(good, np.sum(polished[:, self._controls] ** 2 / weights, axis=1), np.inf)
        best = int(np.argmin(costs)) if np.any(good) else int(np.argmin(F))
        _, _, _, xi = self._flow(polished[best][None], weights, steps, sensitivities=True)
        row["mu0"], row["residual"], row["jacobian"] = polished[best], float(np.sqrt(F[best])), xi[0]
        row["cost"] = float(np.sum(polished[best][self._controls] ** 2 / weights))
        row["status"] = 1 if good[best] else 2
        row["agreeing"] = int(np.sum(energies[kept] <= 1.01 * row["cost"]))
        row["linearisations"] += spent
        return row

    def _fine_steps(self, p: Array, target: Array, weights: Array) -> int:
        """Steps at which the fourth-order flow agrees with twice as many to 1e-11."""
        steps = 64
        _, coarse, _, _ = self._flow(p, weights, steps)
        while steps < _MOST_STEPS:
            steps *= 2
            _, fine, _, _ = self._flow(p, weights, steps)
            if np.max(np.abs(fine - coarse)) < 1.5e-10 * max(1.0, float(np.max(np.abs(target)))):
                break
            coarse = fine
        return steps

    def _descend(
        self, p: Array, target: Array, weights: Array, steps: int, most: int, exact: bool
    ) -> tuple[Array, Array, Array, int]:
        """Levenberg-Marquardt on every row of p: points, |X(1) - target|^2, which are done, linearisations."""
        damping = np.full(len(p), 1e-12 if exact else 1e-2)
        F, g, H = self._linearise(p, target, weights, steps)
        options = self._defaults
        enough = options.polish_share * options.tolerance**2 if exact else options.search_tolerance
        n = self._group.dim
        for iteration in range(most + 1):
            shift = damping * np.trace(H, axis1=1, axis2=2) / n + 1e-300
            s = -np.linalg.solve(H + shift[:, None, None] * np.eye(n), g[..., None])[..., 0]
            done = enough > F if exact else (-np.sum(s * g, axis=1) < enough) & (options.search_residual > F)
            if iteration == most or np.all(done | (damping >= options.most_damping)):
                break
            reach = 1 + 0.5 * np.linalg.norm(p, axis=1)
            size = np.linalg.norm(s, axis=1)
            trial = p + s * np.minimum(1, reach / np.maximum(size, 1e-300))[:, None]
            F_new, g_new, H_new = self._linearise(trial, target, weights, steps)
            better = F_new < F
            gain = np.where(better, F_new / np.maximum(F, 1e-300), 1.0)
            damping = np.where(
                better,
                damping * np.where(gain < 0.25, 0.05, np.where(gain < 0.75, 0.3, 1.0)),
                np.maximum(8 * damping, 1e-8),
            )
            p, F = np.where(better[:, None], trial, p), np.where(better, F_new, F)
            g, H = np.where(better[:, None], g_new, g), np.where(better[:, None, None], H_new, H)
        return p, F, done, iteration + 1

    def _linearise(self, p: Array, target: Array, weights: Array, steps: int) -> tuple[Array, Array, Array]:
        with np.errstate(all="ignore"):
            _, X, _, xi = self._flow(p, weights, steps, sensitivities=True)
            moves = _reals(X[:, None] @ self._group.basis)
            r = _reals(X - target)
            J = np.einsum("ske,skc->sec", moves, xi)
            F = np.sum(r**2, axis=1)
            bad = ~np.isfinite(F)
            J[bad], r[bad] = 0.0, 0.0
            return np.where(bad, np.inf, F), np.einsum("sec,se->sc", J, r), np.einsum("sec,sed->scd", J, J)

    def _flow(
        self,
        mu: Array,
        weights: Array,
        steps: int,
        *,
        X: Array | None = None,
        length: float = 1.0,
        sensitivities: bool = False,
    ) -> tuple[Array, Array, Array, Array]:
        """mu, X, psi, xi after `length`, by classical Runge-Kutta steps."""
        count, n, d = len(mu), self._group.dim, self._group.degree
        columns = n if sensitivities else 0
        psi = np.broadcast_to(np.eye(n)[:, :columns], (count, n, columns))
        start = np.broadcast_to(np.eye(d, dtype=self._group.basis.dtype), (count, d, d)) if X is None else X
        state = (mu, start, psi, np.zeros((count, n, columns)))
        h = length / steps

        space = TUPLES

        def rate(_: float, change: tuple[Array, ...]) -> tuple[Array, ...]:
            return self._rate(space.plus(state, change), weights)

        for _ in range(steps):
            state = space.plus(state, increment(space, CLASSICAL, rate, (0.0,) * len(state), h))
        return state

    def _rate(self, state: tuple[Array, ...], weights: Array) -> tuple[Array, ...]:
        mu, X, psi, xi = state
        u = mu[:, self._controls] / weights
        du = psi[:, self._controls] / weights[:, None]
        act = np.einsum("si,ijk->sjk", u, self._ad)
        forced = np.einsum("ijk,sk->sij", self._ad, mu)
        psi_rate = act @ psi + np.einsum("sij,sic->sjc", forced, du)
        xi_rate = -np.swapaxes(act, 1, 2) @ xi
        xi_rate[:, self._controls] += du
        velocity = np.tensordot(u, self._group.basis[self._controls], axes=(1, 0))
        return (act @ mu[..., None])[..., 0], X @ velocity, psi_rate, xi_rate

    def _nearest_costate(self, u: Array, weights: Array) -> Array:
        """(starts, n) least squares of w_i u_i(t) = <mu(t), A_i> over mu(0), for u (starts, 2 * 16 + 1, m)."""
        count, n = len(u), self._group.dim
        psi = np.broadcast_to(np.eye(n), (count, n, n))
        H, g = np.zeros((count, n, n)), np.zeros((count, n))
        h = 1.0 / _SEED_STEPS
        act = np.einsum("sti,ijk->tsjk", u, self._ad)
        steps = propagators(act, h)
        for t in range(0, 2 * _SEED_STEPS + 1, 2):
            rows = psi[:, self._controls]
            g += np.einsum("sic,si->sc", rows, u[:, t])
            H += np.einsum("sic,sid,i->scd", rows, rows, 1 / weights)
            if t < 2 * _SEED_STEPS:
                psi = steps[t // 2] @ psi
        shift = 1e-4 * np.trace(H, axis1=1, axis2=2) / n
        return np.asarray(np.linalg.solve(H + shift[:, None, None] * np.eye(n), g[..., None])[..., 0])


def _reals(matrix: Array) -> Array:
    flat = matrix.reshape(*matrix.shape[:-2], -1)
    return np.concatenate([flat.real, flat.imag], axis=-1)
