"""lc.steer: one front door to every steering method."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any, NamedTuple, Never

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.errors import InfeasibleError, SteeringError, SteeringInputError
from lie_codegen.flow.elements import admitted_element
from lie_codegen.groups.catalogue_load import GroupLike, as_group
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.identifiers import unknown_keywords
from lie_codegen.runtime.patience import shows_progress
from lie_codegen.steering.choice import asks_direct, asks_open, goes_around
from lie_codegen.steering.constraints import Obstacle
from lie_codegen.steering.goal_plans import set_plan
from lie_codegen.steering.goals import GoalSet
from lie_codegen.steering.methods import OPEN_LOOP, plan_by
from lie_codegen.steering.options import check_options
from lie_codegen.steering.plan import Plan
from lie_codegen.steering.start import placed, seen_from
from lie_codegen.steering.task import make_task

#: What is no option of a method.
_TASK = ("group", "target", "controls", "duration", "method", "tolerance", "unknown")


@shows_progress
def steer(
    group: GroupLike,
    target: Any,
    controls: Sequence[Any],
    duration: float,
    method: str = "auto",
    *,
    tolerance: float = 1e-6,
    start: ArrayLike | None = None,
    drift: Any = None,
    bounds: Any = None,
    rate_bounds: Any = None,
    velocity_bounds: Any = None,
    weights: ArrayLike | None = None,
    objective: str | None = None,
    longest: float | None = None,
    obstacles: Sequence[Obstacle] | None = None,
    classes: int | None = None,
    via: Sequence[tuple[float, ArrayLike]] | None = None,
    rest: bool | None = None,
    periodic: bool | None = None,
    dynamics: str | None = None,
    inertia: Any = None,
    start_velocity: ArrayLike | None = None,
    end_velocity: ArrayLike | None = None,
    intervals: int | None = None,
    pieces: int | None = None,
    starts: int | None = None,
    rounds: int | None = None,
    iterations: int | None = None,
    seed: int | None = None,
    guess: Any = None,
    polish: bool | None = None,
    equation: str | None = None,
    spread: Sequence[Any] | None = None,
    vertices: ArrayLike | None = None,
    solver: str | None = None,
    cost: Any = None,
    terminal_cost: Any = None,
    constraints: Any = None,
    parameters: Mapping[str, ArrayLike] | None = None,
    quadrature: str | None = None,
    integrator: str | None = None,
    form: str | None = None,
    q: int | None = None,
    amplitude: str | None = None,
    harmonics: int | None = None,
    order: int | None = None,
    cycles: float | None = None,
    forces: Any = None,
    damping: Any = None,
    compare: bool | None = None,
    exact: bool | None = None,
    threads: int | None = None,
    steps: int | None = None,
    planner: str | None = None,
    gain: ArrayLike | None = None,
    disturbance: ArrayLike | None = None,
    noise: float | None = None,
    step_options: dict[str, Any] | None = None,
    progress: Callable[[str], None] | None = None,
    **unknown: Never,
) -> Plan:
    """Controls that take X' = X sum_i u_i A_i from the identity to the target.

    Args:
        group: the group, its name or its file.
        target: (d, d) group element, (n,) coordinates of the second kind, or a set of goals: `Pointing`, `Position`, `Coset`,
            `UpToPhase`.
        controls: labels (or positions) of the actuated basis elements; for "direct" also vectors (n,), n formulas of t, functions.
        duration: seconds.
        method: "auto": "ocp" for costs, constraints or parameters of one's own, "direct" for goal sets, fuel, bounds and drift,
            "transcription" if another option asks for it (obstacles, rates, torques ...), else "optimal";
            "direct": bounds, drift, goal sets, fuel, functions of time: reaches from many starts, then descends; also least
                time under bounded torques (dynamics="second_order"): arcs of constant torque with exact switches;
            "four_phase": closed form, section 5.2 of TR 93-59; two controls; form="single" for its single-exponential design (66);
            "swing_twist": a constant swing, then a circle, exact; two controls on SO(3), SU(2);
            "sinusoids": a line and one sinusoid a bracket, exact; chained systems (h3, engel ...);
            "circle": two controls that turn at a constant rate, the least energy within the area rule, retuned; three dimensions;
            "area_rule": Fourier controls of least energy within the averaged model, then retuned to hit the target exactly;
            "loops": a straight part, a loop for each bracket, a figure of eight for each bracket of brackets, in turn, retuned;
            "optimal": minimum energy, exact extremals;
            "ocp": cost=, terminal_cost=, constraints=, parameters= of one's own, as `lc.ocp` has them, with the target as end;
            "symmetric_product": torques of a body at rest, fewer than its dimensions: oscillations whose symmetric products push in the missing
                directions, retuned to hit the target exactly; no nonlinear program, milliseconds, not cheap;
            "transcription": bounds, rates, obstacles, drift, torques, via points, periodic controls, minimum time;
            "feedback": in steps, each planned from the measured state.
        tolerance: endpoint error |log(target^-1 X)| below which the plan counts as solved.
        start: (d, d) X(0), an element or coordinates; the identity if not given.
        drift: (n,) constant velocity beside the controls' own [units of u]; for "direct" also formulas of t or a function.
        bounds: of the controls [units of u]: a number b for -b <= u <= b, a pair (low, high), (m, 2) a pair for each, or {label: number or pair}; none.
        rate_bounds: of their time derivatives [units of u / s], as bounds; none (transcription).
        velocity_bounds: of any component of xi, as bounds, second order; none (transcription).
        weights: (m,) positive weights w_i of the cost sum w_i u_i^2; ones.
        objective: "energy" (default), "time" or "fuel" (transcription: not fuel).
        longest: longest duration allowed for "time", in units of `duration`; 20.
        obstacles: `Cone`s, `Ball`s, `Box`es and `Cylinder`s to keep out of, on all of the way; none (transcription, direct).
        classes: classes of ways around them that are tried, which cannot be drawn into each other; 4 (discs: transcription; direct).
        via: (fraction of the duration, element or coordinates) to pass through; none (transcription).
        rest: controls are zero at both ends; False (transcription).
        periodic: controls end as they begin: a gait; False (transcription).
        dynamics: "first_order" (default): u is a velocity; "second_order": u is a torque [N m] or force [N] (transcription).
        inertia: of the second order: a number, (n,) or (n, n), positive definite [kg m^2, kg].
        start_velocity: (n,) xi at the start, second order; zero.
        end_velocity: (n,) xi at the end, second order; zero.
        intervals: pieces of the controls; 64 (transcription), 60 (ocp).
        pieces: constant pieces of the first search; by the task (direct).
        starts: first guesses tried; 16 (direct), 8 (ocp, circle, area_rule), 3 (transcription; 8 beside walls), tuned (optimal).
        rounds: rounds of starts before giving up; 4 (direct).
        iterations: iterations of a descent; 150 (direct).
        seed: of the random starts or the noise; 0 (direct, ocp, feedback).
        guess: controls to start from beside the others: a Plan of any method, (k, m) samples at equal times, a function of t, a path
            (k, d, d) at equal times or (path, times); none (direct, transcription; optimal: their nearest extremal).
        polish: continuous controls after the constant pieces; True (direct).
        equation: "left" (default), X' = X hat(u), or "right", X' = hat(u) X (direct).
        spread: systems {"drift": ..., "gain": ...} that the controls shall serve alike; none (direct).
        vertices: control vectors that arcs of least time take; the corners of the bounds (direct).
        solver: "auto" (default), "fatrop" or "ipopt" (transcription).
        cost: running cost l of `lc.ocp`; norm2(u) (ocp).
        terminal_cost: phi of `lc.ocp`; none (ocp).
        constraints: g <= 0 of `lc.ocp`; none (ocp).
        parameters: {name: value} of the formulas; none (ocp).
        quadrature: "trapezoid" (default), "left" or "simpson" (ocp).
        integrator: "rkmk4" (default) or "midpoint" (ocp).
        form: "product" (default), (60), or "single", (66) (four_phase); "oscillation" (default) or "primitives", a sequence of motions along
            decoupling fields (symmetric_product).
        q: periods of the second phase; by the task (four_phase).
        amplitude: "auto" (default), "free" or as the paper's (four_phase).
        harmonics: harmonics of the controls; 2 (area_rule).
        order: order of averaging; 2 (area_rule).
        cycles: of the slowest oscillation, not necessarily whole; from 4 down while the cost falls (symmetric_product).
        forces: (m, n) covectors in place of controls, for thrusters that are no basis elements (symmetric_product).
        damping: D of the force -D xi, a number, (n,) or (n, n); 0 (symmetric_product).
        compare: tell the cost of the transcription's torques beside, `details["transcription_cost"]`; False (symmetric_product).
        exact: retuned to hit the target; True (circle, loops, area_rule).
        threads: processor threads; 1 (optimal).
        steps: steps, each planned from the measured state; 8 (feedback).
        planner: method of each step; "area_rule" (feedback).
        gain: of the corrections; 1 (feedback).
        disturbance: (n,) constant velocity that the plans do not know; none (feedback).
        noise: standard deviation of the measured state; 0 (feedback).
        step_options: options of the planner; none (feedback).
        progress: called with a line a stage; a line on stderr after a second, in a terminal or a notebook.

    An option that is None is the default of the method; one that the method does not have is refused, with those it has.

    Raises:
        UncontrollableError: with the growth vector and the missing directions.
        SteeringInputError: an unknown method or option, or a task the method cannot do.
        ShapeError, NotFiniteError, NotOnGroupError: about the target.
        InfeasibleError: no controls within the bounds reach the target: proved, see `.certificate`.
        SteeringError: the solver found nothing admissible; says what was tried, `.best` and `.violation`.
    """
    given = locals().copy()  # every argument by its name, before another local is made
    group = as_group(group, "steer")
    if unknown:
        known = set(inspect.signature(steer).parameters) - {"unknown"}
        raise SteeringInputError(unknown_keywords(f"steer({group.name})", unknown, known))
    options = {name: value for name, value in given.items() if value is not None and name not in _TASK}
    check_options(f"steer({group.name})", method, options)
    plan = _found(_Asked(group, target, controls, duration, method, tolerance, options))
    if isinstance(target, GoalSet) or np.shape(target) != (group.degree, group.degree):
        return plan
    distance = admitted_element(group, target, f"steer({group.name}): target").projected
    return replace(plan, projected=distance) if distance else plan


class _Asked(NamedTuple):
    """What `steer` was asked for, read."""

    group: MatrixGroup
    target: Any
    controls: Sequence[Any]
    duration: float
    method: str
    tolerance: float
    options: dict[str, Any]


def _found(asked: _Asked) -> Plan:
    """The plan; among obstacles where the transcription finds none, that of the direct method."""
    try:
        return _planned(asked)
    except SteeringError as error:
        directly = asks_direct(asked.method, asked.target, asked.controls, asked.options)
        around = goes_around(asked.method, asked.controls, asked.options)
        if directly or isinstance(error, InfeasibleError) or not around:
            raise
        try:
            return _planned(asked._replace(method="direct"))
        except SteeringError:
            raise error from None


def _planned(asked: _Asked) -> Plan:
    group, target, controls, duration, method, tolerance, options = asked
    # what one method alone needs is imported with it: half of the time of a first plan
    if asks_open(method, options):
        from lie_codegen.steering.ocp.steered import open_plan

        return open_plan(group, target, controls, duration, tolerance, **options)
    if asks_direct(method, target, controls, options):
        from lie_codegen.steering.direct.front import direct_plan

        return direct_plan(group, target, controls, duration, tolerance, options)
    if isinstance(target, GoalSet):
        return set_plan(group, target, controls, duration, method, tolerance, options)
    if method == "symmetric_product" and options.get("start") is None:
        from lie_codegen.steering.symmetric_product.method import symmetric_product_plan

        return symmetric_product_plan(group, target, controls, duration, tolerance, options)
    if options.get("start") is not None:
        # planned from the identity, and placed where it begins
        start, element, moved = seen_from(group, options["start"], target, options)
        return placed(steer(group, element, controls, duration, method, tolerance=tolerance, **moved), start)
    methods = dict(OPEN_LOOP)
    if method not in methods and method != "auto":
        from lie_codegen.steering.feedback import feedback

        methods["feedback"] = feedback
    torques = options.get("dynamics") == "second_order"
    task = make_task(group, target, controls, duration, tolerance, torques=torques, drift=options.get("drift"))
    return plan_by(methods, method, task, options)
