"""Figure 4 of TR 93-59: a rigid spacecraft with momentum wheels, here with three skew ones, and its drift.

The wheels oscillate with zero mean and the body drifts: theta -> u = C theta' (68), areas by the cofactor matrix of C, and the
area rule for the attitude, against the simulated body.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from lie_codegen.averaging.actuated_inputs import wheel_input
from lie_codegen.averaging.averaged import average
from lie_codegen.averaging.order_check import order_check
from lie_codegen.flow.attitude_metrics import rotation_angle
from lie_codegen.flow.batched_exponential import logm
from lie_codegen.flow.reference_flow import reference_flow
from lie_codegen.gallery.leonard_style import SAND, bare, plain
from lie_codegen.groups.catalogue_load import group
from lie_codegen.mechanics.actuators import MomentumWheels
from lie_codegen.pictures.result import GalleryResult, new_figure, save
from lie_codegen.pictures.style import BLUE, GREEN, GREY, RED, caption
from lie_codegen.signals.periodic_input import PeriodicInput

_WHEELS = MomentumWheels(
    inertia=[[2, "-1/20", "1/10"], ["-1/20", "17/10", "3/100"], ["1/10", "3/100", "6/5"]],
    axes=[[1, "1/5", 0], [0, 1, "3/10"], ["-1/5", 0, 1]],
    axial=["3/10", "3/10", "3/10"],
    transverse=["3/20", "3/20", "3/20"],
)
_RATES = ["3*cos(t)", "3*sin(t)", "cos(2*t)"]
_EPS = 0.2
_PERIODS = 25


def momentum_wheels(folder: Path, progress: Callable[[str], None] = lambda line: None) -> GalleryResult:
    """Figure 4: the spacecraft, its loops, and the drift of its attitude."""
    so3 = group("so3")
    theta_dot = PeriodicInput(_RATES, "2*pi")
    u = wheel_input(_WHEELS, theta_dot)
    progress("simulating the body and fitting the order of the area rule")
    second, third = average(so3, u, 2, "product"), average(so3, u, 3, "single")
    flow = reference_flow(so3, u, _EPS, _PERIODS * u.T)
    errors = {
        label: rotation_angle(so3, np.swapaxes(avg.state(_EPS, flow.t), 1, 2) @ flow.X)
        for label, avg in (("area rule", second), ("area-moment rule", third))
    }
    check = order_check(so3, u, 2, "product", metric="angle")
    wheel_areas = average(so3, theta_dot, 1).areas
    numbers = {
        "C": _WHEELS.C.tolist(),
        "wheel_areas": _axial(wheel_areas).tolist(),
        "body_areas": _axial(second.areas).tolist(),
        "body_areas_by_cofactors": (_WHEELS.area_transform @ _axial(wheel_areas)).tolist(),
        "eps": _EPS,
        "drift_rad_per_period": (u.T * _EPS**2 * second.F[1]).tolist(),
        "largest_attitude_error_rad": {label: float(np.max(error)) for label, error in errors.items()},
        "order_slopes": list(check.slopes),
        "order_constant": check.constant,
    }
    return save("momentum_wheels", folder, _draw(theta_dot, u, second, flow, errors), numbers)


def _axial(areas: Any) -> Any:
    return np.array([areas[1, 2], areas[2, 0], areas[0, 1]])


def _draw(theta_dot: PeriodicInput, u: PeriodicInput, averaged: Any, flow: Any, errors: dict[str, Any]) -> Any:
    figure = new_figure(12, 7.5)
    grid = figure.add_gridspec(2, 3)
    figure.suptitle("A spacecraft turned by oscillating momentum wheels (TR 93-59, Figure 4)")
    caption(
        figure,
        "Loops of pairs of angles, whose areas turn the body; attitude: the body simulated (colours), the area rule (dashed); "
        "errors from the first period on.",
    )
    sketch = figure.add_subplot(grid[:, 0], projection="3d")
    _sketch(sketch)
    loops = [figure.add_subplot(grid[row, 1]) for row in (0, 1)]
    t = np.linspace(0, u.T, 400)
    for axes, signal, title, name in (
        (loops[0], theta_dot, "wheel angles $\\theta$, per unit $\\epsilon$", "\\theta"),
        (loops[1], u, "body angles $C\\theta$, per unit $\\epsilon$", "(C\\theta)"),
    ):
        tilde = signal.integral(t)
        for (i, j), colour in (((0, 1), BLUE), ((1, 2), RED), ((2, 0), GREEN)):
            axes.fill(tilde[:, i], tilde[:, j], color=colour, alpha=0.10)
            axes.plot(tilde[:, i], tilde[:, j], color=colour, label=f"${name}_{i + 1}, {name}_{j + 1}$")
        axes.set(title=title, aspect="equal", xlabel="first of the pair [rad]", ylabel="second of the pair [rad]")
        axes.set_adjustable("datalim")
        axes.legend()
    drift, error = (figure.add_subplot(grid[row, 2]) for row in (0, 1))
    so3 = group("so3")
    actual, mean = (so3.project(logm(X)) for X in (flow.X, averaged.state(_EPS, flow.t)))
    for i, colour in enumerate((BLUE, RED, GREEN)):
        drift.plot(flow.t, actual[:, i], color=colour, lw=1, label=f"axis {i + 1}")
        drift.plot(flow.t, mean[:, i], "--", color="0.15", lw=0.8)
    drift.plot([], [], "--", color="0.15", lw=0.8, label="area rule")
    drift.set(title=f"attitude, $\\epsilon = {_EPS}$", xlabel="t [s]", ylabel="rotation vector [rad]")
    drift.legend()
    late = flow.t >= u.T
    for (label, values), colour in zip(errors.items(), (BLUE, RED), strict=True):
        error.semilogy(flow.t[late], values[late], color=colour, lw=0.9, label=label)
    error.set(title="attitude error", xlabel="t [s]", ylabel="angle [rad]")
    error.legend()
    plain(*loops, drift, error)
    return figure


def _sketch(axes: Any) -> None:
    """The body as a box, the wheels as discs on their axes."""
    half = np.array([0.55, 0.5, 0.42])
    square = np.array([[-1.0, 1.0], [-1.0, 1.0]])
    for k in range(3):
        for sign in (-1, 1):
            face = np.empty((3, 2, 2))
            face[k], face[(k + 1) % 3], face[(k + 2) % 3] = sign, square, square.T
            axes.plot_surface(
                *(face * half[:, None, None]), color=SAND, edgecolor=GREY, alpha=0.35, lw=0.8, shade=False
            )
    radius, turn = np.meshgrid([0.0, 0.22], np.linspace(0, 2 * np.pi, 60))
    for i, colour in enumerate((BLUE, RED, GREEN)):
        spin = np.array(_WHEELS.axes.row(i), dtype=float).ravel()
        first, second = np.linalg.svd(spin[None])[2][1:]
        disc = [
            0.95 * s + radius * (np.cos(turn) * f + np.sin(turn) * g)
            for s, f, g in zip(spin, first, second, strict=True)
        ]
        axes.plot_surface(*disc, color=colour, alpha=0.5, lw=0, shade=False)
        axes.plot(*np.array([np.zeros(3), 1.35 * spin]).T, color=colour, lw=1.2)
        axes.text(*(1.48 * spin), f"$b_{i + 1}$", color=colour)
    for i in range(3):
        e = np.eye(3)[i]
        axes.plot(*np.array([np.zeros(3), 0.8 * e]).T, color="0.35", lw=0.8, ls=":")
        axes.text(*(0.86 * e), f"$r_{i + 1}$", color="0.35", fontsize=8)
    axes.set(xlim=(-0.8, 1.2), ylim=(-0.8, 1.2), zlim=(-0.8, 1.2))
    axes.view_init(22, 38)
    axes.text2D(
        0.5, -0.02, "three skew wheels at $b_i$; body axes $r_i$", transform=axes.transAxes, ha="center", fontsize=12
    )
    bare(axes)
