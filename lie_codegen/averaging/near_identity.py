"""From osculating to mean variables and back: x = y + eps W(y, psi), phi = psi + eps V(y, psi), solved for (y, psi)."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from lie_codegen.arrays import Array

#: (y (n,), psi) -> (W (n,), V).
Map = Callable[[Array, float], tuple[Array, Any]]
_STEPS, _CLOSE = 200, 4e-15
#: eps |dW/dy| beyond which the map is no change of variables that averaging may rely on.
LARGEST_SLOPE = 0.5
TOO_LARGE = "eps is too large for the map to mean variables (eps |dW/dy| = {:.3g} > 1/2): started at first order"
GOOD = "ok"


def to_mean(
    maps: Map, x: Array, phi: float, eps: float, inside: Callable[[Array], Array] = lambda y: y
) -> tuple[Array, float, str]:
    """(y, psi, status) of an osculating (x, phi).

    Half steps of the fixed point: undamped it falls into a cycle of two where eps |dW/dy| comes near 1.

    Args:
        maps: W and V.
        x, phi: the osculating variables.
        eps: the small number.
        inside: brings y back into the domain of the map at each step.
    """
    W, V = maps(x, phi)
    simple = inside(x - eps * W), phi - eps * float(V)
    y, psi = simple
    for _ in range(_STEPS):
        W, V = maps(y, psi)
        move, turn = x - eps * W - y, phi - eps * float(V) - psi
        y, psi = inside(y + move / 2), psi + turn / 2
        if max(float(np.max(np.abs(move))), abs(turn)) <= _CLOSE * max(1.0, float(np.max(np.abs(x)))):
            break
    slope = eps * steepness(maps, y, psi, inside)
    # a difference that is not finite is no small one
    return (y, psi, GOOD) if slope <= LARGEST_SLOPE else (*simple, TOO_LARGE.format(slope))


def steepness(maps: Map, y: Array, psi: float, inside: Callable[[Array], Array] = lambda y: y) -> float:
    """|dW/dy|, the largest stretch, by central differences."""
    columns = []
    for i in range(len(y)):
        step = np.zeros(len(y))
        step[i] = 1e-5 * max(abs(y[i]), 1e-2)
        above, below = inside(y + step), inside(y - step)
        columns.append((maps(above, psi)[0] - maps(below, psi)[0]) / (above[i] - below[i]))
    matrix = np.stack(columns, axis=1)
    return float(np.linalg.norm(matrix, 2)) if np.all(np.isfinite(matrix)) else float("nan")
