"""The motion of a plan: the axes of a rotation on the sphere, a vehicle's way, or the coordinates of an element."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.errors import ChartError
from lie_codegen.flow.simulate import simulate
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.pictures.quantum_path import bloch_paths
from lie_codegen.pictures.solid_lines import outline, surface
from lie_codegen.pictures.steering_loops import COLOURS, GREY
from lie_codegen.steering.blocks import Block
from lie_codegen.steering.constraints import Ball, Cone, Obstacle
from lie_codegen.steering.plan import Plan

_FRAMES = 12

#: Cones in opposite directions favour no side.
_NO_SIDE = 0.1


def draw_path(figure: Any, place: Any, plan: Plan, t: Array, X: Array, obstacles: Sequence[Obstacle]) -> None:
    """The path in the way that suits the group."""
    group = plan.group
    if _moves_space(group):
        _positions(figure, place, X, obstacles)
        return
    turned = _rotations(group, X)
    if turned is not None:
        label = "body axis" if not group.is_complex else "Bloch axis"
        names = [f"{label} {axis}" for axis in (1, 2, 3)]
        _sphere(figure.add_subplot(place, projection="3d"), turned, names, obstacles)
        return
    states = bloch_paths(plan, X) if group.is_complex else None
    if states is not None:
        _sphere(
            figure.add_subplot(place, projection="3d"),
            *states,
            obstacles,
            "Bloch vectors, open to filled dots",
        )
        return
    _coordinates(figure.add_subplot(place), plan, t, X)


def _moves_space(group: MatrixGroup) -> bool:
    """Whether X = (R p; 0 1), R a rotation: SE(2), SE(3)."""
    basis, d = group.basis, group.degree
    if group.is_complex or d not in (3, 4) or np.any(basis[:, -1]) or not np.any(basis[:, :-1, -1]):
        return False
    blocks = basis[:, :-1, :-1]
    return bool(np.any(blocks)) and bool(np.allclose(blocks, -np.swapaxes(blocks, 1, 2)))


def _rotations(group: MatrixGroup, X: Array) -> Array | None:
    """(k, 3, 3) X itself, or Ad_X where that is a rotation (SU(2)); None for other groups."""
    if not group.is_complex and group.degree == 3 and np.allclose(group.basis, -np.swapaxes(group.basis, 1, 2)):
        return X
    if group.dim != 3 or not group.is_complex:
        return None
    images = group.project(X[:, None] @ group.basis @ np.linalg.inv(X)[:, None])
    adjoint = np.swapaxes(images, 1, 2)
    return adjoint if np.allclose(adjoint @ np.swapaxes(adjoint, 1, 2), np.eye(3), atol=1e-6) else None


def _sphere(
    axes: Any,
    R: Array,
    names: Sequence[str],
    obstacles: Sequence[Obstacle],
    title: str = "path of the axes in space, from the open to the filled dots",
) -> None:
    """Curves (k, 3, j) in the unit ball: where each axis points in space."""
    a, b = np.meshgrid(np.linspace(0, 2 * np.pi, 25), np.linspace(0, np.pi, 13))
    axes.computed_zorder = False
    axes.plot_wireframe(np.cos(a) * np.sin(b), np.sin(a) * np.sin(b), np.cos(b), color="0.9", lw=0.5, zorder=0)
    for axis, (name, colour) in enumerate(zip(names, COLOURS, strict=False)):
        axes.plot(*R[:, :, axis].T, color=colour, label=name)
        axes.scatter(*R[0, :, axis], color="white", edgecolor=colour, s=18)
        axes.scatter(*R[-1, :, axis], color=colour, s=18)
    seen = np.zeros(3)
    for obstacle in obstacles:
        if isinstance(obstacle, Cone):
            p = np.array(obstacle.parameters())
            seen += p[3:6] / np.linalg.norm(p[3:6])
            axes.plot(*(R @ p[:3]).T, color="k", lw=5, alpha=0.15, zorder=1, label="guarded axis")
            axes.plot(*_circle(p[3:6], float(obstacle.half_angle)).T, color="k", ls="--", lw=1.2, label="kept out of")
    axes.set(title=title)
    axes.set_axis_off()
    axes.set_box_aspect((1, 1, 1), zoom=1.3)
    elevation, azimuth = _facing(seen)
    axes.view_init(elev=elevation, azim=azimuth)
    axes.legend(frameon=False, fontsize=8, loc="upper left", bbox_to_anchor=(-0.1, 1))


def _facing(direction: Array) -> tuple[float, float]:
    """Elevation and azimuth [degrees] from which a cone there is seen open, a little from the side; without one the usual ones."""
    if np.linalg.norm(direction) < _NO_SIDE:
        return 25.0, 35.0
    x, y, z = direction
    return float(np.clip(np.degrees(np.arctan2(z, np.hypot(x, y))), -60, 60)), float(
        np.degrees(np.arctan2(y, x))
    ) + 15.0


def _circle(direction: Array, angle: float) -> Array:
    """The rim of a cone on the unit sphere."""
    across = np.linalg.svd(direction[None])[2][1:]
    phase = np.linspace(0, 2 * np.pi, 100)[:, None]
    rim = np.cos(phase) * across[0] + np.sin(phase) * across[1]
    return np.asarray(np.cos(angle) * direction + np.sin(angle) * rim)


def _positions(figure: Any, place: Any, X: Array, obstacles: Sequence[Obstacle]) -> None:
    p = X[:, :-1, -1]
    size = max(float(np.max(np.ptp(p, axis=0))), 1e-9)
    shown = np.unique(np.linspace(0, len(X) - 1, _FRAMES).astype(int))
    if p.shape[1] == 2:
        axes = figure.add_subplot(place)
        axes.plot(*p.T, color=COLOURS[0])
        axes.quiver(*p[shown].T, *X[shown, :2, 0].T, color=GREY, width=0.004, scale=14)
        phase = np.linspace(0, 2 * np.pi, 100)
        for obstacle in obstacles:
            if isinstance(obstacle, Ball):
                x, y = obstacle.center
                rim = x + obstacle.radius * np.cos(phase), y + obstacle.radius * np.sin(phase)
                axes.fill(*rim, color=COLOURS[1], alpha=0.3)
            elif isinstance(obstacle, Block):
                axes.fill(*outline(obstacle).T, color=COLOURS[1], alpha=0.3)
        axes.set_aspect("equal", "datalim")
        axes.grid(color="0.92")
        axes.set(xlabel="x", ylabel="y")
    else:
        axes = figure.add_subplot(place, projection="3d")
        axes.plot(*p.T, color="k", lw=1.2)
        for axis, colour in zip(range(3), COLOURS, strict=False):
            axes.quiver(*p[shown].T, *X[shown, :3, axis].T, length=0.12 * size, color=colour, lw=1)
        for obstacle in obstacles:
            if isinstance(obstacle, Ball):
                a, b = np.meshgrid(np.linspace(0, 2 * np.pi, 25), np.linspace(0, np.pi, 13))
                net = np.stack([np.cos(a) * np.sin(b), np.sin(a) * np.sin(b), np.cos(b)])
                points = np.array(obstacle.center)[:, None, None] + obstacle.radius * net
                axes.plot_wireframe(*points, color=COLOURS[1], linewidth=0.5, alpha=0.4)
            elif isinstance(obstacle, Block):
                axes.plot_wireframe(*surface(obstacle), color=COLOURS[1], linewidth=0.5, alpha=0.4)
        low, high = np.min(p, axis=0) - 0.15 * size, np.max(p, axis=0) + 0.15 * size
        ends = dict(zip(("xlim", "ylim", "zlim"), zip(low.tolist(), high.tolist(), strict=True), strict=True))
        axes.set(xlabel="x", ylabel="y", zlabel="z", **ends)
        axes.set_box_aspect(tuple((high - low).tolist()))
    axes.scatter(*p[0], color="white", edgecolor="k", s=25, zorder=3)
    axes.scatter(*p[-1], color="k", s=25, zorder=3)
    axes.set(title="path of the vehicle, from the open to the filled dot")


def _coordinates(axes: Any, plan: Plan, t: Array, X: Array) -> None:
    """Coordinates of the second kind; where their chart ends on the way, what `draw_entries` draws."""
    g = _second_kind(plan, t)
    if g is None:
        draw_entries(axes, plan.group, t, X)
        return
    for number, label in enumerate(plan.group.labels):
        style = "-" if number < len(COLOURS) else "--"
        axes.plot(t, g[:, number], style, color=COLOURS[number % len(COLOURS)], label=label)
    axes.set(title="coordinates of the second kind", xlabel="t [s]", xlim=(0, plan.duration))
    axes.grid(color="0.92")
    axes.legend(frameon=False, fontsize=8)


def _second_kind(plan: Plan, t: Array) -> Array | None:
    drift = plan.details.get("drift")
    if "inertia" in plan.details or "start" in plan.details or getattr(plan.details.get("system"), "right", False):
        return None
    try:
        return simulate(plan.group, plan.u if drift is None else plan.u.plus(drift), t=t).g
    except ChartError:
        return None


def draw_entries(axes: Any, group: MatrixGroup, t: Array, X: Array) -> None:
    """Of real groups the entries of X that move, of complex ones the weights of the first column."""
    if group.is_complex:
        for row in range(group.degree):
            axes.plot(t, np.abs(X[:, row, 0]) ** 2, label=f"|X[{row}, 0]|^2")
        axes.set(title="weights of the first column of X", xlabel="t [s]")
    else:
        moving = np.argwhere(np.ptp(X, axis=0) > 1e-9)[: 2 * len(COLOURS)]
        for number, (row, column) in enumerate(moving):
            style = "-" if number < len(COLOURS) else "--"
            axes.plot(t, X[:, row, column], style, color=COLOURS[number % len(COLOURS)], label=f"X[{row}, {column}]")
        axes.set(title="entries of X", xlabel="t [s]")
    axes.grid(color="0.92")
    if axes.get_legend_handles_labels()[1]:
        axes.legend(frameon=False, fontsize=8)
