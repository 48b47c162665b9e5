"""Rows of `lie-codegen bench propagate` of our own alone: a long run, loops with another inertia and by fixed steps, single precision."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.benchmarks.loop_cases import START, loop_case, loop_error, states_of
from lie_codegen.benchmarks.propagate_peers import chain_input
from lie_codegen.control.attitude_law import attitude_law
from lie_codegen.control.closed_loop import closed_loop
from lie_codegen.flow.batched_exponential import expm
from lie_codegen.flow.simulate import simulate
from lie_codegen.groups.catalogue_load import group
from lie_codegen.signals.periodic_input import PeriodicInput

#: Qubits of a chain, and how many of them are driven at once.
_CHAINS = ((1, 4000), (2, 1000), (3, 200))
#: What is asked for in both precisions; floats are good for it over such durations.
_FLOATS = 1e-5
#: what, who, rtol, seconds, error, build.
Row = tuple[str, str, float, float, float, float]


def own_rows(say: Callable[[str], None]) -> Iterator[Row]:
    """One after the other."""
    say("a rotating field over 5e4")
    so3, field = group("so3"), PeriodicInput(("3*cos(t)/10", "3*sin(t)/10", "0"))
    yield timed(
        "so3, T = 5e4", 1e-11, lambda: simulate(so3, field, t=[0, 5e4], rtol=1e-11).X[-1], field_error, repeats=5
    )

    say("attitude loops with another inertia, and by fixed steps")
    tuned, case = attitude_law("pd", tunable=True), loop_case(10_000)
    t, bodies = np.linspace(0, 10, 101), case.inertia[:, :, None] * np.eye(3)
    given: dict[str, Any] = {"law": tuned, "X0": states_of(START, np.zeros(3))[:9].reshape(3, 3)}

    def one(inertia: Array) -> Array:
        gains = {"k_p": 4, "k_d": 6}
        run = closed_loop("so3", t=t, inertia=inertia, gains=gains, xi0=case.xi0[:1], rtol=1e-10, **given)
        return np.append(run.X[20, 0].ravel(), run.xi[20, 0])

    one(np.diag([3.0, 2, 3])[None])
    # The first call with this inertia after one with another: a compiler would show.
    yield timed("PD loop, another inertia", 1e-10, lambda: one(bodies[:1]), loop_error, repeats=20)
    gains = {"k_p": case.k_p, "k_d": case.k_d}

    def by_steps() -> Array:
        run = closed_loop("so3", t=case.t, inertia=bodies, gains=gains, xi0=case.xi0, step=0.02, **given)
        return np.append(run.X[1, 0].ravel(), run.xi[1, 0])

    yield timed("10,000 PD loops, 500 steps", 1e-6, by_steps, loop_error, repeats=2)
    say("many chains in double and in single precision")
    for qubits, members in _CHAINS:
        yield from precision_rows(qubits, members)


def precision_rows(qubits: int, members: int) -> Iterator[Row]:
    """Members of one chain, all that drives them scaled, in both precisions to what floats can do; errors against 1e-10 in doubles."""
    G, chain = chain_input(qubits)
    given: dict[str, Any] = {"t": [0, 50], "eps": np.linspace(0.2, 1, members)}
    exact = simulate(G, chain, rtol=1e-10, **given).X[-1]
    for precision in ("double", "single"):

        def run(precision: str = precision) -> Array:
            X: Array = simulate(G, chain, rtol=_FLOATS, precision=precision, **given).X[-1]
            return X

        def error(X: Array) -> float:
            return float(np.max(np.abs(X - exact)))

        title = f"{members:,} x SU({2**qubits}), {precision}"
        yield timed(title, _FLOATS, run, error, repeats=5)


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
