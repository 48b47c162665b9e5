"""Minimum-energy steering of any controllable left-invariant system by direct multiple shooting.

    minimise int_0^T |u|^2 dt   subject to   X' = X sum_i u_i A_i,  X(0) = I,  X(T) = target

Controls are continuous and linear on each of N intervals; a step is X_{k+1} = X_k exp(Theta_k),
    Theta = h (a + b) / 2 + h^2 / 12 [a, b],   a, b the controls at its ends,
exact on the group and of fourth order (Magnus, for a linear control). The cost of the discretised problem exceeds the
continuum by O(h^4). The problem is built once for a group, its controls and N; targets are parameters.
"""

from __future__ import annotations

import operator
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from lie_codegen.errors import InputError, SteeringError
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernels.complex_scalar import Complex
from lie_codegen.kernels.kernel import Kernel, Port
from lie_codegen.kernels.rkmk import bracket_body, times_taylor_exp
from lie_codegen.lowering.casadi_arithmetic import function_of
from lie_codegen.simulation.libraries import integrators
from lie_codegen.steering.finish import finish
from lie_codegen.steering.plan import Controls, Plan, Status
from lie_codegen.steering.seeds import seeds
from lie_codegen.steering.task import Task

Array = NDArray[Any]

_EXPONENTIAL_DEGREE = 9
_LARGE_STEP = 600
_SEED = 5


@dataclass(frozen=True)
class _Candidate:
    cost: float
    controls: Array
    converged: bool
    iterations: int


def least_energy(
    task: Task,
    *,
    weights: Array | None = None,
    tried: tuple[str, ...] = (),
    intervals: int = 64,
    starts: int = 4,
    progress: Callable[[str], None] | None = None,
) -> Plan:
    """The minimum-energy manoeuvre, the best of several starts from the area rule.

    Args:
        task: the task.
        intervals: N, pieces of the control.
        starts: number of first guesses tried.
        progress: called with one line a start.

    Raises:
        InputError: intervals below 4 or starts below 1.
        SteeringError: if no start converges to the target.
    """
    for name, value, least in (("intervals", intervals, 4), ("starts", starts, 1)):
        if operator.index(value) < least:
            raise InputError(f"steer({task.group.name}): {name} must be at least {least}, got {value}")
    started = time.perf_counter()
    solver = _solver(task.group, task.controls, intervals)
    built = time.perf_counter()
    s = np.linspace(0, 1, intervals + 1)
    candidates = []
    for number, guess in enumerate(seeds(task, s, starts), start=1):
        candidate = _solve(task, solver, guess)
        candidates.append(candidate)
        if progress is not None:
            how = "converged" if candidate.converged else "not converged"
            progress(f"start {number} of {starts}: {how}, energy {candidate.cost / task.duration:.6g}")
    good = [candidate for candidate in candidates if candidate.converged]
    if not good:
        raise SteeringError(
            f"steer({task.group.name}): none of {starts} starts reached the target with {intervals} intervals; try more "
            "starts, more intervals, or a nearer target"
        )
    best = min(good, key=lambda candidate: candidate.cost)
    u = _piecewise_linear(task, best.controls / task.duration)
    details = {
        "intervals": intervals,
        "starts": starts,
        "converged": len(good),
        "iterations": sum(candidate.iterations for candidate in candidates),
        "discretisation": "continuous controls, linear on each interval",
    }
    seconds = {"build": built - started, "solve": time.perf_counter() - built}
    return finish(task, "optimal", u, details, seconds, solved=Status.LOCAL, otherwise=Status.NOT_CONVERGED)


def _solve(task: Task, solver: Any, guess: Array) -> _Candidate:
    group = task.group
    count, m = guess.shape
    full = np.zeros((count, group.dim))
    full[:, list(task.controls)] = guess
    step = integrators(group).rkmk4_step
    start = np.eye(group.degree, dtype=complex if group.is_complex else float)
    states = step.scan(
        start, n=count - 1, u0=full[:-1], um=(full[:-1] + full[1:]) / 2, u1=full[1:], h=1.0 / (count - 1)
    )
    x0 = np.concatenate([guess.ravel(), _real(states[1:]).ravel()])
    goal = _real(np.linalg.inv(task.target)).ravel()
    solution = solver(x0=x0, p=goal, lbg=0, ubg=0)
    stats = solver.stats()
    violation = float(np.max(np.abs(np.asarray(solution["g"]))))
    controls = np.asarray(solution["x"]).ravel()[: count * m].reshape(count, m)
    reached = _real(np.asarray(_unreal(np.asarray(solution["x"]).ravel()[-_width(group) :], group)))
    off = float(np.max(np.abs(reached.ravel() - _real(task.target).ravel())))
    scale = max(1.0, float(np.max(np.abs(task.target))))
    converged = violation < 1e-7 and off < 1e-6 * scale
    return _Candidate(float(solution["f"]), controls, converged, int(stats["iter_count"]))


