"""lc.view: one HTML file that moves: a plan, a trajectory, a closed loop or an average, offline, in any browser."""

from __future__ import annotations

import html
import json
from collections.abc import Sequence
from functools import singledispatch
from pathlib import Path
from typing import Any

import numpy as np

from lie_codegen.averaging.averaged import Averaged
from lie_codegen.codegen.templates import template_folder
from lie_codegen.control.loop_result import ClosedLoop
from lie_codegen.errors import InputError, write_refusal
from lie_codegen.flow.trajectory import Trajectory
from lie_codegen.groups.catalogue_load import GroupLike, as_group
from lie_codegen.pictures.average_page import average_scene
from lie_codegen.pictures.gltf import gltf_faces
from lie_codegen.pictures.scene import Curves, Scene, distance_curve, motion_of, scene_data
from lie_codegen.steering.constraints import Obstacle
from lie_codegen.steering.plan import Plan
from lie_codegen.whole_files import write_whole

_SAMPLES = 401
_MOST = 100_000


def view(
    what: Any,
    path: str | Path = "page.html",
    *,
    group: GroupLike | None = None,
    body: str | Path | None = None,
    obstacles: Sequence[Obstacle] = (),
    title: str | None = None,
    samples: int = _SAMPLES,
    solve: bool = False,
) -> Path:
    """Write a page with the body in space, its axes or its way, the controls and errors under a time slider; returns its path.

    One file without anything from elsewhere: data, style and script are in it. It follows the browser's light or dark
    scheme, turns by drag, arrow keys and touch, and its numbers are those of Python to the last bit.

    Args:
        what: a Plan, a Trajectory, a ClosedLoop (give `group`), or an average of `lc.average` (its amplitude and phase become sliders, and
            the page integrates the system itself). Of several runs the first one.
        path: the file.
        group: that of a ClosedLoop.
        body: "box", "satellite", "vehicle", "car", "arrow", or a glTF file (.gltf with its buffers inside, or .glb).
        obstacles: cones, balls, boxes and cylinders, drawn with the motion.
        title: heading of the page.
        samples: times shown of a Plan and of an average.
        solve: of a plan without bounds on rotations or poses: the generated C, compiled to WebAssembly, goes into the page, and moving the
            target by its sliders, on SO(3), SU(2) and SE(2) by dragging it in the view too, solves again there. Needs the extra `lie_codegen[zig]`.

    Raises:
        InputError: nothing that a page can show, an unknown body, a glTF file that cannot be read.
        OutputFolderError: the file cannot be written.
    """
    target = Path(path)
    if target.suffix.lower() not in (".html", ".htm"):
        raise InputError(f"view: the page's name ends in .html, given {target}")
    page = page_text(what, group=group, body=body, obstacles=obstacles, title=title, samples=samples, solve=solve)
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise write_refusal(f"{target}: cannot be written", error) from None
    return write_whole(target, page)


def page_text(
    what: Any,
    *,
    group: GroupLike | None = None,
    body: str | Path | None = None,
    obstacles: Sequence[Obstacle] = (),
    title: str | None = None,
    samples: int = _SAMPLES,
    solve: bool = False,
) -> str:
    """The whole page as HTML; arguments and errors are those of `view`."""
    if isinstance(samples, bool) or not isinstance(samples, int) or not 2 <= samples <= _MOST:
        raise InputError(f"view: samples lies between 2 and {_MOST}, given {samples!r}")
    scene = _scene(what, None if group is None else as_group(group, "view"), samples)
    faces = None
    if body is not None and str(body).lower().endswith((".gltf", ".glb")):
        faces, body = gltf_faces(Path(body)), None
    script, solver = "", dict(scene.solver)
    if solver.get("kind") == "average":
        script = _part("page_average.js")
    elif solve:
        from lie_codegen.pictures.page_solver import page_solver

        solver, script = page_solver(what), _part("page_solver.js") + _part("page_target.js")
    shown = Scene(
        title or scene.title,
        scene.words,
        scene.t,
        scene.motions,
        scene.curves,
        scene.facts,
        scene.names,
        scene.target,
        obstacles,
        solver,
    )
    data = scene_data(shown, None if faces is not None else (None if body is None else str(body)), faces)
    # "</" would end the script element, whatever it stands in
    text = json.dumps(data, separators=(",", ":"), allow_nan=False).replace("</", "<\\/")
    return (
        _part("page.html")
        .replace("@TITLE@", html.escape(shown.title))
        .replace("/*@SOLVER@*/", script)
        .replace("@DATA@", text)
    )


