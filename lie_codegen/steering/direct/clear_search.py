"""Stages 1 and 2 among obstacles: controls that reach the goal and stay clear, then cheaper ones that do.

Stage 1 is that of `numpy_search` with rows for the nodes that cut an obstacle, min(0, gap - margin), beside those of the goal. A step
of stage 2 solves

    min objective(v) + rho/2 |v - u|^2   with   J v = J u - r,   gap + A (v - u) >= margin,   low <= v <= high

by projected Newton steps on its dual, whose unknowns are the goal's n rows and one for each gap in sight; then a few steps of stage 1.
Of least time the duration is one more unknown: all velocities are multiplied by it, in units of the given one.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.steering.direct.chain import by_factors, exponentials, factors, flat, residual
from lie_codegen.steering.direct.numpy_search import Box, Lanes, Rows, reach
from lie_codegen.steering.direct.programme import Goal, Programme, Settings
from lie_codegen.steering.obstacles.keep_out import KeepOut

#: Obstacles of a node that a step looks at, the nearest ones.
_NEAREST = 2
_NEWTON, _HALVINGS = 40, 12
_ROUNDING = 1e-11
_ARRIVE = 8
#: Where chords between nodes are looked at, and how deep in an obstacle they are a way through it, in units of its size.
_ALONG, _THROUGH = (0.2, 0.35, 0.5, 0.65, 0.8), 0.7
#: Least duration, in units of the given one.
SHORTEST = 1e-3


@dataclass(frozen=True, eq=False)
class Known:
    """Of controls (L, C): by how much they fail (L,), the goal's reduced rows r (L, n) and J (L, n, C), gaps less margins (L, R) and A (L, R, C)."""

    size: Array
    r: Array
    J: Array
    gap: Array
    A: Array

    def lanes(self, u: Array) -> Lanes:
        """The goal's rows and those of the nodes that cut an obstacle, as `numpy_search` asks for them."""
        rows = np.concatenate([self.J, self.A * (self.gap < 0)[:, :, None]], axis=1)
        return Lanes(u, self.size, np.concatenate([self.r, np.minimum(self.gap, 0.0)], axis=1), rows)


