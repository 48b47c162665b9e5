"""The search in numpy, where there is no compiler: as templates/direct_core.c without Newton's steps, many lanes at once.

Stage 1 reaches: Levenberg and Marquardt's steps on the residual, projected on the bounds, in the n reduced rows of the goal, so
that systems are n by n whatever the number of controls. Stage 2 descends: the proximal step of the linearised problem, by
semismooth Newton's method on its dual, then a few undamped steps of stage 1 to restore the goal.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields, replace

import numpy as np
from numpy.typing import NDArray

from lie_codegen.arrays import Array
from lie_codegen.steering.direct.chain import linearise, phase_ahead
from lie_codegen.steering.direct.programme import Goal, Programme, Reached, Settings, chosen

_LEAST, _MOST = 1e-13, 1e8
_ROUNDING = 1e-13
#: Times that a step is taken again without the controls it would push out of the box.
_FACES = 4


@dataclass
class Lanes:
    """Controls (L, C) and what is known there: residual norm (L,), reduced residual (L, n) and its derivative (L, n, C)."""

    u: Array
    size: Array
    r: Array
    J: Array

    def lanes(self, rows: Rows) -> Lanes:
        """Some of the lanes, copied."""
        return Lanes(*(getattr(self, each.name)[rows] for each in fields(self)))

    def take(self, rows: Array, other: Lanes, picked: Array) -> None:
        """Lanes `picked` of another become the lanes `rows` of this."""
        for each in fields(self):
            getattr(self, each.name)[rows] = getattr(other, each.name)[picked]


@dataclass(frozen=True)
class Box:
    """Limits (C,), weights of the objective and lengths of the slots."""

    low: Array
    high: Array
    weight: Array
    mass: Array

    @staticmethod
    def of(p: Programme) -> Box:
        """The box of a programme."""
        return Box(p.low.ravel(), p.high.ravel(), p.weight.ravel(), np.repeat(p.mass, p.low.shape[1]))

    def objective(self, fuel: bool, u: Array) -> Array:
        """sum w |u| or 1/2 sum w u^2, (L,)."""
        w = self.weight * self.mass
        return np.asarray(np.abs(u) @ w if fuel else u**2 @ w / 2)


Rows = NDArray[np.int_]
#: (numbers of lanes, controls (k, C) of those) -> what is known there.
Look = Callable[[Rows, Array], Lanes]


class NumpySearch:
    """The search of any group."""

    compiled = False

    def linearise(self, programme: Programme, goal: Goal, u: Array) -> tuple[Array, Array, Array]:
        """See `Machine`."""
        at = _look(programme, goal)(np.arange(len(u)), u.reshape(len(u), -1))
        return at.size, at.r, at.J

    def reach(self, programme: Programme, goal: Goal, u: Array, settings: Settings) -> Reached:
        """See `Machine`."""
        found = reach(_look(programme, goal), Box.of(programme), u.reshape(len(u), -1), settings)
        controls = found.u.reshape(u.shape)
        return replace(found, u=controls, phase=phase_ahead(programme, goal, controls))

    def descend(self, programme: Programme, goal: Goal, u: Array, settings: Settings) -> Reached:
        """See `Machine`."""
        found = descend(_look(programme, goal), Box.of(programme), u.reshape(len(u), -1), settings)
        return replace(found, u=found.u.reshape(u.shape))


def reach(look: Look, box: Box, u: Array, settings: Settings) -> Reached:
    """From any controls (L, C) towards the goal, within the box."""
    rows = np.arange(len(u))
    at = look(rows, np.clip(u, box.low, box.high))
    used = _arrive(look, rows, box, at, settings.reach_iterations, settings.enough, settings.damping, settings.wanted)
    return Reached(at.u, at.size, box.objective(settings.fuel, at.u), np.zeros_like(at.r), used, np.zeros(len(used)))


def descend(look: Look, box: Box, u: Array, settings: Settings) -> Reached:
    """From controls (L, C) that reach the goal to cheaper ones that do."""
    at = look(np.arange(len(u)), np.clip(u, box.low, box.high))
    rho, quiet, used = np.ones(len(u)), np.zeros(len(u)), np.zeros(len(u), int)
    y = np.zeros_like(at.r)
    best = box.objective(settings.fuel, at.u)
    enough = 100 * settings.enough
    for _ in range(settings.descend_iterations):
        act = np.flatnonzero((quiet < 2) & (rho < 1e6))
        if not len(act):
            break
        v, multipliers = _proximal(box, settings.fuel, at.lanes(act), y[act], rho[act])
        trial = look(act, v)
        # v keeps to the linearised goal and leaves the true one by the flow's curvature: it is brought back, and what is cheaper then counts
        _arrive(look, act, box, trial, 12, settings.enough, 1e-9, len(act) + 1)
        cost = box.objective(settings.fuel, trial.u)
        better = (trial.size < enough) & (cost < best[act])
        small = better & (best[act] - cost <= settings.relative * best[act])
        quiet[act] = np.where(small, quiet[act] + 1, np.where(better, 0, quiet[act]))
        # a shorter step where the model promised too much, a longer one where it kept its word
        rho[act] = np.where(better, np.maximum(rho[act] / 3, 1e-6), rho[act] * 4)
        rows = act[better]
        at.take(rows, trial, better)
        y[rows], best[rows] = multipliers[better], cost[better]
        used[act] += 1
    return Reached(at.u, at.size, best, y, used, np.zeros(len(used)))


def _look(p: Programme, goal: Goal) -> Look:
    """Of a chain of exponentials."""

    def look(lanes: Rows, u: Array) -> Lanes:
        part, aim = chosen(p, goal, lanes)
        full, r, J = linearise(part, aim, u.reshape(len(u), *p.low.shape))
        return Lanes(u, np.linalg.norm(full, axis=1), r, J)

    return look


def _arrive(
    look: Look, lanes: Rows, box: Box, at: Lanes, iterations: int, enough: float, damping: float, wanted: int
) -> Rows:
    """Damped steps of all lanes towards the goal, in place; steps taken by each."""
    damped = np.full(len(at.u), damping)
    used = np.zeros(len(at.u), int)
    for _ in range(iterations):
        act = np.flatnonzero((at.size > enough) & (damped < _MOST))
        if not len(act) or np.sum(at.size <= enough) >= wanted:
            break
        here = at.lanes(act)
        trial = look(lanes[act], np.clip(here.u + _damped_step(box, here, damped[act]), box.low, box.high))
        better = trial.size < here.size
        at.take(act[better], trial, better)
        damped[act] = np.where(better, np.maximum(damped[act] / 5, _LEAST), damped[act] * 6)
        used[act] += 1
    return used


def _damped_step(box: Box, at: Lanes, damped: Array) -> Array:
    """-J'(J J' + damping)^-1 r, a control at a bound that pulls outwards left where it is."""
    pull = np.einsum("lnc,ln->lc", at.J, at.r)
    free = np.ones(pull.shape, bool)
    n = at.J.shape[1]
    for again in range(_FACES):
        held = free & (((at.u <= box.low) & (pull > 0)) | ((at.u >= box.high) & (pull < 0)))
        if again and not np.any(held):
            break
        free &= ~held
        K = (at.J * (free / box.mass)[:, None, :]) @ np.swapaxes(at.J, 1, 2)
        K += (damped * np.trace(K, axis1=1, axis2=2) / n + 1e-300)[:, None, None] * np.eye(n)
        # what the step itself would push out of the box is held as well, and the step taken without it
        pull = np.einsum("lnc,ln->lc", at.J, np.linalg.solve(K, at.r[..., None])[..., 0])
    return np.asarray(-pull * free / box.mass)


def _proximal(box: Box, fuel: bool, at: Lanes, y: Array, rho: Array) -> tuple[Array, Array]:
    """min objective(v) + rho/2 |v - u|^2 over the box with J v = J u - r; v and the multipliers y, from a first guess of y."""
    want = np.einsum("lnc,lc->ln", at.J, at.u) - at.r
    scale = rho[:, None]

    # The dual of a separable problem in a box: its gradient J v(y) - want is piecewise linear in y, so that Newton on it ends in a few steps.
    def primal(y: Array) -> tuple[Array, Array, Array]:
        z = np.einsum("lnc,ln->lc", at.J, y) / box.mass
        if fuel:
            s, t = at.u + z / scale, box.weight / scale
            v = np.sign(s) * np.maximum(np.abs(s) - t, 0)
            rate = np.where(np.abs(s) > t, 1 / scale, 0)
        else:
            rate = 1 / (box.weight + scale)
            v = (z + scale * at.u) * rate
        # A control at its bound does not answer to y.
        rate = np.where((v > box.low) & (v < box.high), rate, 0)
        v = np.clip(v, box.low, box.high)
        return v, rate, np.einsum("lnc,lc->ln", at.J, v) - want

    trace = np.einsum("lnc,lnc->l", at.J, at.J / box.mass)
    v, rate, F = primal(y)
    for _ in range(30):
        norm = np.linalg.norm(F, axis=1)
        open_ = norm > _ROUNDING
        if not np.any(open_):
            break
        H = (at.J * (rate / box.mass)[:, None, :]) @ np.swapaxes(at.J, 1, 2)
        # H is singular where all controls of a row are at their bounds.
        H += (1e-10 * trace + 1e-300)[:, None, None] * np.eye(H.shape[1])
        step = -np.linalg.solve(H, F[..., None])[..., 0]
        moved = np.zeros(len(y), bool)
        for half in range(8):
            found = np.linalg.norm(primal(y + 0.5**half * step)[2], axis=1)
            falls = open_ & (found < norm)
            y = np.where(falls[:, None], y + 0.5**half * step, y)
            moved |= falls
            open_ &= ~falls
            if not np.any(open_):
                break
        v, rate, F = primal(y)
        if not np.any(moved):
            break
    return v, y
