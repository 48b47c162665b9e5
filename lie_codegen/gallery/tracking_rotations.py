"""Figures 3 and 4 of Bullo and Murray: left and right velocity errors, seen by the feedforward alone."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lie_codegen.control.closed_loop import closed_loop
from lie_codegen.control.loop_result import ClosedLoop
from lie_codegen.control.reference_motion import formula_reference
from lie_codegen.control.tracking_law import tracking_law
from lie_codegen.gallery.attitude_style import brick, quiet
from lie_codegen.groups.catalogue_load import group
from lie_codegen.pictures.result import GalleryResult, new_figure, save
from lie_codegen.pictures.style import BLUE, GREEN, GREY, RED, caption

#: The angle 2 pi (3 t^2 - t^3/5)/100: rest to rest in 10 s through 2 pi; the printed velocity 2 pi (3 t^2 - t)/100
# makes 19 pi.
_ANGLE = "2*pi*(3*t^2 - t^3/5)/100"
_INERTIA = (6.0, 4.0, 3.0)
#: Gains so small that nothing but the feedforward acts.
_NONE = 1e-15


def tracking_rotations(folder: Path, progress: Callable[[str], None] = quiet) -> GalleryResult:
    """Bricks turned about the vertical, from an initial error of 45 degrees about X."""
    so3 = group("so3")
    reference = formula_reference(so3, ["0", "0", _ANGLE])
    c = np.sqrt(0.5)
    R0 = np.array([[1, 0, 0], [0, c, -c], [0, c, c]])
    t = np.linspace(0, 10, 101)
    runs: dict[str, ClosedLoop] = {}
    for side in ("left", "right"):
        progress(f"{side} velocity error")
        law = tracking_law(
            so3, inertia=_INERTIA, error=f"so3_{side}", gains={"K_p": _NONE, "K_d": _NONE}, feedforward=side
        )
        runs[side] = closed_loop(so3, inertia=_INERTIA, law=law, reference=reference, X0=R0, t=t, tolerance=1e-11)
    R_d = np.asarray(runs["left"].X_d)
    closed = {"left": R0 @ R_d, "right": R_d @ R0}
    numbers = {
        f"{side}_gap_to_closed_form": float(np.max(np.abs(runs[side].X - closed[side]))) for side in ("left", "right")
    }
    return save("tracking_rotations", folder, _draw(R_d, runs), numbers)


def _draw(R_d: NDArray[Any], runs: dict[str, ClosedLoop]) -> Any:
    figure = new_figure(12, 4.6)
    figure.suptitle(
        "Feedforward alone, from an error of 45 degrees about X: left and right velocity errors (Figures 3, 4)"
    )
    axes = figure.subplots()
    rows = (
        (R_d, BLUE, "reference\none turn about Z in 10 s"),
        (runs["left"].X, RED, "left velocity error\n$R = R_0 R_d$"),
        (runs["right"].X, GREEN, "right velocity error\n$R = R_d R_0$"),
    )
    for level, (rotations, colour, label) in enumerate(rows):
        picked = rotations[:: len(rotations) // 8]
        for number, R in enumerate(picked):
            brick(axes, R, (1.5 * number, -1.45 * level), (1.15, 0.72, 0.36), colour)
        axes.text(-1.0, -1.45 * level, label, ha="right", va="center", fontsize=11)
    for number in range(9):
        axes.text(1.5 * number, 0.85, f"{10 * number / 8:.3g} s", ha="center", color=GREY)
    axes.set(aspect="equal", xlim=(-3.9, 13), ylim=(-3.8, 1.1))
    axes.axis("off")
    caption(
        figure,
        "No error feedback: the left error keeps the body's error fixed in space, the right one fixed in the reference's frame.",
    )
    return figure