@dataclass(frozen=True, eq=False)
class Course:
    """A programme among obstacles.

    Attributes:
        programme, goal: of one lane each; the goal of one variant.
        keep_out: the obstacles.
        start: (d, d) X(0); free motions of the goal are no motions of the system, and are left out of what obstacles see.
        first: number of the first exponential that is the system's own.
        nodes: (k,) numbers of own exponentials after which the obstacles are looked at.
        margins: (o,) gaps that must be kept.
        longest: the duration is the last control of each lane, up to that many times the given one; zero where it is given.
        right: whether the system is right-invariant: its chain is that of the left-invariant one in reversed time.
    """

    programme: Programme
    goal: Goal
    keep_out: KeepOut
    start: Array
    first: int
    nodes: Rows
    margins: Array
    longest: float = 0.0
    right: bool = False

    @property
    def box(self) -> Box:
        """Limits and weights; of least time only the duration has one."""
        box = Box.of(self.programme)
        if not self.longest:
            return box
        last = (SHORTEST, self.longest, 1.0, 1.0)
        parts = (box.low, box.high, 0 * box.weight, box.mass)
        return Box(*(np.append(part, more) for part, more in zip(parts, last, strict=True)))

    def split(self, u: Array) -> tuple[Array, Array]:
        """Controls (L, S, m) of lanes, and the durations (L,)."""
        lanes, shape = len(u), self.programme.low.shape
        if not self.longest:
            return u.reshape(lanes, *shape), np.ones(lanes)
        return u[:, :-1].reshape(lanes, *shape), u[:, -1]

    def factors(self, u: Array) -> tuple[Array, Array]:
        """The system's own exponentials E (L, K, d, d) in the order of the chain, and their derivatives (L, K, m, d, d) by what drives
        each; of least time the last of m + 1 belong to the duration."""
        p = self.programme
        controls, lasting = self.split(u)
        own = self.own
        entry, slot, share = p.entry[0, own], p.slot[own], p.share[own]
        b = p.directions[entry]
        after = np.minimum(slot + 1, controls.shape[1] - 1)
        driven = share[:, :1] * controls[:, slot] + share[:, 1:] * controls[:, after]
        velocity = p.drifts[entry] + np.einsum("lki,kixy->lkxy", driven, b)
        slopes = np.broadcast_to(b, (len(u), *b.shape))
        if self.longest:
            by = lasting[:, None, None, None]
            slopes = np.concatenate([by[..., None] * slopes, velocity[:, :, None]], axis=2)
            velocity = by * velocity
        return exponentials(velocity, slopes)

    def states(self, u: Array) -> tuple[Array, Array]:
        """States X (L, K + 1, d, d) along the way, and the matrices eta (L, K, m, d, d) by which what drives the k-th step moves all
        later ones: to exp(eta) X, of a right-invariant system to X exp(eta).

        Of least time the last of the m + 1 matrices belong to the duration, which moves the states after each exponential.
        """
        return self._stepped(*self.factors(u))

    def _stepped(self, E: Array, dE: Array) -> tuple[Array, Array]:
        if self.right:
            E, dE = E[:, ::-1], dE[:, ::-1]
        X = np.empty((len(E), E.shape[1] + 1, *self.start.shape), E.dtype)
        X[:, 0] = self.start
        for k in range(E.shape[1]):
            X[:, k + 1] = E[:, k] @ X[:, k] if self.right else X[:, k] @ E[:, k]
        back = np.linalg.inv(X[:, 1:])
        # X_k+1 = X_k E_k moves by X_k dE_k = (X_k dE_k X_k+1^-1) X_k+1, and what follows from it by the same factor on the left;
        # X_k+1 = E_k X_k by X_k+1 (X_k+1^-1 dE_k X_k), and what follows by the same factor on the right
        if self.right:
            return X, back[:, :, None] @ dE @ X[:, :-1, None]
        return X, X[:, :-1, None] @ dE @ back[:, :, None]

    @property
    def own(self) -> slice:
        """The system's own exponentials among all of the chain."""
        return slice(self.first, self.first + int(self.nodes[-1]) + 1)

    @property
    def free(self) -> bool:
        """Whether the goal leaves motions free, which have exponentials of their own."""
        return len(self.programme.slot) > len(self.own_slots)

    @property
    def own_slots(self) -> Rows:
        """The slot of each of the system's own exponentials."""
        return self.programme.slot[self.own]

    def _gaps(self, X: Array, eta: Array) -> tuple[Array, Array]:
        """Gaps less margins (L, R) of the nearest obstacles at the nodes, and their derivatives (L, R, C)."""
        lanes, count, m = eta.shape[:3]
        here = np.real(X[:, 1 + self.nodes])
        gap, N = self.keep_out.nearest(here, self.margins, _NEAREST)
        if self.right:
            # X exp(eta) is exp(X eta X^-1) X: <N, X eta X^-1> = <X' N X^-T, eta>
            turned = np.swapaxes(here, -1, -2)[:, :, None]
            N = turned @ N @ np.linalg.inv(turned)
        few = gap.shape[2]
        d2 = N.shape[-1] ** 2
        A = N.reshape(lanes, -1, d2) @ np.swapaxes(np.real(eta).reshape(lanes, count * m, d2), 1, 2)
        A = A.reshape(lanes, len(self.nodes), few, count, m)
        A *= (np.arange(count) <= self.nodes[:, None])[None, :, None, :, None]
        rows = self.by_slots(A.reshape(lanes, -1, count, m))
        return gap.reshape(lanes, -1), rows

    def columns_moved(self, X: Array, eta: Array, axes: Array) -> Array:
        """(L, nodes, a, K, m, d): how the columns X e of the nodes change, e the rows of axes (a, d); eta as `states` has them."""
        here, steps = np.real(X[:, 1 + self.nodes]), np.real(eta)
        if self.right:
            moved = np.einsum("lkxz,ljmzy,ay->lkajmx", here, steps, axes, optimize=True)
        else:
            moved = np.einsum("ljmxy,lkyz,az->lkajmx", steps, here, axes, optimize=True)
        earlier = np.arange(eta.shape[1]) <= self.nodes[:, None]
        return np.asarray(moved * earlier[None, :, None, :, None, None])

    def by_slots(self, rows: Array) -> Array:
        """Derivatives (L, R, K, m) by what drives each own step as those by the controls, (L, R, C)."""
        return self._spread(rows[:, :, ::-1] if self.right else rows, self.own)

    def _spread(self, rows: Array, some: slice) -> Array:
        """Derivatives (L, R, K, m) by what drives some exponentials of the chain as those by the controls, (L, R, C)."""
        p, count = self.programme, rows.shape[2]
        if self.longest:
            rows, lasting = rows[..., :-1], np.sum(rows[..., -1], axis=2)
        by_slot = np.zeros((count, p.low.shape[0]))
        by_slot[np.arange(count), p.slot[some]] += p.share[some, 0]
        ahead = np.minimum(p.slot[some] + 1, p.low.shape[0] - 1)
        by_slot[np.arange(count), ahead] += p.share[some, 1]
        found = np.einsum("lrkm,ks->lrsm", rows, by_slot, optimize=True)
        found = found.reshape(*found.shape[:2], -1)
        return np.asarray(np.concatenate([found, lasting[..., None]], axis=2) if self.longest else found)

    def known(self, u: Array) -> Known:
        """What a step needs at controls u (L, C)."""
        E, dE = self.factors(u)
        X, eta = self._stepped(E, dE)
        gap, A = self._gaps(X, eta)
        goal = replace(self.goal, value=np.repeat(self.goal.value, len(u), axis=0))
        if self.free or self.right:
            # free motions have exponentials of their own on either side, which no duration stretches; a right-invariant system's chain
            # ends at X X(0)^-1
            full, r, rows = by_factors(self.programme, goal, *self._whole(u, E, dE))
            J = self._spread(rows, slice(None))
        else:
            full, reduce = residual(self.programme.basis, goal, X[:, -1])
            moved = goal.left @ eta @ (X[:, -1] @ goal.right)[:, None, None]
            J = self.by_slots(np.einsum("lnq,lkiq->lnki", reduce, flat(moved)))
            r = np.einsum("lnq,lq->ln", reduce, full)
        size = np.sqrt(np.sum(full**2, axis=1) + np.sum(np.minimum(gap, 0.0) ** 2, axis=1))
        return Known(np.where(np.isfinite(size), size, np.inf), *(np.nan_to_num(each) for each in (r, J, gap, A)))

    def _whole(self, u: Array, E: Array, dE: Array) -> tuple[Array, Array]:
        """All exponentials of the chain, of which the system's own are known; the duration does not move the others."""
        p, own = self.programme, self.own
        rows = np.concatenate([np.arange(own.start), np.arange(own.stop, len(p.slot))])
        if not len(rows):
            return E, dE
        others = replace(p, entry=p.entry[:, rows], slot=p.slot[rows], share=p.share[rows])
        F, dF = factors(others, self.split(u)[0])
        if self.longest:
            dF = np.concatenate([dF, np.zeros_like(dF[:, :, :1])], axis=2)
        F, dF = F.astype(E.dtype), dF.astype(E.dtype)
        first = own.start
        return (
            np.concatenate([F[:, :first], E, F[:, first:]], axis=1),
            np.concatenate([dF[:, :first], dE, dF[:, first:]], axis=1),
        )

    def jumps(self, u: Array) -> Array:
        """(L,) whether a lane (L, C) goes through an obstacle in one step, clear before and behind it: past the middle of the thinnest
        part. What a chord cuts off at an edge or a rim is less than that, and margins mend it."""
        X, _ = self.states(u)
        nodes = np.real(X[:, np.concatenate([[0], 1 + self.nodes])])
        found = np.zeros(len(u), bool)
        for s in _ALONG:
            gap = self.keep_out.gaps(nodes[:, :-1] + s * np.diff(nodes, axis=1))
            found |= np.any(gap < -_THROUGH * self.keep_out.sizes, axis=(1, 2))
        return found

    def look(self, _: Rows, u: Array) -> Lanes:
        """The goal's rows and those of the nodes that cut an obstacle."""
        return self.known(u).lanes(u)

    def followed(self, u: Array, along: Array, axes: Array, weight: Array) -> tuple[Known, Array, Array]:
        """What is known at lanes (L, C), and how far their columns X e, e the rows of axes (a, d), are from `along` (nodes, a, d) at the
        nodes, times weight (a,): (L, rows), with the derivatives (L, rows, C)."""
        X, eta = self.states(u)
        off = (np.einsum("lkij,aj->lkai", np.real(X[:, 1 + self.nodes]), axes) - along) * weight[:, None]
        moved = self.columns_moved(X, eta, axes) * weight[:, None, None, None]
        lanes, _, _, count, m, _ = moved.shape
        rows = self.by_slots(np.moveaxis(moved, 5, 3).reshape(lanes, -1, count, m))
        return self.known(u), off.reshape(lanes, -1), rows


