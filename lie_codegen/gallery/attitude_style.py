"""Clean axes and small drawings shared by the attitude and tracking figures."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray


def quiet(line: str) -> None:
    """Progress that nobody reads."""


def tidy(axes: Any, title: str, x: str = "t [s]", y: str = "") -> None:
    """Title, labels, light grid, no frame above and right."""
    axes.set(title=title, xlabel=x, ylabel=y)
    axes.grid(color="0.92")
    axes.spines[["top", "right"]].set_visible(False)


def bare_3d(axes: Any, limit: float = 1.0) -> None:
    """Equal 3-D axes without ticks."""
    axes.set_box_aspect((1, 1, 1))
    axes.set(xlim=(-limit, limit), ylim=(-limit, limit), zlim=(-limit, limit))
    axes.set_axis_off()


def sphere(axes: Any) -> None:
    """The unit sphere as a light wire frame."""
    axes.computed_zorder = False  # what is drawn later lies on top
    u, v = np.mgrid[0 : 2 * np.pi : 49j, 0 : np.pi : 25j]
    x, y, z = np.cos(u) * np.sin(v), np.sin(u) * np.sin(v), np.cos(v)
    axes.plot_surface(x, y, z, color="#f3f5f9", alpha=0.25, linewidth=0, shade=False)
    axes.plot_wireframe(x, y, z, color="0.82", linewidth=0.4, rstride=4, cstride=4)


def brick(
    axes: Any, R: NDArray[Any], place: tuple[float, float], size: tuple[float, float, float], colour: str
) -> None:
    """A box turned by R, seen from in front and above, drawn with its far faces first."""
    elevation, azimuth = np.radians(22.0), np.radians(-70.0)
    c, s = np.cos(azimuth), np.sin(azimuth)
    right = np.array([-s, c, 0.0])
    towards = np.array([np.cos(elevation) * c, np.cos(elevation) * s, np.sin(elevation)])
    up = np.cross(towards, right)
    corners = np.array([[x, y, z] for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]) * np.array(size) / 2 @ R.T
    faces = [(0, 1, 3, 2), (4, 5, 7, 6), (0, 1, 5, 4), (2, 3, 7, 6), (0, 2, 6, 4), (1, 3, 7, 5)]
    normals = [R @ n for n in ([-1, 0, 0], [1, 0, 0], [0, -1, 0], [0, 1, 0], [0, 0, -1], [0, 0, 1])]
    for face, normal in sorted(zip(faces, normals, strict=True), key=lambda item: float(item[1] @ towards)):
        if normal @ towards <= 0:
            continue
        points = corners[list(face)]
        light = 0.7 + 0.35 * max(-0.5, float(normal @ (0.35 * right + 0.75 * up - 0.2 * towards)))
        flat = np.column_stack([points @ right + place[0], points @ up + place[1]])
        axes.fill(*flat.T, color=_shaded(colour, light), ec="white", lw=0.8)


def _shaded(colour: str, light: float) -> tuple[float, ...]:
    return tuple(min(1.0, light * int(colour[i : i + 2], 16) / 255) for i in (1, 3, 5))
