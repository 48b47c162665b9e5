"""Kapitza's pendulum: averaged against actual, the threshold, and a tilted equilibrium held by its amplitude, in C.

The last part is the documented way from a Lagrangian written as text to a vibrationally stabilised closed loop in C:
a spherical pendulum (two degrees of freedom, the azimuth cyclic) on a shaken pivot is held at its unstable tilt.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from lie_codegen.groups.build import build
from lie_codegen.groups.generate import generate
from lie_codegen.mechanics.lagrangian import lagrangian_system
from lie_codegen.mechanics.routh import routh_reduce
from lie_codegen.mechanics.vibrational_average import VibrationalAverage, vibrational_average
from lie_codegen.mechanics.vibrational_feedback import VibrationalFeedback, design_feedback
from lie_codegen.mechanics.vibrational_fields import vibrational_fields
from lie_codegen.mechanics.vibrational_law import closed_loop_start, feedback_kernels
from lie_codegen.pictures.result import GalleryResult, new_figure, save
from lie_codegen.pictures.style import BLUE, GREY, RED, caption
from lie_codegen.signals.periodic_input import PeriodicInput

_EPS, _STEPS = 0.01, 60


def vibrational_kapitza(folder: Path, progress: Callable[[str], None] = lambda line: None) -> GalleryResult:
    """Motion near the upright, threshold against Mathieu's, and the closed loop at the unstable tilt."""
    pendulum = lagrangian_system(
        coordinates=("th",),
        lagrangian="m*l^2*dth^2/2 - m*g*l*cos(th)",
        forces={"th": "m*l*sin(th)*u"},
        dissipation="c*m*l^2*dth^2/2",
        parameters={"m": 1, "l": 1, "g": 9.81, "c": 0.2},
    )
    u = PeriodicInput(["6*cos(t)"], period="2*pi")
    models = [vibrational_average(pendulum, u, order=order, gauge="pull_back") for order in (1, 2)]
    t = np.linspace(0, 2 * np.pi * _EPS * 96, 96 * 20 + 1)
    progress("integrating the actual and the averaged pendulum")
    actual = models[0].solve_actual([0.4, 0.0], t, _EPS)
    means = [model.solve([0.4, 0.0], t, _EPS) for model in models]
    at = 64 * 20
    thresholds = {"averaged": float(np.sqrt(2 * 9.81)), "mathieu": mathieu_threshold(_EPS, 9.81)}
    progress("designing the amplitude feedback; generating and compiling the law")
    design, free = tilt_design()
    kernels = feedback_kernels(design, "tilt", steps=_STEPS)
    package = generate(kernels, folder / "tilt")
    library = build(kernels)
    start = closed_loop_start(design, np.add(design.equilibrium, [0.15, 0.0]))
    run = library["loop"].scan(start, n=_STEPS * 50)
    times = 2 * np.pi * _EPS / _STEPS * np.arange(len(run))
    loose = free.solve_actual(start[:2], times, _EPS, {"alpha": 0.0})
    numbers = {
        "t": float(t[at]),
        "actual": actual[at].tolist(),
        "order_1": means[0][at].tolist(),
        "order_2": means[1][at].tolist(),
        "threshold": thresholds,
        "threshold_relative_error": abs(thresholds["averaged"] / thresholds["mathieu"] - 1),
        "tilt_rad": float(design.equilibrium[0]),
        "open_loop": sorted(float(x) for x in design.open_loop.real),
        "closed_loop": sorted(float(x) for x in design.closed_loop.real),
        "c_package": sorted(str(p.relative_to(package)) for p in package.rglob("*.c")),
        "final_amplitude_change": float(run[-1, 2]),
    }
    figure = new_figure(11, 7)
    axes: Any = figure.subplots(2, 2)
    figure.suptitle("Kapitza's pendulum, $\\epsilon = 0.01$")
    caption(
        figure,
        "Grey: actual motion. The amplitude $\\beta$ is that of the speed of the pivot; the law holds it over each period.",
    )
    axes[0, 0].plot(t, actual[:, 0], color=GREY, lw=0.8, label="actual")
    axes[0, 0].plot(t, means[0][:, 0], color=RED, lw=1, label="averaged, order 1")
    axes[0, 0].plot(t, means[1][:, 0], color=BLUE, lw=1, label="averaged, order 2")
    axes[0, 0].set(title="upright by vibration", xlabel="t [s]", ylabel="angle from the upright [rad]")
    angle = np.linspace(-np.pi, np.pi, 400)
    for beta, colour in ((0.0, GREY), (thresholds["averaged"], RED), (6.0, BLUE)):
        axes[0, 1].plot(
            angle,
            9.81 * np.cos(angle) + beta**2 / 4 * np.sin(angle) ** 2,
            color=colour,
            label=rf"$\beta = {beta:.3g}$ m/s",
        )
    axes[0, 1].set(
        title=r"effective potential; threshold $\beta = \sqrt{2gl}$",
        xlabel="angle from the upright [rad]",
        ylabel="potential / mass [J/kg]",
    )
    axes[1, 0].plot(times, loose[:, 0], color=GREY, lw=0.8, label="constant amplitude")
    axes[1, 0].plot(times, run[:, 0], color=BLUE, lw=1, label="amplitude feedback, in C")
    axes[1, 0].axhline(design.equilibrium[0], color=RED, ls="--", lw=0.8, label="averaged equilibrium")
    axes[1, 0].set(
        title="spherical pendulum at its unstable tilt", xlabel="t [s]", ylabel="angle from the upright [rad]"
    )
    axes[1, 1].step(times[1:], 6 + run[1:, 2], where="post", color=BLUE)
    axes[1, 1].axhline(6, color=GREY, lw=0.8, ls="--")
    axes[1, 1].set(title="amplitude under feedback, switched once a period", xlabel="t [s]", ylabel=r"$\beta$ [m/s]")
    for axis in (axes[0, 0], axes[0, 1], axes[1, 0]):
        axis.legend(frameon=False)
    return save("vibrational_kapitza", folder, figure, numbers)


def tilt_design() -> tuple[VibrationalFeedback, VibrationalAverage]:
    """From text to the designed law: the spherical pendulum at its unstable tilt."""
    full = lagrangian_system(
        coordinates=("th", "ph"),
        lagrangian="m*l^2*(dth^2 + sin(th)^2*dph^2)/2 - m*g*l*cos(th)",
        forces={"th": "m*l*sin(th)*u"},
        parameters={"m": 1, "l": 1, "g": 9.81},
    )
    reduced = routh_reduce(full, momentum={"ph": "1/2"})
    u = PeriodicInput(["(6 + alpha)*cos(t)"], period="2*pi", parameters=("alpha",))
    weights = (np.diag([10.0, 1.0]), np.eye(1))
    design = design_feedback(
        vibrational_fields(reduced, u), amplitudes=["alpha"], eps=_EPS, guess=[1.0, 0.0], weights=weights, limit=2.0
    )
    return design, vibrational_average(reduced, u)


def mathieu_threshold(eps: float, stiffness: float) -> float:
    """beta at which the upright turns stable: a_0(q) = -4 eps^2 g / l with q = 2 eps beta / l, l = 1."""
    from scipy.optimize import brentq
    from scipy.special import mathieu_a

    centre = np.sqrt(2 * stiffness)

    def margin(beta: float) -> float:
        return float(mathieu_a(0, 2 * eps * beta)) + 4 * eps**2 * stiffness

    return float(brentq(margin, 0.8 * centre, 1.2 * centre, xtol=1e-13))
