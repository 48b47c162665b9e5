"""Rows of `lie-codegen bench propagate` of our own alone: a long run, and loops of second order."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.control.attitude_law import attitude_law
from lie_codegen.control.closed_loop import closed_loop
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

    say("an attitude loop, once and 10,000 times")
    fixed = attitude_law("pd", inertia=(1, 2, 3), k_p=4, k_d=6)
    tuned = attitude_law("pd", tunable=True)
    t = np.linspace(0, 10, 101)
    start: dict[str, Any] = {"X0": _TURNED, "xi0": [1.0, 0.5, -0.2], "t": t}

    def loop() -> Array:
        run = closed_loop("so3", law=fixed, inertia=(1, 2, 3), rtol=1e-10, **start)
        return np.append(run.X[20].ravel(), run.xi[20])

    yield timed("PD loop", 1e-10, loop, loop_error, repeats=20)
    closed_loop("so3", law=tuned, inertia=np.diag([3.0, 2, 3])[None], gains={"k_p": 4, "k_d": 6}, rtol=1e-10, **start)

    def another() -> Array:
        run = closed_loop(
            "so3", law=tuned, inertia=np.diag([1.0, 2, 3])[None], gains={"k_p": 4, "k_d": 6}, rtol=1e-10, **start
        )
        return np.append(run.X[20, 0].ravel(), run.xi[20, 0])

    # The first call with this inertia after one with another: a compiler would show.
    yield timed("PD loop, another inertia", 1e-10, another, loop_error, repeats=20)
    rng, N = np.random.default_rng(0), 10_000
    inertias = np.array([np.diag(row) for row in rng.uniform(1, 3, (N, 3))])
    inertias[0] = np.diag([1.0, 2, 3])
    k_p, k_d, xi0 = rng.uniform(2, 6, N), rng.uniform(3, 6, N), rng.normal(size=(N, 3))
    k_p[0], k_d[0], xi0[0] = 4, 6, start["xi0"]
    many: dict[str, Any] = {
        "law": tuned,
        "inertia": inertias,
        "gains": {"k_p": k_p, "k_d": k_d},
        "X0": _TURNED,
        "xi0": xi0,
    }
    some = np.linspace(0, 10, 6)

    def by_steps() -> Array:
        run = closed_loop("so3", t=some, step=0.02, **many)
        return np.append(run.X[1, 0].ravel(), run.xi[1, 0])

    def by_tolerance() -> Array:
        run = closed_loop("so3", t=some, rtol=1e-8, **many)
        return np.append(run.X[1, 0].ravel(), run.xi[1, 0])

    yield timed("10,000 PD loops, 500 steps", 1e-6, by_steps, loop_error, repeats=2)
    yield timed("10,000 PD loops, rtol", 1e-8, by_tolerance, loop_error, repeats=2)


#: The rotation of the quaternion (2, 1, 2, 4)/5, and the attitude loop's X and xi after two seconds: DOP853 and Radau of scipy agree in
#: these digits.
_TURNED = np.array([[-15.0, -12, 16], [20, -9, 12], [0, 20, 15]]) / 25
_AFTER_TWO = np.array([
    0.8213720837312, -0.4561583396303, 0.3424433810906, 0.4926589186552, 0.8699217275695, -0.0228774511663, -0.2874631975341,
    0.1874986855636, 0.9392598963947, -0.0881757214376, -0.3041266645566, -0.5503909575072,
])  # fmt: skip


def loop_error(state: Array) -> float:
    """Of X and xi at t = 2."""
    return float(np.max(np.abs(state - _AFTER_TWO)))


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
