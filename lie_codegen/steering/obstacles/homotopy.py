"""Shortest paths in the plane among discs, one for each of the first few homotopy classes.

Discs that overlap are one cluster. From one disc of each cluster a ray goes down; a path is named by the rays it crosses, +c from
left to right, -c from right to left, inverse neighbours cancelled (a word of the free group). Dijkstra's search on pairs of a grid
cell and a word arrives at the goal with different words in the order of their lengths.
"""

from __future__ import annotations

import heapq
from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.steering.constraints import Ball

Word = tuple[int, ...]

#: Cells along the longer side, letters of a word beyond one a cluster, and states that are expanded at most.
_CELLS = 80
_LETTERS = 2
_MOST_STATES = 60_000
_POINTS = 129
_SMOOTHINGS = 400


@dataclass(frozen=True, eq=False)
class Discs:
    """Discs in the plane, with the rays that name the ways around them.

    Attributes:
        centers, radii: (k, 2) and (k,).
        rays: (c, 2) the upper end of each cluster's ray; all abscissas differ.
    """

    centers: Array
    radii: Array
    rays: Array = field(repr=False)

    @staticmethod
    def of(centers: Array, radii: Array) -> Discs:
        """The discs, in clusters of those that overlap or touch."""
        k = len(radii)
        parent = list(range(k))
        for i in range(k):
            for j in range(i):
                if np.hypot(*(centers[i] - centers[j])) <= (radii[i] + radii[j]) * (1 + 1e-9):
                    a, b = _root(parent, i), _root(parent, j)
                    parent[a] = b
        rays: list[Array] = []
        for cluster in sorted({_root(parent, i) for i in range(k)}):
            # the lowest disc, so that the ray does not run through the cluster's own gaps
            members = [i for i in range(k) if _root(parent, i) == cluster]
            lowest = min(members, key=lambda i: (centers[i][1] - radii[i], i))
            x, width = float(centers[lowest][0]), 0.05 * float(radii[lowest])
            # rays one above the other would be crossed in one step, in an order that is not the path's
            shifts = (width * sign * n for n in range(1, 10) for sign in (1, -1))
            while any(abs(x - ray[0]) < 0.5 * width for ray in rays):
                x = float(centers[lowest][0]) + next(shifts, width * (len(rays) + 11))
            rays.append(np.array([x, float(centers[lowest][1])]))
        return Discs(centers, radii, np.array(rays).reshape(-1, 2))

    def clearance(self, points: Array) -> Array:
        """(k,) distance of points (k, 2) to the nearest disc, negative inside."""
        gaps = np.linalg.norm(points[:, None] - self.centers, axis=2) - self.radii
        return np.asarray(np.min(gaps, axis=1))

    def crossings(self, a: Array, b: Array) -> Word:
        """The rays that the segment from a to b crosses, in order."""
        low, high = min(a[0], b[0]), max(a[0], b[0])
        crossed = []
        for number, (x, top) in enumerate(self.rays, start=1):
            if low < x <= high:
                s = (x - a[0]) / (b[0] - a[0])
                if a[1] + s * (b[1] - a[1]) < top:
                    crossed.append((s, number if b[0] > a[0] else -number))
        return tuple(number for _, number in sorted(crossed))

    def word(self, path: Array) -> Word:
        """The class of a path (k, 2)."""
        word: Word = ()
        for a, b in pairwise(path):
            word = reduced(word, self.crossings(a, b))
        return word


def reduced(word: Word, more: Word) -> Word:
    """word followed by more, inverse neighbours cancelled."""
    letters = list(word)
    for letter in more:
        if letters and letters[-1] == -letter:
            letters.pop()
        else:
            letters.append(letter)
    return tuple(letters)


