"""A three-link swimmer: height functions of its curvature with the best gait on them, and the way of its middle link."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from lie_codegen.averaging.gait_design import gait
from lie_codegen.averaging.path_end import magnus_six
from lie_codegen.averaging.shape_examples import example_connection
from lie_codegen.flow.batched_exponential import expm
from lie_codegen.pictures.result import GalleryResult, new_figure, save
from lie_codegen.pictures.style import caption
from lie_codegen.signals.periodic_input import PeriodicInput

_WIDTH, _NODES, _STEPS, _PERIODS = 1.6, 61, 200, 6


def swimmer_gait(folder: Path, progress: Callable[[str], None] = lambda line: None) -> GalleryResult:
    """The gait of greatest displacement by effort, three harmonics, beside circles."""
    swimmer = example_connection("three_link_swimmer")
    progress("the frame of least motion, and the gait")
    framed = swimmer.best_frame(half_width=_WIDTH, degree=3)
    best = gait(swimmer, harmonics=3)
    grid = np.linspace(-_WIDTH, _WIDTH, _NODES)
    r1, r2 = np.meshgrid(grid, grid, indexing="ij")
    heights = -framed.curvature(np.stack([r1, r2], axis=-1))[..., 0, 1, :]
    t = np.linspace(0, 2 * np.pi, _STEPS + 1)
    loop = best.r(t)
    figure = new_figure(13, 4.8)
    figure.suptitle("Three links in a viscous fluid: the gait of greatest displacement by effort")
    axes: Any = figure.subplots(1, 3)
    names = {0: r"$\omega$", 1: "$v_x$"}
    for axis, component in zip(axes[:2], (1, 0), strict=True):
        height = heights[..., component]
        size = np.abs(height).max()
        drawn = axis.contourf(r1, r2, height, 21, cmap="RdBu_r", vmin=-size, vmax=size)
        axis.plot(loop[:, 0], loop[:, 1], color="black", lw=1.5)
        axis.set(
            title=f"height function $-DA_{{12}}$ of {names[component]}", xlabel="$r_1$ [rad]", ylabel="$r_2$ [rad]"
        )
        axis.set_aspect("equal")
        unit = "m/rad$^2$" if component else "1/rad"
        figure.colorbar(drawn, ax=axis, shrink=0.8, label=unit, format="%.2g")

    def velocity(times: Any) -> Any:
        rate = (best.r(times + 1e-6) - best.r(times - 1e-6)) / 2e-6
        return -np.einsum("tnk,tk->tn", swimmer.A(best.r(times)), rate)

    steps = expm(swimmer.group.hat(magnus_six(swimmer.group, velocity, t[:-1], np.diff(t))))
    X, way = np.eye(3), [np.zeros(2)]
    for _ in range(_PERIODS):
        for step in steps:
            X = X @ step
            way.append(X[:2, 2])
    path = np.array(way)
    axes[2].plot(path[:, 0], path[:, 1], color="#1f5aa6")
    axes[2].plot(*path[::_STEPS].T, "o", color="#c8442f", ms=4)
    axes[2].set(title=f"path over {_PERIODS} periods", xlabel="x [m]", ylabel="y [m]")
    axes[2].set_aspect("equal")
    caption(
        figure,
        "The curve is the gait on the shape space; what it encloses is, to second order, what it moves. Dots: ends of the periods.",
    )
    circles = {}
    for radius in (0.8, 1.0, 1.2, 1.4):
        X = swimmer.displacement(PeriodicInput(["cos(t)", "sin(t)"]), amplitude=radius)
        circles[str(radius)] = float(np.linalg.norm(X[:2, 2]))
    numbers = {
        "objective": best.objective,
        "efficiency": best.efficiency,
        "distance": best.distance,
        "rotation": best.rotation,
        "distance_of_circles": circles,
        "int_A2_before": framed.frame.cost_before if framed.frame else None,
        "int_A2_after": framed.frame.cost_after if framed.frame else None,
        "cbvi": framed.cbvi(best.r).tolist(),
        "log": best.log.tolist(),
    }
    return save("swimmer_gait", folder, figure, numbers)
