"""First controls for the search: none, white noise, smooth waves, and nearly constant ones; the same for the same seed."""

from __future__ import annotations

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.flow.second_kind_coordinates import element_coordinates
from lie_codegen.steering.direct.assemble import Manoeuvre
from lie_codegen.steering.direct.programme import Programme

#: Sizes of the waves, in units of the bounds: larger ones start at the bounds and stay there (measured on two-qubit gates).
_SIZES = (0.3, 0.15, 0.6, 0.1)
_WAVES = 4
#: White noise on steady controls, which may be as large as the bounds.
_UNSTEADY = 0.2
#: Size of a kick in units of the bounds, and the gradient, relative to |J| |r|, below which a lane stands still.
_KICK, _STILL = 0.03, 1e-6


def starts(task: Manoeuvre, pieces: int, lanes: int, seed: int, round_: int) -> Array:
    """(lanes, pieces, m): white, smooth, white, nearly constant in turn; the very first is zero, moved into the bounds."""
    rng = np.random.default_rng([seed, round_])
    middle, half = _box(task)
    s = (np.arange(pieces) + 0.5) / pieces
    waves = np.cos(np.pi * np.outer(s, np.arange(_WAVES)))
    sizes = np.array([_SIZES[(lane // 2 + round_) % len(_SIZES)] for lane in range(lanes)])
    # one draw for all: of each lane the wave's amplitudes, white noise, and a mean, since a motion to one side needs one apart from the wave
    drawn = np.split(
        rng.uniform(-1, 1, (lanes, (_WAVES + pieces + 1) * task.controls)),
        np.cumsum([_WAVES, pieces]) * task.controls,
        1,
    )
    wave, white, mean = (each.reshape(lanes, -1, task.controls) for each in drawn)
    found = np.array(white)
    # white noise arrives where smooth waves stall at the bounds (gates in short time), and the other way round (one in four)
    found[1::4] += 0.3 * (waves @ wave[1::4] + mean[1::4])
    found = middle + sizes[:, None, None] * half * found
    # each whole turn that steady controls make is a valley of its own (rigid motions: costs up to twice as high without these)
    found[3::4] = middle + half * (mean[3::4] + _UNSTEADY * white[3::4])
    if round_ == 0:
        found[0] = 0
    return np.clip(found, task.low, task.high)


def still(programme: Programme, u: Array, r: Array, J: Array) -> Array:
    """(lanes,) whether no small step within the bounds comes nearer to the goal: J' r vanishes but for what pushes out of the bounds."""
    slope = np.einsum("lnc,ln->lc", J, r).reshape(u.shape)
    held = ((u <= programme.low) & (slope > 0)) | ((u >= programme.high) & (slope < 0))
    left = np.linalg.norm(np.where(held, 0.0, slope), axis=(1, 2))
    return np.asarray(left <= _STILL * np.linalg.norm(J, axis=(1, 2)) * np.linalg.norm(r, axis=1))


def kicked(task: Manoeuvre, u: Array, seed: int) -> Array:
    """Controls (lanes, S, m), a little aside: off a symmetry that every step from them would keep."""
    before, after = task.free_slots
    _, half = _box(task)
    found = np.array(u)
    own = found[:, before : u.shape[1] - after]
    own += _KICK * half * np.random.default_rng([seed, 1, *u.shape]).uniform(-1, 1, own.shape)
    np.clip(own, task.low, task.high, out=own)
    return found


def with_free_slots(task: Manoeuvre, u: Array, seed: int) -> Array:
    """The controls (lanes, S, m) with slots for the free motions of the goal: none in the first lane, then any."""
    before, after = task.free_slots
    if before + after == 0:
        return u
    rng = np.random.default_rng([seed, before, after])
    free = rng.uniform(-np.pi, np.pi, (len(u), before + after, u.shape[2]))
    free[0] = 0
    return np.concatenate([free[:, :before], u, free[:, before:]], axis=1)


def _box(task: Manoeuvre) -> tuple[Array, Array]:
    """(m,) middle and half width of the limits; where there is none, what reaches the target in the time, doubled."""
    # a target is at least 2 pi away here: limits that are not wide for that are not for any
    least = 4 * np.pi / task.duration
    if np.all(task.low >= -10 * least) and np.all(task.high <= 10 * least):
        return (task.low + task.high) / 2, (task.high - task.low) / 2
    reach = 2 * np.pi
    elements = task.end.elements
    if elements is not None:
        reach += float(np.linalg.norm(element_coordinates(task.system.group, elements[0])))
    else:
        reach += float(np.linalg.norm(task.end.values[0]))
    usual = 2 * reach / task.duration
    low = np.where(np.isfinite(task.low), task.low, np.where(np.isfinite(task.high), task.high - 2 * usual, -usual))
    high = np.where(np.isfinite(task.high), task.high, np.where(np.isfinite(task.low), task.low + 2 * usual, usual))
    # very wide limits are as good as none
    low, high = (
        np.maximum(low, np.minimum(-10 * usual, high - 20 * usual)),
        np.minimum(high, np.maximum(10 * usual, low + 20 * usual)),
    )
    return (low + high) / 2, (high - low) / 2
