"""Figures 1 and 2 of Bullo and Murray: what coordinates do to errors on the sphere, and the transport map that needs none."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.gallery.attitude_style import bare_3d, quiet, sphere
from lie_codegen.pictures.result import GalleryResult, new_figure, save
from lie_codegen.pictures.style import BLUE, COLOURS, RED, caption

#: Where the paths start and end: latitude and longitude [rad].
_FROM, _TO = (0.25, -0.2), (0.85, 2.0)
#: The transport maps are seen from this elevation and azimuth [degrees], at this many points of the whole sphere.
_VIEW, _POINTS = (48.0, 25.0), 260


def tracking_sphere(folder: Path, progress: Callable[[str], None] = quiet) -> GalleryResult:
    """Straight lines of four charts on one sphere; the transported velocity of two designs."""
    charts = {
        "latitude, longitude": _plain,
        "Mercator": _mercator,
        "stereographic": _stereographic,
        "gradient of 1 - q.r": None,
    }
    q, r = (_point(*place) for place in (_FROM, _TO))
    paths = {name: _great_circle(q, r) if chart is None else chart(q, r) for name, chart in charts.items()}
    lengths = {name: float(np.sum(np.linalg.norm(np.diff(path, axis=0), axis=1))) for name, path in paths.items()}
    figure = new_figure(12, 8.4)
    figure.suptitle(
        "Errors on the sphere: straight lines of four charts, and two transport maps (Bullo and Murray, Figures 1 and 2)"
    )
    caption(
        figure,
        "Below: the velocity at the tilted point (red) carried to other points of the near side (blue, drawn shorter, "
        "both panels to one scale).",
    )
    for number, (name, path) in enumerate(paths.items()):
        axes = figure.add_subplot(2, 4, number + 1, projection="3d")
        sphere(axes)
        axes.plot(*path.T, color=COLOURS[number], lw=2)
        axes.scatter(*np.array([q, r]).T, color="black", s=14)
        axes.view_init(elev=25, azim=50)
        bare_3d(axes, 0.7)
        axes.set_title(f"{name.replace('1 - q.r', '$1 - q^T r$')}\nlength {lengths[name]:.4f}")
    tilted = _point(1.25, 0.3)
    ours = _field(lambda p: _transport(p, tilted, _velocity(tilted, 0.7)))
    theirs = _field(lambda p: _by_chart(p, tilted, _velocity(tilted, 0.7)))
    progress("transport maps")
    for place, field, title in (
        (3, ours, r"$\mathcal{T} = (q^T r)\,1 - r\,q^T$: smooth everywhere"),
        (4, theirs, "by latitude and longitude: breaks at the pole N"),
    ):
        axes = figure.add_subplot(2, 2, place, projection="3d")
        sphere(axes)
        points, arrows = field
        axes.quiver(*points.T, *(0.2 * arrows).T, color=BLUE, lw=0.9, arrow_length_ratio=0.35)
        axes.scatter(0, 0, 1, color="black", s=12)
        axes.quiver(*(1.02 * tilted), *_velocity(tilted, 0.7), color=RED, lw=3, arrow_length_ratio=0.25)
        axes.text(0, 0, 1.08, "N", fontsize=11)
        axes.view_init(*_VIEW)
        bare_3d(axes, 0.75)
        axes.set_title(title)
    near = [_point(np.pi / 2 - 1e-6, a) for a in (0.0, np.pi)]
    numbers = {
        "lengths": lengths,
        "angle_between_the_ends": float(np.arccos(q @ r)),
        "jump_across_the_pole_smooth": float(
            np.linalg.norm(np.subtract(*[_transport(p, tilted, _velocity(tilted, 0.7)) for p in near]))
        ),
        "jump_across_the_pole_chart": float(
            np.linalg.norm(np.subtract(*[_by_chart(p, tilted, _velocity(tilted, 0.7)) for p in near]))
        ),
    }
    return save("tracking_sphere", folder, figure, numbers)


def _point(latitude: Any, longitude: Any) -> Array:
    c = np.cos(latitude)
    return np.asarray(
        np.stack([c * np.cos(longitude), c * np.sin(longitude), np.sin(latitude) + 0 * longitude], axis=-1)
    )


def _angles(q: Array) -> tuple[float, float]:
    return float(np.arcsin(np.clip(q[2], -1, 1))), float(np.arctan2(q[1], q[0]))


def _line(a: Any, b: Any) -> Array:
    s = np.linspace(0, 1, 400)[:, None]
    return np.asarray((1 - s) * np.array(a) + s * np.array(b))


def _plain(q: Array, r: Array) -> Array:
    x = _line(_angles(q), _angles(r))
    return _point(x[:, 0], x[:, 1])


def _mercator(q: Array, r: Array) -> Array:
    x = _line(*[(np.arctanh(p[2]), _angles(p)[1]) for p in (q, r)])
    return _point(np.arcsin(np.tanh(x[:, 0])), x[:, 1])


def _stereographic(q: Array, r: Array) -> Array:
    """Seen from the north pole."""
    x = _line(*[p[:2] / (1 - p[2]) for p in (q, r)])
    square = np.sum(x**2, axis=1)
    return np.asarray(np.column_stack([2 * x[:, 0], 2 * x[:, 1], square - 1]) / (1 + square)[:, None])


def _great_circle(q: Array, r: Array) -> Array:
    """The flow of the gradient of 1 - q.r runs along great circles."""
    angle = np.arccos(q @ r)
    s = np.linspace(0, angle, 400)[:, None]
    return np.asarray((np.sin(angle - s) * q + np.sin(s) * r) / np.sin(angle))


def _velocity(r: Array, size: float) -> Array:
    east = np.array([-r[1], r[0], 0])
    north = np.cross(r, east)
    direction = east + 0.6 * north
    return np.asarray(size * direction / np.linalg.norm(direction))


def _transport(q: Array, r: Array, rate: Array) -> Array:
    return np.asarray((q @ r) * rate - (q @ rate) * r)


def _by_chart(q: Array, r: Array, rate: Array) -> Array:
    """Components of the velocity in the chart at r, taken as components in the chart at q."""
    here, there = (_chart_basis(p) for p in (q, r))
    components = [rate @ e / (e @ e) for e in there]
    return np.asarray(components[0] * here[0] + components[1] * here[1])


def _chart_basis(q: Array) -> tuple[Array, Array]:
    latitude, longitude = _angles(q)
    s, c = np.sin(latitude), np.cos(latitude)
    north = np.array([-s * np.cos(longitude), -s * np.sin(longitude), c])
    return north, np.array([-c * np.sin(longitude), c * np.cos(longitude), 0])


def _field(function: Callable[[Array], Array]) -> tuple[Array, Array]:
    """The function at points spread evenly over the side that is seen: a spiral of the golden angle, equal areas apart."""
    k = np.arange(_POINTS)
    points = _point(np.arcsin(1 - (2 * k + 1) / _POINTS), k * np.pi * (3 - np.sqrt(5)))
    points = points[points @ _point(*np.radians(_VIEW)) > 0.25]
    return points, np.array([function(p) for p in points])
