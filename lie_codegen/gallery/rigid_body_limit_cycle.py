"""Coppola, Figure 3: a limit cycle on the momentum sphere made by linear feedback."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from lie_codegen.pictures.result import GalleryResult, new_figure, save
from lie_codegen.rigid_body.euler_average import euler_average
from lie_codegen.rigid_body.euler_equilibria import limit_cycles, momentum_directions
from lie_codegen.rigid_body.euler_solutions import solve_actual, solve_averaged
from lie_codegen.rigid_body.free_rigid_body import free_rigid_body

_EPS = 0.1
_BLUE, _RED, _GREY, _GREEN = "#1f5aa6", "#c8442f", "#8a8f98", "#2e8b57"


def rigid_body_limit_cycle(folder: Path, progress: Callable[[str], None] = lambda line: None) -> GalleryResult:
    """The cycle, the approach to it, and the slow growth of the spin, which is of third order in eps; panel (d) repaired.

    The paper starts its average at the osculating point, and its curve (d) falls where the truth rises.

    The paper prints khat = 0.25, which is khat^2: the gains give khat = 0.49999993.
    """
    body = free_rigid_body((3, 4, 5))
    flow = euler_average(body, ["-1.35614*w1", "1.26209*w2", "-0.187738*w3"])
    start = np.array([0.5, 0.5, 1.0])
    t = np.linspace(0, 200, 8001)
    progress("integrating 200 s of the full equations")
    omega = solve_actual(flow, start, t, _EPS)
    actual, first = body.to_slow(omega), body.to_slow(start)
    slow = solve_averaged(flow, float(first.Omega), float(first.k), t, _EPS)
    progress("averaging to second and third order")
    sparse = t[::40]
    second, third_order = (flow.solve(start, sparse, _EPS, order=order) for order in (2, 3))
    (cycle,) = limit_cycles(flow)
    c3, _ = flow.cycle_growth(cycle.k)
    _, momentum = body.energy_and_momentum(omega)
    cosines = omega * [3, 4, 5] / momentum[:, None]
    ring = momentum_directions(flow, cycle.k, 400)
    third = ring[:, 2]
    numbers = {
        "khat": cycle.k,
        "khat_squared": cycle.k**2,
        "stable": cycle.stable,
        "slope_of_averaged_drift": cycle.slope,
        "t": 200.0,
        "Omega": {
            "actual": float(actual.Omega[-1]),
            "averaged": float(slow.Omega[-1]),
            "second_order": {"mean": float(second.mean.Omega[-1]), "osculating": float(second.Omega[-1])},
            "third_order": {"mean": float(third_order.mean.Omega[-1]), "osculating": float(third_order.Omega[-1])},
        },
        "c3": c3,
        "k_squared_at_start": float(first.k**2),
    }
    figure = new_figure(11, 10)
    axes: Any = figure.subplots(3, 2)
    figure.suptitle("Limit cycle by linear feedback, $\\epsilon = 0.1$ (Coppola, Figure 3)", fontsize=13)
    late = t > 150
    axes[0, 0].remove()
    ball: Any = figure.add_subplot(3, 2, 1, projection="3d")
    u, v = np.meshgrid(np.linspace(0, 2 * np.pi, 37), np.linspace(0, np.pi, 19))
    ball.plot_wireframe(np.cos(u) * np.sin(v), np.sin(u) * np.sin(v), np.cos(v), color="#dddddd", lw=0.4)
    ball.plot(*cosines[late].T, color=_GREY, lw=0.8)
    ball.plot(*ring.T, color=_BLUE, lw=1.6)
    ball.set(title="(a) momentum sphere", box_aspect=(1, 1, 1))
    axes[0, 1].plot(cosines[late, 0], cosines[late, 1], color=_GREY, lw=0.8, label="actual, t > 150 s")
    axes[0, 1].plot(ring[:, 0], ring[:, 1], color=_BLUE, label="averaged")
    axes[0, 1].set(title="(b) $\\ell_1$, $\\ell_2$", aspect="equal")
    axes[0, 1].legend(frameon=False, fontsize=8, loc="upper left", bbox_to_anchor=(1.02, 1))
    panels = (
        (axes[1, 0], actual.k**2, (slow.k**2,), "(c) $k^2$"),
        (axes[1, 1], actual.Omega, (slow.Omega,), "(d) $\\Omega$ [rad/s], repaired: the mean start rises"),
        (
            axes[2, 0], np.degrees(np.arccos(cosines[:, 2])),
            tuple(np.degrees(np.arccos(np.full_like(t, c))) for c in (third.max(), third.min())),
            "(e) coning angle [deg] and bounds at $\\hat k$",
        ),
        (axes[2, 1], cosines[:, 0], tuple(np.full_like(t, c) for c in (ring[:, 0].max(), ring[:, 0].min())),
         "(f) $\\ell_1$ and $\\pm r_1(\\hat k)$"),
    )  # fmt: skip
    for axis, values, lines, title in panels:
        axis.plot(t, values, color=_GREY, lw=0.7)
        for line in lines:
            axis.plot(t, line, color=_BLUE)
        axis.set(title=title, xlabel="t [s]")
    for run, colour, name in ((second, _GREEN, "mean, order 2"), (third_order, _RED, "mean, order 3")):
        axes[1, 1].plot(run.t, run.mean.Omega, color=colour, label=name)
        axes[1, 1].plot(run.t, run.Omega, color=colour, lw=0.6, alpha=0.6, label=f"osculating{name[4:]}")
    axes[1, 1].lines[0].set_label("actual")
    axes[1, 1].lines[1].set_label("as the paper starts")
    axes[1, 1].legend(frameon=False, fontsize=7, loc="upper left", bbox_to_anchor=(1.02, 1))
    axes[1, 0].axhline(cycle.k**2, color=_RED, lw=0.8, ls="--")
    return save("rigid_body_limit_cycle", folder, figure, numbers)
