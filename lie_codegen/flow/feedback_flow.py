"""X' = X hat(eps u(t, X)) and X' = X hat(eps u(t, g)): the pair 8(5,3) in compiled loops, or in Python for a Python function."""

from __future__ import annotations

import random
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.errors import ChartError, ComputationError, InputError, NotOnGroupError, ShapeError
from lie_codegen.flow.attitude_metrics import second_kind_along
from lie_codegen.flow.feedback_law import Feedback, feedback_body
from lie_codegen.flow.libraries import logarithms
from lie_codegen.flow.pair853 import System, integrate
from lie_codegen.flow.product_rate import product_rate, reach_of, turning
from lie_codegen.flow.product_step import Move
from lie_codegen.flow.second_kind_coordinates import second_kind
from lie_codegen.flow.trajectory import Trajectory
from lie_codegen.groups.derivation import derivation_of
from lie_codegen.groups.maps.element_pattern import pack, packed_size, unpack, varying_entries
from lie_codegen.groups.maps.matrices import matrix_port, random_element
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.groups.wei_norman.body import rate as wei_norman_rate
from lie_codegen.kernel.arithmetic import Arithmetic, FloatArithmetic, Scalar
from lie_codegen.kernel.definition import kernel_factory, plain
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.linear import Vector, scaled
from lie_codegen.kernel.plain_data import Definition, NoDefinitionError, made_from
from lie_codegen.runtime import ode_numpy
from lie_codegen.runtime.build import build_kernels, defined_together
from lie_codegen.runtime.library import Library


@dataclass(frozen=True, eq=False, repr=False)
class FeedbackTrajectory(Trajectory):
    """A solution of X' = X hat(eps u(t, X)), or u(t, g).

    Attributes:
        u: (k, n) the feedback along the way, without eps; (k, N, n) of N trajectories.
        feedback: as it was given.
        eps: the factor, () or (N,).
        chart: (k, n) the coordinates of a feedback of g, as they were integrated; None for one of X.
    """

    u: Array = field(kw_only=True)
    feedback: Any = field(kw_only=True, repr=False)
    eps: Array = field(kw_only=True, repr=False)
    chart: Array | None = field(kw_only=True, repr=False)

    def _flow(self, times: Array, start: Array) -> Array:
        """X at the times after the first, by a fresh run from the output time that is the first."""
        law = Feedback(self.feedback, "X" if self.chart is None else "g")
        chart = None if self.chart is None else self.chart[int(np.searchsorted(self.t, times[0]))]
        return feedback_flow(self.group, law, times, self.eps, start, rtol=self.rtol, chart=chart).X[1:]

    @cached_property
    def g(self) -> Array:
        """(k, n) Wei-Norman coordinates: those of a feedback of g, with X = exp(g_1 A_1) ...; else of X0^-1 X, from g = 0 at t[0].

        Raises:
            ChartError: the chart ends on the way.
        """
        if self.chart is not None:
            return self.chart
        if self.X.ndim != 3:
            raise InputError(f"{self.group.name}: coordinates are of one trajectory; simulate it alone")
        return second_kind_along(self.group, np.linalg.solve(self.X[0], self.X))

    @property
    def charts(self) -> Any:
        """Not of a feedback: simulate the input u(t) that it made."""
        raise InputError(f"{self.group.name}: charts with restarts are of runs of an input of time, not of a feedback")


@kernel_factory()
def feedback_rate(group: MatrixGroup, u: Any, reads: str, name: str = "feedback_rate") -> Kernel:
    """(X packed, y, t, eps) -> y': y = Theta, or (Theta, g) for a feedback of the coordinates g, g' = M(g) eps u(t, g)."""
    move, law = Move(group), feedback_body(group, u, reads)
    data, size = derivation_of(group).wei_norman, group.dim * (2 if reads == "g" else 1)

    def body(ops: Arithmetic, X: Vector, y: Vector, t: Scalar, eps: Scalar) -> tuple[Any, ...]:
        def rates(time: Scalar, elements: list[Any], g: Vector) -> tuple[list[Vector], Vector]:
            xi = scaled(eps, law(ops, time, elements[0], g or None))
            return [xi], list(wei_norman_rate(ops, data, g, xi)) if g else []

        return (product_rate(ops, [move], [unpack(group, X)], y, rates, t),)

    def sampler(rng: random.Random) -> tuple[Any, ...]:
        flat = pack(group, random_element(group, data, rng))
        return flat, [rng.uniform(-0.1, 0.1) for _ in range(size)], rng.uniform(0, 1), 0.1

    ports = (Port("X", (packed_size(group),)), Port("y", (size,)), Port("t", (), "s"), Port("eps", ()))
    formula = "X' = X hat(eps u), y = (Theta, g), X = X_0 exp(Theta)"
    return Kernel(name, group.name, ports, (Port("y_dot", (size,)),), body, formula, "TR 93-59, (16), (17)", sampler)


