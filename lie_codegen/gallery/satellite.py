"""The two-wheel satellite: Figures 2 and 3 of Leonard and Krishnaprasad, TR 93-59, section 5.2.

Two wheels turn the body about its first two axes; the manoeuvre needs all three. The area rule plans it in closed
form, the true system is simulated on SO(3), and the same manoeuvre is then solved for minimum energy.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from lie_codegen.flow.simulate import simulate
from lie_codegen.groups.build import build
from lie_codegen.groups.catalogue_load import group
from lie_codegen.groups.generate import generate
from lie_codegen.groups.wei_norman.matrix import wei_norman
from lie_codegen.pictures.result import GalleryResult, new_figure, save
from lie_codegen.pictures.style import BLUE, GREY, RED, caption
from lie_codegen.steering.closed_form.four_phase import average, integrals
from lie_codegen.steering.front import steer

_GD = (0.1, 0.05, np.pi / 40)
_DURATION = 24.0
_CONTROLS = ("w1", "w2")


def satellite(folder: Path, progress: Callable[[str], None] = lambda line: None) -> GalleryResult:
    """Figures 2 and 3 as one picture, and the energy that optimal steering saves."""
    so3 = group("so3")
    wn = wei_norman(so3)
    progress("M(g) = " + str(wn.M.tolist()))
    library = build("so3")
    package = generate(so3, folder / "so3")
    progress(f"C package: {package}; " + (f"compiled: {library.path}" if library.compiled else "interpreted"))
    progress("planning by the area rule, simulating on SO(3)")
    plan = steer(so3, _GD, _CONTROLS, _DURATION, method="four_phase")
    t = np.linspace(0, _DURATION, 961)
    run = simulate(so3, plan.u, t=t)
    mean = average(plan, t)
    progress("solving the same manoeuvre for minimum energy")
    best = steer(so3, plan.target, _CONTROLS, _DURATION, method="optimal")
    gap = np.abs(run.g - mean).sum(axis=1)
    numbers = {
        "wei_norman_matrix": [[str(entry) for entry in row] for row in wn.M.tolist()],
        "compiled": library.compiled,
        "desired_coordinates": [float(value) for value in _GD],
        "periods": plan.details["q"],
        "psi_rad": plan.details["psi"],
        "final_coordinates": [float(value) for value in run.g[-1]],
        "attitude_error_rad": plan.error,
        "largest_gap_to_average": float(gap.max()),
        "largest_gap_at_s": float(t[gap.argmax()]),
        "energy_area_rule": plan.cost,
        "energy_optimal": best.cost,
        "energy_saved_percent": 100 * (1 - best.cost / plan.cost),
        "energy_ratio": plan.cost / best.cost,
        "attitude_error_optimal_rad": best.error,
        "integration_steps": run.steps,
    }
    return save("satellite", folder, _draw(plan, best, t, run.g, mean), numbers)


def _draw(plan: Any, best: Any, t: Any, g: Any, mean: Any) -> Any:
    figure = new_figure(11, 9)
    top, middle, bottom = figure.subplots(3, 2)
    figure.suptitle("Two wheels, three axes: attitude by the area rule (TR 93-59, Figures 2 and 3)")
    u, optimal = plan.u(t), best.u(t)
    for axes, column, name in zip(top, (0, 1), ("1", "2"), strict=True):
        axes.plot(t, u[:, column], color=BLUE, label="controls by the area rule")
        axes.plot(t, optimal[:, column], color=GREY, lw=1.2, label="controls of minimum energy")
        axes.set(title=f"Figure 2: control $\\epsilon u_{name}$", ylabel="rate [rad/s]")
    for axes, column, letter in ((middle[0], 0, "a"), (middle[1], 1, "b"), (bottom[1], 2, "d")):
        axes.plot(t, mean[:, column], color=BLUE, label="second-order average")
        axes.plot(t, g[:, column], "--", color=RED, label="actual motion")
        axes.set(title=f"Figure 3({letter}): $g_{column + 1}$", ylabel="angle [rad]")
    loop = integrals(plan, t)
    bottom[0].fill(loop[:, 0], loop[:, 1], color=BLUE, alpha=0.12)
    bottom[0].plot(loop[:, 0], loop[:, 1], color=BLUE)
    bottom[0].set(
        title="Figure 3(c): the loop whose area turns axis 3",
        xlabel="$\\epsilon\\tilde u_1$ [rad]",
        ylabel="$\\epsilon\\tilde u_2$ [rad]",
    )
    shown = [handle for axes in (top[0], middle[0]) for handle in axes.get_legend_handles_labels()[0]]
    figure.legend(handles=shown, loc="outside lower center", ncols=4, frameon=False)
    caption(
        figure,
        "Target: Wei-Norman coordinates (0.1, 0.05, $\\pi$/40) in 24 s, four phases; grey: the same attitude by least energy.",
    )
    for axes in (*top, *middle, bottom[1]):
        axes.set_xlabel("t [s]")
    for axes in (*top, *middle, *bottom):
        axes.grid(color="0.92")
        axes.spines[["top", "right"]].set_visible(False)
    return figure
