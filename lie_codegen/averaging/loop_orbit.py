"""Periodic orbits of closed loops on matrix groups: multipliers in the left-trivialised tangent space."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lie_codegen.arrays import Array
from lie_codegen.averaging.orbit_newton import Linearised, OrbitSystem, found_orbit
from lie_codegen.control.loop_flow import loop_flow
from lie_codegen.control.loop_rate import columns, has_rate, loop_settle, moves_of
from lie_codegen.control.loop_result import ClosedLoop, making_of
from lie_codegen.errors import InputError
from lie_codegen.groups.build import build
from lie_codegen.kernel.saved import Saved


@dataclass(frozen=True, eq=False, repr=False)
class LoopOrbit(Linearised, Saved):
    """A periodic motion of a closed loop and its linearisation over a period, X exp(hat(eta)) beside X.

    Attributes:
        X: (d, d) the configuration at t0.
        xi: (n,) the velocity there, as `ClosedLoop.xi`; empty where the law commands it.
        states: of the law, by name.
        t0: the time of the reference, the law and the disturbance at which the period begins.
        period: T.
        multipliers: (k,) eigenvalues of the monodromy matrix, largest modulus first; of an autonomous loop one of them is 1.
        exponents: (k,) their logarithms over T, imaginary parts in (-pi/T, pi/T].
        monodromy: (k, k) over a period, in (eta, the change of xi, the law's own vectors).
        autonomous: whether nothing in the loop depends on time, so that T was found too.
        residual: distance of the entries of the state after a period from those at the start.
    """

    X: Array
    xi: Array
    states: dict[str, Array]
    t0: float
    period: float
    multipliers: NDArray[np.complex128]
    exponents: NDArray[np.complex128]
    monodromy: Array
    autonomous: bool
    residual: float


def loop_orbit(run: ClosedLoop, period: Any, transient: bool) -> LoopOrbit:
    """The periodic orbit near the end of a run.

    Raises:
        InputError: several loops, a sampled one, one with a state that jumps, or none on a matrix group; a loop that was loaded.
        PeriodError, ComputationError: as `lc.floquet`.
    """
    made = making_of(run, "floquet")
    loop = made.run.loop
    if made.run.many:
        raise InputError("floquet: many loops were run at once; run the one alone")
    if made.run.sample or not has_rate(loop):
        raise InputError(
            "floquet: only of a loop that acts continuously on a matrix group, without an observer: this one is sampled, has a "
            "state that jumps, or its mechanism is not on a group (lc.loop_margins is for sampled loops)"
        )
    ranks = {port.name: len(port.shape) for port in loop.number_ports(noisy=False)}
    numbers = {n: v[0] if np.ndim(v) > ranks[n] else v for n, v in made.run.numbers.items() if n in ranks}
    library = build((*loop_flow(loop, made.reference), loop_settle(loop)))
    elements, vectors = columns(loop)
    turns = sum(move.group.dim for move in moves_of(loop))

    def moved(y: Array, d: Array) -> Array:
        after = y.copy()
        after[elements] = library.loop_settle(y[elements], d[:turns])
        after[vectors] += d[turns:]
        return after

    own = [np.asarray(run.states[each.port.name][-1]) for each in loop.own_ports]
    end = loop.plant.starts(run.X[-1], run.xi[-1] if loop.plant.order == 2 else None)[0][0]
    start = np.concatenate(
        [end, *(_entries(loop, each, value) for each, value in zip(loop.own_ports, own, strict=True))]
    )
    system = OrbitSystem(
        library, "state", len(start), numbers, float(run.t[-1]), lambda y: np.asarray(library.tangent(y)), moved
    )
    driven = _is_driven(system, start)
    start, length, residual, monodromy, logs = found_orbit(system, start, period, driven, None, transient)
    X, xi = loop.plant.split(start)
    place, states = sum(loop.plant.sizes[:2]), {}
    for each, value in zip(loop.own_ports, own, strict=True):
        size = loop.own_size(each.port)
        found = start[place : place + size]
        states[each.port.name] = loop.plant.split(found)[0] if each.kind == "group" else found.reshape(value.shape)
        place += size
    return LoopOrbit(
        X, xi, states, system.begin, length, np.exp(logs), logs / length, monodromy, not driven, residual
    )  # fmt: skip


def _entries(loop: Any, each: Any, value: Array) -> Array:
    """A state of the law as it stands in the state of the loop."""
    return np.asarray(
        loop.plant.starts(value, None)[0][0, : loop.own_size(each.port)] if each.kind == "group" else value.ravel()
    )


def _is_driven(system: OrbitSystem, start: Array) -> bool:
    """Whether the rate at one state depends on time: looked at, for a law of one's own may hide it."""
    rates = [system.rate(start, t) for t in (0.0, 0.371, 1.93, 7.11)]
    return any(not np.allclose(rate, rates[0], rtol=1e-12, atol=1e-13) for rate in rates[1:])
