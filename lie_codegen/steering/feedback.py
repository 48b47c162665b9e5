"""method="feedback": in steps, each planned from the measured state (sections 5.1 and 5.2 of TR 93-59).

At the start of each step the state is measured, with noise; the rest of the way, target relative to the measurement, is planned
in closed form by the area rule (or by any other method) and driven by the true, disturbed system. An error of the
averaged model, of the gain or of the measurement is thus corrected by the next step. Where every direction is
actuated the plan of a step is a constant control: first-order steering.
"""

from __future__ import annotations

import operator
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.errors import NotOnGroupError, ShapeError, SteeringError, SteeringInputError
from lie_codegen.exact.counts import seeded
from lie_codegen.flow.logarithm import distance
from lie_codegen.flow.second_kind_coordinates import element_coordinates
from lie_codegen.flow.simulate import simulate
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.steering.methods import OPEN_LOOP, plan_by, solver_of
from lie_codegen.steering.plan import Controls, Facts, Plan, Status, Stretched
from lie_codegen.steering.seeds import area_rule_seed
from lie_codegen.steering.simulated_plan import energy
from lie_codegen.steering.task import Task
from lie_codegen.values import Value

_SMALL_ENOUGH = 1.0
#: A remainder that small is left to the area rule where the planner refuses it.
_REMAINDER = 0.1


def feedback(
    task: Task,
    *,
    steps: int = 8,
    planner: str = "area_rule",
    gain: ArrayLike = 1.0,
    disturbance: ArrayLike | None = None,
    noise: float = 0.0,
    seed: int = 0,
    step_options: dict[str, Any] | None = None,
    progress: Callable[[str], None] | None = None,
) -> Plan:
    """Steers in steps of equal duration.

    Args:
        task: the task; its duration is that of all steps together.
        steps: number of steps.
        planner: "area_rule": closed form, a straight part and circles; or a method of lc.steer for each step.
        gain: what the true system makes of a commanded control, a number or (n,): X' = X hat(gain u + disturbance).
        disturbance: (n,) constant velocity that the planner does not know.
        noise: standard deviation of a measured state's coordinates (exponential, body side).
        seed: of the noise.
        step_options: options of the planner, where it is a method.
        progress: called with one line a step.

    Returns:
        A plan whose u is what was commanded, whose X_final is where the true, disturbed system ended; details hold the error after
        each step.

    Raises:
        SteeringInputError, ShapeError: about an option; and what the planner raises.
    """
    started = time.perf_counter()
    group, n = task.group, task.group.dim
    where = f"steer({group.name}): feedback"
    if operator.index(steps) < 1:
        raise SteeringInputError(f"{where}: steps must be at least 1, got {steps}")
    if not noise >= 0 or not np.isfinite(noise):
        raise SteeringInputError(f"{where}: noise must be a standard deviation, got {noise!r}")
    if planner != "area_rule":
        solver_of(OPEN_LOOP, planner, step_options or {})
    factor = np.broadcast_to(np.asarray(gain, dtype=float), (n,))
    push = np.zeros(n) if disturbance is None else np.asarray(disturbance, dtype=float)
    if push.shape != (n,) or not np.all(np.isfinite(push)):
        raise ShapeError(f"{where}: disturbance must be {n} finite numbers, got {disturbance!r}")
    rng = seeded(seed, "feedback")
    span = task.duration / steps
    X = np.eye(group.degree, dtype=complex if group.is_complex else float)
    parts: list[Controls] = []
    errors = [distance(group, task.target, X)]
    spent = 0.0
    for number in range(1, steps + 1):
        measured = X @ _exponential(group.hat(noise * rng.normal(size=n)))
        rest = np.linalg.solve(measured, task.target)
        u = _planned(replace(task, target=rest, duration=span), planner, step_options or {})
        parts.append(u)
        spent += energy(u, span)
        X = simulate(group, u.scaled(factor).plus(push), t=[0.0, span], X0=X).X[-1]
        errors.append(distance(group, task.target, X))
        if progress is not None:
            progress(f"step {number} of {steps}: error {errors[-1]:.3g}")
    details = {
        "winner": f"feedback in {steps} steps, each by {planner}",
        "errors": tuple(errors),
        "steps": steps,
        "step_duration": span,
        "noise": noise,
    }
    return Plan(
        group=group,
        target=task.target,
        controls=tuple(group.labels[i] for i in task.controls),
        duration=task.duration,
        method="feedback",
        u=_joined(parts, span, n),
        cost=spent,
        outcome=Facts(
            X,
            errors[-1],
            Status.SOLVED if errors[-1] <= task.tolerance else Status.APPROXIMATE,
            details,
            {"all": time.perf_counter() - started},
        ),
    )


def _planned(task: Task, planner: str, options: dict[str, Any]) -> Controls:
    size = distance(task.group, task.target, np.eye(task.group.degree))
    if planner != "area_rule" and size > task.tolerance:
        try:
            return plan_by(OPEN_LOOP, planner, task, options).u
        except (SteeringInputError, SteeringError, NotOnGroupError):
            # a planner that does what is asked of it in general may not do the little that is left: four phases need both
            # coordinates, and loops of their size. A name or an option that is wrong is wrong for every remainder.
            if size > _REMAINDER:
                raise
    x = element_coordinates(task.group, task.target)
    size = float(np.linalg.norm(x))
    x = x if size <= _SMALL_ENOUGH else x * (_SMALL_ENOUGH / size)

    seed = _Seed(task.group, task.controls, x)
    return Controls(Stretched(task.group.dim, tuple(task.controls), seed, task.duration), ())


@dataclass(frozen=True, eq=False, repr=False)
class _Seed(Value):
    """The area rule's first guess over unit time for coordinates x."""

    group: MatrixGroup
    controls: tuple[int, ...]
    x: Array

    def __call__(self, s: Array) -> Array:
        """(k,) -> (k, m)."""
        return np.asarray(area_rule_seed(self.group, self.controls, self.x, s, 0.0))


def _exponential(A: Array) -> Array:
    from scipy.linalg import expm

    return np.asarray(expm(A))


@dataclass(frozen=True, eq=False, repr=False)
class _Joined(Value):
    """Controls one after the other, each over a span of time."""

    parts: tuple[Controls, ...]
    span: float
    n: int

    def __call__(self, t: Array) -> Array:
        """(k,) times -> (k, n)."""
        place = np.clip((t / self.span).astype(int), 0, len(self.parts) - 1)
        u = np.zeros((len(t), self.n))
        for number, part in enumerate(self.parts):
            now = place == number
            if np.any(now):
                u[now] = part(np.clip(t[now] - number * self.span, 0.0, self.span))
        return u


def _joined(parts: list[Controls], span: float, n: int) -> Controls:
    inner = [number * span + np.asarray(part.breakpoints) for number, part in enumerate(parts)]
    return Controls(_Joined(tuple(parts), span, n), np.sort(np.concatenate([*inner, span * np.arange(1, len(parts))])))
