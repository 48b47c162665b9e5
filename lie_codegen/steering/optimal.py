"""What shooting found: a record from which the facts of a plan follow, and its controls."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.flow.logarithm import distance
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.steering.plan import Controls, Facts, Plan, Status, Stretched
from lie_codegen.steering.shooting.extremal import Extremal
from lie_codegen.steering.shooting.shooter import shooter
from lie_codegen.steering.shooting.transversal import focal_times
from lie_codegen.steering.simulated_plan import simulated_end
from lie_codegen.steering.task import Task
from lie_codegen.values import Value

_CONJUGATE = 1e-6
#: Elements of a set of goals, beside the one given, whose extremals are begun from.
ELSEWHERE = 2


@dataclass(frozen=True, eq=False, repr=False)
class Shot(Value):
    """What the shooting found; the true system is flown, and conjugate points are looked for, when that is first read: both
    take a hundred times as long as the solution itself, and who steers in a loop reads the controls alone.

    Attributes:
        controls, tolerance, weights: of the task.
        mu0: (n,) the costate of unit time.
        weighted_cost: int sum_i w_i u_i^2.
        residual: of the solver.
        counts: starts, converged, agreeing, linearisations.
        tried: what was tried, in words.
        seconds: spent so far.
        free: (k, n) directions that the goal leaves free, None where it is an element.
    """

    controls: tuple[int, ...]
    tolerance: float
    weights: Array
    mu0: Array
    weighted_cost: float
    residual: float
    counts: tuple[int, ...]
    tried: tuple[str, ...]
    seconds: Mapping[str, float] = field(compare=False)
    free: Array | None = None

    def of(self, plan: Plan) -> Facts:
        """The facts of the plan."""
        started = time.perf_counter()
        extremal = _extremal(plan.group, self.controls, tuple(self.mu0.tolist()), tuple(self.weights.tolist()))
        singular = extremal.singular_values()
        conjugate = extremal.conjugate_times() if self.free is None else focal_times(extremal, self.free)
        ratio = extremal.conjugacy()
        examined = time.perf_counter()
        starts, converged, agreeing, linearisations = self.counts
        compiled = shooter(plan.group, self.controls).compiled
        details = {
            "winner": "shooting on the Lie-Poisson equations" + ("" if compiled else ", in numpy (no C compiler)"),
            "tried": self.tried,
            "starts": starts,
            "converged": converged,
            "agreeing": agreeing,
            "linearisations": linearisations,
            "costate": self.mu0 / plan.duration,
            "weights": self.weights,
            "weighted_cost": self.weighted_cost,
            "residual": self.residual,
            "singular_values": singular,
            "conjugate_target": ratio < _CONJUGATE,
            "conjugate_times": tuple(t * plan.duration for t in conjugate),
            "optimality": _optimality(starts, agreeing, ratio, conjugate)
            if self.free is None
            else _optimality_over_a_set(conjugate),
            "discretisation": "none: the extremal is exact to rounding",
            "extremal": extremal,
        }
        if self.free is not None:
            details["transversality"] = float(np.linalg.norm(self.free @ extremal.costates[-1])) / plan.duration
        end = simulated_end(plan.group, plan.u, plan.duration)
        error = distance(plan.group, plan.target, end)
        seconds = {**self.seconds, "examine": examined - started, "simulate": time.perf_counter() - examined}
        return Facts(end, error, self._status(error, conjugate), details, seconds)

    def _status(self, error: float, conjugate: tuple[float, ...]) -> Status:
        """An extremal with a conjugate point inside is no local minimum, however well it ends."""
        if error > self.tolerance:
            return Status.NOT_CONVERGED
        return Status.EXTREMAL if conjugate else Status.LOCAL


def _optimality(starts: int, agreeing: int, ratio: float, conjugate: tuple[float, ...]) -> str:
    """What is known, and what is not."""
    if conjugate:
        first = f"an extremal with a conjugate point at {conjugate[0]:.3f} of its duration: not a local minimum; try more starts"
    elif ratio < _CONJUGATE:
        first = (
            "an extremal whose target is a conjugate point: one of a family of equal cost (the phase of a loop is free), "
            "no conjugate point before it"
        )
    else:
        first = "a strict local minimum: no conjugate point up to the target"
    return (
        f"{first}; the cheapest extremal of {starts} starts, {agreeing} of which ended within 1 % of its cost; that nothing "
        "is cheaper is likely, not proved"
    )


def _optimality_over_a_set(focal: tuple[float, ...]) -> str:
    if focal:
        return (
            f"an extremal that meets the set transversally, with a focal point at {focal[0]:.3f} of its duration: not a local "
            "minimum over the set; try more starts"
        )
    return (
        "an extremal that meets the set transversally (see `transversality`), no focal point before its end; the cheapest from "
        f"{1 + ELSEWHERE} elements of the set; that nothing is cheaper is likely, not proved"
    )


@dataclass(frozen=True, eq=False, repr=False)
class ExtremalControls(Value):
    """The controls of an extremal over unit time: (k,) -> (k, m)."""

    group: MatrixGroup
    controls: tuple[int, ...]
    mu0: Array
    weights: Array

    def __call__(self, s: Array) -> Array:
        """(k,) -> (k, m)."""
        extremal = _extremal(self.group, self.controls, tuple(self.mu0.tolist()), tuple(self.weights.tolist()))
        return extremal.control(np.clip(s, 0, 1))


@lru_cache(maxsize=256)
def _extremal(
    group: MatrixGroup, controls: tuple[int, ...], mu0: tuple[float, ...], weights: tuple[float, ...]
) -> Extremal:
    return shooter(group, controls).extremal(mu0, weights=weights)


def extremal_controls(task: Task, mu0: Array, weights: Array) -> Controls:
    """The controls of an extremal, slowed down to the task's duration."""
    unit = ExtremalControls(task.group, task.controls, np.array(mu0, dtype=float), np.array(weights, dtype=float))
    return Controls(Stretched(task.group.dim, tuple(task.controls), unit, task.duration), ())
