"""Words of arcs of constant torque: made, cleared of arcs that are gone, and with switches that met in the other order."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.steering.direct.numpy_search import Box
from lie_codegen.steering.direct.programme import Goal
from lie_codegen.steering.direct.torque_arcs import TorqueArcs, euler_constants
from lie_codegen.steering.task import Task
from lie_codegen.steering.transcription.numbers import Dynamics

#: The share of controls that stay off.
_OFF = 0.15
#: Duration from which an arc counts as gone, of the whole.
GONE = 1e-7


@dataclass(frozen=True, eq=False)
class TorqueWord:
    """Torques (K, m) of arcs in unit time, their durations (K,), and their sum."""

    torques: Array = field(repr=False)
    durations: Array = field(repr=False)
    total: float
    size: float


def torque_words(low: Array, high: Array, lanes: int, switches: int, rng: np.random.Generator) -> Array:
    """(lanes, K, m) torques: each control starts at one of its bounds and changes to the other one to `switches` times, or is off; all
    switches in a random order."""
    m = len(low)
    arcs = m * switches + 1
    words = np.empty((lanes, arcs, m))
    for lane in range(lanes):
        counts = rng.integers(1, switches + 1, m)
        off = (rng.random(m) < _OFF) & (low <= 0) & (high >= 0)
        off &= not np.all(off)
        counts[off] = 0
        at_high = rng.random(m) < 0.5
        order = rng.permutation(np.repeat(np.arange(m), counts))
        for k in range(arcs):
            if 0 < k <= len(order):
                at_high[order[k - 1]] ^= True
            words[lane, k] = np.where(off, 0.0, np.where(at_high, high, low))
    return words


def arcs_of(task: Task, second: Dynamics, torques: Array, steps: int) -> TorqueArcs:
    """Those of words (lanes, K, m), integrated in so many steps an arc."""
    group = task.group
    forces = np.zeros((*torques.shape[:2], group.dim))
    forces[..., list(task.controls)] = torques
    eye = np.eye(group.degree)
    return TorqueArcs(
        group,
        Goal(eye, eye, task.target[None]),
        euler_constants(group, second.inertia),
        np.linalg.solve(second.inertia, forces[..., None])[..., 0],
        np.array(second.ends),
        steps,
    )


def word_box(arcs: int, longest: float) -> Box:
    """Durations from 0 to the longest, all of one weight."""
    one = np.ones(arcs)
    return Box(np.zeros(arcs), np.full(arcs, longest), one, one)


def tidied(torques: Array, durations: Array, size: float, gone: float = GONE) -> TorqueWord:
    """Without arcs that are gone, equal neighbours joined."""
    words: list[Array] = []
    lengths: list[float] = []
    for f, s in zip(torques, durations, strict=True):
        if words and np.array_equal(words[-1], f):
            lengths[-1] += float(s)
        elif s > gone:
            words.append(f)
            lengths.append(float(s))
    return TorqueWord(np.array(words), np.array(lengths), float(np.sum(lengths)), size)
