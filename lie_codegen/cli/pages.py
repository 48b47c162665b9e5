"""The command about pages that move: page."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from lie_codegen.cli.groups import GroupName, Json
from lie_codegen.cli.output import emit
from lie_codegen.cli.steering_texts import BALL, BOX, CONE, CYLINDER, numbers, obstacles_of, target_of

_Optional = typer.Option


def page(
    group: GroupName,
    controls: Annotated[
        str | None, _Optional(help="Comma-separated labels of the actuated basis elements; all if not given.")
    ] = None,
    target: Annotated[str | None, _Optional(help="As of steer; 0.5 in every coordinate if not given.")] = None,
    duration: Annotated[float, _Optional(help="Seconds.")] = 10.0,
    weights: Annotated[
        str | None, _Optional(help="Positive weights of the controls' energies, comma-separated.")
    ] = None,
    body: Annotated[str | None, _Optional(help="box, satellite, vehicle, car, arrow, or a glTF file.")] = None,
    cone: Annotated[list[str] | None, _Optional(help=f"{CONE}, as of steer; repeatable.")] = None,
    ball: Annotated[list[str] | None, _Optional(help=f"{BALL}, as of steer; repeatable.")] = None,
    box: Annotated[list[str] | None, _Optional(help=f"{BOX}, as of steer; repeatable.")] = None,
    cylinder: Annotated[list[str] | None, _Optional(help=f"{CYLINDER}, as of steer; repeatable.")] = None,
    solve: Annotated[
        bool | None,
        _Optional(
            "--solve/--still", help="With the compiled solver in the page; if not said, where ziglang is installed."
        ),
    ] = None,
    out: Annotated[Path, _Optional(help="File of the page.")] = Path("page.html"),
    json: Json = False,
) -> None:
    """Write a page that moves: a plan of least energy, in one HTML file that needs no network."""
    import importlib.util

    from lie_codegen.groups.catalogue_load import group as load
    from lie_codegen.pictures.view import view
    from lie_codegen.steering.front import steer

    g = load(group)
    names = [name.strip() for name in controls.split(",")] if controls else list(g.labels)
    goal: Any = target_of(target, g) if target is not None else [0.5] * g.dim
    obstacles = obstacles_of(cone, ball, box, cylinder)
    options: dict[str, Any] = {"obstacles": obstacles} if obstacles else {"method": "optimal"}
    if weights is not None:
        options["weights"] = numbers(weights, "--weights")
    plan = steer(g, goal, names, duration, **options)
    able = plan.method == "optimal" and not g.is_complex and importlib.util.find_spec("ziglang") is not None
    written = view(plan, out, body=body, obstacles=obstacles, solve=able if solve is None else solve)
    emit(
        f"wrote {written}: {plan.status}",
        {"page": str(written), "cost": plan.cost, "error": plan.error, "status": plan.status},
        json,
    )


commands = (page,)
