"""The dumbbell in orbit: what of Figure 3 of Sanyal, Bloch and McClamroch reproduces, and the corrected design.

Reproduces: the averaged system (19) with the printed T^j and gains converges slowly; without amplitude feedback (PD and
sin alone) the actual motion looks like the figure. Does not: the actual system with the printed amplitude feedback,
whose input (36) has the mean alpha omega, hence a positive rate feedback k2 = -2.1, diverges within one time unit. The
PD term alone already stabilises the equilibrium, and the printed feedback adds nothing to the orbit mode.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import sympy as sp

from lie_codegen.arrays import Array
from lie_codegen.groups.build import build
from lie_codegen.kernel.expressions import expression_body
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.runge_kutta import ARRAYS, CLASSICAL, increment
from lie_codegen.mechanics.lagrangian import lagrangian_system
from lie_codegen.mechanics.lagrangian_step import lagrangian_variational_step
from lie_codegen.mechanics.relative_equilibria import relative_equilibrium
from lie_codegen.mechanics.routh import RouthReduction, routh_reduce
from lie_codegen.mechanics.vector_fields import lie_bracket, symmetric_product
from lie_codegen.mechanics.vibrational_average import VibrationalAverage, integrate, vibrational_average
from lie_codegen.mechanics.vibrational_feedback import VibrationalFeedback, design_feedback
from lie_codegen.mechanics.vibrational_fields import vibrational_fields
from lie_codegen.mechanics.vibrational_law import closed_loop_start, feedback_kernels
from lie_codegen.pictures.result import GalleryResult, new_figure, save
from lie_codegen.pictures.style import BLUE, GREY, RED, caption
from lie_codegen.signals.periodic_input import PeriodicInput

_P, _RATIO, _OMEGA, _K1, _K2 = 2.00102, 0.05, 50.0, 0.7, -2.1
_START = (1.00027, 1.6008, 0.001555, 0.0)


def dumbbell(ratio: float) -> RouthReduction:
    """The dumbbell of (25) in scaled variables with the PD term of (35), the orbit angle eliminated.

    u enters theta'' as (1 + eps^2 / rho^2) u: it is Nbar / eps of (30).
    """
    full = lagrangian_system(
        coordinates=("rho", "th", "nu"),
        lagrangian="drho^2 + rho^2*dnu^2 + e^2*(dth + dnu)^2 + (2 - e^2/rho^2*(1 - 3*cos(th)^2))/rho",
        forces={"th": "2*e^2*(u - 10*((th - pi/2) + dth))"},
        parameters={"e": ratio},
    )
    return routh_reduce(full, momentum={"nu": "p"})


def vibrational_dumbbell(folder: Path, progress: Callable[[str], None] = lambda line: None) -> GalleryResult:
    """Actual and averaged on one axis: as printed, without amplitude feedback, and by the corrected design."""
    reduced = dumbbell(_RATIO)
    alone = relative_equilibrium(reduced, [1.0, np.pi / 2], {"p": _P})
    progress("the averaged system (19), as printed")
    t = np.linspace(0, 180 * np.pi, 3170)
    averaged = integrate(printed_average(reduced), _START, t, 1e-9)
    progress("the actual system with the printed amplitude feedback")
    escape, actual = printed_actual(reduced)
    progress("the actual system with PD and sin alone, 4500 periods")
    calm = vibrational_average(reduced, PeriodicInput(["20*sin(t)"], period="2*pi"), order=1)
    free = calm.solve_actual(_START, t, 1 / _OMEGA, {"p": _P}, rtol=1e-8)
    progress("the same by the variational integrator, as the paper has it")
    discrete = variational_run(reduced)
    progress("the corrected design at l/R = 0.3")
    corrected = corrected_design()
    design = corrected.design
    numbers = {
        "pd_alone_eigenvalues": [[float(x.real), float(x.imag)] for x in alone.eigenvalues],
        "averaged_as_printed": {
            "rho_amplitude_first_tenth": _amplitude(averaged[:300, 0]),
            "rho_amplitude_last_tenth": _amplitude(averaged[-300:, 0]),
            "theta_amplitude": _amplitude(averaged[:, 1]),
        },
        "actual_as_printed_escapes_at": escape,
        "pd_and_sin_alone": {
            "rho_amplitude_first_tenth": _amplitude(free[:300, 0]),
            "rho_amplitude_last_tenth": _amplitude(free[-300:, 0]),
            "theta_amplitude_last_tenth": _amplitude(free[-300:, 1]),
        },
        "pd_and_sin_alone_variational": {
            "rho_amplitude_first_tenth": _amplitude(discrete[: len(discrete) // 10, 0]),
            "rho_amplitude_last_tenth": _amplitude(discrete[-len(discrete) // 10 :, 0]),
        },
        "corrected_design": {
            "ratio": 0.3,
            "orbit_damping_without": float(np.min(-design.open_loop.real)),
            "orbit_damping_with": float(np.min(-design.closed_loop.real)),
            "rho_amplitude_last_orbit_without": _amplitude(corrected.without[-100:, 0]),
            "rho_amplitude_last_orbit_with": _amplitude(corrected.run[-100:, 0]),
        },
    }
    figure = new_figure(12, 11)
    _draw_printed(figure, t, averaged, free, discrete, calm, actual, escape)
    _draw_corrected(figure, corrected)
    figure.suptitle(
        "Dumbbell in orbit (Sanyal, Bloch and McClamroch, Figure 3): what reproduces, and the corrected design"
    )
    caption(
        figure,
        "Grey: actual motion; in (a)-(c) by PD and sine alone, which looks like the figure. Reconstructed: the average carried to "
        "the phase at which amplitudes switch.",
    )
    return save("vibrational_dumbbell", folder, figure, numbers)


def _draw_printed(
    figure: Any,
    t: Array,
    averaged: Array,
    free: Array,
    discrete: Array,
    calm: VibrationalAverage,
    actual: Array,
    escape: float,
) -> None:
    near = np.linspace(0, 6 * np.pi, 3001)
    close = calm.solve_actual(_START, near, 1 / _OMEGA, {"p": _P}, rtol=1e-8)
    mean = calm.solve(calm.start(_START, 1 / _OMEGA, {"p": _P}), near, 1 / _OMEGA, {"p": _P}, rtol=1e-8)
    first = t <= near[-1]
    axes = [figure.add_subplot(3, 2, number) for number in (1, 2, 3, 4)]
    axes[0].plot(t / (2 * np.pi), free[:, 0], color=GREY, lw=0.5, label="actual")
    axes[0].plot(t / (2 * np.pi), averaged[:, 0], color=BLUE, lw=0.5, label="averaged (19), as printed")
    axes[0].set(title="(a) distance, 90 orbits: both decay slowly", xlabel="orbits", ylabel="$\\rho$")
    for panel, column, shift, title, label in (
        (axes[1], 0, 0.0, "(b) distance, the first orbits", "$\\rho$"),
        (axes[2], 1, np.pi / 2, "(c) attitude, the first orbits", "$\\theta - \\pi/2$ [rad]"),
    ):
        panel.plot(near / (2 * np.pi), close[:, column] - shift, color="0.75", lw=2 - 1.4 * column, label="actual")
        panel.plot(near / (2 * np.pi), mean[:, column] - shift, "--", color=RED, lw=1.2, label="its average")
        panel.plot(
            t[first] / (2 * np.pi),
            averaged[first, column] - shift,
            color=BLUE,
            lw=1.2,
            label="averaged (19), as printed",
        )
        panel.set(title=title, xlabel="orbits", ylabel=label)
    shown = np.arange(0, 151, 5)
    axes[1].plot(shown / _OMEGA, discrete[shown, 0], ".", color="black", ms=4, label="variational step")
    axes[3].plot(actual[:, 0], actual[:, 2] - np.pi / 2, color=GREY, lw=2, label="actual, feedback (36), (37)")
    axes[3].plot(t[:2], averaged[:2, 1] - np.pi / 2, color=BLUE, label="averaged (19), as printed")
    axes[3].set_xlim(-0.0005, 1.1 * escape)
    axes[3].set(
        title=f"(d) as printed, the actual motion escapes at {escape:.3f}",
        xlabel="orbital time [rad]",
        ylabel="$\\theta - \\pi/2$ [rad]",
    )
    for panel in axes:
        panel.margins(y=0.25)
        panel.legend(loc="upper left" if panel is axes[3] else "upper right", ncols=1 if panel is axes[3] else 2)


def _draw_corrected(figure: Any, corrected: CorrectedRun) -> None:
    orbits = corrected.t / (2 * np.pi)
    rows = ((5, 0, 0.0, "(e) corrected design, LQR, $l/R = 0.3$: distance", "$\\rho$"),
            (6, 1, np.pi / 2, "(f) corrected design: attitude", "$\\theta - \\pi/2$ [rad]"))  # fmt: skip
    for place, column, shift, title, label in rows:
        panel = figure.add_subplot(3, 2, place)
        panel.plot(orbits, corrected.without[:, column] - shift, color=GREY, lw=0.9, label="actual, PD and vibration")
        panel.plot(
            orbits, corrected.run[:, column] - shift, color=BLUE, lw=2.2, alpha=0.5, label="actual, feedback in C"
        )
        panel.plot(orbits, corrected.averaged[:, column] - shift, "--", color=RED, lw=1, label="reconstructed")
        panel.set(title=title, xlabel="orbits", ylabel=label)
        panel.margins(y=0.15)
        panel.legend(loc="upper right", ncols=3, columnspacing=1.0)


def printed_average(reduced: RouthReduction) -> Callable[[float, Any], Any]:
    """z' of (19) with the printed coefficients of Figure 2 and alpha = -k1 (theta - pi/2) - k2 theta'."""
    system = reduced.system
    state, drift, lift = system.state, system.drift, system.input_fields[0]
    alpha = -sp.Float(_K1) * (state[1] - sp.pi / 2) - sp.Float(_K2) * state[3]
    w, pi, e = sp.Float(_OMEGA), sp.pi, sp.Float(_RATIO)
    second = sp.Rational(3, 2) + 2 * pi * alpha + 5 * alpha**2 / 8 + 4 * pi**2 * alpha**2 / 3
    # (1/eps) T^j of the paper's Figure 2; T^3 is a misprint there and is kept as printed
    coefficients = (
        1 + pi * alpha,
        -second / 2,
        e * (sp.Rational(3, 4) + pi * alpha + 5 * alpha**2 / 16 + 2 * pi**2 * alpha**2 / 3 - pi * (1 + pi * alpha) / w),
        -e
        / 2
        * ((100 * alpha + pi * (36 + alpha * (3 * alpha + 16 * pi * (2 + pi * alpha)))) / (24 * w) - pi / w * second),
    )
    bracket, product = lie_bracket(lift, drift, state), symmetric_product(lift, lift, drift, state)
    fields = (bracket, product, lie_bracket(bracket, drift, state), lie_bracket(product, drift, state))
    total = sum((c * f for c, f in zip(coefficients, fields, strict=True)), drift)
    (p,) = system.parameter_symbols
    body = expression_body([state], [list(total.xreplace({p: sp.Float(_P)}))])
    kernel = Kernel("printed", "dumbbell", (Port("z", (4,)),), (Port("z_dot", (4,)),), body)
    rate = build(kernel)["printed"]
    return lambda time, z: rate(z)


def printed_actual(reduced: RouthReduction) -> tuple[float, Array]:
    """The time at which |theta - pi/2| passes pi, and (N, 5) samples (t, y): Nbar / eps = Nbar_f + (36) / eps."""
    system = reduced.system
    y = system.state
    t, (p,) = sp.Symbol("t", real=True), system.parameter_symbols
    alpha = -sp.Float(_K1) * (y[1] - sp.pi / 2) - sp.Float(_K2) * y[3]
    w = sp.Float(_OMEGA)
    force = (alpha * w * (1 - sp.cos(2 * w * t)) + w * sp.sin(w * t)) / sp.Float(_RATIO)
    total = (system.drift + force * system.input_fields[0]).xreplace({p: sp.Float(_P)})
    body = expression_body([y, t], [list(total)])
    kernel = Kernel("printed_actual", "dumbbell", (Port("y", (4,)), Port("t", ())), (Port("y_dot", (4,)),), body)
    rate = build(kernel)["printed_actual"]
    now, state, step, rows = 0.0, np.array(_START), 2 * np.pi / _OMEGA / 400, []

    def slope(state: Array, now: float, c: float, change: Array) -> Array:
        return np.asarray(rate(state + change, now + c * step))

    while now < 5:
        rows.append([now, *state])
        if abs(state[1] - np.pi / 2) > np.pi:
            break
        state = state + increment(ARRAYS, CLASSICAL, partial(slope, state, now), 0.0, step)
        now += step
    return now, np.array(rows)


def variational_run(reduced: RouthReduction, periods: int = 4500, steps: int = 60) -> Array:
    """(periods + 1, 2) rho and theta at whole periods of 20 sin(50 t) / eps, eps = 1/50, with the PD term, by the midpoint variational step."""
    system = reduced.system
    step = build([lagrangian_variational_step(system)])["variational_step"]
    values = {**dict(zip(system.q, _START[:2], strict=True)), system.parameter_symbols[0]: _P}
    M, b = (np.array(m.subs(values).tolist(), dtype=float) for m in (system.mass, system.gyroscopic))
    start = np.concatenate([_START[:2], M @ _START[2:] + b[:, 0]])
    h = 2 * np.pi / _OMEGA / steps
    middles = (np.arange(periods * steps) + 0.5) * h
    u = 20 * _OMEGA * np.sin(_OMEGA * middles)[:, None]
    states: Array = step.scan(start, n=periods * steps, every=steps, u=u, h=h, p=_P)
    return states[:, :2]


@dataclass(frozen=True)
class CorrectedRun:
    """The corrected design and actual motions with and without it, sampled once a period; what the average reconstructs of it."""

    design: VibrationalFeedback
    t: Array
    run: Array
    without: Array
    averaged: Array


def corrected_design(eps: float = 0.01, orbits: int = 12) -> CorrectedRun:
    """LQR on the averaged system with input (5.5 + alpha) sin, zero mean, held over a period; l/R = 0.3."""
    reduced = dumbbell(0.3)
    momentum = 2 * (1 + 0.09) * np.sqrt(1 - 1.5 * 0.09)
    u = PeriodicInput(["(11/2 + alpha)*sin(t)"], period="2*pi", parameters=("alpha",))
    design = design_feedback(
        vibrational_fields(reduced, u), amplitudes=["alpha"], eps=eps, guess=[1.1, np.pi / 2, 0.0, 0.0],
        weights=(np.eye(4), 0.01 * np.eye(1)), parameters={"p": momentum}, limit=5.0,
    )  # fmt: skip
    steps, periods = 40, round(orbits / eps)
    library = build(feedback_kernels(design, "dumbbell", steps=steps))
    start = closed_loop_start(design, design.equilibrium + np.array([0.05, 0.0, 0.0, 0.0]))
    loop = library["loop"].scan(start, n=steps * periods, every=steps)
    t: Array = np.linspace(0, 2 * np.pi * eps * periods, periods + 1)
    still = replace(design, K=0 * design.K)
    silent = build(feedback_kernels(still, "dumbbell_free", steps=steps))
    rest = silent["loop"].scan(start, n=steps * periods, every=steps)
    model = vibrational_average(reduced, u)
    gain = np.ravel(design.K)

    def mean(time: float, z: Array) -> Array:
        alpha = float(np.clip(-gain @ (z - design.equilibrium), -5.0, 5.0))
        return model.rate(z, eps, {"p": momentum, "alpha": alpha})

    # the loop starts, and is sampled, at the phase where amplitudes switch: z belongs to y there
    z0 = model.start(start[:4], eps, {"p": momentum, "alpha": 0.0}, tau=design.switch_phase)
    z = integrate(mean, z0, t, 1e-8)
    alpha = np.clip(-(z - design.equilibrium) @ gain, -5.0, 5.0)
    y = model.reconstruct(z, design.switch_phase, eps, {"p": momentum, "alpha": alpha})
    return CorrectedRun(design, t, loop, rest, y)


def _amplitude(values: Array) -> float:
    return float((values.max() - values.min()) / 2)
