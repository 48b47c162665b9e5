"""A path in the plane as a first guess of a motion: poses along it, heading along the tangent, and the controls that come nearest."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.steering.obstacles.homotopy import Discs, Word, resampled, shortest_classes

#: Part of the way over which the heading turns from the start's to the path's, and from the path's to the goal's.
_EASE = 0.08


@dataclass(frozen=True, eq=False)
class PathGuess:
    """A guess of a motion in unit time.

    Attributes:
        word: class of the path.
        turns: full turns added to the end heading.
        states: (N + 1, d, d) poses.
        velocities: (N + 1, n) of the algebra.
    """

    word: Word
    turns: int
    states: Array = field(repr=False)
    velocities: Array = field(repr=False)

    @property
    def name(self) -> str:
        """As it is reported."""
        return f"the class {word_text(self.word)}" + (f", {self.turns:+d} turns" if self.turns else "")


def word_text(word: Word) -> str:
    """A class as a text: "+1 -2", or "0" where no ray is crossed."""
    return " ".join(f"{letter:+d}" for letter in word) or "0"


def moves_in_the_plane(group: MatrixGroup) -> bool:
    """Whether X is a rotation of the plane and a position, as on SE(2)."""
    corner = group.basis[:, :2, :2] if group.degree == 3 else np.zeros((1, 2, 2))
    flat = group.degree == 3 and not group.is_complex and not np.any(group.basis[:, 2])
    return flat and bool(np.any(corner)) and bool(np.allclose(corner, -np.swapaxes(corner, 1, 2)))


def path_guesses(
    group: MatrixGroup, discs: Discs, start: Array, goal: Array, intervals: int, classes: int, turns: tuple[int, ...]
) -> list[PathGuess]:
    """Guesses for the shortest classes of paths from one pose to another, with each of the end headings."""
    paths = shortest_classes(discs, start[:2, 2], goal[:2, 2], classes)
    return [_guess(group, word, path, start, goal, intervals, turn) for turn in turns for word, path in paths]


def _guess(
    group: MatrixGroup, word: Word, path: Array, start: Array, goal: Array, intervals: int, turns: int
) -> PathGuess:
    points = resampled(path, intervals + 1)
    tangent = np.gradient(points, axis=0)
    along = np.unwrap(np.arctan2(tangent[:, 1], tangent[:, 0]))
    first, last = (float(np.arctan2(X[1, 0], X[0, 0])) for X in (start, goal))
    along += 2 * np.pi * np.round((first - along[0]) / (2 * np.pi))
    last += 2 * np.pi * (np.round((along[-1] - last) / (2 * np.pi)) + turns)
    s = np.linspace(0, 1, intervals + 1)
    ease_in, ease_out = (np.clip(1 - x / _EASE, 0, 1) ** 2 for x in (s, 1 - s))
    heading = along + (first - along[0]) * ease_in
    # a full turn more is spread over the whole way
    heading += 2 * np.pi * turns * s + (last - 2 * np.pi * turns - heading[-1]) * ease_out
    states = np.zeros((intervals + 1, 3, 3))
    c, sine = np.cos(heading), np.sin(heading)
    states[:, 0, 0] = states[:, 1, 1] = c
    states[:, 0, 1], states[:, 1, 0] = -sine, sine
    states[:, :2, 2], states[:, 2, 2] = points, 1
    moving = np.gradient(points, s, axis=0)
    rate = np.zeros((intervals + 1, 3, 3))
    rate[:, 1, 0] = np.gradient(heading, s)
    rate[:, 0, 1] = -rate[:, 1, 0]
    rate[:, :2, 2] = np.einsum("kji,kj->ki", states[:, :2, :2], moving)
    return PathGuess(word, turns, states, group.project(rate))
