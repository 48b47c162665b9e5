"""A tractor with a trailer moved sideways: in chained form it is the Engel group, its sideways move a figure of eight.

Trailer axle (x, y) at the angle phi, tractor at the angle theta, hitch on the tractor's axle, length L; v and omega are the
tractor's speed and turn:
    x' = v cos(theta - phi) cos(phi),  y' = v cos(theta - phi) sin(phi),  phi' = v sin(theta - phi) / L,  theta' = omega.
With z = (x, dz3/dx, tan(phi), y), dz3/dx = tan(theta - phi) / (L cos^3(phi)), and u_1 = x' this is
    z1' = u1,  z2' = u2,  z3' = z2 u1,  z4' = z3 u1,
left-invariant on the Engel group: g = (z1, z2, -z3, z4) are coordinates of the second kind, as [f1, f2] = -d/dz3 and
[f1, [f1, f2]] = d/dz4; the same for any drift-free system that can be brought to this chained form.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp

from lie_codegen.arrays import Array
from lie_codegen.groups.catalogue_load import group
from lie_codegen.pictures.result import GalleryResult, new_figure, save
from lie_codegen.pictures.steering_loops import COLOURS, GREY, draw_loops
from lie_codegen.pictures.style import caption
from lie_codegen.steering.front import steer
from lie_codegen.steering.plan import Plan

_LENGTH = 1.0
_SIDEWAYS = 1.0
_DURATION = 20.0


def steering_trailer(folder: Path, progress: Callable[[str], None] = lambda line: None) -> GalleryResult:
    """Plans in chained form, drives the true vehicle, integrated by SciPy, and draws where it goes."""
    engel = group("engel")
    target = (0.0, 0.0, 0.0, _SIDEWAYS)
    plan = steer(engel, target, ("x1", "x2"), _DURATION, method="loops")
    progress("least energy, for the comparison")
    best = steer(engel, target, ("x1", "x2"), _DURATION)
    t = np.linspace(0, _DURATION, 2001)
    driven = {"the figure of eight": _driven(plan, t), "least energy": _driven(best, t)}
    ends = {name: way[-1] - np.array([0.0, _SIDEWAYS, 0.0, 0.0]) for name, way in driven.items()}
    [moment] = plan.details["moments"].values()
    numbers = {
        "moment": float(moment),
        "energy": plan.cost,
        "least_energy": best.cost,
        "vehicle_misses_by": float(np.max(np.abs(ends["the figure of eight"]))),
        "vehicle_misses_by_least_energy": float(np.max(np.abs(ends["least energy"]))),
        "largest_hitch_angle_rad": float(np.max(np.abs(driven["the figure of eight"] @ [0, 0, -1, 1]))),
    }
    return save("steering_trailer", folder, _figure(plan, t, driven), numbers)


def _driven(plan: Plan, t: Array) -> Array:
    """(k, 4) x, y, phi, theta of the vehicle under the plan's inputs, from rest at the origin."""

    def rate(time: float, state: Array) -> Array:
        _, _, phi, theta = state
        u1, u2 = plan.u(time)[:2]
        hitch = theta - phi
        v = u1 / (np.cos(hitch) * np.cos(phi))
        phi_rate = v * np.sin(hitch) / _LENGTH
        # z2 = tan(hitch) / (L cos^3 phi): u2 = z2' solved for hitch', then theta' = hitch' + phi'
        hitch_rate = np.cos(hitch) ** 2 * (_LENGTH * np.cos(phi) ** 3 * u2 - 3 * np.tan(hitch) * np.tan(phi) * phi_rate)
        return np.array([u1, u1 * np.tan(phi), phi_rate, hitch_rate + phi_rate])

    state, pieces = np.zeros(4), [np.zeros((1, 4))]
    knots = np.concatenate([[0.0], plan.u.breakpoints, [plan.duration]])
    for start, stop in pairwise(knots):
        inner = t[(t > start) & (t <= stop)]
        times = np.unique(np.append(inner, stop))
        span = (start + 1e-12, stop - 1e-12)  # inside the piece on which u is smooth
        run = solve_ivp(rate, span, state, method="DOP853", rtol=1e-11, atol=1e-12, t_eval=np.clip(times, *span))
        state = run.y[:, -1]
        pieces.append(run.y.T[: len(inner)])
    return np.vstack(pieces)


def _figure(plan: Plan, t: Array, driven: dict[str, Array]) -> Any:
    figure = new_figure(12, 7)
    parts = figure.add_gridspec(2, 2, width_ratios=(1.6, 1))
    axes = figure.add_subplot(parts[:, 0])
    for (name, way), colour in zip(driven.items(), COLOURS, strict=False):
        axes.plot(way[:, 0], way[:, 1], color=colour, label=name)
    for x, y, phi, theta in driven["the figure of eight"][:: len(t) // 14]:
        hitch = np.array([x + _LENGTH * np.cos(phi), y + _LENGTH * np.sin(phi)])
        front = hitch + 0.4 * np.array([np.cos(theta), np.sin(theta)])
        axes.plot(*np.array([[x, y], hitch]).T, color=GREY, lw=1.2)
        axes.plot(*np.array([hitch, front]).T, color="k", lw=2.2)
    figure.suptitle("A tractor with a trailer moved one metre sideways: the figure of eight of the Engel group")
    caption(
        figure,
        "Thick: the tractor; thin: the trailer's bar, at even times of the figure of eight. The vehicle is integrated by SciPy.",
    )
    axes.set(title="paths of the trailer's axle", xlabel="x [m]", ylabel="y [m]")
    axes.set_aspect("equal", "datalim")
    axes.legend(loc="upper left")
    axes.grid(color="0.92")
    loops = figure.add_subplot(parts[0, 1])
    draw_loops(loops, plan, t, plan.u(t))
    loops.set(title="the figure of eight in chained form", xlabel=r"$\int u_1\,dt$ [m]", ylabel=r"$\int u_2\,dt$ [1/m]")
    below = figure.add_subplot(parts[1, 1])
    for number, label in enumerate(("$x$ [m]", "$y$ [m]", r"trailer $\phi$ [rad]", r"tractor $\theta$ [rad]")):
        below.plot(t, driven["the figure of eight"][:, number], color=COLOURS[number], label=label)
    below.set(title="the vehicle over time", xlabel="t [s]", ylabel="m, rad")
    below.legend(frameon=False, ncols=2)
    below.grid(color="0.92")
    return figure
