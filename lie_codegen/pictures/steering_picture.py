"""A plan as a picture: controls, the loops whose areas do the work, the path, and the cost against the minimum."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.mechanics.driven import simulate_driven
from lie_codegen.pictures.quantum_path import draw_populations
from lie_codegen.pictures.result import new_figure
from lie_codegen.pictures.steering_loops import COLOURS, GREY, draw_loops
from lie_codegen.pictures.steering_path import draw_entries, draw_path
from lie_codegen.pictures.style import symbol
from lie_codegen.steering.constraints import Obstacle
from lie_codegen.steering.plan import Plan

_SAMPLES = 1201


def draw_plan(plan: Plan, minimum: float | None = None, obstacles: Sequence[Obstacle] = ()) -> Any:
    """A matplotlib figure of a plan.

    Args:
        plan: any plan of `lc.steer`.
        minimum: the least energy, for the comparison; left out where it is not known.
        obstacles: drawn with the path.
    """
    t = np.linspace(0, plan.duration, _SAMPLES)
    X, velocity = _motion(plan, t)
    figure = new_figure(11, 8.5)
    parts = figure.add_gridspec(2, 2)
    _controls(figure.add_subplot(parts[0, 0]), plan, t)
    if _has_loops(plan):
        draw_loops(figure.add_subplot(parts[0, 1]), plan, t, velocity)
    elif plan.group.is_complex:
        draw_populations(figure.add_subplot(parts[0, 1]), plan, t, X)
    else:
        draw_entries(figure.add_subplot(parts[0, 1]), plan.group, t, X)
    draw_path(figure, parts[1, 0], plan, t, X, obstacles)
    _cost(figure.add_subplot(parts[1, 1]), plan, minimum)
    winner = plan.details.get("winner", plan.method.replace("_", " "))
    figure.suptitle(f"{plan.group.name}: {winner}, endpoint error {plan.error:.1e}", fontsize=12)
    return figure


def _has_loops(plan: Plan) -> bool:
    """Whether loops of the integrated controls tell where it ends: controls of the basis, and no drift that turns all the time."""
    system = plan.details.get("system")
    drifts = np.any(plan.details.get("drift", 0.0)) or (system is not None and np.any(system.drift.constant != 0))
    return set(plan.controls) <= set(plan.group.labels) and not (plan.group.is_complex and drifts)


def _motion(plan: Plan, t: Array) -> tuple[Array, Array]:
    """X and the controlled velocities of the true system: under torques if the plan's controls are."""
    inertia = plan.details.get("inertia")
    if inertia is not None:
        return plan.X(t), simulate_driven(plan.group, plan.u, inertia, t=t, xi0=plan.details["start_velocity"]).xi
    return plan.X(t), plan.u(t)


def _controls(axes: Any, plan: Plan, t: Array) -> None:
    for label, values, colour in zip(plan.controls, plan.inputs(t).T, COLOURS * 3, strict=False):
        axes.plot(t, values, color=colour, label=symbol(label))
    units = _units(plan)
    rates = "rate [" + ", ".join(f"{unit}/s" for unit in units) + "]" if units else ""
    axes.set(title="controls", xlabel="t [s]", ylabel=rates, xlim=(0, plan.duration))
    axes.legend(frameon=False)
    axes.grid(color="0.92")


def _units(plan: Plan) -> list[str]:
    """The units of the controls' integrals, each once; none where one has none, or where controls are torques, forces or vectors."""
    if not set(plan.controls) <= set(plan.group.labels):
        return []
    units = list(dict.fromkeys(plan.group.units[plan.group.labels.index(label)] for label in plan.controls))
    return [] if "" in units or plan.details.get("inertia") is not None else units


def _cost(axes: Any, plan: Plan, minimum: float | None) -> None:
    names, values = [f"this plan\n({plan.method})"], [plan.cost]
    if minimum is not None:
        names, values = [*names, "least energy\nwithout limits"], [*values, minimum]
    bars = axes.barh(names, values, color=[COLOURS[0], GREY][: len(names)], height=0.5)
    axes.bar_label(bars, fmt="%.6g", padding=3)
    ratio = f", {plan.cost / minimum:.4g} times the least" if minimum else ""
    axes.set(title=r"energy $\int |u|^2\,dt$" + ratio, xlim=(0, 1.3 * max(*values, 1e-12)), ylim=(-0.7, 1.7))
    axes.invert_yaxis()
    units = _units(plan)
    if len(units) == 1:
        axes.set_xlabel(f"energy [{units[0]}$^2$/s]")
