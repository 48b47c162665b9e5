"""lc.steer: one front door to every steering method."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from lie_codegen.errors import SteeringInputError
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.steering.direct.front import asks_direct, direct_plan
from lie_codegen.steering.feedback import feedback
from lie_codegen.steering.goals import GoalSet
from lie_codegen.steering.methods import OPEN_LOOP, plan_by
from lie_codegen.steering.ocp.steered import asks_open, open_plan
from lie_codegen.steering.plan import Plan
from lie_codegen.steering.start import placed, seen_from
from lie_codegen.steering.task import make_task


def steer(
    group: MatrixGroup,
    target: Any,
    controls: Sequence[Any],
    duration: float,
    method: str = "auto",
    *,
    tolerance: float = 1e-6,
    **options: Any,
) -> Plan:
    """Controls that take X' = X sum_i u_i A_i from the identity to the target.

    Args:
        group: the group.
        target: (d, d) group element, (n,) coordinates of the second kind, or a set of goals: `Pointing`, `Position`, `Coset`,
            `UpToPhase`.
        controls: labels (or positions) of the actuated basis elements; for "direct" also vectors (n,), n formulas of t, functions.
        duration: seconds.
        method: "auto": "ocp" for costs, constraints or parameters of one's own, "direct" for goal sets, fuel, bounds and drift,
            "transcription" if another option asks for it (obstacles, rates, torques ...), else "optimal";
            "direct": bounds, drift, goal sets, fuel, functions of time: reaches from many starts, then descends;
            "four_phase": closed form, section 5.2 of TR 93-59; two controls; form="single" for its single-exponential design (66);
            "swing_twist": a constant swing, then a circle, exact; two controls on SO(3), SU(2);
            "circle": two controls that turn at a constant rate, the least energy within the area rule, retuned; three dimensions;
            "area_rule": Fourier controls of least energy within the averaged model, then retuned to hit the target exactly;
            "loops": a straight part, a loop for each bracket, a figure of eight for each bracket of brackets, in turn, retuned;
            "optimal": minimum energy, exact extremals;
            "ocp": cost=, terminal_cost=, constraints=, parameters= of one's own, as `lc.ocp` has them, with the target as end;
            "transcription": bounds, rates, obstacles, drift, torques, via points, periodic controls, minimum time;
            "feedback": in steps, each planned from the measured state.
        tolerance: endpoint error |log(target^-1 X)| below which the plan counts as solved.
        **options: of the method; see its function.

    Raises:
        UncontrollableError: with the growth vector and the missing directions.
        SteeringInputError: an unknown method or option, or a task the method cannot do.
        ShapeError, NotFiniteError, NotOnGroupError: about the target.
        InfeasibleError: no controls within the bounds reach the target: proved, see `.certificate`.
        SteeringError: the solver found nothing admissible; says what was tried, `.best` and `.violation`.
    """
    if asks_open(method, options):
        return open_plan(group, target, controls, duration, tolerance, **options)
    if isinstance(target, GoalSet) and method not in ("auto", "direct", "ocp"):
        raise SteeringInputError(
            f"steer: a {type(target).__name__} is a set of goals, which method='direct' takes, not {method!r}"
        )
    if asks_direct(method, target, controls, options):
        return direct_plan(group, target, controls, duration, tolerance, options)
    if options.get("start") is not None:
        return _from(group, target, controls, duration, method, tolerance, options)
    methods = {**OPEN_LOOP, "feedback": feedback}
    torques = options.get("dynamics") == "second_order"
    task = make_task(group, target, controls, duration, tolerance, torques=torques, drift=options.get("drift"))
    return plan_by(methods, method, task, options)


def _from(
    group: MatrixGroup,
    target: Any,
    controls: Sequence[Any],
    duration: float,
    method: str,
    tolerance: float,
    options: dict[str, Any],
) -> Plan:
    """The plan of a method that begins at the identity, from another start."""
    start, element, moved = seen_from(group, options["start"], target, options)
    return placed(steer(group, element, controls, duration, method, tolerance=tolerance, **moved), start)
