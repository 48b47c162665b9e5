"""Figure 5 of Bullo and Murray: the gradient flows of phi_1, phi_2, phi_3 on SE(2)."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lie_codegen.control.tracking_law import tracking_law
from lie_codegen.gallery.attitude_style import quiet
from lie_codegen.groups.catalogue_load import group
from lie_codegen.groups.kernels import group_kernel
from lie_codegen.kernel.kernel import Kernel
from lie_codegen.pictures.result import GalleryResult, new_figure, save
from lie_codegen.pictures.style import BLUE, RED, caption
from lie_codegen.runtime.build import build_kernels

_METRIC = (4.0, 1.0, 1.5)
_STEP, _STEPS = 0.005, 1600
_STARTS = 12
#: Frames are drawn this far apart along a path, up to this far from the goal, where they would hide each other. [m]
_APART, _NEAR = 0.35, 0.35


def tracking_planar_flows(folder: Path, progress: Callable[[str], None] = quiet) -> GalleryResult:
    """Frames on the plane flowing down the three error functions; gains equal to the metric (J, m_x, m_y)."""
    figure = new_figure(13, 5)
    figure.suptitle(
        r"Gradient flows of the error functions on SE(2), metric $(J, m_x, m_y) = (4, 1, 1.5)$ (Bullo and Murray, Figure 5)"
    )
    caption(
        figure,
        f"Body frames (first axis red) every {_APART:g} m along the path, from the start to {_NEAR:g} m before the goal.",
    )
    numbers: dict[str, Any] = {}
    rows = (
        ("1", r"$\phi_1$: gains in space"),
        ("3", r"$\phi_2$: gains in the body frame"),
        ("4", r"$\phi_3$: symmetric"),
    )
    for axes, (row, title) in zip(figure.subplots(1, 3), rows, strict=True):
        progress(f"row {row}")
        flow, phi = _flow(row)
        for path in np.moveaxis(flow, 1, 0):
            axes.plot(path[:, 0, 2], path[:, 1, 2], color=BLUE, lw=0.9)
            for X in path[_evenly(path)]:
                _frame(axes, X)
        axes.plot(0, 0, "o", color="black", ms=4)
        axes.set(title=title, aspect="equal", xlim=(-1.9, 1.9), ylim=(-1.9, 1.9), xlabel="x [m]", ylabel="y [m]")
        numbers[f"phi_{row}_left"] = float(np.max(phi))
        numbers[f"length_{row}"] = float(np.sum(np.linalg.norm(np.diff(flow[:, :, :2, 2], axis=0), axis=2)) / _STARTS)
    return save("tracking_planar_flows", folder, figure, numbers)


def _flow(row: str) -> tuple[NDArray[Any], NDArray[Any]]:
    """(k, N, 3, 3) elements down xi = -I^{-1} d phi, and the last phi."""
    se2 = group("se2")
    # K_1 such that phi_1 has the stiffness J about the identity: tr(K_1 (1 - R))/2 = (k_1 + k_2)(1 - cos)/2.
    gains = {"K_1": _METRIC[0], "K_2": list(_METRIC[1:]), "K_d": 1}
    kernels: list[Kernel] = [
        tracking_law(se2, inertia=_METRIC, error=f"se2_{row}", gains=gains), group_kernel(se2, "exp")
    ]  # fmt: skip
    lib = build_kernels(lambda: kernels, namespace="se2")
    X = np.array([_start(2 * np.pi * k / _STARTS) for k in range(_STARTS)])
    still, eye = np.zeros((_STARTS, 3)), np.repeat(np.eye(3)[None], _STARTS, 0)
    path = [X]
    phi = np.zeros(_STARTS)
    for _ in range(_STEPS):
        force, phi, *_ = lib.tracking_law.batch(X, still, eye, still, still)
        middle = X @ lib.exp.batch(np.ascontiguousarray(force / _METRIC * _STEP / 2))
        force = lib.tracking_law.batch(np.ascontiguousarray(middle), still, eye, still, still).force
        X = np.ascontiguousarray(X @ lib.exp.batch(np.ascontiguousarray(force / _METRIC * _STEP)))
        path.append(X)
    return np.array(path), phi


def _start(angle: float) -> NDArray[Any]:
    turn = 1.2
    c, s = np.cos(turn), np.sin(turn)
    return np.array([[c, -s, 1.5 * np.cos(angle)], [s, c, 1.5 * np.sin(angle)], [0, 0, 1]])


def _evenly(path: NDArray[Any]) -> NDArray[Any]:
    """The samples of a path that lie evenly along its length, however fast it was run through."""
    places = path[:, :2, 2]
    along = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(places, axis=0), axis=1))])
    chosen = np.searchsorted(along, np.arange(0.0, along[-1] - _NEAR, _APART))
    values: NDArray[Any] = chosen[np.linalg.norm(places[chosen], axis=1) > _NEAR]
    return values


def _frame(axes: Any, X: NDArray[Any]) -> None:
    for column, colour in ((0, RED), (1, "0.55")):
        axes.plot(
            [X[0, 2], X[0, 2] + 0.16 * X[0, column]], [X[1, 2], X[1, 2] + 0.16 * X[1, column]], color=colour, lw=1
        )
