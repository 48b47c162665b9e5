"""Averages over the phase of a torque-free motion by the trapezoid rule."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.errors import ComputationError
from lie_codegen.kernel.elliptic import nome

_MOST_NODES = 8192


def nodes_for(k: float, tolerance: float = 1e-16) -> int:
    """Phases the trapezoid rule needs at modulus k: Fourier coefficients fall like nome^(m/2).

    The count has room for products of several elliptic functions, whose poles in the complex plane are multiple.
    """
    q = nome(k)
    if q == 0:
        return 16
    return max(16, 8 * math.ceil((2 * math.log(tolerance) / math.log(q) + 12) / 8))


def phase_means(
    functions: Callable[[Array], Array], Omega: Array, k: ArrayLike, tolerance: float, nodes: int | None
) -> Array:
    """(3, ...) means over phi of F_Omega, F_k and G.

    Args:
        functions: (N,) phases -> (3, ..., N).
        Omega: (...) spins, the scale of F_Omega.
        k: moduli, whose largest says how many phases to begin with.
        tolerance: of the means, relative to the size of the functions.
        nodes: number of phases; None doubles them until half of them give the same means.

    Raises:
        ComputationError: the means do not converge, for functions with corners.
    """
    count = nodes or nodes_for(float(np.max(np.asarray(k, dtype=np.float64))))
    while True:
        values = functions(np.arange(count) / count)
        means = values.mean(axis=-1)
        # Every second phase is the rule with half as many, whose error is by far the larger of the two: it bounds that of the means.
        error = np.abs(means - values[..., ::2].mean(axis=-1))
        sizes = np.abs(values).mean(axis=-1)
        # One rate [1/s] for all three: F_k and G may vanish where F_Omega does not, and are no more exact than it.
        rate = np.max([sizes[0] / Omega, sizes[1], sizes[2]], axis=0)
        scale = np.stack([rate * Omega, rate, rate])
        if nodes or bool(np.all(error <= tolerance * scale + 1e-300)):
            return np.asarray(means)
        count *= 2
        if count > _MOST_NODES:
            raise ComputationError(
                f"the averages over phi have converged to {float(np.max(error / (scale + 1e-300))):.1e} with "
                f"{_MOST_NODES} phases, not to {tolerance:.1e}: the perturbation is not smooth (abs?); "
                "give a larger tolerance"
            )
