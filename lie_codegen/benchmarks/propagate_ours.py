"""Rows of `lie-codegen bench propagate` of our own alone: a long run, and loops of second order."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.flow.batched_exponential import expm
from lie_codegen.flow.simulate import simulate
from lie_codegen.groups.catalogue_load import group
from lie_codegen.signals.periodic_input import PeriodicInput

#: what, who, rtol, seconds, error, build.
Row = tuple[str, str, float, float, float, float]


def own_rows(say: Callable[[str], None]) -> Iterator[Row]:
    """One after the other."""
    say("a rotating field over 5e4")
    so3, field = group("so3"), PeriodicInput(("3*cos(t)/10", "3*sin(t)/10", "0"))
    yield timed(
        "so3, T = 5e4", 1e-11, lambda: simulate(so3, field, t=[0, 5e4], rtol=1e-11).X[-1], field_error, repeats=5
    )


def timed(what: str, rtol: float, call: Callable[[], Array], error: Callable[[Array], float], repeats: int) -> Row:
    """The first call, then the least of several."""
    start = time.process_time()
    found = call()
    first, least = time.process_time() - start, float("inf")
    for _ in range(repeats):
        start = time.process_time()
        call()
        least = min(least, time.process_time() - start)
    return what, "lie_codegen", rtol, least, error(found), max(0.0, first - least)


def field_error(X: Array) -> float:
    """X(T) = exp(T (0.3 e_1 + e_3)^) exp(-T e_3^) at T = 5e4, the angles reduced in extended precision."""
    so3, T = group("so3"), np.longdouble(5e4)
    turn = 2 * np.longdouble("3.14159265358979323846264338328")
    rate = np.sqrt(np.longdouble("1.09"))
    axis = np.array([0.3, 0, 1]) / np.sqrt(1.09)
    angles = float(np.fmod(T * rate, turn)), float(np.fmod(T, turn))
    exact = expm(so3.hat(axis * angles[0])[None])[0] @ expm(so3.hat([0, 0, -angles[1]])[None])[0]
    return float(np.max(np.abs(X - exact)))
