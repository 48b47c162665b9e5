"""A plan as a picture: controls, the loops whose areas do the work, the path, and the cost against the minimum."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lie_codegen.gallery.result import new_figure
from lie_codegen.simulation.driven import simulate_driven
from lie_codegen.simulation.flow import simulate
from lie_codegen.steering.constraints import Ball, Cone, Obstacle
from lie_codegen.steering.plan import Plan

Array = NDArray[Any]

_COLOURS = ("#1f5aa6", "#c8442f", "#3c8d5a", "#8a5aa6", "#b08a2e", "#5b6470")
_GREY = "#8a8f98"
_SAMPLES = 801


def draw_plan(plan: Plan, minimum: float | None = None, obstacles: Sequence[Obstacle] = ()) -> Any:
    """A matplotlib figure of a plan.

    Args:
        plan: any plan of `lc.steer`.
        minimum: the least energy, for the comparison; left out where it is not known.
        obstacles: drawn with the path.
    """
    t = np.linspace(0, plan.duration, _SAMPLES)
    X = _motion(plan, t)
    figure = new_figure(11, 8)
    parts = figure.add_gridspec(2, 2)
    _controls(figure.add_subplot(parts[0, 0]), plan, t)
    _loops(figure.add_subplot(parts[0, 1]), plan, t)
    _path(figure, parts[1, 0], plan, X, obstacles)
    _cost(figure.add_subplot(parts[1, 1]), plan, minimum)
    figure.suptitle(
        f"{plan.group.name}: {plan.details.get('winner', plan.method)}, error {plan.error:.1e}", fontsize=12
    )
    return figure


def _motion(plan: Plan, t: Array) -> Array:
    """X of the true system: under torques if the plan's controls are."""
    inertia, drift = plan.details.get("inertia"), plan.details.get("drift")
    if inertia is not None:
        return simulate_driven(plan.group, plan.u, inertia, t=t, xi0=plan.details["start_velocity"]).X
    return simulate(plan.group, plan.u if drift is None else plan.u.plus(drift), t=t).X


def _controls(axes: Any, plan: Plan, t: Array) -> None:
    u = plan.u(t)
    for label, colour in zip(plan.controls, _COLOURS * 3, strict=False):
        axes.plot(t, u[:, plan.group.labels.index(label)], color=colour, label=label)
    axes.set(title="controls", xlabel="t [s]")
    axes.legend(frameon=False)
    axes.grid(color="0.92")


def _loops(axes: Any, plan: Plan, t: Array) -> None:
    """The integrals of each pair of controls without their means: closed curves, whose areas drive the brackets."""
    positions = [plan.group.labels.index(label) for label in plan.controls]
    u = plan.u(t)[:, positions]
    centred = u - np.trapezoid(u, t, axis=0) / plan.duration
    steps = (centred[1:] + centred[:-1]) / 2 * np.diff(t)[:, None]
    curve = np.vstack([np.zeros(len(positions)), np.cumsum(steps, axis=0)])
    c = plan.group.algebra.structure_constants
    pairs = [
        pair for pair in combinations(range(len(positions)), 2) if np.any(c[positions[pair[0]], positions[pair[1]]])
    ]
    for (i, j), colour in zip(pairs, _COLOURS * 3, strict=False):
        x, y = curve[:, i], curve[:, j]
        area = float(np.trapezoid(x * np.gradient(y, t) - y * np.gradient(x, t), t) / 2)
        axes.fill(x, y, color=colour, alpha=0.12)
        axes.plot(x, y, color=colour, label=f"{plan.controls[i]}, {plan.controls[j]}: area {area:.4g}")
    axes.set(title="loops of the integrated controls, means taken out")
    axes.set_aspect("equal", "datalim")
    if pairs:
        axes.legend(frameon=False, fontsize=8)
    axes.grid(color="0.92")


