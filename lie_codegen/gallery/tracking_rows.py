"""Table 1 of Bullo and Murray in action: six error functions, one underwater vehicle, inside and outside the proved region."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lie_codegen.control.closed_loop import closed_loop
from lie_codegen.control.loop_result import ClosedLoop
from lie_codegen.control.reference_kernels import ReferenceBody
from lie_codegen.control.reference_motion import FormulaReference, formula_reference
from lie_codegen.control.tracking_law import tracking_law
from lie_codegen.control.tracking_region import TrackingRegion, tracking_region
from lie_codegen.gallery.attitude_style import quiet, tidy
from lie_codegen.groups.catalogue_load import group
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernel.arithmetic import FloatArithmetic
from lie_codegen.pictures.result import GalleryResult, new_figure, save
from lie_codegen.pictures.style import COLOURS, caption

_INERTIA = (2.0, 3.0, 4.0, 5.0, 6.0, 8.0)
_GAINS = {"K_1": [8, 10, 12], "K_2": [6, 7, 8], "K_d": [6, 7, 8, 10, 11, 12]}
_PATH = ["0", "sin(t/4)/3", "t/5", "2*sin(t/5)", "t/10", "cos(t/3)/2"]
#: What a row measures of the position (its K_2-norm) and of the attitude; row 5 as corrected.
_NAMES = (
    r"$p - p_d$;  $R_d^T R$",
    r"$R_d^T (p - p_d)$;  $R_d^T R$",
    r"$R^T (p - p_d)$;  $R_d^T R$",
    r"$(R + R_d)^T (p - p_d)$;  $R_d^T R$",
    r"$(R + R_d)(R^T p - R_d^T p_d)$;  $R R_d^T$",
    r"$R^T p - R_d^T p_d$;  $R R_d^T$",
)
#: Where the logarithmic axes end: below, rounding is seen.
_FLOOR = {"W": 1e-13, "distance": 1e-7, "angle": 1e-5}
_STARTS = {"inside": (0.9, -0.5, 0.7, 0.5, -0.4, 0.3), "outside": (2.0, -1.4, 1.2, 1.5, -1.4, 1.3)}


def tracking_rows(folder: Path, progress: Callable[[str], None] = quiet) -> GalleryResult:
    """W(t) of every row from a state inside its region, and from one outside, with whether it converged."""
    se3 = group("se3")
    reference = formula_reference(se3, _PATH)
    figure = new_figure(12, 8.5)
    shown = figure.subplots(2, 2)
    numbers: dict[str, Any] = {}
    for row in range(1, 7):
        progress(f"row {row}")
        colour, name = COLOURS[row - 1], f"{row}: {_NAMES[row - 1]}"
        run, regions = _run(se3, reference, row)
        W = run.outputs["W"]
        for number, where in enumerate(_STARTS):
            numbers[f"row_{row}_{where}"] = _summary(W[:, number], regions[number])
            shown[0, number].semilogy(run.t, W[:, number], color=colour, label=name)
        distance = np.linalg.norm(run.X[:, 0, :3, 3] - np.asarray(run.X_d)[:, :3, 3], axis=1)
        shown[1, 0].semilogy(run.t, distance, color=colour)
        shown[1, 1].semilogy(run.t, np.degrees(_angles(run)), color=colour)
    for axes, place, where in zip(shown[0], "ab", _STARTS, strict=True):
        tidy(axes, f"({place}) energy $W(t)$, start {where} the proved region", "t [s]", "W [J]")
        axes.set_ylim(_FLOOR["W"], None)
    tidy(shown[1, 0], "(c) distance from the reference, start inside", y="distance [m]")
    tidy(shown[1, 1], "(d) angle from the reference, start inside", y="angle [degrees]")
    shown[1, 0].set_ylim(_FLOOR["distance"], None)
    shown[1, 1].set_ylim(_FLOOR["angle"], None)
    figure.suptitle("Six error functions on SE(3), one vehicle, one reference (Bullo and Murray, Table 1)")
    cut = ", ".join(
        f"$10^{{{np.log10(_FLOOR[each]):.0f}}}$ {unit}"
        for each, unit in (("W", "J"), ("distance", "m"), ("angle", "degrees"))
    )
    figure.legend(*shown[0, 0].get_legend_handles_labels(), loc="outside lower center", ncols=3)
    caption(
        figure,
        f"Row of Table 1: its errors of position and of attitude. Logarithmic axes, cut at {cut}: below, rounding is seen.",
    )
    return save("tracking_rows", folder, figure, numbers)


def _run(se3: MatrixGroup, reference: FormulaReference, row: int) -> tuple[ClosedLoop, list[TrackingRegion]]:
    from scipy.linalg import expm

    options: dict[str, Any] = {"inertia": _INERTIA, "error": f"se3_{row}", "gains": _GAINS}
    law = tracking_law(se3, **options, feedforward="levi_civita")
    X_d, xi_d, _ = ReferenceBody(reference)(FloatArithmetic(), 0.0)
    starts = [np.array(X_d, dtype=float) @ expm(se3.hat(twist)) for twist in _STARTS.values()]
    regions = [tracking_region(se3, **options, X=X0, xi=np.zeros(6), X_d=X_d, xi_d=xi_d) for X0 in starts]
    t = np.linspace(0, 25, 251)
    run = closed_loop(se3, inertia=_INERTIA, law=law, reference=reference, X0=np.array(starts), t=t, step=0.02)
    return run, regions


def _summary(W: NDArray[Any], region: TrackingRegion) -> dict[str, Any]:
    return {
        "W_0": float(W[0]), "L": region.bound, "inside": region.inside, "W_end": float(W[-1]),
        "converged": bool(W[-1] < 1e-4 * W[0]), "W_increases": int(np.sum(np.diff(W) > 1e-9 * W[0])),
    }  # fmt: skip


def _angles(run: ClosedLoop) -> NDArray[Any]:
    relative = np.swapaxes(np.asarray(run.X_d)[:, :3, :3], 1, 2) @ run.X[:, 0, :3, :3]
    cosine = (np.trace(relative, axis1=1, axis2=2) - 1) / 2
    values: NDArray[Any] = np.arccos(np.clip(cosine, -1, 1))
    return values
