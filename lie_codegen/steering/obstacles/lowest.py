"""The least clearance along a way that is known at some states only."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from lie_codegen.arrays import Array

#: Steps of the golden section, to 1e-7 of the distance of two states.
_SECTIONS = 34
_GOLDEN = (np.sqrt(5.0) - 1) / 2


def lowest(gap: Callable[[Array], Array], X: Array) -> float:
    """Least gap along the way through states X (k, d, d), between them too.

    Beside each local minimum of the looks, an end too, the states are on the parabola through it and its neighbours, and the gap there is searched
    by golden sections, once on either side. A gap is no parabola itself: past the edge of a box it falls and rises as |t| does.
    A dip is at most as deep as the higher neighbour is high, so that most minima need no search.
    """
    looks = gap(X)
    before, after = np.append(looks[:1], looks[:-1]), np.append(looks[1:], looks[-1:])
    deep = np.maximum(before, after) - looks
    least = float(np.min(looks))
    k = np.flatnonzero((looks <= before) & (looks <= after) & (looks - deep < least))
    if not len(k) or len(X) < 3:
        return least
    k = np.clip(k, 1, len(X) - 2)
    ends = (X[k - 1], X[k], X[k + 1])

    def at(s: Array) -> Array:
        a, b, c = (weight[:, None, None] for weight in (s * (s - 1) / 2, 1 - s * s, s * (s + 1) / 2))
        return gap(a * ends[0] + b * ends[1] + c * ends[2])

    for side in (-1.0, 0.0):
        low, high = np.full(len(k), side), np.full(len(k), side + 1)
        for _ in range(_SECTIONS):
            s, t = high - _GOLDEN * (high - low), low + _GOLDEN * (high - low)
            at_s, at_t = at(s), at(t)
            least = min(least, float(np.min(at_s)), float(np.min(at_t)))
            left = at_s < at_t
            low, high = np.where(left, low, s), np.where(left, t, high)
    return least
