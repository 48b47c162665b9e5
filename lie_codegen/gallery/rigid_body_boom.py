"""Coppola, Figure 1: a mass deployed along a boom on the third axis of a spinning body."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from lie_codegen.pictures.result import GalleryResult, new_figure, save
from lie_codegen.pictures.style import BLUE, GREY, RED, caption
from lie_codegen.rigid_body.euler_average import euler_average
from lie_codegen.rigid_body.euler_solutions import (
    explicit_inertia_change,
    function_of_tau,
    solve_actual,
    solve_averaged,
)
from lie_codegen.rigid_body.euler_variational import moving_parts
from lie_codegen.rigid_body.free_rigid_body import free_rigid_body
from lie_codegen.rigid_body.principal_body import TAU

_EPS, _MOMENTUM, _K0 = 0.1, 40.0, 0.5


def rigid_body_boom(folder: Path, progress: Callable[[str], None] = lambda line: None) -> GalleryResult:
    """k^2, energy, coning angle and direction cosine: actual, averaged (28), and the algebraic model (32).

    The paper leaves open s(t) and the start: s = 0.25 t and u0 = 0, signs (1, -1, 1). The middle moment of inertia
    reaches the largest at t = 60; past t = 49 the drift in one period is no longer small and averaging is refused.
    """
    boom = "0.04*(2.5*tau)^2"
    body = free_rigid_body((f"10 + {boom}", f"11 + {boom}", "20"))
    flow = euler_average(body, moving_parts(body.model))
    gamma = float(body.model.small_gamma(1, 3).subs(TAU, 0))
    spin = _MOMENTUM / (20 * np.sqrt(1 + gamma**2 * _K0**2))
    t = np.linspace(0, 48, 1921)
    progress("integrating the full equations and the averaged ones")
    omega = solve_actual(flow, body.from_slow(spin, _K0, 0.0), t, _EPS)
    slow = solve_averaged(flow, spin, _K0, t, _EPS)
    tau = _EPS * t
    k = body.to_slow(omega, tau).k
    energy, momentum = body.energy_and_momentum(omega, tau)
    mean, _ = body.energy_and_momentum(body.from_slow(slow.Omega, slow.k, 0.0, tau), tau)
    explicit = explicit_inertia_change(body.model, _MOMENTUM, _K0, tau)
    value = function_of_tau(tau)
    inertia = np.stack([value(moment) for moment in body.model.moments], axis=-1)
    cosines = inertia * omega / momentum[:, None]
    g13 = value(body.model.small_gamma(1, 3))
    third = 1 / np.sqrt(1 + g13**2 * slow.k**2)
    at = int(np.argmin(np.abs(t - 40)))
    numbers = {
        "t": float(t[at]),
        "k_squared": {"actual": k[at] ** 2, "averaged": slow.k[at] ** 2, "algebraic": explicit.k[at] ** 2},
        "energy": {"actual": energy[at], "averaged": mean[at], "algebraic": explicit.T[at]},
        "momentum_drift": float(np.abs(momentum - _MOMENTUM).max()),
        "largest_error_k_squared_percent": float(100 * np.abs(slow.k**2 / k**2 - 1).max()),
        "largest_error_algebraic_percent": float(100 * np.abs(explicit.k**2 / k**2 - 1).max()),
    }
    figure = new_figure(11, 9)
    axes: Any = figure.subplots(3, 2)
    figure.suptitle("Boom deployment, $\\epsilon = 0.1$ (Coppola, Figure 1)")
    for row, actual, averaged, algebraic, name, unit, about in (
        (0, k**2, slow.k**2, explicit.k**2, "$k^2$", "", "squared modulus $k^2$"),
        (1, energy, mean, explicit.T, "$T$", " [J]", "kinetic energy $T$"),
    ):
        axes[row, 0].plot(t, actual, color=GREY, lw=2.5, label="actual")
        axes[row, 0].plot(t, averaged, color=BLUE, label="averaged (28)")
        axes[row, 0].plot(t, algebraic, "--", color=RED, label="algebraic (32)")
        axes[row, 0].set(ylabel=f"{name}{unit}", title=f"({'ac'[row]}) {about}")
        axes[row, 1].plot(t, 100 * (averaged / actual - 1), color=BLUE, label="averaged (28)")
        axes[row, 1].plot(t, 100 * (algebraic / actual - 1), "--", color=RED, label="algebraic (32)")
        axes[row, 1].set(ylabel="error [%]", title=f"({'bd'[row]}) relative error of {name}")
        for axis in axes[row]:
            axis.set_xlabel("t [s]")
            axis.legend(loc="upper left" if row == 0 else "lower left")
    axes[2, 0].plot(t, np.degrees(np.arccos(cosines[:, 2])), color=GREY, lw=0.8, label="actual")
    for bound, label in ((third, "averaged bounds"), (third * np.sqrt(1 - slow.k**2), None)):
        axes[2, 0].plot(t, np.degrees(np.arccos(bound)), color=BLUE, label=label)
    axes[2, 0].set(ylabel="angle [degrees]", xlabel="t [s]", title="(e) coning angle and its averaged bounds")
    axes[2, 1].plot(t, cosines[:, 0], color=GREY, lw=0.8, label="actual")
    axes[2, 1].plot(t, g13 * slow.k * third, color=BLUE, label="averaged amplitude")
    axes[2, 1].plot(t, -g13 * slow.k * third, color=BLUE)
    axes[2, 1].set(xlabel="t [s]", ylabel="$\\ell_1$", title="(f) $\\ell_1$ and its averaged amplitude $r_1$")
    axes[2, 0].set_ylim(44, 59)
    axes[2, 0].legend(loc="upper left")
    axes[2, 1].set_ylim(-0.85, 1.5)
    axes[2, 1].legend(loc="upper left")
    caption(
        figure, "The boom grows with $\\epsilon t$ until $k^2$ nears 1/2; (28) is integrated, (32) is its closed form."
    )
    return save("rigid_body_boom", folder, figure, numbers)
