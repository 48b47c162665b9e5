"""The true system under piecewise-linear controls, on a grid finer than their knots: what a solver's answer is checked by."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.flow.libraries import integrators
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.mechanics.driven import simulate_driven
from lie_codegen.steering.plan import Controls
from lie_codegen.steering.transcription.numbers import Numbers
from lie_codegen.values import Value

#: States a knot interval at which obstacles are checked.
FINE = 8
_TOLERANCE = 1e-11
_MOST = 1024


@dataclass(frozen=True)
class SimulatedPath:
    """A trajectory of the true system in units of the task's duration.

    Attributes:
        t: (k,) times.
        X: (k, d, d).
        xi: (k, n) body velocities.
    """

    t: Array
    X: Array
    xi: Array


def simulated_path(
    group: MatrixGroup,
    controls: tuple[int, ...],
    numbers: Numbers,
    v: Array,
    duration: float,
    fine: int = FINE,
    tolerance: float = _TOLERANCE,
) -> SimulatedPath:
    """The motion under v (N + 1, m) at the knots, linear between them, at `fine` times an interval; even."""
    t = np.linspace(0, duration, fine * (len(v) - 1) + 1)
    if numbers.dynamics is not None:
        force = piecewise_linear(group, controls, v, duration)
        run = simulate_driven(group, force, numbers.dynamics.inertia, t=t, xi0=numbers.dynamics.ends[0])
        return SimulatedPath(t, run.X, run.xi)
    velocities = np.tile(numbers.drift, (len(v), 1))
    velocities[:, list(controls)] += v
    parts, coarse = fine, _run(group, velocities, duration, fine // 2)[:: fine // 2]
    while True:
        states = _run(group, velocities, duration, parts)
        nodes = states[::parts]
        off = float(np.max(np.abs(nodes - coarse))) / 15
        if (off <= tolerance * max(1.0, float(np.max(np.abs(nodes))))) or parts >= _MOST or not np.isfinite(off):
            return SimulatedPath(t, states[:: parts // fine], _between(velocities, fine))
        parts, coarse = 2 * parts, nodes


def _run(group: MatrixGroup, velocities: Array, duration: float, parts: int) -> Array:
    """X at every step, `parts` steps an interval of RKMK4."""
    steps = parts * (len(velocities) - 1)
    u = _between(velocities, 2 * parts)
    h = np.full(steps, duration / steps)
    step = integrators(group).rkmk4_step
    start = np.eye(group.degree, dtype=complex if group.is_complex else float)
    u0, um, u1 = (np.ascontiguousarray(each) for each in (u[:-1:2], u[1::2], u[2::2]))
    return np.asarray(step.scan(start, n=steps, every=1, u0=u0, um=um, u1=u1, h=h))


def _between(values: Array, parts: int) -> Array:
    """Linear interpolation at `parts` equal steps an interval."""
    s = (np.arange(parts) / parts)[:, None]
    inner = (values[:-1, None] + s * np.diff(values, axis=0)[:, None]).reshape(-1, values.shape[1])
    return np.concatenate([inner, values[-1:]])


@dataclass(frozen=True, eq=False, repr=False)
class Lines(Value):
    """m controls that are linear between knots, set among n components."""

    n: int
    controls: tuple[int, ...]
    knots: Array
    values: Array

    def __call__(self, t: Array) -> Array:
        """(k,) times -> (k, n)."""
        u = np.zeros((len(t), self.n))
        for position, column in zip(self.controls, self.values.T, strict=True):
            u[:, position] = np.interp(t, self.knots, column)
        return u


def piecewise_linear(group: MatrixGroup, controls: tuple[int, ...], values: Array, duration: float) -> Controls:
    """u(t), (k,) times -> (k, n), linear between `values` (N + 1, m) at equidistant knots."""
    knots = np.linspace(0, duration, len(values))

    return Controls(Lines(group.dim, tuple(controls), knots, values), knots[1:-1])
