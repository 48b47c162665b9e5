"""lc.widget: the page of lc.view in a cell of Jupyter or marimo, its place in time shared with Python."""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from pathlib import Path
from typing import Any

from lie_codegen.codegen.templates import template_folder
from lie_codegen.errors import InputError, MissingDependencyError
from lie_codegen.groups.catalogue_load import GroupLike
from lie_codegen.pictures.view import page_text
from lie_codegen.steering.constraints import Obstacle

_LEAST, _TALLEST = 200, 4000


def widget(
    what: Any,
    *,
    group: GroupLike | None = None,
    body: str | Path | None = None,
    obstacles: Sequence[Obstacle] = (),
    title: str | None = None,
    samples: int = 401,
    solve: bool = False,
    height: int | None = None,
) -> Any:
    """The page of `lc.view` as an anywidget: the last line of a cell in Jupyter, JupyterLab, VS Code or Colab shows it; in marimo `mo.ui.anywidget(lc.widget(plan))`.

    `w.place` is the index of the time that is shown, in both directions: setting it moves the page, and the page's slider
    sets it (`w.observe(f, "place")`). `w.page` is the HTML.

    Args:
        what: a Plan, a Trajectory, a ClosedLoop (give `group`), or an average of `lc.average`.
        group: that of a ClosedLoop.
        body: "box", "satellite", "vehicle", "car", "arrow", or a glTF file.
        obstacles: cones, balls, boxes and cylinders, drawn with the motion.
        title: heading of the page.
        samples: times shown of a Plan and of an average.
        solve: of a plan without bounds on rotations or poses: moving the target, by drag or sliders, solves again in the cell.
        height: of the cell's output, pixels; None: that of the page, whose charts lie beside the view or below it as the cell is wide.

    Raises:
        MissingDependencyError: anywidget is not installed: the extra `lie_codegen[widget]`.
        InputError: as `lc.view`; a height that is no whole number from 200 to 4000.
    """
    if height is not None and (
        isinstance(height, bool) or not isinstance(height, int) or not _LEAST <= height <= _TALLEST
    ):
        raise InputError(f"widget: height lies between {_LEAST} and {_TALLEST} pixels, given {height!r}")
    made = _widget_class()
    page = page_text(what, group=group, body=body, obstacles=obstacles, title=title, samples=samples, solve=solve)
    return made(page=page, height=height)


@cache
def _widget_class() -> Any:
    """The class is made where anywidget is there: the package itself does not need it."""
    try:
        import anywidget
        import traitlets
    except ImportError:
        raise MissingDependencyError(
            "widgets need anywidget: install lie_codegen with its extra, pip install 'lie_codegen[widget]'; "
            "lc.view writes the same page as a file without it"
        ) from None

    class PageWidget(anywidget.AnyWidget):  # type: ignore[misc]
        """A page of lc.view in a frame of its own, so that its style and the notebook's do not meet."""

        _esm = (template_folder() / "page_widget.js").read_text(encoding="utf-8")
        page = traitlets.Unicode("").tag(sync=True)
        height = traitlets.Int(None, allow_none=True).tag(sync=True)
        place = traitlets.Int(0).tag(sync=True)

    return PageWidget