@kernel_factory()
def feedback_move(group: MatrixGroup, name: str = "feedback_move") -> Kernel:
    """(X packed, Theta) -> X exp(Theta), packed."""
    move, size = Move(group), packed_size(group)
    body = lambda ops, X, theta: (pack(group, move(ops, unpack(group, X), theta)),)  # noqa: E731
    ports = (Port("X", (size,)), Port("theta", (group.dim,)))
    return Kernel(name, group.name, ports, (Port("X_next", (size,)),), body, "X exp(Theta)")


@kernel_factory()
def feedback_value(group: MatrixGroup, u: Any, reads: str, name: str = "feedback_value") -> Kernel:
    """(t, X) -> u, or (t, g) -> u."""
    law = feedback_body(group, u, reads)

    def body(ops: Arithmetic, t: Scalar, where: Any) -> tuple[Any, ...]:
        return (law(ops, t, where, None) if reads == "X" else law(ops, t, None, list(where)),)

    place = matrix_port(group, "X") if reads == "X" else Port("g", (group.dim,))
    return Kernel(name, group.name, (Port("t", (), "s"), place), (Port("u", (group.dim,)),), body, "u")


def feedback_library(group: MatrixGroup, law: Feedback) -> Library:
    """The three kernels of a feedback of texts or a Kernel, compiled; built once a process where its definition says what it is."""
    try:
        return _known(group, plain(law.u), law.reads)
    except NoDefinitionError:
        return _library(group, law.u, law.reads)


@lru_cache(maxsize=32)
def _known(group: MatrixGroup, u: Definition | tuple[str, ...], reads: str) -> Library:
    return _library(group, made_from(u), reads)


def _library(group: MatrixGroup, u: Any, reads: str) -> Library:
    kernels = [feedback_rate(group, u, reads), feedback_move(group), feedback_value(group, u, reads)]
    return build_kernels(lambda: kernels, namespace=group.name, definition=defined_together(kernels))


def feedback_flow(
    group: MatrixGroup,
    law: Feedback,
    times: Array,
    eps: Array,
    start: Array,
    *,
    rtol: float,
    atol: float = 0.0,
    chart: Array | None = None,
    threads: int = 1,
) -> FeedbackTrajectory:
    """The run; a Python function is called at every stage, one trajectory after the other.

    Args:
        group, law, times, eps, start, rtol, atol, threads: as `simulate`.
        chart: coordinates g of the start, for a feedback of g; those nearest to 0 if not given.

    Raises:
        ChartError: the start has no coordinates, or the chart ends on the way.
        ComputationError: the tolerance is not reached.
    """
    many = start.ndim == 3 or eps.ndim == 1
    count = len(start) if start.ndim == 3 else len(eps) if eps.ndim else 1
    X0 = np.broadcast_to(start, (count, group.degree, group.degree))
    factors = np.ascontiguousarray(np.broadcast_to(eps, (count,)), dtype=float)
    g0 = _coordinates(group, X0, chart) if law.reads == "g" else np.zeros((count, 0))
    where = f"simulate({group.name})"
    library = None if law.slow else feedback_library(group, law)
    if library is not None and library.compiled:
        found = _compiled(group, library, law, times, factors, X0, g0, rtol, atol, where, threads)
    else:
        function = law.u if law.slow else _called(group, law)
        found = _interpreted(group, function, law.reads, times, factors, X0, g0, rtol, atol, where)
    X, g, u, steps, error, evaluations = found
    if not many:
        X, g, u = X[:, 0], g[:, 0], u[:, 0]
    method = "feedback in Python" if law.slow else "pair853"
    return FeedbackTrajectory(
        group, times, X, steps, error, method, evaluations if law.slow else 0, 0.0, (), None, rtol, 0,  # type: ignore[arg-type]
        u=u, feedback=law.u, eps=np.asarray(eps, dtype=float), chart=g if law.reads == "g" else None,
    )  # fmt: skip


def _coordinates(group: MatrixGroup, X0: Array, chart: Array | None) -> Array:
    if chart is not None:
        return np.atleast_2d(chart)
    try:
        return np.array([second_kind(group, X) for X in X0])
    except NotOnGroupError as error:
        raise ChartError(f"simulate({group.name}): X0 has no coordinates g: {error}") from None


