"""Words of arcs with constant controls: the letters (controls at their bounds), how long each is of use, and the words that are tried."""

from __future__ import annotations

from itertools import pairwise, product

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.errors import NotFiniteError, ShapeError, SteeringInputError
from lie_codegen.flow.batched_exponential import expm
from lie_codegen.steering.direct.assemble import Manoeuvre

#: Words of n arcs are all tried up to that many; else as many drawn at random.
_MOST_WORDS = 1024
#: Random durations of each word, at least; lanes in all, at most.
_EACH, _MOST_LANES = 2, 4096
#: Controls at most: the letters are all their combinations.
MOST_CONTROLS = 4


def letters_of(task: Manoeuvre, vertices: ArrayLike | None) -> tuple[Array, Array]:
    """(L, m) controls at a bound or zero, or those given, and hat of the velocities they make in the unit of the given duration (L, d, d)."""
    name = task.system.group.name
    if not task.system.steady:
        raise SteeringInputError(
            f'steer({name}): objective="time" needs controls and a drift that do not depend on time'
        )
    if vertices is not None:
        return _given(task, vertices)
    unbounded = [
        label for label, a, b in zip(task.system.labels, task.low, task.high, strict=True) if not np.isfinite(b - a)
    ]
    if unbounded:
        raise SteeringInputError(f'steer({name}): objective="time" needs bounds; {", ".join(unbounded)} has none')
    if task.controls > MOST_CONTROLS:
        raise SteeringInputError(
            f'steer({name}): objective="time" takes at most {MOST_CONTROLS} controls, got {task.controls}'
        )
    choices = [(a, 0.0, b) if a < 0 < b else (a, b) for a, b in zip(task.low, task.high, strict=True)]
    return _moving(task, np.array(list(product(*choices))))


def _given(task: Manoeuvre, vertices: ArrayLike) -> tuple[Array, Array]:
    """The caller's own control vectors, within the bounds."""
    name, m = task.system.group.name, task.controls
    letters = np.array(vertices, dtype=float)
    if letters.ndim != 2 or letters.shape[1] != m or not len(letters):
        raise ShapeError(
            f"steer({name}): vertices have shape {letters.shape}; give (k, {m}), a vector of controls for each arc"
        )
    if not np.all(np.isfinite(letters)):
        raise NotFiniteError(f"steer({name}): vertices hold NaN or infinity")
    if np.any(letters < task.low - 1e-12) or np.any(letters > task.high + 1e-12):
        raise SteeringInputError(f"steer({name}): a vertex breaks the bounds")
    return _moving(task, letters)


def _moving(task: Manoeuvre, letters: Array) -> tuple[Array, Array]:
    velocities = task.system.group.hat(task.duration * task.system.velocity(np.zeros(len(letters)), letters))
    moving = np.max(np.abs(velocities), axis=(1, 2)) > 0
    return letters[moving], velocities[moving]


def longest_useful(task: Manoeuvre, velocities: Array, longest: float) -> Array:
    """(L,) longest useful duration of each letter: its period, where exp(s V) returns to the identity."""
    limits = np.full(len(velocities), float(longest))
    for number, V in enumerate(velocities):
        # exp(s V) is the identity only where every eigenvalue's rate times s is a whole number of turns: for the slowest one, two, three ...
        rates = np.abs(np.linalg.eigvals(V).imag)
        rates = rates[rates > 1e-9]
        if len(rates):
            turns = 2 * np.pi / np.min(rates) * np.arange(1, 5)
            back = expm(turns[:, None, None] * V)
            home = np.max(np.abs(back - np.eye(len(V))), axis=(1, 2)) < 1e-9
            if np.any(home):
                limits[number] = min(longest, float(turns[np.argmax(home)]))
    return limits


def short_words(letters: int, arcs: int, starts: int, rng: np.random.Generator) -> Array:
    """(lanes, arcs) all words without the same letter twice in a row, repeated; or some of them."""
    count = letters * max(letters - 1, 1) ** (arcs - 1)
    if count > _MOST_WORDS:
        return long_words(letters, arcs, _MOST_WORDS * _EACH, rng)
    words = np.array([w for w in product(range(letters), repeat=arcs) if all(a != b for a, b in pairwise(w))])
    if not len(words):
        words = np.zeros((1, arcs), int)
    return np.repeat(words, min(max(_EACH, starts), max(_EACH, _MOST_LANES // len(words))), axis=0)


def long_words(letters: int, arcs: int, lanes: int, rng: np.random.Generator) -> Array:
    """(lanes, arcs) random words without the same letter twice in a row."""
    words = rng.integers(0, letters, (lanes, arcs))
    for k in range(1, arcs if letters > 1 else 0):  # 1 .. letters - 1 further on: every other letter is as likely
        words[:, k] = (words[:, k - 1] + rng.integers(1, letters, lanes)) % letters
    return words


def with_one_more(word: Array, durations: Array, letters: int) -> tuple[Array, Array]:
    """Words (lanes, K + 2) and durations of the same motion, with a letter of no duration before, in the middle of or after one of the
    arcs, every other letter in turn."""
    words, lengths = [], []
    for k, share, letter in product(range(len(word)), (0.0, 0.5, 1.0), range(letters)):
        if letter != word[k]:
            words.append([*word[:k], word[k], letter, *word[k:]])
            lengths.append([*durations[:k], share * durations[k], 0.0, (1 - share) * durations[k], *durations[k + 1 :]])
    return np.array(words, dtype=int), np.array(lengths)


def with_one_less(word: Array, durations: Array) -> tuple[Array, Array]:
    """Words (K, K - 1) and durations without one of the arcs, each in turn."""
    others = ~np.eye(len(word), dtype=bool)
    return np.array([word[kept] for kept in others]), np.array([durations[kept] for kept in others])
