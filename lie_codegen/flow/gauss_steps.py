"""X' = X hat(xi), y' = F(t, X, y) by Gauss collocation of order 6 in compiled loops."""

from __future__ import annotations

import ctypes

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.errors import ComputationError
from lie_codegen.flow.pair_library import LOST, STUCK, compiled_pair
from lie_codegen.flow.pair_system import System

#: Steps in one call of compiled code, after which Python looks whether somebody pressed Ctrl-C.
_BLOCK = 20_000


def gauss(system: System, X0: Array, y0: Array, times: Array, parts: int, where: str) -> tuple[Array, Array]:
    """(k, packed) and (k, size) states of one member by Gauss collocation of order 6, `parts` equal steps between equally spaced times.

    Quadratic invariants of y, as the energy and the momentum of a free body, are kept to rounding over any number of steps; so
    is the reversibility of the motion within a step. The stages are found by iteration, which asks for steps short beside the
    fastest rate.

    Raises:
        ComputationError: a step is too long for the iteration or for the exponential, or a state is no longer finite.
    """
    given = system.record()
    X, y = np.array(X0, dtype=float), np.array(y0, dtype=float)
    k = len(times)
    X_out, y_out = np.empty((k, system.packed)), np.empty((k, system.size))
    X_out[0], y_out[0] = X, y
    work = system.work()
    h = float(times[-1] - times[0]) / ((k - 1) * parts)
    given.h, given.work = h, work.ctypes.data
    given.X, given.y = X.ctypes.data, y.ctypes.data
    library = compiled_pair()
    library.pair_lift(ctypes.addressof(given))
    block = max(1, _BLOCK // parts)
    for first in range(0, k - 1, block):
        spans = min(block, k - 1 - first)
        given.t, given.next = float(times[0]) + first * parts * h, 0
        given.X_out, given.y_out = X_out[first + 1 :].ctypes.data, y_out[first + 1 :].ctypes.data
        status = library.gauss_run(ctypes.addressof(given), spans, parts)
        if status == LOST:
            raise ComputationError(f"{where}: the state is no longer finite behind t = {given.t:.9g}")
        if status == STUCK:
            raise ComputationError(f"{where}: the step {h:.3g} is too long at t = {given.t:.9g}; take a shorter one")
    return X_out, y_out
