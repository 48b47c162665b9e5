"""Least time of cars, beside closed forms: Dubins' six words, and Reeds and Shepp's by rsplan where it is installed.

A closed form answers one question in microseconds and says how long the shortest way is; ours finds the same without knowing the
words. A target is solved where the way ends there and is as short as the shortest that anybody found.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.errors import SteeringError
from lie_codegen.groups.catalogue_load import group
from lie_codegen.steering.direct.method import direct

Pose = tuple[float, float, float]
_SHORTEST = 1e-6
#: Reeds and Shepp's car turns at a rate bounded by its speed: the control vectors (omega, v) of its arcs.
_REEDS_SHEPP = [(1, 1), (0, 1), (-1, 1), (1, -1), (0, -1), (-1, -1)]


@dataclass(frozen=True)
class Timed:
    """Durations found and the seconds that took, a target each."""

    durations: list[float]
    seconds: list[float]

    def solved(self, shortest: Array) -> int:
        """Targets whose duration is the shortest."""
        return int(np.sum(np.array(self.durations) <= shortest * (1 + _SHORTEST)))


def least_times(car: str, targets: int, seed: int) -> dict[str, Timed | str]:
    """Solver -> what it found of one of `CARS`, or why it did not take part; ours first."""
    rng = np.random.default_rng(seed)
    low, high = (-3, -3, -np.pi), (3, 3, np.pi)
    poses = [(float(x), float(y), float(angle)) for x, y, angle in rng.uniform(low, high, (targets, 3))]
    found: dict[str, Timed | str] = {}
    for name, make in CARS[car].items():
        try:
            found[name] = _timed(make(), poses)
        except ImportError as error:
            found[name] = f"not installed: {error.name}"
    return found


def _timed(solve: Callable[[Pose], float], poses: list[Pose]) -> Timed:
    solve(poses[0])  # compiled, imported
    durations, seconds = [], []
    for pose in poses:
        began = time.perf_counter()
        durations.append(solve(pose))
        seconds.append(time.perf_counter() - began)
    return Timed(durations, seconds)


def _ours(controls: tuple[str, ...], **options: Any) -> Callable[[Pose], float]:
    se2 = group("se2")

    def solve(pose: Pose) -> float:
        x, y, angle = pose
        c, s = np.cos(angle), np.sin(angle)
        try:
            plan = direct(
                se2, np.array([[c, -s, x], [s, c, y], [0, 0, 1]]), controls, 5.0, objective="time", bounds=1, **options
            )
        except SteeringError:
            return np.inf
        return plan.duration if plan.error < _SHORTEST else np.inf

    return solve


def dubins(pose: Pose) -> float:
    """Length of the shortest way forwards of curvature at most one: LSL, RSR, LSR, RSL, LRL, RLR (Dubins, Amer. J. Math. 79 (1957) 497).

    With turning circles about s = (0, e) and p + f (-sin, cos), e, f = +-1 for left and right, their distance tells the headings of the
    tangent, or of the circle that touches both.
    """
    x, y, angle = pose
    best = np.inf
    for first, last in product((1, -1), repeat=2):
        gap = np.array([x - last * np.sin(angle), y + last * np.cos(angle) - first])
        away, heading = float(np.hypot(*gap)), float(np.arctan2(gap[1], gap[0]))
        if first == last:
            best = min(best, _turn(first, 0.0, heading) + away + _turn(first, heading, angle))
            if away <= 4:
                for side in (1, -1):
                    # headings where the middle circle touches: a quarter turn on from the directions of its centre
                    tilt = side * np.arccos(away / 4)
                    one, two = heading + tilt + first * np.pi / 2, heading + np.pi - tilt + first * np.pi / 2
                    best = min(best, _turn(first, 0.0, one) + _turn(-first, one, two) + _turn(first, two, angle))
        elif away >= 2:
            straight = np.sqrt(away**2 - 4)
            middle = heading + first * np.arctan2(2, straight)
            best = min(best, _turn(first, 0.0, middle) + straight + _turn(last, middle, angle))
    return float(best)


def _turn(sign: int, a: float, b: float) -> float:
    """Length of the turn from heading a to b, to the left where the sign is 1."""
    return float(sign * (b - a) % (2 * np.pi))


def _reeds_shepp() -> Callable[[Pose], float]:
    """By rsplan's formulas.

    Raises:
        ImportError: rsplan is not installed.
    """
    from rsplan import planner  # type: ignore[import-not-found]

    def solve(pose: Pose) -> float:
        # points of the way are a metre apart: the length alone is asked for
        way = planner.path((0.0, 0.0, 0.0), pose, 1.0, 0.0, 1.0, length_tolerance=0.0)
        return float(sum(abs(segment.length) for segment in way.segments))

    return solve


#: {task: {solver: what makes it}}.
CARS: dict[str, dict[str, Callable[[], Callable[[Pose], float]]]] = {
    "Dubins' car, least time": {
        "lie_codegen, least time": lambda: _ours(("omega",), drift=(0, 1, 0)),
        "closed form, six words": lambda: dubins,
    },
    "Reeds and Shepp's car, least time": {
        "lie_codegen, least time": lambda: _ours(("omega", "vx"), vertices=_REEDS_SHEPP),
        "closed form, rsplan": _reeds_shepp,
    },
}
