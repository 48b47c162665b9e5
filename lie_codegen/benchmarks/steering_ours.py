"""Our two solvers as rows of the steering benchmark."""

from __future__ import annotations

from typing import Any

from lie_codegen.benchmarks.steering_cases import INTERVALS, Case, Problem, Solver
from lie_codegen.errors import SteeringError
from lie_codegen.steering.shooting.shooter import shooter
from lie_codegen.steering.task import make_task
from lie_codegen.steering.transcription.transcribe import transcription


def shooting_row(asked: Problem) -> Solver:
    """Lie-Poisson shooting in generated C, with its default number of starts."""
    solver = shooter(asked.group, asked.controls)

    def solve(case: Case) -> float:
        found = solver.solve(case.goal)
        return float(found.cost[0]) if found.status[0] == 1 else float("nan")

    return solve


def transcription_row(asked: Problem) -> Solver:
    """The whole plan from one first guess: seed, fatrop, and the check by integrating the true system."""

    def solve(case: Case) -> float:
        options: dict[str, Any] = {"intervals": INTERVALS, "starts": 1}
        if case.obstacle is not None:
            options["obstacles"] = [case.obstacle]
        if case.bound is not None:
            options |= {"bounds": case.bound, "objective": "time"}
        try:
            plan = transcription(make_task(asked.group, case.goal, asked.controls, 1.0, 1e-6), **options)
        except SteeringError:
            return float("nan")
        if plan.error > plan.duration * 1e-5:
            return float("nan")
        return plan.duration if case.bound is not None else plan.cost

    return solve