def _part(name: str) -> str:
    return (template_folder() / name).read_text(encoding="utf-8")


@singledispatch
def _scene(what: Any, group: Any, samples: int) -> Scene:
    raise InputError(
        f"view: a page shows a Plan, a Trajectory, a ClosedLoop or an average of lc.average; given a {type(what).__name__}"
    )


@_scene.register
def _of_plan(plan: Plan, group: Any, samples: int) -> Scene:
    t = np.linspace(0.0, plan.duration, samples)
    X = plan.X(t)
    labels = list(plan.controls) if all(isinstance(name, str) for name in plan.controls) else []
    inputs = plan.inputs(t)
    names = labels if len(labels) == inputs.shape[1] else [f"u{i + 1}" for i in range(inputs.shape[1])]
    units = {plan.group.units[plan.group.labels.index(name)] for name in names if name in plan.group.labels}
    unit = f"{units.pop()}/s" if len(units) == 1 and "" not in units else ""
    return Scene(
        f"{plan.group.name}: a plan by {plan.method}",
        str(plan.status),
        t,
        [motion_of(plan.group, X)],
        [Curves("controls", unit, names, inputs), distance_curve(plan.group, X, plan.target, "distance to the target")],
        [
            ("controls", ", ".join(names)),
            ("duration", f"{plan.duration:.6g} s"),
            ("cost", f"{plan.cost:.9g}"),
            ("error at the end", f"{plan.error:.3g}"),
        ],
        target=motion_of(plan.group, np.asarray(plan.target)[None]),
    )


@_scene.register
def _of_trajectory(run: Trajectory, group: Any, samples: int) -> Scene:
    X = run.X if run.X.ndim == 3 else run.X[:, 0]
    return Scene(
        f"{run.group.name}: a trajectory",
        f"{run.method}, {run.steps} steps, error below {run.error_estimate:.1e}",
        run.t,
        [motion_of(run.group, X)],
        [distance_curve(run.group, X, X[0], "distance from the start")],
        [("times", f"{len(run.t)}"), ("end", f"{run.t[-1]:.6g} s")],
    )


@_scene.register
def _of_loop(run: ClosedLoop, group: Any, samples: int) -> Scene:
    group = group or getattr(run, "group", None)
    if group is None:
        raise InputError('view: of which group is the closed loop? give group="so3"')
    many = run.X.ndim == 4
    X, xi = (run.X[:, 0], run.xi[:, 0]) if many else (run.X, run.xi)
    curves = [Curves("body velocity", "", group.labels, xi)]
    for name, values in run.outputs.items():
        column = np.asarray(values)[:, 0] if many else np.asarray(values)
        shown = column[:, None] if column.ndim == 1 else column
        if name in ("force", "torque", "u", "W", "V", "phi") and shown.ndim == 2:
            curves.append(Curves(name, "", group.labels if shown.shape[1] == group.dim else [""], shown))
    motions, names = [motion_of(group, X)], ["the body"]
    if run.X_d is not None:
        motions.append(motion_of(group, run.X_d))
        names.append("its reference")
        error = np.linalg.solve(run.X_d, X)
        curves.append(distance_curve(group, error, np.eye(group.degree), "tracking error"))
    else:
        curves.append(distance_curve(group, X, np.eye(group.degree), "distance to the identity"))
    facts = [("integration steps", str(run.steps)), ("end", f"{run.t[-1]:.6g} s")]
    words = f"one of {run.X.shape[1]} runs" if many else f"{len(run.t)} times of one run"
    return Scene(f"{group.name}: a closed loop", words, run.t, motions, curves[:5], facts, names)


@_scene.register
def _of_average(averaged: Averaged, group: Any, samples: int) -> Scene:
    return average_scene(averaged, samples)