class Clear(Protocol):
    """A course, whatever drives it: what stages 1 and 2 ask for."""

    @property
    def box(self) -> Box:
        """Limits and weights of a lane."""

    def known(self, u: Array) -> Known:
        """What a step needs at lanes (L, C)."""

    def jumps(self, u: Array) -> Array:
        """(L,) whether a lane goes through an obstacle in one step."""

    def look(self, _: Rows, u: Array) -> Lanes:
        """As `numpy_search` asks for it."""

    def followed(self, u: Array, along: Array, axes: Array, weight: Array) -> tuple[Known, Array, Array]:
        """How far lanes are from a way."""

    @property
    def nodes(self) -> Rows:
        """The exponentials after which the obstacles are looked at."""

    @property
    def start(self) -> Array:
        """(d, d) X(0)."""


def arrive(course: Clear, u: Array, settings: Settings) -> tuple[Array, Array]:
    """Controls (L, C) near u that reach the goal and stay clear, and by how much they fail to (L,)."""
    found = reach(course.look, course.box, u, settings)
    return found.u, found.size


def cheaper(course: Clear, u: Array, settings: Settings) -> tuple[Array, float, int]:
    """Controls (C,) that reach the goal and stay clear as u does, at less cost; the cost, and steps taken."""
    box, enough = course.box, 100 * settings.enough
    best = float(box.objective(settings.fuel, u[None])[0])
    at = course.known(u[None])
    rho, quiet, steps = 1.0, 0, 0
    restoring = Settings(reach_iterations=_ARRIVE, enough=settings.enough, damping=1e-9)
    while steps < settings.descend_iterations and quiet < 3 and rho < 1e5:
        steps += 1
        v = _proximal(box, settings.fuel, u, at.r[0], at.J[0], at.gap[0], at.A[0], rho)
        trial, off = arrive(course, v[None], restoring)
        cost = float(box.objective(settings.fuel, trial)[0])
        if off[0] < enough and cost < best and not course.jumps(trial)[0]:
            quiet = quiet + 1 if best - cost <= settings.relative * best else 0
            u, best = trial[0], cost
            at = course.known(trial)
            rho = max(rho / 3, 1e-6)
        else:
            rho *= 4
    return u, best, steps


