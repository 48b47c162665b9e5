"""What controls and drift can reach at all: the brackets of both must fill the algebra, or the directions that the goal asks for."""

from __future__ import annotations

from functools import lru_cache, partial

import numpy as np

from lie_codegen.algebra.brackets import bracket
from lie_codegen.arrays import Array
from lie_codegen.errors import UncontrollableError
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.steering.accessibility import closure, independent
from lie_codegen.steering.direct.system import System
from lie_codegen.steering.end import End

_SAMPLES = 7


def require_reach(system: System, duration: float, end: End) -> None:
    """Nothing, if brackets of controls and drift, with the motions the goal leaves free, fill the algebra.

    The test is made on directions at a few times, so that controls that turn count as all they turn through. Goals that prescribe
    a part of X alone (a line of sight, a position) are not refused: less than the algebra may do.

    Raises:
        UncontrollableError: with the dimensions reached.
    """
    group = system.group
    t = np.linspace(0.0, duration, 1 if system.steady else _SAMPLES)
    rows = [system.directions_at(t).reshape(-1, group.dim), system.drift.at(t)]
    filled = _filled(group, np.vstack(rows).tobytes())
    if len(filled) == group.dim or end.elements is None or len(end.before) or len(end.after):
        return
    missing = np.eye(group.dim) - filled.T @ filled
    names = [label for label, row in zip(group.labels, missing, strict=True) if np.linalg.norm(row) > 1e-9]
    helped = ", even with the drift" if np.any(system.drift.at(t)) else ""
    raise UncontrollableError(
        f"steer({group.name}): not controllable{helped}: the brackets of {', '.join(system.labels)} fill {len(filled)} of "
        f"{group.dim} dimensions; nothing moves along {', '.join(names)}; add a control in a missing direction"
    )


@lru_cache(maxsize=64)
def _filled(group: MatrixGroup, rows: bytes) -> Array:
    """Orthonormal rows of what the brackets of velocities (k, n) fill: the same for every target of a system."""
    first = independent(np.frombuffer(rows).reshape(-1, group.dim))
    return closure(first, partial(bracket, group.algebra), independent)