def _piecewise_linear(task: Task, values: Array) -> Controls:
    knots = np.linspace(0, task.duration, len(values))

    def evaluate(t: Array) -> Array:
        u = np.zeros((len(t), task.group.dim))
        for position, column in zip(task.controls, values.T, strict=True):
            u[:, position] = np.interp(t, knots, column)
        return u

    return Controls(evaluate, knots[1:-1])


def _width(group: MatrixGroup) -> int:
    return group.degree**2 * (2 if group.is_complex else 1)


def _real(matrix: Array) -> Array:
    """Complex entries as interleaved (re, im)."""
    contiguous = np.ascontiguousarray(matrix)
    return contiguous.view(float) if np.iscomplexobj(contiguous) else contiguous


def _unreal(flat: Array, group: MatrixGroup) -> Array:
    entries = flat.view(complex) if group.is_complex else flat
    return entries.reshape(group.degree, group.degree)


def _step_kernel(group: MatrixGroup, controls: tuple[int, ...]) -> Kernel:
    d, m = group.degree, len(controls)

    def body(ops: Any, X: Any, a: Any, b: Any, h: Any) -> tuple[Any, ...]:
        first: list[Any] = [0] * group.dim
        last: list[Any] = [0] * group.dim
        for position, left, right in zip(controls, a, b, strict=True):
            first[position], last[position] = left, right
        turn = bracket_body(group, ops, first, last)
        theta = [h * (p + q) / 2 + h * h * r / 12 for p, q, r in zip(first, last, turn, strict=True)]
        return (times_taylor_exp(group, ops, X, theta, _EXPONENTIAL_DEGREE),)

    X = Port("X", (d, d), is_complex=group.is_complex)
    ports = (X, Port("a", (m,)), Port("b", (m,)), Port("h", ()))
    out = (Port("X_next", (d, d), is_complex=group.is_complex),)
    return Kernel("magnus_step", group.name, ports, out, body)


def _miss_kernel(group: MatrixGroup) -> Kernel:
    """Coordinates of target^-1 X - I, projected on the algebra: zero, near the identity, only at the target."""
    d = group.degree
    weights = group.coordinate_rows

    def body(ops: Any, inverse: Any, X: Any) -> tuple[Any, ...]:
        entries = []
        for i in range(d):
            for j in range(d):
                total = sum((inverse[i][m] * X[m][j] for m in range(1, d)), inverse[i][0] * X[0][j])
                entries.append(Complex.of(total - (1 if i == j else 0)))
        parts = [entry.re for entry in entries] + [entry.im for entry in entries]
        return (
            [sum((float(w) * p for w, p in zip(row, parts, strict=True) if w != 0), 0 * parts[0]) for row in weights],
        )

    X = Port("X", (d, d), is_complex=group.is_complex)
    inverse = Port("inverse", (d, d), is_complex=group.is_complex)
    return Kernel("miss", group.name, (inverse, X), (Port("x", (group.dim,)),), body)


@lru_cache(maxsize=16)
def _solver(group: MatrixGroup, controls: tuple[int, ...], intervals: int) -> Any:
    step = function_of(_step_kernel(group, controls))
    width, m, h = _width(group), len(controls), 1.0 / intervals
    U = ca.MX.sym("U", m, intervals + 1)
    X = ca.MX.sym("X", width, intervals)
    goal = ca.MX.sym("goal", width)
    identity = _real(np.eye(group.degree, dtype=complex if group.is_complex else float)).ravel()
    before = ca.horzcat(ca.DM(identity), X[:, :-1])
    a, b = U[:, :-1], U[:, 1:]
    gaps = X - step.map(intervals)(before, a, b, h)
    miss = function_of(_miss_kernel(group))(goal, X[:, -1])
    energy = h / 3 * (ca.dot(a, a) + ca.dot(a, b) + ca.dot(b, b))
    problem: dict[str, Any] = {
        "x": ca.vertcat(ca.vec(U), ca.vec(X)),
        "p": goal,
        "f": energy,
        "g": ca.vertcat(ca.vec(gaps), miss),
    }
    options: dict[str, Any] = {
        "expand": step.n_instructions() < _LARGE_STEP,
        "print_time": False,
        "ipopt": {"print_level": 0, "sb": "yes", "max_iter": 300, "tol": 1e-10, "mu_init": 1e-3},
    }
    return ca.nlpsol("steer", "ipopt", problem, options)
