"""Roots of many functions at once between bracketing points: Chandrupatla, Adv. Eng. Software 28 (1997) 145."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from lie_codegen.arrays import Array

_MOST_ITERATIONS = 80


def roots(f: Callable[[Array, NDArray[np.intp]], Array], a: Array, b: Array) -> Array:
    """(k,) x_i between a_i and b_i with f_i(x_i) = 0, to two units in the last place.

    Inverse quadratic interpolation where the three last points say that it is safe, else bisection: never more than
    twice as many steps as bisection alone.

    Args:
        f: ((m,) arguments, (m,) which function each belongs to) -> (m,) values.
        a, b: (k,) with f_i of different sign, or zero.
    """
    every = np.arange(len(a))
    x1, x2 = np.array(b, dtype=float), np.array(a, dtype=float)
    if not len(every):
        return x1
    f1, f2 = np.array(f(x1, every)), np.array(f(x2, every))
    x3, f3 = x2.copy(), f2.copy()
    t = np.full(len(x1), 0.5)
    best = np.where(np.abs(f1) < np.abs(f2), x1, x2)
    left = every[(f1 != 0) & (f2 != 0)]
    for _ in range(_MOST_ITERATIONS):
        if not len(left):
            break
        k = left
        x = x1[k] + t[k] * (x2[k] - x1[k])
        value = f(x, k)
        # x1 becomes the newest point, x2 stays beyond the root from it, and x3 is the one that this step left behind
        same = np.sign(value) == np.sign(f1[k])
        x3[k], f3[k] = np.where(same, x1[k], x2[k]), np.where(same, f1[k], f2[k])
        x2[k], f2[k] = np.where(same, x2[k], x1[k]), np.where(same, f2[k], f1[k])
        x1[k], f1[k] = x, value
        best[k] = np.where(np.abs(f1[k]) < np.abs(f2[k]), x1[k], x2[k])
        width = np.abs(x2[k] - x1[k])
        tight = 2 * np.spacing(np.abs(best[k]))
        on = (value != 0) & (width > 2 * tight)
        with np.errstate(all="ignore"):
            limit = tight / width
            xi, phi = (x1[k] - x2[k]) / (x3[k] - x2[k]), (f1[k] - f2[k]) / (f3[k] - f2[k])
            # where this holds the inverse parabola through the three points is monotone between x1 and x2, and its value lies there
            safe = (phi**2 < xi) & ((1 - phi) ** 2 < 1 - xi)
            quadratic = f1[k] / (f2[k] - f1[k]) * f3[k] / (f2[k] - f3[k]) + (x3[k] - x1[k]) / (x2[k] - x1[k]) * f1[
                k
            ] / (f3[k] - f1[k]) * f2[k] / (f3[k] - f2[k])
        # a step of at least the tolerance: a root that is nearer is passed by it, and then lies between x1 and x2 that close
        t[k] = np.clip(np.where(safe & np.isfinite(quadratic), quadratic, 0.5), limit, 1 - limit)
        left = k[on]
    return best
