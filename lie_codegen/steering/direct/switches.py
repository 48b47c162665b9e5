"""Goals at the edge of what can be reached: pieces whose ends may move, where controls on equal pieces come near and no nearer.

Beyond the edge lie the ends that no controls reach; at the edge those of one control alone, which switches between its bounds at times
that no equal pieces have. Unknown are the durations s_k >= 0 of K arcs, of sum T, and their controls within the bounds:
    X = X0 E_1 ... E_K,   E_k = exp(s_k (a + sum_i u_ki b_i)).
Exact derivatives come from the chain with the coefficients (s_k, s_k u_k) of a and b; steps are Levenberg and Marquardt's.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import product

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.steering.direct.assemble import Manoeuvre, programme_of
from lie_codegen.steering.direct.chain import linearise
from lie_codegen.steering.direct.continuation import read_arcs
from lie_codegen.steering.direct.inputs import Drive, Inputs
from lie_codegen.steering.direct.magnus_flow import end_reached
from lie_codegen.steering.direct.polish import Flown
from lie_codegen.steering.direct.programme import Programme

_ITERATIONS = 80
#: Steps that promise to leave more than that part of the residual lead to the nearest end there is, not to the goal.
_STALLED = 0.99
#: Neighbours whose controls differ by less, relative to the bounds, are one arc.
_BLUR = 0.02
#: The same, for arcs whose controls are then held at a bound or zero; and how near to it they are for that.
_COARSE, _SNAP = (0.3, 0.05), 0.15
#: Words of at most that many arcs, of that many of the nearest lanes, with at most that many controls, are tried with one more arc anywhere.
_FEW, _WIDENED, _CORNERED = 8, 3, 2
_THERE = 1e-10
#: Arcs below that part of the time are left out.
_BRIEF = 2e-3
#: Of an arc that is put in between others, at first.
_NEW = 0.01
#: By how much arcs may miss the goal for one more to be tried, in units of its size: where one more was what lacked, they missed it by 3e-4.
_MISSED = 0.02
#: Words of at most that many controls are spelt in other ways, that many in all.
_SPELLED, _SPELLINGS = 5, 120

#: Durations (K,), controls (K, m), and which of these move (all where None).
_Try = tuple[Array, Array, Array | None]


def switched(task: Manoeuvre, near: Sequence[tuple[Array, int]]) -> tuple[Flown, int] | None:
    """Arcs near one of the given pieces (S, m), each for a variant of the goal, that end there; flown, with the variant.

    None where none were found, and for systems that depend on time, controls without bounds, or motions that the goal leaves free.
    """
    bounded = np.all(np.isfinite(task.low)) and np.all(np.isfinite(task.high))
    if not task.system.steady or not bounded or any(task.free_slots):
        return None
    scale = max(1.0, float(np.max(np.abs(task.end.values))))
    words: list[tuple[float, Array, Array, int]] = []
    for u, variant in near:
        durations, letters = read_arcs(task, u)
        arcs = _settled(task, durations, letters, np.zeros(letters.shape, dtype=bool), variant)
        flown = _flown(task, *arcs, variant)
        if flown.miss <= _THERE * scale:
            return flown, variant
        words.append((flown.miss, *arcs, variant))
    respelt = _respelt(task, words, 1.5 * task.duration / len(near[0][0]), scale)
    if respelt is not None:
        return respelt
    for number, (u, variant) in enumerate(near):
        bang = np.where(u < (task.low + task.high) / 2, task.low, task.high)
        tries: list[_Try] = [(*_arcs(task, u, _BLUR), None), (*_arcs(task, bang, _BLUR), None)]
        wider: list[_Try] = []
        for alike in _COARSE:
            durations, means = _arcs(task, u, alike)
            letters, held = _letters(task, means, durations < 1.5 * task.duration / len(u))
            tries.append((durations, letters, ~held))
            if number < _WIDENED and len(letters) <= _FEW and task.controls <= _CORNERED:
                wider += _with_one_more(task, durations, letters, held)
        nearest = np.inf
        for place, each in enumerate([*tries, *wider]):
            if place == len(tries) and nearest > _MISSED * scale:
                break  # an arc shorter than a piece does not make up for that
            flown = _flown(task, *_settled(task, *each, variant), variant)
            if flown.miss <= _THERE * scale:
                return flown, variant
            nearest = min(nearest, flown.miss)
    return None


def _respelt(
    task: Manoeuvre, words: Sequence[tuple[float, Array, Array, int]], brief: float, scale: float
) -> tuple[Flown, int] | None:
    """One of the nearest words of arcs (miss, durations, letters, variant) with other letters on its brief arcs, that ends at the goal.

    What happens within one piece leaves its means alone: whether a control that leaves its bound for a moment does so before or after
    another switches, or with it, they do not tell. Letters are changed one arc at a time, as long as that leads nearer.
    """
    if task.controls > _SPELLED:
        return None
    corners = np.array(list(product(*zip(task.low, task.high, strict=True))))
    left, seen = _SPELLINGS, set[bytes]()
    for miss, durations, letters, variant in sorted(words, key=lambda word: word[0]):
        while miss <= _MISSED * scale:
            durations, letters = _merged(durations, letters)
            if letters.tobytes() in seen:
                break
            seen.add(letters.tobytes())
            nearer: tuple[float, Array, Array] = (miss, durations, letters)
            for place, corner in product(np.flatnonzero(durations < brief), corners):
                if left == 0:
                    return None
                left -= 1
                other = letters.copy()
                other[place] = corner
                arcs = _settled(task, durations, other, np.zeros(other.shape, dtype=bool), variant)
                flown = _flown(task, *arcs, variant)
                if flown.miss <= _THERE * scale:
                    return flown, variant
                if flown.miss < nearer[0]:
                    nearer = (flown.miss, *arcs)
            if nearer[0] == miss:
                break
            miss, durations, letters = nearer
    return None


def _merged(durations: Array, letters: Array) -> tuple[Array, Array]:
    """Neighbours with the same letters as one arc."""
    first = np.flatnonzero([True, *np.any(letters[1:] != letters[:-1], axis=1)])
    return np.add.reduceat(durations, first), letters[first]


def _settled(task: Manoeuvre, s: Array, v: Array, moving: Array | None, variant: int) -> tuple[Array, Array]:
    """The arcs, brought as near to the goal as they come, without those that are all but gone where they do not get there."""
    durations, controls, left = _solved(task, s, v, moving, variant)
    # the piece in which a switch was shrinks without end: the steps get on when it is gone
    long = durations > _BRIEF * task.duration
    if left > _THERE and not np.all(long) and np.any(long):
        rest = None if moving is None else moving[long]
        durations, controls, _ = _solved(task, durations[long], controls[long], rest, variant)
    return durations, controls


def _arcs(task: Manoeuvre, u: Array, alike: float) -> tuple[Array, Array]:
    """Durations and mean controls of neighbouring pieces that differ by less than `alike`, relative to the bounds."""
    h = task.duration / len(u)
    durations, controls = [h], [u[0]]
    for row in u[1:]:
        if np.all(np.abs(row - controls[-1]) <= alike * (task.high - task.low)):
            total = durations[-1] + h
            controls[-1] = (durations[-1] * controls[-1] + h * row) / total
            durations[-1] = total
        else:
            durations.append(h)
            controls.append(row)
    return np.array(durations), np.array(controls)


def _letters(task: Manoeuvre, means: Array, brief: Array) -> tuple[Array, Array]:
    """The controls (K, m) of arcs, those near a bound or zero moved there, and which were moved; arcs as brief as a piece are all
    moved to what is nearest, for their mean is that of two arcs.

    On a singular arc of a shortest way what its control does is of second order: with the control free the steps crawl, with the
    durations alone they arrive.
    """
    choices = _choices(task)
    far = np.abs(means - choices[:, None])
    nearest = np.argmin(far, axis=0)
    letters = np.take_along_axis(choices, nearest, axis=0)
    held = (np.min(far, axis=0) <= _SNAP * (task.high - task.low)) | brief[:, None]
    return np.where(held, letters, means), held


def _choices(task: Manoeuvre) -> Array:
    """(3, m): what controls are on arcs of shortest ways, mostly."""
    return np.array([np.clip(0.0, task.low, task.high), task.low, task.high])


def _with_one_more(
    task: Manoeuvre, durations: Array, letters: Array, held: Array
) -> list[tuple[Array, Array, Array | None]]:
    """The arcs with one more at every place, each control at a bound or zero: an arc shorter than a piece is lost in the mean of that piece."""
    found: list[tuple[Array, Array, Array | None]] = []
    for place in range(len(letters) + 1):
        beside = letters[max(0, place - 1) : place + 1]
        for corner in product(*_choices(task).T):
            if any(np.array_equal(corner, letter) for letter in beside):
                continue
            found.append(
                (
                    np.insert(durations, place, _NEW * task.duration),
                    np.insert(letters, place, corner, axis=0),
                    np.insert(~held, place, False, axis=0),
                )
            )
    return found


def _programme(task: Manoeuvre, arcs: int) -> Programme:
    """Exponentials of s a + sum_i w_i b_i, one an arc, with m + 1 coefficients each."""
    system, m, now = task.system, task.controls, np.zeros(1)
    rows = np.concatenate([system.drift.at(now)[:, None], system.directions_at(now)], axis=1)
    wide = replace(task, low=np.full(m + 1, -np.inf), high=np.full(m + 1, np.inf), weights=np.ones(m + 1))
    directions = system.group.hat(rows)
    table = (np.zeros_like(directions[:, 0]), directions, np.zeros(arcs, int))
    return programme_of(wide, table, np.arange(arcs), np.tile([1.0, 0.0], (arcs, 1)), np.ones(arcs))


def _solved(task: Manoeuvre, s: Array, u: Array, moving: Array | None, variant: int) -> tuple[Array, Array, float]:
    """Durations (K,) and controls (K, m), those `moving` or all, that end nearest to the goal and add up to the time there is; by how
    much they miss both."""
    m, arcs = task.controls, len(s)
    programme, goal = _programme(task, arcs), task.goal(np.array([variant]))

    def equations(x: Array) -> tuple[Array, Array]:
        """Reduced residual and the total duration, and their derivative by s and u."""
        s, u = x[:arcs], x[arcs:].reshape(arcs, m)
        _, r, J = linearise(programme, goal, np.column_stack([s, s[:, None] * u])[None])
        rows = J[0].reshape(-1, arcs, m + 1)
        by_s = rows[:, :, 0] + np.einsum("nkm,km->nk", rows[:, :, 1:], u)
        by_u = (rows[:, :, 1:] * s[:, None]).reshape(len(rows), -1)
        clock = np.concatenate([np.full(arcs, 1 / task.duration), np.zeros(arcs * m)])
        return np.append(r[0], np.sum(s) / task.duration - 1), np.vstack([np.hstack([by_s, by_u]), clock])

    lowest, highest = np.tile(task.low, (arcs, 1)), np.tile(task.high, (arcs, 1))
    if moving is not None:
        lowest, highest = np.where(moving, lowest, u), np.where(moving, highest, u)
    low = np.concatenate([np.zeros(arcs), lowest.ravel()])
    high = np.concatenate([np.full(arcs, task.duration), highest.ravel()])
    # a step in s counts in units of the time there is, one in u in units of the bounds
    unit = np.concatenate([np.full(arcs, task.duration), (highest - lowest).ravel()]) ** 2
    x, damped = np.concatenate([s, u.ravel()]), 1e-3
    r, J = equations(x)
    for _ in range(_ITERATIONS):
        size = float(np.linalg.norm(r))
        if size <= 1e-14 or damped > 1e8:
            break
        pull = J.T @ r
        open_ = ~(((x <= low) & (pull > 0)) | ((x >= high) & (pull < 0)))
        scaled = J * np.where(open_, unit, 0.0)
        K = scaled @ J.T
        shift = damped * np.trace(K) / len(K) + 1e-300
        K += shift * np.eye(len(K))
        y = np.linalg.solve(K, r)
        # shift y is what the step would leave of r, were the equations linear: where that is r, no arrival is near
        if damped <= 1 and float(np.linalg.norm(shift * y)) > _STALLED * size:
            break
        trial = np.clip(x - scaled.T @ y, low, high)
        new_r, new_J = equations(trial)
        if np.linalg.norm(new_r) < size:
            x, r, J, damped = trial, new_r, new_J, max(damped / 5, 1e-13)
        else:
            damped *= 6
    return x[:arcs], x[arcs:].reshape(arcs, m), float(np.linalg.norm(r))


def _flown(task: Manoeuvre, durations: Array, controls: Array, variant: int) -> Flown:
    """The arcs in the system's own time, their sum exactly the time there is."""
    there = durations > 1e-12 * task.duration
    durations, controls = durations[there], controls[there]
    if task.system.right:
        durations, controls = durations[::-1], controls[::-1]
    knots = np.concatenate([[0.0], np.cumsum(durations)])
    inputs = Inputs.constant(knots * (task.duration / knots[-1]), controls)
    X = end_reached(Drive(task.system, inputs))
    eye = np.eye(task.system.group.degree)
    miss = task.end.left @ X @ task.end.right - task.end.values[variant]
    return Flown(inputs, X, float(np.linalg.norm(miss)), (eye, eye))
