"""lc.mpc: the solver of a problem as a controller, one Gauss-Newton sweep a sample."""

from __future__ import annotations

import numpy as np

from lie_codegen.errors import InputError
from lie_codegen.steering.ocp.controller import ModelPredictiveControl
from lie_codegen.steering.ocp.problem import OptimalControlProblem
from lie_codegen.steering.ocp.problem_data import ProblemData
from lie_codegen.steering.ocp.terms import name_of


def mpc(
    problem: OptimalControlProblem, *, iterations: int = 1, penalty: float = 300.0, sample: float | None = None
) -> ModelPredictiveControl:
    """A controller that solves `problem` anew at every sample, from the solution of the last one.

    Each step moves controls, states and multipliers on by one interval, sets the first state to the measurement, and takes
    `iterations` Gauss-Newton sweeps, each with one roll-out and at most four trials of its line search; the multipliers
    follow with a constant penalty. A control outside its bounds never leaves it.

    Args:
        problem: from `lc.ocp`; a sample is one of its intervals. Where its duration is free, what is left of it is chosen anew at every
            sample, down to the shortest; then the horizon keeps that length.
        iterations: sweeps a sample; one is enough where samples are short (real-time iteration). After one that finds nothing
            better the next is damped; the multipliers follow once a sample.
        penalty: rho of the conditions.
        sample: seconds between two steps of a problem of free duration; its shortest interval if not given.

    Raises:
        InputError: iterations below 1, a penalty that is not positive, no problem; a sample that is none, or a formula of t, which
            cannot tell where a free duration began.
    """
    if not isinstance(problem, OptimalControlProblem):
        raise InputError(f"mpc: expected a problem of lc.ocp, got {problem!r:.60}")
    if isinstance(iterations, bool) or not isinstance(iterations, int | np.integer) or not 1 <= iterations <= 1000:
        raise InputError(
            f"mpc({problem.data.name}): iterations must be a whole number from 1 to 1000, got {iterations!r}"
        )
    if not (isinstance(penalty, int | float | np.number) and penalty > 0 and float(penalty) < np.inf):
        raise InputError(f"mpc({problem.data.name}): penalty must be a positive number, got {penalty!r}")
    return ModelPredictiveControl(problem, int(iterations), float(penalty), _sample(problem.data, sample))


def _sample(data: ProblemData, sample: float | None) -> float:
    """Seconds between two steps."""
    where = f"mpc({data.name})"
    interval = (data.duration if data.free_duration is None else data.free_duration[0]) / data.intervals
    if sample is None:
        seconds = interval
    elif not (isinstance(sample, int | float | np.number) and sample > 0 and float(sample) < np.inf):
        raise InputError(f"{where}: sample must be a positive number of seconds, got {sample!r}")
    elif data.free_duration is None and not np.isclose(sample, interval, rtol=1e-9):
        raise InputError(
            f"{where}: a sample is an interval of the problem, {interval:g} s; give lc.ocp other intervals"
        )
    else:
        seconds = float(sample)
    if data.free_duration is not None and (timed := [term for term in data.terms if "t" in data.scope.uses(term)]):
        raise InputError(f"{where}: {name_of(timed[0])} is a formula of t; with a free duration give it a parameter")
    return seconds
