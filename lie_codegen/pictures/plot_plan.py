"""plot_plan: one call from a plan to a picture."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, overload

import numpy as np

from lie_codegen.errors import InputError
from lie_codegen.pictures.result import write_figure
from lie_codegen.pictures.steering_picture import draw_plan
from lie_codegen.steering.constraints import Obstacle
from lie_codegen.steering.front import steer
from lie_codegen.steering.plan import Plan

#: Endings of the names of pictures.
KINDS = (".png", ".svg", ".pdf")


def picture_path(path: str | Path) -> Path:
    """The path, if its ending is one of a picture.

    Raises:
        InputError: naming those there are.
    """
    target = Path(path)
    if target.suffix.lower() not in KINDS:
        raise InputError(f"picture {target}: the name of a picture ends in {', '.join(KINDS)}")
    return target


@overload
def plot_plan(plan: Plan, path: None = None, *, obstacles: Sequence[Obstacle] = (), compare: bool = True) -> Any: ...


@overload
def plot_plan(plan: Plan, path: str | Path, *, obstacles: Sequence[Obstacle] = (), compare: bool = True) -> Path: ...


def plot_plan(
    plan: Plan, path: str | Path | None = None, *, obstacles: Sequence[Obstacle] = (), compare: bool = True
) -> Any:
    """Draws controls, loops, path and energy into a file (png, svg, pdf) and returns its path; without one, returns the figure,
    which a notebook shows.

    Args:
        plan: any plan of `lc.steer`.
        path: the file, or None.
        obstacles: drawn with the path.
        compare: solve for the least energy without limits, for the comparison.

    Raises:
        MissingDependencyError: without matplotlib.
        InputError: the name of the file ends in no kind of picture.
        OutputFolderError: the file cannot be written.
    """
    target = None if path is None else picture_path(path)
    minimum = plan.cost if plan.method == "optimal" else None
    if compare and minimum is None and _driven_alone(plan):
        minimum = steer(plan.group, plan.target, plan.controls, plan.duration, "optimal").cost
    figure = draw_plan(plan, minimum, obstacles)
    return figure if target is None else write_figure(figure, target)


def _driven_alone(plan: Plan) -> bool:
    """Whether basis elements alone move it from the identity, so that `optimal` solves the same task without limits."""
    system = plan.details.get("system")
    steady = system is None or (system.steady and not np.any(system.drift.constant))
    other = any(plan.details.get("drift", ())) or {"inertia", "start"} & set(plan.details)
    return steady and not other and set(plan.controls) <= set(plan.group.labels)
