"""A falling cat: two bodies on a universal joint turn over without angular momentum, one bend of the back after another."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from lie_codegen.averaging.shape_examples import example_connection
from lie_codegen.flow.logarithm import matrix_log
from lie_codegen.pictures.result import GalleryResult, new_figure, save
from lie_codegen.pictures.style import caption
from lie_codegen.signals.periodic_input import PeriodicInput

_RADII = np.linspace(0.05, 1.4, 28)
_ORDERS = (2, 4, 6)


def falling_cat(folder: Path, progress: Callable[[str], None] = lambda line: None) -> GalleryResult:
    """Angle turned by a circle of the back's two bends, exact, by averages of rising order and by the area integral."""
    cat = example_connection("falling_cat")
    circle = PeriodicInput(["cos(t)", "sin(t)"])
    progress("circles of all radii")
    exact = np.array([matrix_log(cat.group, cat.displacement(circle, amplitude=float(r)))[0] for r in _RADII])
    areas = np.array([cat.cbvi(circle, amplitude=float(r)) for r in _RADII])
    averages = {order: cat.average(circle, order=order) for order in _ORDERS}
    figure = new_figure(10, 4.6)
    figure.suptitle("Two bodies on a joint turn over without angular momentum")
    axes: Any = figure.subplots(1, 2)
    size = np.linalg.norm(exact, axis=1)
    # a logarithm tells angles up to half a turn: past its peak the way on is the rest of the full turn
    angle = np.where(np.arange(len(size)) > np.argmax(size), 2 * np.pi - size, size)
    axes[0].plot(_RADII, angle, color="black", lw=2, label="exact")
    for order, average in averages.items():
        axes[0].plot(
            _RADII, [np.linalg.norm(average.log(float(r))) for r in _RADII], lw=1, label=f"average of order {order}"
        )
    axes[0].plot(_RADII, np.linalg.norm(areas, axis=1), "--", color="#8a8f98", label="area integral")
    axes[0].set(
        title="angle turned by one circle", xlabel="radius of the bend [rad]", ylabel="angle [rad]", ylim=(0, 4)
    )
    axes[0].legend(frameon=False, fontsize=8)
    grid = np.linspace(-1.4, 1.4, 61)
    r1, r2 = np.meshgrid(grid, grid, indexing="ij")
    height = -cat.curvature(np.stack([r1, r2], axis=-1))[..., 0, 1, 2]
    drawn = axes[1].contourf(r1, r2, height, 21, cmap="viridis")
    figure.colorbar(drawn, ax=axes[1], label="turn per area of the loop [1/rad]", format="%.1f")
    axes[1].plot(np.cos(grid * np.pi / 1.4), np.sin(grid * np.pi / 1.4), color="white", lw=1.5)
    axes[1].set(title="$-DA_{12}$ about the long axis", xlabel="$r_1$ [rad]", ylabel="$r_2$ [rad]")
    axes[1].set_aspect("equal")
    caption(
        figure,
        "Drawn at the right: the circle of radius 1. Averages are series in the radius, of use below about 0.7 rad.",
    )
    at_one = matrix_log(cat.group, cat.displacement(circle))[0]
    numbers = {"log_at_radius_1": at_one.tolist(), "F": averages[_ORDERS[-1]].F.tolist()}
    return save("falling_cat", folder, figure, numbers)
