"""The five open problems solved and drawn: paths, attitudes, controls at their bounds."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from scipy.linalg import expm

from lie_codegen.arrays import Array
from lie_codegen.gallery.open_problems import parking, quadrotor, qubit, satellite, underwater
from lie_codegen.groups.catalogue_load import group
from lie_codegen.pictures.result import GalleryResult, new_figure, save
from lie_codegen.pictures.style import COLOURS, GREY, caption, symbol
from lie_codegen.steering.ocp.mpc import mpc
from lie_codegen.steering.ocp.plan import OptimalPlan

Progress = Callable[[str], None]


def _quiet(_line: str) -> None:
    return None


def open_quadrotor(folder: Path, progress: Progress = _quiet) -> GalleryResult:
    """Around a cylinder either way, and the loop of one sweep a sample in noise."""
    problem, cylinder = quadrotor(), np.array([1.0, 0.05, 0.4])
    values: dict[str, Any] = {"target": np.array([2.0, 0, 1]), "cyl": cylinder}
    plan = problem.solve(starts=8, **values)
    progress("the loop, in noise")
    controller = mpc(problem)
    controller.reset(plan)
    run = controller.simulate(steps=60, noise={"X": 0.01, "v": 0.05}, seed=1)
    figure = new_figure(11, 4.5)
    left, right = figure.subplots(1, 2)
    left.add_patch(_disc(cylinder))
    left.plot(plan.X[:, 0, 3], plan.X[:, 1, 3], color=COLOURS[0], label="plan, 1.5 s")
    left.plot(run.X[:, 0, 3], run.X[:, 1, 3], "--", color=COLOURS[1], label="loop in noise, 3 s")
    _finish(left, "from above", "x [m]", "y [m]", equal=True)
    _controls(right, plan, ("thrust / mass [m/s$^2$]", "roll rate [rad/s]", "pitch rate [rad/s]", "yaw rate [rad/s]"))
    depth = cylinder[2] - np.min(np.hypot(run.X[:, 0, 3] - 1.0, run.X[:, 1, 3] - 0.05))
    numbers = {**_numbers(plan), "deepest_in_the_cylinder_m": float(depth), "samples_held": run.status.count("held")}
    figure.suptitle("A quadrotor around a cylinder")
    caption(
        figure,
        "The best of eight starts, thrust and rates bounded; dashed: one sweep of the solver a sample, place and velocity measured with noise.",
    )
    return save("open_quadrotor", folder, figure, numbers)


def open_satellite(folder: Path, progress: Progress = _quiet) -> GalleryResult:
    """A slew around the sun with wheels, to rest."""
    so3, sun = group("so3"), np.array([0.6, 0.75, 0.2]) / np.linalg.norm([0.6, 0.75, 0.2])
    progress("eight starts")
    plan = satellite().solve(starts=8, Rd=expm(so3.hat([1.2, 0, 1.6])), sun=sun)
    angles = np.arccos(np.clip(plan.X[:, :, 0] @ sun, -1, 1))
    figure = new_figure(11, 4.5)
    left, right = figure.subplots(1, 2)
    left.plot(plan.t, angles, color=COLOURS[0], label="angle of the star tracker to the sun")
    left.axhline(0.3, color=GREY, lw=0.8)
    for i in range(3):
        left.plot(plan.t, plan.states["w"][:, i], color=COLOURS[i + 1], label=f"{symbol(f'w{i + 1}')} [rad/s]")
    _finish(left, "kept out of a cone of 0.3 rad", "t [s]", "angle [rad], rate [rad/s]")
    _controls(right, plan, tuple(f"wheel torque {i} [N m]" for i in (1, 2, 3)))
    numbers = {
        **_numbers(plan),
        "smallest_angle_to_the_sun_rad": float(np.min(angles)),
        "attitude_error_rad": plan.error,
    }
    figure.suptitle("A satellite with three wheels whose star tracker keeps off the sun")
    caption(
        figure, "The best of eight starts, to rest in 20 s; grey: half angle of the cone. Torques of 0.4 N m at most."
    )
    return save("open_satellite", folder, figure, numbers)


def open_parking(folder: Path, progress: Progress = _quiet) -> GalleryResult:
    """One metre sideways and half a metre on in six seconds, from rest to rest."""
    goal = np.array([[1, 0, 0.5], [0, 1, 1.0], [0, 0, 1]])
    progress("eight starts")
    plan = parking().solve(starts=8, goal=goal)
    figure = new_figure(11, 4.5)
    left, right = figure.subplots(1, 2)
    left.plot(plan.X[:, 0, 2], plan.X[:, 1, 2], color=COLOURS[0], label="rear axle")
    for X in plan.X[::5]:
        corners = np.array([[-0.5, -0.8, 1], [3, -0.8, 1], [3, 0.8, 1], [-0.5, 0.8, 1], [-0.5, -0.8, 1]])
        left.plot(*(corners @ X.T)[:, :2].T, color=GREY, lw=0.5)
    _finish(left, "parking", "x [m]", "y [m]", equal=True)
    _controls(right, plan, ("acceleration [m/s$^2$]", "steering rate [rad/s]"))
    figure.suptitle("A car parked one metre sideways and half a metre on")
    caption(figure, "The best of eight starts, from rest to rest in six seconds; grey: the car every half second.")
    return save("open_parking", folder, figure, {**_numbers(plan), "pose_error": plan.error})


def open_underwater(folder: Path, progress: Progress = _quiet) -> GalleryResult:
    """Four forces against a current that is a parameter: another current builds nothing."""
    se3, problem = group("se3"), underwater()
    goal = expm(se3.hat([0, 0, 0.6, 3.0, 0.5, 0.5]))
    figure = new_figure(11, 4.5)
    left, right = figure.subplots(1, 2)
    numbers: dict[str, Any] = {}
    plan = None
    for number, current in enumerate(((0, 0, 0), (0, 0.2, 0), (0, -0.2, 0))):
        progress(f"a current of {current[1]} m/s")
        plan = problem.solve(goal=goal, c=current, starts=2)
        label = f"current {current[1]:g} m/s"
        left.plot(plan.X[:, 0, 3], plan.X[:, 1, 3], color=COLOURS[number], label=label)
        numbers[f"cost, {label}"] = plan.cost
        numbers[f"misses by, {label} [m]"] = float(np.linalg.norm(plan.X_final[:3, 3] - goal[:3, 3]))
    left.plot(*goal[:2, 3], "k+")
    _finish(left, "a vehicle in a current along y", "x [m]", "y [m]", equal=True)
    if plan is not None:
        _controls(right, plan, ("torque 1 [N m]", "torque 2 [N m]", "torque 3 [N m]", "thrust [N]"))
        numbers["status"] = plan.status.name
    figure.suptitle("An underwater vehicle with three torques and one thruster, in a current")
    caption(
        figure,
        "One problem, built once: the current is a parameter. The cross is the goal; right: controls against -0.2 m/s.",
    )
    return save("open_underwater", folder, figure, numbers)


def open_qubit(folder: Path, progress: Progress = _quiet) -> GalleryResult:
    """A Hadamard gate (in SU(2)) by a bounded drive."""
    gate = 1j * np.array([[1, 1], [1, -1]]) / np.sqrt(2)
    progress("eight starts")
    plan = qubit().solve(starts=8, gate=gate)
    bloch = np.array([_bloch(X @ [1, 0]) for X in plan.X])
    figure = new_figure(11, 4.5)
    left, right = figure.subplots(1, 2)
    for i, name in enumerate("xyz"):
        left.plot(plan.t, bloch[:, i], color=COLOURS[i], label=rf"${name}$")
    _finish(left, r"Bloch vector of $X(t)|0\rangle$", "t [s]", "component")
    _controls(right, plan, ("drive x [rad/s]", "drive y [rad/s]"))
    figure.suptitle("A Hadamard gate of a detuned qubit by a bounded drive")
    caption(figure, "The best of eight starts; the drive is constant in each of 40 intervals.")
    fidelity = abs(np.trace(gate.conj().T @ plan.X_final)) / 2
    return save("open_qubit", folder, figure, {**_numbers(plan), "fidelity": float(fidelity), "gate_error": plan.error})


def _numbers(plan: OptimalPlan) -> dict[str, Any]:
    return {
        "cost": plan.cost,
        "violation": plan.violation,
        "status": plan.status.name,
        "iterations": plan.iterations,
        "controls_at_a_bound": int(
            np.sum((np.asarray(plan.u) <= plan.problem.lower) | (np.asarray(plan.u) >= plan.problem.upper))
        ),
        "costs_of_the_starts": sorted(round(float(cost), 9) for cost in plan.starts[:, 0]),
    }


def _bloch(psi: Array) -> Array:
    a, b = psi
    return np.array([2 * (a.conjugate() * b).real, 2 * (a.conjugate() * b).imag, abs(a) ** 2 - abs(b) ** 2])


def _disc(cylinder: Array) -> Any:
    from matplotlib.patches import Circle

    return Circle((cylinder[0], cylinder[1]), cylinder[2], color="0.85")


def _controls(axes: Any, plan: OptimalPlan, names: tuple[str, ...]) -> None:
    for i, name in enumerate(names):
        axes.stairs(plan.u[:, i], plan.t, color=COLOURS[i], label=name, baseline=None)
    _finish(axes, "controls, within their bounds exactly", "t [s]", "control, units in the legend")


def _finish(axes: Any, title: str, x: str, y: str, *, equal: bool = False) -> None:
    axes.set(title=title, xlabel=x, ylabel=y)
    if equal:
        axes.set_aspect("equal", "datalim")
    axes.legend(frameon=False, fontsize=8)
    axes.grid(color="0.92")
