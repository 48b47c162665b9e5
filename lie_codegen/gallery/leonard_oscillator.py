"""Figure 5 of TR 93-59: a rigid spacecraft with an appended point-mass oscillator, and the drift it causes.

The mass moves along y = eps x(t); Omega = -alpha_m I_lock(y)^{-1} (y x y') (70). The paper's average (77) and the one with the
next order, against the true body over many periods.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from lie_codegen.averaging.actuated_inputs import oscillator_areas, oscillator_average
from lie_codegen.flow.batched_exponential import expm, logm
from lie_codegen.flow.reference_flow import reference_flow
from lie_codegen.gallery.leonard_style import SAND, bare, eps_axis, plain
from lie_codegen.groups.catalogue_load import group
from lie_codegen.mechanics.actuators import PointMassOscillator
from lie_codegen.pictures.result import GalleryResult, new_figure, save
from lie_codegen.pictures.style import BLUE, GREEN, GREY, RED, caption
from lie_codegen.signals.periodic_input import PeriodicInput

_BODY = PointMassOscillator(10, 2, [["3/2", "1/20", 0], ["1/20", "6/5", "1/25"], [0, "1/25", 1]])
_VELOCITY = ["cos(t)", "sin(t) + 1/2*cos(2*t)", "sin(2*t)"]
_EPS = 0.2
_PERIODS = 7
_SWEEP = (0.4, 0.3, 0.2, 0.14, 0.1)


def true_rate(x_dot: PeriodicInput, eps: float) -> PeriodicInput:
    """Omega(t), (70), as a sampled periodic input."""
    return PeriodicInput.from_callable(lambda t: _BODY.body_rate(eps * x_dot.integral(t), eps * x_dot(t)), x_dot.period)


def point_mass_oscillator(folder: Path, progress: Callable[[str], None] = lambda line: None) -> GalleryResult:
    """Figure 5: the spacecraft, the path of the mass, the drift, and the order of both averages."""
    so3 = group("so3")
    x_dot = PeriodicInput(_VELOCITY, "2*pi")
    averaged = oscillator_average(so3, _BODY, x_dot)
    progress("simulating the body with its exact locked inertia")
    flow = reference_flow(so3, true_rate(x_dot, _EPS), 1.0, _PERIODS * x_dot.T)
    drifts = []
    for eps in _SWEEP:
        one = reference_flow(so3, true_rate(x_dot, eps), 1.0, x_dot.T)
        drifts.append(so3.project(logm(one.X[int(np.argmax(one.t))])) / x_dot.T)
    errors = np.array(
        [
            [np.linalg.norm(averaged.drift(eps, order) - true) for order in (1, 2)]
            for eps, true in zip(_SWEEP, drifts, strict=True)
        ]
    )
    slopes = np.log(errors[:-1] / errors[1:]) / np.log(np.array(_SWEEP[:-1]) / np.array(_SWEEP[1:]))[:, None]
    area = oscillator_areas(x_dot)
    numbers = {
        "reduced_mass_kg": float(_BODY.reduced_mass),
        "areas_of_the_path": [float(area[1, 2]), float(area[2, 0]), float(area[0, 1])],
        "u_av": [float(value) for value in averaged.first],
        "next_order": [float(value) for value in averaged.second],
        "eps": list(_SWEEP),
        "drift_error_printed": errors[:, 0].tolist(),
        "drift_error_next_order": errors[:, 1].tolist(),
        "slopes": slopes.tolist(),
        "turned_rad": float(np.linalg.norm(averaged.drift(_EPS)) * _PERIODS * x_dot.T),
    }
    return save("point_mass_oscillator", folder, _draw(x_dot, averaged, flow, errors), numbers)


def _draw(x_dot: PeriodicInput, averaged: Any, flow: Any, errors: Any) -> Any:
    figure = new_figure(12, 7.5)
    grid = figure.add_gridspec(2, 3)
    figure.suptitle("A spacecraft turned by a vibrating point mass (TR 93-59, Figure 5)")
    caption(
        figure, "Attitude: the body simulated with its exact locked inertia (colours), both averages (dotted, dashed)."
    )
    _sketch(figure.add_subplot(grid[:, 0], projection="3d"), x_dot)
    paths, shown = figure.add_subplot(grid[0, 1]), figure.add_subplot(grid[1, 1])
    drift, order = figure.add_subplot(grid[0, 2]), figure.add_subplot(grid[1, 2])
    t = np.linspace(0, x_dot.T, 400)
    x = x_dot.integral(t)
    for (i, j), colour in (((0, 1), BLUE), ((1, 2), RED), ((2, 0), GREEN)):
        paths.fill(x[:, i], x[:, j], color=colour, alpha=0.10)
        paths.plot(x[:, i], x[:, j], color=colour, label=f"$x_{i + 1}, x_{j + 1}$")
    paths.set(
        title="path of the mass, per unit $\\epsilon$",
        aspect="equal",
        xlabel="first of the pair [m]",
        ylabel="second of the pair [m]",
    )
    paths.set_adjustable("datalim")
    paths.legend(loc="lower right")
    rate = true_rate(x_dot, _EPS)(t)
    for i, colour in enumerate((BLUE, RED, GREEN)):
        shown.plot(t, rate[:, i], color=colour, label=f"$\\Omega_{i + 1}$")
    shown.set(title=f"body rate over one period, $\\epsilon = {_EPS}$", xlabel="t [s]", ylabel="rate [rad/s]")
    shown.legend()
    so3 = group("so3")
    actual = so3.project(logm(flow.X))
    for i, colour in enumerate((BLUE, RED, GREEN)):
        drift.plot(flow.t, actual[:, i], color=colour, lw=1, label=f"axis {i + 1}")
    for terms, style in ((1, ":"), (2, "--")):
        turned = so3.project(logm(expm(so3.hat(flow.t[:, None] * averaged.drift(_EPS, terms)))))
        drift.plot(flow.t, turned, style, color="0.15", lw=0.9)
        drift.plot([], [], style, color="0.15", label="average (77)" if terms == 1 else "with the next order")
    drift.set(title=f"attitude, $\\epsilon = {_EPS}$", ylabel="rotation vector [rad]", xlabel="t [s]")
    drift.legend()
    for column, label, colour in ((0, "average (77)", BLUE), (1, "with the next order", RED)):
        order.loglog(_SWEEP, errors[:, column], "o-", mfc="none", color=colour, label=label)
    order.set(title="error of the drift rate", ylabel="error [rad/s]")
    eps_axis(order, _SWEEP)
    order.legend()
    plain(paths, shown, drift, order)
    return figure


def _sketch(axes: Any, x_dot: PeriodicInput) -> None:
    """The body as an ellipsoid, the mass on its path, a spring between."""
    polar, round_ = np.meshgrid(np.linspace(0, np.pi, 24), np.linspace(0, 2 * np.pi, 48))
    ball = np.array([np.sin(polar) * np.cos(round_), np.sin(polar) * np.sin(round_), np.cos(polar)])
    axes.plot_surface(*(ball * np.array([1.0, 0.85, 0.7])[:, None, None]), color=SAND, alpha=0.13, lw=0, shade=True)
    path = 0.42 * x_dot.integral(np.linspace(0, x_dot.T, 300))
    axes.plot(*path.T, color=RED, lw=1.3)
    mass = path[150]
    along = np.linspace(0, 1, 200)
    direction = mass / np.linalg.norm(mass)
    across = np.cross(direction, [0, 0, 1.0])
    across /= np.linalg.norm(across)
    coil = along[:, None] * mass + 0.045 * (
        np.sin(24 * np.pi * along)[:, None] * across + np.cos(24 * np.pi * along)[:, None] * np.cross(direction, across)
    )
    axes.plot(*coil.T, color=GREY, lw=1)
    axes.scatter(*mass, color=RED, s=60, depthshade=False)
    axes.text(*(mass + np.array([0.0, 0.05, 0.14])), "$m_1$ at $y(t)$", color=RED)
    for i in range(3):
        e = np.eye(3)[i]
        axes.plot(*np.array([np.zeros(3), 1.25 * e]).T, color="0.35", lw=0.8, ls=":")
        axes.text(*(1.33 * e), f"$r_{i + 1}$", color="0.35", fontsize=8)
    axes.set(xlim=(-0.9, 1.1), ylim=(-0.9, 1.1), zlim=(-0.9, 1.1))
    axes.view_init(48, 15)
    axes.text2D(
        0.5, -0.02, "a point mass $m_1$ driven inside the body", transform=axes.transAxes, ha="center", fontsize=12
    )
    bare(axes)