def shortest_classes(discs: Discs, start: Array, goal: Array, count: int) -> list[tuple[Word, Array]]:
    """Up to `count` smooth paths (k, 2) from start to goal of different classes, the shortest first."""
    xs, ys, free = _grid(discs, start, goal)
    first, last = (_cell(xs, ys, free, point) for point in (start, goal))
    if first is None or last is None:
        return []
    points = np.stack(np.meshgrid(xs, ys, indexing="ij"), axis=-1)
    moves = [(dx, dy) for dx in (-1, 0, 1) for dy in (-1, 0, 1) if dx or dy]
    lengths = {move: float(np.hypot(move[0] * (xs[1] - xs[0]), move[1] * (ys[1] - ys[0]))) for move in moves}
    nothing: Word = ()
    begin = (first, nothing)
    distance = {begin: 0.0}
    came: dict[tuple[tuple[int, int], Word], Any] = {begin: None}
    queue: list[tuple[float, float, tuple[int, int], Word]] = [(0.0, 0.0, first, nothing)]
    done: set[tuple[tuple[int, int], Word]] = set()
    arrivals: dict[tuple[int, int], int] = {}
    found: list[tuple[Word, Array]] = []
    while queue and len(found) < count and len(done) < _MOST_STATES:
        _, way, cell, word = heapq.heappop(queue)
        if (cell, word) in done or arrivals.get(cell, 0) >= count:
            continue
        done.add((cell, word))
        # a cell's k shortest classes are enough for the goal's k shortest
        arrivals[cell] = arrivals.get(cell, 0) + 1
        if cell == last:
            path = _traced(came, (cell, word), points)
            found.append((word, _smoothed(discs, np.vstack([start, path, goal]))))
            continue
        here = points[cell]
        for move in moves:
            other = (cell[0] + move[0], cell[1] + move[1])
            if not (0 <= other[0] < len(xs) and 0 <= other[1] < len(ys)) or not free[other]:
                continue
            there = points[other]
            longer = reduced(word, discs.crossings(here, there)) if move[0] else word
            if len(longer) > len(discs.rays) + _LETTERS:
                continue
            total, state = way + lengths[move], (other, longer)
            if total < distance.get(state, np.inf) - 1e-12:
                distance[state] = total
                came[state] = (cell, word)
                ahead = float(np.hypot(*(goal - there)))
                heapq.heappush(queue, (total + ahead, total, other, longer))
    return found


def _root(parent: list[int], i: int) -> int:
    while parent[i] != i:
        i = parent[i]
    return i


def _grid(discs: Discs, start: Array, goal: Array) -> tuple[Array, Array, Any]:
    """Abscissas, ordinates, and which cells are free, on a box with room to go around everything."""
    low = np.minimum(np.minimum(start, goal), np.min(discs.centers - discs.radii[:, None], axis=0))
    high = np.maximum(np.maximum(start, goal), np.max(discs.centers + discs.radii[:, None], axis=0))
    room = 0.15 * float(np.max(high - low))
    low, high = low - room, high + room
    step = float(np.max(high - low)) / _CELLS
    xs, ys = (np.arange(a, b + step, step) for a, b in zip(low, high, strict=True))
    points = np.stack(np.meshgrid(xs, ys, indexing="ij"), axis=-1)
    free = discs.clearance(points.reshape(-1, 2)).reshape(points.shape[:2]) > 0
    return xs, ys, free


def _cell(xs: Array, ys: Array, free: Any, point: Array) -> tuple[int, int] | None:
    """The free cell nearest to a point, if it is a neighbour."""
    i, j = int(np.argmin(np.abs(xs - point[0]))), int(np.argmin(np.abs(ys - point[1])))
    near = [
        (a, b)
        for a in range(max(0, i - 2), min(len(xs), i + 3))
        for b in range(max(0, j - 2), min(len(ys), j + 3))
        if free[a, b]
    ]
    return min(near, key=lambda c: (xs[c[0]] - point[0]) ** 2 + (ys[c[1]] - point[1]) ** 2, default=None)


def _traced(came: dict[Any, Any], state: Any, points: Array) -> Array:
    cells = []
    while state is not None:
        cells.append(state[0])
        state = came[state]
    return np.array([points[cell] for cell in reversed(cells)])


def _smoothed(discs: Discs, path: Array) -> Array:
    """Equidistant points of a shorter, smoother path of the same class: neighbours' means, pushed out of the discs."""
    points = resampled(path, _POINTS)
    margin = 0.02 * float(np.min(discs.radii))
    for number in range(_SMOOTHINGS):
        points[1:-1] += 0.5 * ((points[:-2] + points[2:]) / 2 - points[1:-1])
        away = points[1:-1, None] - discs.centers
        gap = np.linalg.norm(away, axis=2)
        inside = np.maximum(0.0, discs.radii + margin - gap) / np.maximum(gap, 1e-12)
        points[1:-1] += np.sum(inside[..., None] * away, axis=1)
        if number % 20 == 19:
            points = resampled(points, _POINTS)
    return points


def resampled(path: Array, count: int) -> Array:
    """(count, 2) points at equal distances along a path."""
    steps = np.linalg.norm(np.diff(path, axis=0), axis=1)
    way = np.concatenate([[0.0], np.cumsum(steps)])
    s = np.linspace(0, way[-1], count)
    return np.column_stack([np.interp(s, way, column) for column in path.T])


def planar_discs(obstacles: Sequence[Any]) -> Discs | None:
    """The discs among obstacles of the plane; None where there is none, or an obstacle of another kind."""
    balls = [each for each in obstacles if isinstance(each, Ball) and len(each.center) == 2]
    if not balls or len(balls) < len(obstacles):
        return None
    return Discs.of(
        np.array([each.center for each in balls], dtype=float), np.array([float(each.radius) for each in balls])
    )
