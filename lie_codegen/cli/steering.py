"""The command steer: a task, the options of its method, a picture."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from lie_codegen.cli.groups import GroupName, Json
from lie_codegen.cli.output import emit
from lie_codegen.cli.steering_texts import (
    BALL,
    BOX,
    CONE,
    CYLINDER,
    limits_of,
    numbers,
    obstacles_of,
    target_of,
    via_point,
)

_Optional = typer.Option
_LIMITS = "one number, low:high, or label=either, comma-separated."


def steer(
    group: GroupName,
    target: Annotated[
        str,
        _Optional(
            help="Coordinates of the second kind: comma-separated numbers, pi and sqrt allowed; or a file: the rows of a matrix of the "
            "group, or coordinates (.npy, .csv or text)."
        ),
    ],
    controls: Annotated[str, _Optional(help="Comma-separated labels of the actuated basis elements.")],
    duration: Annotated[float, _Optional(help="Seconds.")] = 1.0,
    method: Annotated[
        str,
        _Optional(
            help="auto, direct, four_phase, swing_twist, circle, loops, area_rule, optimal, transcription or feedback."
        ),
    ] = "auto",
    weights: Annotated[
        str | None, _Optional(help="Positive weights of the controls' energies, comma-separated.")
    ] = None,
    starts: Annotated[int | None, _Optional(help="First guesses that are tried.")] = None,
    form: Annotated[str | None, _Optional(help="Of four_phase: product (60) or single (66).")] = None,
    q: Annotated[int | None, _Optional(help="Of four_phase: periods of its second phase.")] = None,
    harmonics: Annotated[int | None, _Optional(help="Of area_rule: harmonics of the controls.")] = None,
    order: Annotated[int | None, _Optional(help="Of area_rule: order of averaging.")] = None,
    exact: Annotated[
        bool | None,
        _Optional("--exact/--averaged", help="Of circle, loops, area_rule: retuned to hit the target, or not."),
    ] = None,
    steps: Annotated[int | None, _Optional(help="Of feedback: number of steps.")] = None,
    bounds: Annotated[str | None, _Optional(help=f"Limits of the controls: {_LIMITS}")] = None,
    rate_bounds: Annotated[str | None, _Optional(help=f"Limits of the controls' rates: {_LIMITS}")] = None,
    rest: Annotated[bool | None, _Optional("--rest", help="Controls are zero at both ends.")] = None,
    periodic: Annotated[bool | None, _Optional("--periodic", help="Controls end as they begin: a gait.")] = None,
    objective: Annotated[str | None, _Optional(help="energy, time; of direct also fuel and none (reach only).")] = None,
    drift: Annotated[str | None, _Optional(help="Constant velocity beside the controls', comma-separated.")] = None,
    via: Annotated[
        list[str] | None, _Optional(help="FRACTION@COORDINATES: a point to pass through, say 0.5@0.1,0,0; repeatable.")
    ] = None,
    cone: Annotated[
        list[str] | None, _Optional(help=f"{CONE}: keep a body axis so far from a direction; repeatable.")
    ] = None,
    ball: Annotated[list[str] | None, _Optional(help=f"{BALL}: keep out of a ball; repeatable.")] = None,
    box: Annotated[
        list[str] | None,
        _Optional(
            help=f"{BOX}: keep out of a box, turned by an angle in the plane, in space by the nine numbers of a rotation; repeatable."
        ),
    ] = None,
    cylinder: Annotated[
        list[str] | None, _Optional(help=f"{CYLINDER}: keep out of a cylinder, a bar in the plane; repeatable.")
    ] = None,
    intervals: Annotated[int | None, _Optional(help="Of transcription: pieces of the controls.")] = None,
    pieces: Annotated[int | None, _Optional(help="Of direct: constant pieces of the search.")] = None,
    seed: Annotated[int | None, _Optional(help="Of direct: of the first guesses.")] = None,
    equation: Annotated[str | None, _Optional(help="Of direct: left (X' = X u^) or right (X' = u^ X).")] = None,
    picture: Annotated[Path | None, _Optional(help="File for a picture of the plan: png, svg or pdf.")] = None,
    save: Annotated[
        Path | None, _Optional(help="File for the plan (.npz), as lc.load and generate --plan read it.")
    ] = None,
    samples: Annotated[int, _Optional(help="Number of control samples in the JSON object.")] = 101,
    json: Json = False,
) -> None:
    """Steer from the identity to a target."""
    import numpy as np

    from lie_codegen.groups.catalogue_load import group as load
    from lie_codegen.steering.front import steer as plan_steering

    if picture is not None:
        from lie_codegen.pictures.plot_plan import picture_path

        picture_path(picture)  # before anything is solved
    g = load(group)
    obstacles = obstacles_of(cone, ball, box, cylinder)
    options: dict[str, Any] = {
        "weights": None if weights is None else numbers(weights, "--weights"),
        "starts": starts,
        "form": form,
        "q": q,
        "harmonics": harmonics,
        "order": order,
        "exact": exact,
        "steps": steps,
        "bounds": None if bounds is None else limits_of(bounds, "--bounds"),
        "rate_bounds": None if rate_bounds is None else limits_of(rate_bounds, "--rate-bounds"),
        "rest": rest,
        "periodic": periodic,
        "objective": objective,
        "pieces": pieces,
        "seed": seed,
        "equation": equation,
        "drift": None if drift is None else numbers(drift, "--drift"),
        "via": [via_point(text) for text in via] if via else None,
        "obstacles": obstacles or None,
        "intervals": intervals,
    }
    given = {name: value for name, value in options.items() if value is not None}
    names = [name.strip() for name in controls.split(",")]
    goal = target_of(target, g)
    plan = plan_steering(g, goal, names, duration, method, **given)
    t = np.linspace(0, plan.duration, max(2, samples))
    data = {
        "group": g.name,
        "method": plan.method,
        "status": plan.status,
        "cost": plan.cost,
        "error": plan.error,
        "X_final": plan.X_final,
        "seconds": plan.seconds,
        "details": plan.details,
        "t": t,
        "u": plan.u(t),
    }
    text = f"{g.name}, {plan.method}: energy {plan.cost:.9g}, endpoint error {plan.error:.3g}\n{plan.status}"
    if picture is not None:
        from lie_codegen.pictures.plot_plan import plot_plan

        data["picture"] = plot_plan(plan, picture, obstacles=obstacles).resolve()
        text += f"\npicture: {data['picture']}"
    if save is not None:
        data["saved"] = plan.save(save).resolve()
        text += f"\nsaved: {data['saved']}"
    emit(text, data, json)
