"""Between the variables of the program and what they stand for."""

from __future__ import annotations

from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.groups.maps.packed_arrays import packed_elements
from lie_codegen.steering.transcription.numbers import Numbers
from lie_codegen.steering.transcription.structure import Structure

_RELAXED = 1.05e-8
#: Most of a free motion in one solve: its exponential is a short polynomial, and the goal moves along afterwards.
_FREE = 1.0


def unpack_elements(structure: Structure, packed: Array, *, of_difference: bool = False) -> Array:
    """(k, size) packed elements, or differences of such, as (k, d, d) matrices."""
    group = structure.group
    d = group.degree
    flat = np.tile((0 if of_difference else 1) * np.eye(d).ravel(), (len(packed), 1))
    entries = np.ascontiguousarray(packed)
    values = entries.view(complex) if group.is_complex else entries
    flat = flat.astype(values.dtype)
    flat[:, list(structure.positions)] = values
    return flat.reshape(-1, d, d)


def unpacked(structure: Structure, solution: Array) -> tuple[Array, float]:
    """(N + 1, m) controls and the duration of a solution."""
    stages, _ = stages_of(structure, solution)
    first, last = structure.variable_ranges["v"]
    duration = float(stages[0, structure.variable_ranges["s"][0]]) if structure.free_time else 1.0
    return stages[:, first:last], duration


def free_motion(structure: Structure, solution: Array) -> Array:
    """(k,) h of a solution: how far along the goal's free directions it ends."""
    first, last = structure.variable_ranges["h"]
    return stages_of(structure, solution)[0][-1, first:last]


def at_rest(structure: Structure, solution: Array) -> Array:
    """The solution with h = 0, for a target that was moved by h."""
    table = np.zeros((structure.intervals + 1) * structure.width)
    table[: structure.variables] = solution
    first, last = structure.variable_ranges["h"]
    table.reshape(-1, structure.width)[:, first:last] = 0
    return table[: structure.variables]


def joined(structure: Structure, states: Array, xi: Array | None, v: Array, scale: float) -> Array:
    """All variables from X (N + 1, d, d), xi, v at the nodes and the duration."""
    size, N = structure.size, structure.intervals
    table = np.zeros((N + 1, structure.width))
    flat = np.ascontiguousarray(states.reshape(N + 1, -1)[:, list(structure.positions)])
    table[:, :size] = flat.view(float)
    for name, values in (("xi", xi), ("v", v), ("s", np.full((N + 1, 1), scale))):
        first, last = structure.variable_ranges[name]
        if last > first and values is not None:
            table[:, first:last] = values
    first, last = structure.variable_ranges["r"]
    table[:-1, first:last] = np.diff(v, axis=0)
    return table.ravel()[: structure.variables]


def stages_of(structure: Structure, solution: Array) -> tuple[Array, Array]:
    """(N + 1, stage) variables without r, and (N, m) r."""
    padded = np.concatenate([solution, np.zeros(structure.width - structure.stage)])
    table = padded.reshape(structure.intervals + 1, structure.width)
    return table[:, : structure.stage], table[:-1, structure.stage :]


def variable_limits(structure: Structure, numbers: Numbers, end_velocity: Array) -> tuple[Array, Array]:
    """Lower and upper limits of all variables."""
    N, ranges, second = structure.intervals, structure.variable_ranges, numbers.dynamics
    low = np.full((N + 1, structure.width), -np.inf)
    high = np.full((N + 1, structure.width), np.inf)

    def limit(name: str, nodes: Any, between: tuple[Any, Any]) -> None:
        first, last = ranges[name]
        low[nodes, first:last], high[nodes, first:last] = between

    identity = packed_elements(structure.group, np.eye(structure.group.degree))
    limit("X", 0, (identity, identity))
    if second is not None:
        limit("xi", slice(None), second.speeds)
        limit("xi", 0, (second.ends[0], second.ends[0]))
        limit("xi", N, (end_velocity, end_velocity))
    limit("v", slice(None), numbers.bounds)
    limit("h", slice(None), (-_FREE, _FREE))
    if numbers.rest:
        limit("v", [0, N], (0.0, 0.0))
    if structure.free_time:
        limit("s", slice(None), (1e-3, numbers.longest))
    else:
        limit("r", slice(None), (numbers.rates[0] / N, numbers.rates[1] / N))
    return low.ravel()[: structure.variables], high.ravel()[: structure.variables]


def tightened(low: Array, high: Array) -> tuple[Array, Array]:
    """Limits tighter by as much as fatrop relaxes them."""
    wide = high - low > 1e-6
    below, above = (
        np.where(wide & np.isfinite(each), _RELAXED * np.maximum(1.0, np.abs(each)), 0.0) for each in (low, high)
    )
    return low + below, high - above