def _compiled(
    group: MatrixGroup, library: Library, law: Feedback, times: Array, eps: Array, X0: Array, g0: Array,
    rtol: float, atol: float, where: str, threads: int,
) -> tuple[Array, Array, Array, int, float, int]:  # fmt: skip
    n, count = group.dim, len(X0)
    rows, columns = np.array(varying_entries(group)).T
    packed = np.ascontiguousarray(X0[:, rows, columns])
    flat = packed.view(float) if group.is_complex else packed
    closed = Move(group).derivation.closed_exponential
    numbers = (eps[0],) if count == 1 else (eps,)
    system = System(
        library.feedback_rate, library.feedback_move, n, reach_of(group, closed=closed), tuple(map(np.asarray, numbers))
    )
    y0 = np.ascontiguousarray(np.concatenate([np.zeros((count, n)), g0], axis=1))
    try:
        run = integrate(
            system,
            np.ascontiguousarray(flat, dtype=float),
            y0,
            times,
            rtol=rtol,
            atol=atol,
            where=where,
            threads=threads,
        )
    except ComputationError as error:
        if law.reads == "g":
            raise ChartError(f"{error}; or the chart of the coordinates g ends there") from None
        raise
    values = np.ascontiguousarray(run.X).view(complex) if group.is_complex else run.X
    X = np.broadcast_to(np.eye(group.degree, dtype=values.dtype), (*run.X.shape[:2], group.degree, group.degree)).copy()
    X[..., rows, columns] = values
    g = run.y[..., n:]
    clock = np.repeat(times, count)
    place = X.reshape(-1, group.degree, group.degree) if law.reads == "X" else g.reshape(-1, n)
    u = library.feedback_value.batch(clock, np.ascontiguousarray(place)).reshape(len(times), count, n)
    return X, g, u, run.steps, run.error_estimate, run.evaluations


def _called(group: MatrixGroup, law: Feedback) -> Callable[[float, Array], Any]:
    """Texts or a kernel as a Python function, where there is no compiler."""
    kernel, ops = feedback_value(group, law.u, law.reads), FloatArithmetic()
    return lambda t, where: kernel.evaluate(ops, t, where.tolist())[0]


def _interpreted(
    group: MatrixGroup, function: Callable[..., Any], reads: str, times: Array, eps: Array, X0: Array, g0: Array,
    rtol: float, atol: float, where: str,
) -> tuple[Array, Array, Array, int, float, int]:  # fmt: skip
    """The same pair in Python; the error is the difference to a run with local errors eight times as large."""
    runs = [
        [_alone(group, function, reads, times, float(e), X, g, rtol / part, atol / part, where) for e, X, g in zip(eps, X0, g0, strict=True)]
        for part in (1, 8)
    ]  # fmt: skip
    coarse, fine = (np.stack([each[0] for each in run], axis=1) for run in runs)
    g, u = (np.stack([each[place] for each in runs[1]], axis=1) for place in (1, 2))
    steps = sum(each[3] for each in runs[1])
    evaluations = sum(each[4] for run in runs for each in run)
    return fine, g, u, steps, 2 * float(np.max(np.abs(fine - coarse))) / 7, evaluations


def _alone(
    group: MatrixGroup, function: Callable[..., Any], reads: str, times: Array, eps: float, X0: Array, g0: Array,
    rtol: float, atol: float, where: str,
) -> tuple[Array, Array, Array, int, int]:  # fmt: skip
    n, ops, data = group.dim, FloatArithmetic(), derivation_of(group).wei_norman
    exp, reach = logarithms(group).exp, min(1.0, reach_of(group, closed=True)) / 2
    scale = np.full(n + len(g0), max(atol, rtol * 1e-3))

    def value(t: float, X: Array, g: Array) -> Array:
        u = np.asarray(function(t, X if reads == "X" else g), dtype=float)
        if u.shape != (n,):
            raise ShapeError(f"{where}: u(t, {reads}) has shape {u.shape}; give ({n},)")
        return u

    def rate(t: float, y: Array) -> Array:
        X = X_here @ exp(y[:n])
        xi = (eps * value(t, X, y[n:])).tolist()
        turn = turning(ops, group, y[:n].tolist(), xi)
        return np.array([*turn, *(wei_norman_rate(ops, data, y[n:].tolist(), xi) if len(g0) else [])], dtype=float)

    X_here, g = np.array(X0), np.array(g0)
    path, chart = [X_here], [g]
    steps, calls, t = 0, 0, float(times[0])
    for stop in times[1:]:
        length = float(stop) - t
        while t < stop:
            end = min(float(stop), t + length)
            end = float(stop) if stop - end < 1e-12 * abs(stop - times[0]) else end
            knots, states, status, _, count = ode_numpy.run(
                rate, np.concatenate([np.zeros(n), g]), t, end, rtol, scale, None, (), end - t
            )
            calls += count
            if status == 3 or not np.all(np.isfinite(states[-1])):
                raise ComputationError(f"{where}: no step is short enough at t = {knots[-1]:.9g}; is u smooth there?")
            if np.linalg.norm(states[-1][:n]) > reach:  # too far from where the series of Theta' holds: half as far
                length = (end - t) / 2
                continue
            steps += len(knots) - 1
            X_here, g, t = X_here @ exp(states[-1][:n]), states[-1][n:], end
        path.append(X_here)
        chart.append(g)
    u = np.array([value(float(s), X, c) for s, X, c in zip(times, path, chart, strict=True)])
    return np.array(path), np.array(chart), u, steps, calls
