"""lc.steer: one front door to every steering method."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from numpy.typing import ArrayLike

from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.steering.feedback import feedback
from lie_codegen.steering.methods import OPEN_LOOP, plan_by
from lie_codegen.steering.plan import Plan
from lie_codegen.steering.task import make_task


def steer(
    group: MatrixGroup,
    target: ArrayLike,
    controls: Sequence[str | int],
    duration: float,
    method: str = "auto",
    *,
    tolerance: float = 1e-6,
    **options: Any,
) -> Plan:
    """Controls that take X' = X sum_i u_i A_i from the identity to the target.

    Args:
        group: the group.
        target: (d, d) group element, or (n,) coordinates of the second kind.
        controls: labels (or positions) of the actuated basis elements.
        duration: seconds.
        method: "auto": "transcription" if an option asks for it (bounds, obstacles ...), else "optimal";
            "four_phase": closed form, section 5.2 of TR 93-59; two controls; form="single" for its single-exponential design (66);
            "circle": two controls that turn at a constant rate, the least energy within the area rule, retuned; three dimensions;
            "area_rule": Fourier controls of least energy within the averaged model, then retuned to hit the target exactly;
            "loops": a straight part, a loop for each bracket, a figure of eight for each bracket of brackets, in turn, retuned;
            "optimal": minimum energy, exact extremals;
            "transcription": bounds, rates, obstacles, drift, torques, via points, periodic controls, minimum time;
            "feedback": in steps, each planned from the measured state.
        tolerance: endpoint error |log(target^-1 X)| below which the plan counts as solved.
        **options: of the method; see its function.

    Raises:
        UncontrollableError: with the growth vector and the missing directions.
        SteeringInputError: an unknown method or option, or a task the method cannot do.
        ShapeError, NotFiniteError, NotOnGroupError: about the target.
        SteeringError: the solver found nothing admissible; says what was tried.
    """
    methods = {**OPEN_LOOP, "feedback": feedback}
    torques = options.get("dynamics") == "second_order"
    task = make_task(group, target, controls, duration, tolerance, torques=torques, drift=options.get("drift"))
    return plan_by(methods, method, task, options)
