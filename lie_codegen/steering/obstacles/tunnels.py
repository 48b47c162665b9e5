"""Ways through walls: obstacles held at points of time alone let a fast step jump a thin place where two discs overlap.

The segment between the centres of two discs that overlap or touch lies in their union: a way that crosses it is a tunnel, however
fine or coarse the points on it are.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.steering.constraints import Ball


def tunnels(obstacles: Sequence[Any], X: Array) -> bool:
    """Whether the positions of X (k, 3, 3) cross the segment between the centres of two discs that overlap or touch."""
    discs = [each for each in obstacles if isinstance(each, Ball) and len(each.center) == 2]
    if len(discs) < 2:
        return False
    way = X[:, :2, 2]
    for one, two in combinations(discs, 2):
        a, b = np.asarray(one.center, dtype=float), np.asarray(two.center, dtype=float)
        if np.linalg.norm(a - b) <= (one.radius + two.radius) * (1 + 1e-9) and _crosses(way, a, b):
            return True
    return False


def _crosses(way: Array, a: Array, b: Array) -> bool:
    """Whether a polyline (k, 2) crosses the segment from a to b: each has ends on both sides of the other."""
    along = b - a
    side = along[0] * (way[:, 1] - a[1]) - along[1] * (way[:, 0] - a[0])
    step = np.diff(way, axis=0)
    from_a = step[:, 0] * (a[1] - way[:-1, 1]) - step[:, 1] * (a[0] - way[:-1, 0])
    from_b = step[:, 0] * (b[1] - way[:-1, 1]) - step[:, 1] * (b[0] - way[:-1, 0])
    return bool(np.any((side[:-1] * side[1:] <= 0) & (from_a * from_b <= 0) & (side[:-1] != side[1:])))
