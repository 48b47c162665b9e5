"""Extreme values of a function of (X, X_d, nu) where phi(X, X_d) <= level and |nu| <= speed, by search.

Candidates are drawn first, along rays from the reference so that any level is filled; the best of them are refined by sequential quadratic
programming in exponential coordinates. What comes out is attained, so a lower bound of a supremum: sampled, not proved.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.control.error_samples import ErrorSamples, basis_scales, random_elements
from lie_codegen.errors import InputError
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.on_demand import scipy

#: Of phi, relative to the level: below it a candidate is the reference, where quotients of phi have no digits.
_NEAR = 1e-9
_DIFFERENCE = 1e-6


@dataclass(frozen=True)
class Places:
    """N candidates.

    Attributes:
        X, X_d: (N, d, d).
        nu: (N, n) transported reference velocities.
    """

    X: Array
    X_d: Array
    nu: Array

    def __getitem__(self, chosen: Any) -> Places:
        return Places(self.X[chosen], self.X_d[chosen], self.nu[chosen])

    def before(self, others: Places) -> Places:
        """These, then the others."""
        pairs = ((self.X, others.X), (self.X_d, others.X_d), (self.nu, others.nu))
        return Places(*(np.concatenate(pair) for pair in pairs))


#: (N) places -> (N,) values.
Values = Callable[[Places], Array]


class LevelSearch:
    """The set {phi <= level, |nu|_I <= speed} of one pair, with candidates in it."""

    def __init__(
        self,
        samples: ErrorSamples,
        metric: Array,
        level: float,
        speed: float,
        rng: np.random.Generator,
        *,
        moving: bool,
        reach: float,
        count: int = 1000,
    ) -> None:
        """`moving`: whether X_d is searched too, up to `reach`, as it must be where phi is not left-invariant."""
        self.samples, self.level, self.speed, self.moving = samples, level, speed, moving
        self.group, self.n = samples.group, samples.group.dim
        self.scale = basis_scales(self.group)
        self.root = np.linalg.cholesky(metric)
        self.count = count
        self.reach = reach
        self.places = self._drawn(rng, count)

    def extreme(self, values: Values, starts: int = 4, *, largest: bool = False) -> float:
        """The least (or largest) value found."""
        sign = -1.0 if largest else 1.0
        drawn = sign * values(self.places)
        order = np.argsort(np.where(np.isfinite(drawn), drawn, np.inf))
        best = float(drawn[order[0]])
        for index in _apart(order, starts):
            best = min(
                best, self._refined(lambda places: sign * values(places), self.places[[index]], float(drawn[index]))[0]
            )
        return sign * best

    def tracked(self, values: Values, seeds: Places, starts: int) -> tuple[float, Places]:
        """The least value and where, from the best candidates and from places that were best for a neighbouring function."""
        drawn = values(self.places)
        order = np.argsort(np.where(np.isfinite(drawn), drawn, np.inf))
        tries = [self.places[[i]] for i in _apart(order, starts)]
        tries += [seeds[[i]] for i in range(len(seeds.X))]
        found = [self._refined(values, each, float(values(each)[0])) for each in tries]
        found.sort(key=lambda pair: pair[0])
        return found[0]

    def _drawn(self, rng: np.random.Generator, count: int) -> Places:
        """On rays from the reference, at all distances up to where phi reaches the level."""
        n, d = self.n, self.group.degree
        one = np.broadcast_to(np.eye(d), (count, d, d))
        X_d = _within(self.group, count, rng, self.reach) if self.moving else one
        x = rng.normal(size=(count, n))
        x = x / np.linalg.norm(x, axis=1, keepdims=True) * self.scale
        # Where the ray first leaves the level: doubled until outside, then halved.
        low, high = np.zeros(count), np.full(count, 1e-2)
        for _ in range(24):
            inside = self._phi(X_d, high[:, None] * x) <= self.level
            if not np.any(inside & (high < 50)):
                break
            low, high = np.where(inside, high, low), np.where(inside & (high < 50), 1.4 * high, high)
        for _ in range(14):
            middle = (low + high) / 2
            inside = self._phi(X_d, middle[:, None] * x) <= self.level
            low, high = np.where(inside, middle, low), np.where(inside, high, middle)
        # a quarter on the level itself and an eighth next to the reference: there, at the ends of the rays, extreme values often are
        part = np.concatenate(
            [np.ones(count // 4), np.full(count // 8, 1e-2), rng.uniform(0, 1, count - count // 4 - count // 8)]
        )
        X = self.samples.moved(X_d, (low * part)[:, None] * x)
        w = rng.normal(size=(count, n))
        w = w / np.linalg.norm(w, axis=1, keepdims=True)
        nu = self.speed * np.linalg.solve(self.root.T, w.T).T
        phi, _ = self.samples.first(X, X_d)
        kept = np.isfinite(phi) & (phi <= self.level * (1 + 1e-9)) & (phi > _NEAR * self.level)
        if not np.any(kept):
            raise InputError(f"certificate: no configuration with phi <= {self.level:g} was found")
        return Places(np.ascontiguousarray(X[kept]), np.ascontiguousarray(X_d[kept]), nu[kept])

    def _phi(self, X_d: Array, x: Array) -> Array:
        with np.errstate(all="ignore"):
            phi, _ = self.samples.first(self.samples.moved(X_d, x), X_d)
        return np.where(np.isfinite(phi), phi, np.inf)

    def _at(self, base: Places, v: Array) -> Places:
        """The places with coordinates v, (M, k), about one place."""
        n, count = self.n, len(v)
        X_d = np.broadcast_to(base.X_d, (count, *base.X_d.shape[1:]))
        X = np.broadcast_to(base.X, (count, *base.X.shape[1:]))
        X, rest = self.samples.moved(X, v[:, :n] * self.scale), v[:, n:]
        if self.moving:
            X_d, rest = self.samples.moved(X_d, rest[:, :n] * self.scale), rest[:, n:]
        nu = np.broadcast_to(base.nu, (count, n))
        if self.speed:
            nu = nu + self.speed * np.linalg.solve(self.root.T, rest.T).T
        return Places(X, X_d, nu)

    def _refined(self, values: Values, base: Places, start: float) -> tuple[float, Places]:
        """Downhill from one place, within the set."""
        size = self.n * (1 + self.moving + bool(self.speed))

        def together(v: Array) -> Array:
            """Value, phi and speed squared, at v and beside it: one call of the formulas for a gradient."""
            ahead = v + _DIFFERENCE * np.vstack([np.zeros(size), np.eye(size), -np.eye(size)])
            places = self._at(base, ahead)
            phi, _ = self.samples.first(places.X, places.X_d)
            speed = np.sum((places.nu @ self.root) ** 2, axis=1)
            return np.stack([values(places), phi, speed, _extent(places.X_d) if roaming else np.zeros(len(phi))])

        # Of orthogonal matrices no entry is above 1, wherever the reference is.
        turns = np.max(np.abs(self.group.basis + np.conj(np.swapaxes(self.group.basis, 1, 2)))) < 1e-12
        roaming = self.moving and not bool(turns)
        memory: dict[bytes, Array] = {}

        def at(v: Array) -> Array:
            key = v.tobytes()
            if key not in memory:
                memory.clear()
                memory[key] = together(v)
            return memory[key]

        def gradient(v: Array, row: int) -> Array:
            found = at(v)[row]
            return np.asarray((found[1 : size + 1] - found[size + 1 :]) / (2 * _DIFFERENCE))

        level, speed, least = self.level, self.speed**2, 1e-7 * self.level
        limits: list[dict[str, Any]] = [
            {"type": "ineq", "fun": lambda v: 1 - at(v)[1, 0] / level, "jac": lambda v: -gradient(v, 1) / level},
            {"type": "ineq", "fun": lambda v: at(v)[1, 0] / least - 1, "jac": lambda v: gradient(v, 1) / least},
        ]
        if speed:
            limits.append(
                {"type": "ineq", "fun": lambda v: 1 - at(v)[2, 0] / speed, "jac": lambda v: -gradient(v, 2) / speed}
            )
        reach = max(self.reach, 1.0)
        if roaming:
            limits.append(
                {"type": "ineq", "fun": lambda v: 1 - at(v)[3, 0] / reach, "jac": lambda v: -gradient(v, 3) / reach}
            )
        with np.errstate(all="ignore"):
            found = scipy.optimize.minimize(
                lambda v: at(v)[0, 0],
                np.zeros(size),
                jac=lambda v: gradient(v, 0),
                method="SLSQP",
                constraints=limits,
                bounds=[(-1, 1)] * size,
                options={"maxiter": 60, "ftol": 1e-12},
            )
        end = at(np.asarray(found.x))
        within = least / 2 < end[1, 0] <= level * (1 + 1e-8) and end[2, 0] <= speed * (1 + 1e-8) + 1e-300
        within = within and end[3, 0] <= reach * (1 + 1e-8)
        if np.isfinite(end[0, 0]) and within and end[0, 0] < start:
            return float(end[0, 0]), self._at(base, np.asarray(found.x)[None])
        return start, base


def _apart(order: Array, starts: int) -> list[int]:
    """The first, and others a little further down, which are more likely to lie elsewhere."""
    chosen = [0, 1, 3, 8, 20, 50, 120, 300][:starts]
    return [int(order[k]) for k in chosen if k < len(order)]


def _within(group: MatrixGroup, count: int, rng: np.random.Generator, reach: float) -> Array:
    """Elements whose entries, and those of their inverses, are not above `reach` in size (on SO(n) they never are above 1)."""
    X = random_elements(group, count, rng)
    for shrink in (1.0, 0.5, 0.25, 0.1, 0.02):
        far = np.maximum(np.max(np.abs(X), axis=(1, 2)), np.max(np.abs(np.linalg.inv(X)), axis=(1, 2))) > max(
            reach, 1.0
        )
        if not np.any(far):
            break
        X[far] = random_elements(group, int(np.sum(far)), rng, 3 * shrink)
    return np.where(far[:, None, None], np.eye(group.degree), X)


def _extent(X: Array) -> Array:
    """(N,) largest entry of each and its inverse."""
    return np.asarray(np.maximum(np.max(np.abs(X), axis=(1, 2)), np.max(np.abs(np.linalg.inv(X)), axis=(1, 2))))
