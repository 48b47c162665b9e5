"""X' = X hat(eps u(t, X)) and X' = X hat(eps u(t, g)): the pair 8(5,3) in compiled loops, or in Python for a Python function."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import cached_property
from math import inf
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.errors import ChartError, ComputationError, InputError, NotOnGroupError
from lie_codegen.flow.attitude_metrics import second_kind_along
from lie_codegen.flow.feedback_kernels import feedback_library, feedback_value
from lie_codegen.flow.feedback_law import Feedback
from lie_codegen.flow.feedback_python import interpreted
from lie_codegen.flow.pair853 import integrate
from lie_codegen.flow.pair_system import System
from lie_codegen.flow.product_rate import reach_of
from lie_codegen.flow.product_step import Move
from lie_codegen.flow.second_kind_coordinates import second_kind
from lie_codegen.flow.short_state import short_states
from lie_codegen.flow.trajectory import Trajectory
from lie_codegen.groups.maps.packed_arrays import elements_of, packed_elements
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernel.arithmetic import FloatArithmetic
from lie_codegen.runtime.library import Library
from lie_codegen.runtime.rows import row_by_row


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
        found = interpreted(group, function, law.reads, times, factors, X0, g0, rtol, atol, where)
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
    numbers, short = (np.asarray(eps[0] if count == 1 else eps),), short_states([group])
    if short is not None:
        system = System(
            library.feedback_rate, library.feedback_move, short.size, inf, numbers, lift=library.feedback_lift,
            quaternions=short.quaternions,
        )  # fmt: skip
    else:
        reach = reach_of(group, closed=Move(group).derivation.closed_exponential)
        system = System(library.feedback_rate, library.feedback_move, n, reach, numbers)
    y0 = np.ascontiguousarray(np.concatenate([np.zeros((count, system.group)), g0], axis=1))
    try:
        run = integrate(
            system,
            packed_elements(group, X0),
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
    X, g = elements_of(group, run.X), run.y[..., system.group :]
    clock = np.repeat(times, count)
    place = X.reshape(-1, group.degree, group.degree) if law.reads == "X" else g.reshape(-1, n)
    u = row_by_row(library.feedback_value, clock, np.ascontiguousarray(place))[0].reshape(len(times), count, n)
    return X, g, u, run.steps, run.error_estimate, run.evaluations


def _called(group: MatrixGroup, law: Feedback) -> Callable[[float, Array], Any]:
    """Texts or a kernel as a Python function, where there is no compiler."""
    kernel, ops = feedback_value(group, law.u, law.reads), FloatArithmetic()
    return lambda t, where: kernel.evaluate(ops, t, where.tolist())[0]
