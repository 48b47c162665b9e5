"""Coppola, Figure 3: a limit cycle on the momentum sphere made by linear feedback."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from lie_codegen.gallery.attitude_style import bare_3d, sphere
from lie_codegen.pictures.result import GalleryResult, new_figure, save
from lie_codegen.pictures.style import BLUE, GREEN, GREY, RED, caption
from lie_codegen.rigid_body.euler_average import euler_average
from lie_codegen.rigid_body.euler_equilibria import limit_cycles, momentum_directions
from lie_codegen.rigid_body.euler_solutions import solve_actual, solve_averaged
from lie_codegen.rigid_body.free_rigid_body import free_rigid_body

_EPS = 0.1


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
    figure = new_figure(11, 12)
    axes: Any = figure.subplots(3, 2, height_ratios=(1.7, 1, 1))
    figure.suptitle("Limit cycle by linear feedback, $\\epsilon = 0.1$ (Coppola, Figure 3)")
    caption(
        figure,
        "Grey: the full equations. Blue: averaged. Dashed red: the limit cycle, $\\hat k^2 = 0.25$ (printed as $\\hat k$).",
    )
    late = t > 150
    axes[0, 0].remove()
    ball: Any = figure.add_subplot(3, 2, 1, projection="3d")
    sphere(ball)
    for e, name in zip(np.eye(3), ("$\\ell_1$", "$\\ell_2$", "$\\ell_3$"), strict=True):
        ball.plot(*np.array([e, 1.2 * e]).T, color="0.35", lw=0.9)
        ball.text(*(1.3 * e), name, color="0.25", ha="center", va="center")
    ball.plot(*cosines[late].T, color=GREY, lw=0.8)
    ball.plot(*ring.T, color=BLUE, lw=1.6)
    bare_3d(ball, 0.8)
    ball.view_init(38, 35)
    ball.set_title("(a) direction of the momentum in the body")
    axes[0, 1].plot(cosines[late, 0], cosines[late, 1], color=GREY, lw=0.8, label="actual, t > 150 s")
    axes[0, 1].plot(ring[:, 0], ring[:, 1], color=BLUE, label="averaged")
    axes[0, 1].set(
        title="(b) seen along $\\ell_3$",
        xlabel="$\\ell_1$",
        ylabel="$\\ell_2$",
        aspect="equal",
        xlim=(-0.75, 0.75),
        ylim=(-0.75, 0.75),
    )
    axes[0, 1].legend(loc="lower right")
    panels = (
        (axes[1, 0], actual.k**2, (slow.k**2,), "(c) $k^2$", "$k^2$"),
        (axes[1, 1], actual.Omega, (slow.Omega,), "(d) $\\Omega$, repaired: the mean start rises", "$\\Omega$ [rad/s]"),
        (
            axes[2, 0], np.degrees(np.arccos(cosines[:, 2])),
            tuple(np.degrees(np.arccos(np.full_like(t, c))) for c in (third.max(), third.min())),
            "(e) coning angle and its bounds at $\\hat k$",
            "angle [degrees]",
        ),
        (axes[2, 1], cosines[:, 0], tuple(np.full_like(t, c) for c in (ring[:, 0].max(), ring[:, 0].min())),
         "(f) $\\ell_1$ and $\\pm r_1(\\hat k)$", "$\\ell_1$"),
    )  # fmt: skip
    for axis, values, lines, title, label in panels:
        axis.plot(t, values, color=GREY, lw=0.7)
        for line in lines:
            axis.plot(t, line, color=BLUE)
        axis.set(title=title, xlabel="t [s]", ylabel=label)
    for run, colour, name in ((second, GREEN, "order 2"), (third_order, RED, "order 3")):
        axes[1, 1].plot(run.t, run.mean.Omega, color=colour, label=f"mean, {name}")
        axes[1, 1].plot(run.t, run.Omega, ":", color=colour, lw=0.9, label=f"osculating, {name}")
    axes[1, 1].lines[0].set_label("actual")
    axes[1, 1].lines[1].set_label("as the paper starts")
    axes[1, 1].set_ylim(None, 1.9)
    axes[1, 1].legend(loc="upper left", ncols=2)
    axes[1, 0].axhline(cycle.k**2, color=RED, lw=0.8, ls="--")
    return save("rigid_body_limit_cycle", folder, figure, numbers)
