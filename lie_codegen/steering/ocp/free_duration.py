"""The best duration by Newton's method on the optimal cost as a function of it, within a bracket: where choosing it with the controls fails.

The duration is a state T that does not move, so that the sweep which gives the gains gives dV/dT and d2V/dT2 too (the conditions'
multipliers among them): each step costs one warm solution. The solver chooses it with the controls, much sooner, by the same two numbers.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from lie_codegen.steering.ocp.plan import OptimalPlan
from lie_codegen.steering.plan import Status

_MOST = 60
_SETTLED = 1e-9


def best_duration(
    solve: Callable[[float, Any], OptimalPlan], first: float, bounds: tuple[float, float], guess: Any
) -> OptimalPlan:
    """The plan of a duration at which the optimal cost is stationary, or which lies at a bound that presses.

    A duration at which no admissible plan is found is taken to be too short.

    Args:
        solve: (duration, guess) -> plan.
        first: duration to start from.
        bounds: shortest and longest.
        guess: of the first solution.
    """
    low, high = bounds
    T = min(max(first, low), high)
    plan = solve(T, guess)
    best = plan
    for _ in range(_MOST):
        found = plan.status in (Status.SOLVED, Status.ADMISSIBLE)
        if found:
            best = plan if best.status not in (Status.SOLVED, Status.ADMISSIBLE) or plan.cost <= best.cost else best
        slope = float(plan.value_gradient[-1]) if found else -1.0
        curvature = float(plan.value_hessian[-1, -1]) if found else 0.0
        low, high = (T, high) if slope < 0 else (low, T)
        step = T - slope / curvature if curvature > 0 else -1.0
        # outside the bracket, or where the cost is not convex: towards the end that the slope points to
        if not low < step < high:
            step = (low + high) / 2 if found and low > bounds[0] and high < bounds[1] else (high if slope < 0 else low)
        if not found:
            step = (T + high) / 2
        if abs(step - T) <= _SETTLED * T:
            return plan if found else best
        T = step
        plan = solve(T, plan if found else guess)
    return best
