"""A rigid body upside down on a shaken pivot: the threshold of the averages beside that of Floquet, and a motion."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from lie_codegen.arrays import Array
from lie_codegen.flow.batched_exponential import expm
from lie_codegen.groups.catalogue_load import group
from lie_codegen.mechanics.mechanical_system import mechanical_system
from lie_codegen.mechanics.vibrational_average import vibrational_average
from lie_codegen.pictures.result import GalleryResult, new_figure, save
from lie_codegen.pictures.style import caption
from lie_codegen.signals.periodic_input import PeriodicInput

_J = np.array([[1.2, 0.1, -0.05], [0.1, 0.9, 0.07], [-0.05, 0.07, 0.6]])
_ARM = np.array([0.1, -0.05, 0.8])
_GRAVITY = 9.81
_EPS = (0.04, 0.03, 0.02, 0.015, 0.01)


def inverted_body(folder: Path, progress: Callable[[str], None] = lambda line: None) -> GalleryResult:
    """Full inertia, m = 1, l = (.1, -.05, .8), vertical pivot acceleration (beta / eps) cos(t / eps)."""
    so3 = group("so3")
    up = _ARM / np.linalg.norm(_ARM)
    averaged = threshold()
    progress("thresholds by Floquet multipliers")
    true = [
        brentq(lambda beta, e=eps: floquet_size(beta, e) - 1 - 1e-7, averaged * 0.9, averaged * 1.15, xtol=1e-6)
        for eps in _EPS
    ]
    torque = ["0.8*G2 + 0.05*G3", "0.1*G3 - 0.8*G1", "-0.05*G1 - 0.1*G2"]
    body = mechanical_system(
        so3,
        inertia=_J,
        advected={"G": ("direction", (0, 0, 1))},
        force=[f"9.81*({x})" for x in torque],
        damping=0.1,
        inputs=[torque],
    )
    axis = np.cross((0, 0, 1), up)
    upright = expm(-so3.hat(axis / np.linalg.norm(axis) * np.arccos(up[2])))
    start, t = upright @ expm(so3.hat((0.3, 0.2, 0.0))), np.linspace(0, 12, 600)
    figure = new_figure(11, 4.6)
    figure.suptitle("A rigid body upside down on a shaken pivot")
    axes: Any = figure.subplots(1, 2)
    axes[0].axhline(averaged, color="#c8442f", label="$\\sqrt{2 \\lambda_c}$, average of order 1")
    axes[0].plot(_EPS, true, "o-", color="#1f5aa6", label="Floquet")
    axes[0].set(title="least amplitude that keeps the body up", xlabel="$\\epsilon$", ylabel="$\\beta$")
    ends = {}
    for beta, colour in ((7, "#1f5aa6"), (4, "#8a8f98")):
        progress(f"beta = {beta}")
        average = vibrational_average(body, PeriodicInput([f"{beta}*cos(t)"]), order=3)
        actual = average.solve_actual(start, (0, 0, 0), t, 0.02, tolerance=1e-8)
        tilt = np.arccos(np.clip(actual.advected @ up, -1, 1))
        axes[1].plot(t, tilt, color=colour, lw=0.8, label=f"actual, $\\beta$ = {beta}")
        z = average.estimate(start, (0, 0, 0), 0.0, 0.02)
        mean = average.solve(z.X, z.xi, t, 0.02, tolerance=1e-8)
        axes[1].plot(t, np.arccos(np.clip(mean.advected @ up, -1, 1)), "--", color="black", lw=0.8)
        ends[str(beta)] = float(tilt[-1])
    axes[1].set(title="tilt, $\\epsilon = 0.02$", xlabel="t [s]", ylabel="angle from the upright [rad]")
    caption(
        figure,
        "Left: multipliers of the true system by Floquet, against the threshold of the average. Right: dashed, the average of order 3.",
    )
    for each in axes:
        each.legend(frameon=False, fontsize=8)
    numbers = {
        "threshold_averaged": averaged,
        "eps": list(_EPS),
        "threshold_floquet": [float(x) for x in true],
        "tilt_at_end": ends,
    }
    return save("inverted_body", folder, figure, numbers)


def threshold() -> float:
    """beta_c = sqrt(2 lambda_c), lambda_c = g |l| / (m min eig(Q' hat(l)' J^-1 hat(l) Q)), Q the plane normal to l."""
    length = float(np.linalg.norm(_ARM))
    Q = np.linalg.svd(_ARM[None] / length)[2][1:].T
    hat = np.cross(np.eye(3), _ARM)
    smallest = float(np.linalg.eigvalsh(Q.T @ hat.T @ np.linalg.inv(_J) @ hat @ Q)[0])
    return float(np.sqrt(2 * _GRAVITY * length / smallest))


def floquet_size(beta: float, eps: float) -> float:
    """The largest |multiplier| of small motions about the inverted rest."""
    inverse, up = np.linalg.inv(_J), _ARM / np.linalg.norm(_ARM)

    def rate(t: float, y: Array) -> Array:
        w, g = y.reshape(6, 6)[:3], y.reshape(6, 6)[3:]
        strength = _GRAVITY + beta * np.cos(t / eps) / eps
        return np.concatenate([strength * inverse @ np.cross(g.T, _ARM).T, np.cross(up, w.T).T]).ravel()

    end = solve_ivp(rate, (0, 2 * np.pi * eps), np.eye(6).ravel(), method="DOP853", rtol=1e-11, atol=1e-12).y[:, -1]
    return float(np.abs(np.linalg.eigvals(end.reshape(6, 6))).max())
