"""Coppola, Figure 2: a thruster about the third axis of a tumbling body."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from lie_codegen.pictures.result import GalleryResult, new_figure, save
from lie_codegen.pictures.style import caption
from lie_codegen.rigid_body.euler_average import euler_average
from lie_codegen.rigid_body.euler_solutions import solve_actual, solve_averaged
from lie_codegen.rigid_body.free_rigid_body import free_rigid_body

_EPS, _OMEGA0, _K0 = 0.1, 1.0, 0.6
_COLOURS = ("#1f5aa6", "#8a8f98", "#c8442f")


def rigid_body_thruster(folder: Path, progress: Callable[[str], None] = lambda line: None) -> GalleryResult:
    """Rates before and after the thruster starts, and the averaged amplitudes; k Omega is constant in both."""
    body = free_rigid_body((3, 4, 5))
    flow = euler_average(body, ["0", "0", "0.8"])
    start = body.from_slow(_OMEGA0, _K0, 0.0)
    before, t = np.linspace(-20, 0, 801), np.linspace(0, 40, 3201)
    progress("integrating")
    free = body.motion(start, before)
    omega = solve_actual(flow, start, t, _EPS)
    slow = solve_averaged(flow, _OMEGA0, _K0, t, _EPS)
    actual = body.to_slow(omega)
    j = [float(value) for value in body.model.coefficients]
    ratios = (np.sqrt(j[0] / j[2]), np.sqrt(j[1] / j[2]))
    at = int(np.argmin(np.abs(t - 10)))
    numbers = {
        "t": float(t[at]),
        "Omega": {"actual": actual.Omega[at], "averaged": slow.Omega[at]},
        "k": {"actual": actual.k[at], "averaged": slow.k[at]},
        "largest_change_of_k_Omega": {
            "actual": float(np.abs(actual.k * actual.Omega - _K0 * _OMEGA0).max()),
            "averaged": float(np.abs(slow.k * slow.Omega - _K0 * _OMEGA0).max()),
        },
        "momentum_over_energy_at_start": 0.1 * 0.8 * 5 / float(body.energy_and_momentum(start)[0]),
    }
    figure = new_figure(10, 8)
    axes: Any = figure.subplots(3, 1, sharex=True)
    figure.suptitle("A thruster about the third axis from $t = 0$ (Coppola, Figure 2)")
    amplitudes = (ratios[0] * slow.k * slow.Omega, ratios[1] * slow.k * slow.Omega, slow.Omega)
    for n in range(3):
        axes[n].plot(before, free[:, n], color=_COLOURS[n], lw=0.9)
        axes[n].plot(t, omega[:, n], color=_COLOURS[n], lw=0.9, label="actual")
        axes[n].plot(t, amplitudes[n], color="black", lw=1.2, label="averaged amplitude")
        if n < 2:
            axes[n].plot(t, -amplitudes[n], color="black", lw=1.2)
        else:
            axes[n].plot(t, slow.Omega * np.sqrt(1 - slow.k**2), color="black", lw=1.2)
        axes[n].axvline(0, color="#cccccc", lw=0.8)
        axes[n].set(ylabel=f"$\\omega_{n + 1}$ [rad/s]")
    axes[2].legend(frameon=False, loc="upper left")
    axes[2].set(xlabel="t [s]")
    caption(
        figure,
        "Colours: the full equations, free before $t = 0$. Thick: averaged amplitudes, for the third axis its two bounds.",
    )
    return save("rigid_body_thruster", folder, figure, numbers)