def _path(figure: Any, place: Any, plan: Plan, X: Array, obstacles: Sequence[Obstacle]) -> None:
    group = plan.group
    last_row_still = all(matrix[-1, j] == 0 for matrix in group.exact_basis for j in range(group.degree))
    turns = bool(np.allclose(np.real(group.basis), -np.swapaxes(np.real(group.basis), 1, 2)))
    if not group.is_complex and group.degree == 3 and turns:
        _sphere(figure.add_subplot(place, projection="3d"), X, obstacles)
    elif not group.is_complex and last_row_still and group.degree in (3, 4):
        _positions(figure, place, X, obstacles)
    else:
        axes = figure.add_subplot(place)
        for row in range(group.degree):
            axes.plot(np.linspace(0, plan.duration, len(X)), np.abs(X[:, row, 0]) ** 2, label=f"|X[{row}, 0]|^2")
        axes.set(title="weights of the first column of X", xlabel="t [s]")
        axes.legend(frameon=False)


def _sphere(axes: Any, X: Array, obstacles: Sequence[Obstacle]) -> None:
    """Where each body axis points in space."""
    a, b = np.meshgrid(np.linspace(0, 2 * np.pi, 25), np.linspace(0, np.pi, 13))
    axes.plot_wireframe(np.cos(a) * np.sin(b), np.sin(a) * np.sin(b), np.cos(b), color="0.9", linewidth=0.5)
    for axis, colour in zip(range(3), _COLOURS, strict=False):
        axes.plot(*X[:, :, axis].T, color=colour, label=f"body axis {axis + 1}")
        axes.scatter(*X[-1, :, axis], color=colour, s=18)
    for obstacle in obstacles:
        if isinstance(obstacle, Cone):
            p = np.array(obstacle.parameters())
            axes.plot(*(X[:, :3, :3] @ p[:3]).T, color="k", lw=1, label="guarded axis")
            axes.plot(*_circle(p[3:6], float(obstacle.half_angle)).T, color="k", ls="--", label="kept out of")
    axes.set(title="path of the body axes in space")
    axes.set_axis_off()
    axes.set_box_aspect((1, 1, 1))
    axes.legend(frameon=False, fontsize=8)


def _circle(direction: Array, angle: float) -> Array:
    """The rim of a cone on the unit sphere."""
    across = np.linalg.svd(direction[None])[2][1:]
    phase = np.linspace(0, 2 * np.pi, 100)[:, None]
    rim = np.cos(phase) * across[0] + np.sin(phase) * across[1]
    return np.asarray(np.cos(angle) * direction + np.sin(angle) * rim)


def _positions(figure: Any, place: Any, X: Array, obstacles: Sequence[Obstacle]) -> None:
    if X.shape[-1] == 3:
        axes = figure.add_subplot(place)
        axes.plot(X[:, 0, 2], X[:, 1, 2], color=_COLOURS[0])
        axes.quiver(X[::80, 0, 2], X[::80, 1, 2], X[::80, 0, 0], X[::80, 1, 0], color=_GREY, width=0.004)
        phase = np.linspace(0, 2 * np.pi, 100)
        for ball in obstacles:
            if isinstance(ball, Ball):
                x, y = ball.center
                axes.fill(
                    x + ball.radius * np.cos(phase), y + ball.radius * np.sin(phase), color=_COLOURS[1], alpha=0.3
                )
        axes.set_aspect("equal", "datalim")
    else:
        axes = figure.add_subplot(place, projection="3d")
        axes.plot(X[:, 0, 3], X[:, 1, 3], X[:, 2, 3], color=_COLOURS[0])
        for axis, colour in zip(range(3), _COLOURS, strict=False):
            axes.quiver(*X[::160, :3, 3].T, *X[::160, :3, axis].T, length=0.1, color=colour)
    axes.set(title="path of the vehicle")


def _cost(axes: Any, plan: Plan, minimum: float | None) -> None:
    names, values = ["this plan"], [plan.cost]
    if minimum is not None:
        names, values = [*names, "least energy without limits"], [*values, minimum]
    bars = axes.barh(names, values, color=[_COLOURS[0], _GREY][: len(names)], height=0.5)
    axes.bar_label(bars, fmt="%.6g", padding=3)
    axes.set(title="energy", xlim=(0, 1.3 * max(values)))
    axes.invert_yaxis()