def _proximal(box: Box, fuel: bool, u: Array, r: Array, J: Array, gap: Array, A: Array, rho: float) -> Array:
    """The step's controls: the dual is concave with a continuous gradient; z >= 0 belongs to the gaps."""
    n = len(r)
    mass = box.mass
    G = np.concatenate([J, A])
    want = np.concatenate([J @ u - r, A @ u - gap])
    rate, shift = (1 / rho, box.weight / rho) if fuel else (1 / (box.weight + rho), 0.0)
    limit = np.concatenate([np.full(n, -np.inf), np.zeros(len(gap))])

    def primal(y: Array) -> tuple[Array, Array, float, Array]:
        z = (G.T @ y / mass + rho * u) * rate
        v = np.clip(np.sign(z) * np.maximum(np.abs(z) - shift, 0.0), box.low, box.high)
        g = want - G @ v
        size = box.weight * (2 * np.abs(v) if fuel else v * v)
        value = 0.5 * float(mass @ (size + rho * (v - u) ** 2)) + float(y @ g)
        inside = np.where((v > box.low) & (v < box.high) & (np.abs(z) >= shift), rate, 0.0)
        return v, g, value, inside

    y = np.zeros(len(want))
    v, g, value, inside = primal(y)
    for _ in range(_NEWTON):
        # A gap whose multiplier is zero and would fall takes no part: its row is not active.
        free = (y > limit) | (g > 0)
        if float(np.max(np.abs(np.where(free, g, 0.0)))) <= _ROUNDING:
            break
        H = (G[free] * (inside / mass)) @ G[free].T
        H += (1e-9 * np.trace(H) / max(len(H), 1) + 1e-14) * np.eye(len(H))
        step = np.zeros(len(y))
        step[free] = np.linalg.solve(H, g[free])
        for half in range(_HALVINGS):
            trial = np.maximum(y + 0.5**half * step, limit)
            found = primal(trial)
            if found[2] > value + 1e-4 * float(g @ (trial - y)):
                break
        else:
            break
        y = trial
        v, g, value, inside = found
    return v
