"""plot_plan: one call from a plan to a picture."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from lie_codegen.errors import InputError, write_refusal
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


def plot_plan(plan: Plan, path: str | Path, *, obstacles: Sequence[Obstacle] = (), compare: bool = True) -> Path:
    """Draws controls, loops, path and energy into a file (png, svg, pdf); returns its path.

    Args:
        plan: any plan of `lc.steer`.
        path: the file.
        obstacles: drawn with the path.
        compare: solve for the least energy without limits, for the comparison.

    Raises:
        MissingDependencyError: without matplotlib.
        InputError: the name of the file ends in no kind of picture.
        OutputFolderError: the file cannot be written.
    """
    target = picture_path(path)
    minimum = plan.cost if plan.method == "optimal" else None
    same_system = not any(plan.details.get("drift", ())) and "inertia" not in plan.details
    if compare and minimum is None and same_system:
        minimum = steer(plan.group, plan.target, plan.controls, plan.duration, "optimal").cost
    try:
        target.parent.mkdir(parents=True, exist_ok=True)
        draw_plan(plan, minimum, obstacles).savefig(target, dpi=150)
    except OSError as error:
        raise write_refusal(f"{target}: cannot be written", error) from None
    return target
