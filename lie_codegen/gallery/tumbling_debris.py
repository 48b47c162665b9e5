"""Tumbling bodies: sixty days of a debris object under sunlight, averaged beside direct; a body despun through its separatrix."""

from __future__ import annotations

import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.pictures.result import GalleryResult, new_figure, save
from lie_codegen.pictures.style import caption
from lie_codegen.rigid_body.environment_torques import torque
from lie_codegen.rigid_body.plates import Plates, plates
from lie_codegen.rigid_body.tumbling_average import TumblingAverage, tumbling_average

_BLUE, _RED, _GREY, _GREEN = "#1f5aa6", "#c8442f", "#8a8f98", "#2e8b57"
_DAY = 86400.0
_TURN, _DAYS = 600.0, 60.0
#: Body axes turned out of the inertial ones by a vector of angles.
_START = (0.3, -0.5, 0.9)


def _attitude() -> Array:
    from scipy.spatial.transform import Rotation

    return np.asarray(Rotation.from_rotvec(_START).as_matrix())


def _object() -> Plates:
    """A box with a panel on one side, so that light turns it."""
    normals = [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0), (0, 0, 1), (0, 0, -1), (0.6, 0.8, 0), (-0.6, -0.8, 0)]
    centres = [(0.6, 0, 0), (-0.6, 0, 0), (0, 0.5, 0.1), (0, -0.5, 0.1), (0.05, 0, 0.8), (0.05, 0, -0.8)] + [
        (0.1, 1.9, 0.2)
    ] * 2
    areas = [2, 2, 1.5, 1.5, 1, 1, 3, 3]
    return plates(
        normals, centres, areas, [0.3, 0.1, 0.2, 0.2, 0.4, 0.1, 0.2, 0.05], [0.2, 0.4, 0.2, 0.5, 0.1, 0.3, 0.1, 0.1]
    )


def _sunlit() -> TumblingAverage:
    yearly = 2 * np.pi / (365.25 * _DAY)
    sun = ["cos(n*t)", "0.917*sin(n*t)", "0.398*sin(n*t)"]
    return tumbling_average(
        (3000, 4000, 5000), [torque.solar_pressure(_object(), sun, 4.56e-6, parameters={"n": repr(3 * yearly)})]
    )


def _timed(call: Callable[[], Any], times: int) -> tuple[Any, float]:
    """The result, and the least processor time of some calls."""
    spent = []
    for _ in range(times):
        begin = time.process_time()
        result = call()
        spent.append(time.process_time() - begin)
    return result, min(spent)


def _coarsest(model: TumblingAverage, X: Array, omega: Array, t: Array, H: Array, error: float) -> tuple[int, float]:
    """The fewest steps a turn with which the direct run is as near to H as the average is, and their processor time."""
    for steps in (8, 10, 12, 15, 20, 25, 30, 40, 60, 100, 150):
        run, spent = _timed(lambda steps=steps: model.direct(X, omega, t, steps_per_turn=steps), 1)  # type: ignore[misc]
        if np.linalg.norm(run.H - H, axis=1).max() <= error * np.linalg.norm(H[0]):
            break
    return steps, spent


def tumbling_debris(folder: Path, progress: Callable[[str], None] = lambda line: None) -> GalleryResult:
    """Sixty days of a debris object under sunlight: averaged and direct, and what each costs in one run."""
    model, X = _sunlit(), _attitude()
    omega = 2 * np.pi / _TURN * np.array([0.06, 0.1, 1.0])
    t = np.linspace(0, _DAYS * _DAY, 121)
    progress("integrating sixty days directly")
    model.direct(X, omega, [0, _TURN])  # compiled before it is timed
    model.solve(X, omega, [0, _DAY], osculating=False)
    direct, spent = _timed(lambda: model.direct(X, omega, t), 1)
    ends, averaged = _timed(lambda: model.solve(X, omega, t[[0, -1]], osculating=False, rtol=1e-6), 20)
    run = model.solve(X, omega, t, rtol=1e-6)
    naive = model.solve(X, omega, t, start="osculating", osculating=False, rtol=1e-6)
    size = float(np.linalg.norm(run.H[0]))
    error = np.linalg.norm(run.osculating_H - direct.H, axis=1) / size
    paper = np.linalg.norm(naive.H - direct.H, axis=1) / size
    fewest, least = _coarsest(model, X, omega, t, direct.H, float(error.max()))
    numbers = {
        "days": _DAYS,
        "turns": int(_DAYS * _DAY / _TURN),
        "k": float(run.k[0]),
        "seconds": {"direct": spent, "averaged": averaged, "ratio": spent / averaged,
                    "direct_of_equal_error": least, "ratio_at_equal_error": least / averaged},
        "steps_a_turn_of_equal_error": fewest,
        "evaluations": {"direct": 4 * direct.steps, "averaged": ends.evaluations},
        "largest_error": {"osculating_from_mean": float(error.max()), "osculating_start": float(paper.max())},
        "status": run.status,
    }  # fmt: skip
    figure = new_figure(11, 8)
    axes: Any = figure.subplots(2, 2)
    figure.suptitle("A debris object of 8 plates under sunlight, sixty days, 8,640 turns")
    days = t / _DAY
    for i, name in enumerate("xyz"):
        axes[0, 0].plot(days, direct.H[:, i], color=_GREY, lw=3, alpha=0.6, label="direct" if i == 0 else None)
        axes[0, 0].plot(days, run.H[:, i], color=(_BLUE, _RED, _GREEN)[i], lw=1.2, label=f"averaged $H_{name}$")
    axes[0, 0].set(title="(a) angular momentum in space", xlabel="t [days]", ylabel="$H$ [N m s]")
    axes[0, 1].plot(days, direct.dynamic_inertia, color=_GREY, lw=3, alpha=0.6, label="direct")
    axes[0, 1].plot(days, run.dynamic_inertia, color=_BLUE, lw=1.2, label="averaged")
    axes[0, 1].set(title="(b) dynamic inertia", xlabel="t [days]", ylabel="$L^2/2T$ [kg m$^2$]")
    axes[1, 0].semilogy(days[1:], paper[1:], color=_RED, lw=0.9, label="averaged from the osculating point")
    axes[1, 0].semilogy(days[1:], error[1:], color=_BLUE, lw=0.9, label="from the mean point, periodic part added")
    axes[1, 0].set(title="(c) error of $H$ against the direct run", xlabel="t [days]", ylabel="relative error")
    cost = numbers["seconds"]
    names = ["averaged", f"direct, {fewest} steps a turn:\nthe same error", "direct, 150 steps a turn"]
    values = [cost["averaged"], cost["direct_of_equal_error"], cost["direct"]]
    bars = axes[1, 1].barh(names, values, color=[_BLUE, _GREY, _GREY])
    axes[1, 1].bar_label(
        bars, [f"{value / values[0]:.0f} x" if value > values[0] else "1" for value in values], padding=6, fontsize=9
    )
    axes[1, 1].set(
        xscale="log",
        xlim=(0.3 * values[0], 12 * values[-1]),
        xlabel="processor time [s]",
        title="(d) time of a whole call",
    )
    for axis in (axes[0, 0], axes[0, 1], axes[1, 0]):
        axis.legend(frameon=False, fontsize=8)
    caption(
        figure,
        "Direct: the attitude turn by turn. Averaged: over the free motion, started at the mean point of that motion.",
    )
    return save("tumbling_debris", folder, figure, numbers)


def tumbling_separatrix(folder: Path, progress: Callable[[str], None] = lambda line: None) -> GalleryResult:
    """A body despun by eddy currents from its long-axis mode through the separatrix: the event, both continuations, the truth."""
    M = np.diag([0.001, 0.0025, 0.0045])
    moments, omega, X = (5, 4, 2.5), (0.35, 0.2, 1.0), _attitude()
    model = tumbling_average(
        moments, [torque.eddy_current(M, (0.3, 0.8, -0.5)), torque.residual_dipole((4e-4, 0, 0), (0.3, 0.8, -0.5))]
    )
    t = np.linspace(0, 8000, 801)
    progress("integrating 8,000 s directly")
    direct = model.direct(X, omega, t)
    before = model.solve(X, omega, t, osculating=False)
    after = [model.solve(X, omega, t, osculating=False, sign=sign) for sign in (1, -1)]
    if before.event is None:
        raise RuntimeError("the body does not reach its separatrix")
    crossing = int(np.argmax(direct.dynamic_inertia > 4))
    numbers = {
        "event": {"t": before.event.t, "H": float(np.linalg.norm(before.event.H)), "left": before.event.mode_left,
                  "entered": before.event.mode_entered},
        "direct_crossing": {"t": float(t[crossing]), "H": float(np.linalg.norm(direct.H[crossing]))},
        "end_of_H": {"plus": after[0].H[-1].tolist(), "minus": after[1].H[-1].tolist(), "direct": direct.H[-1].tolist()},
        "resonances": len(before.resonances),
    }  # fmt: skip
    figure = new_figure(11, 8)
    axes: Any = figure.subplots(2, 2)
    figure.suptitle("Despun through the separatrix by eddy currents")
    panels: tuple[tuple[Any, Callable[[Any], Any], str, str], ...] = (
        (axes[0, 0], lambda run: run.dynamic_inertia, "(a) dynamic inertia", "$L^2/2T$ [kg m$^2$]"),
        (axes[0, 1], lambda run: np.linalg.norm(run.H, axis=1), "(b) size of the angular momentum", "$|H|$ [N m s]"),
        (axes[1, 1], lambda run: run.H[:, 0], "(d) two continuations, and the truth", "$H_x$ [N m s]"),
    )
    for axis, value, title, unit in panels:
        axis.plot(t, value(direct), color=_GREY, lw=3, alpha=0.6, label="direct")
        for run, colour, name in zip(after, (_RED, _GREEN), ("+", "-"), strict=True):
            late = run.t > before.event.t
            axis.plot(
                run.t[late],
                value(run)[late],
                color=colour,
                lw=1.1,
                ls="-" if name == "+" else "--",
                label=f"beyond, sign {name}",
            )
        axis.plot(before.t, value(before), color=_BLUE, lw=1.3, label="averaged")
        axis.axvline(before.event.t, color="#444444", lw=0.7, ls=":")
        axis.set(title=title, xlabel="t [s]", ylabel=unit)
        axis.legend(frameon=False, fontsize=8)
    axes[1, 1].set(xlim=(5000, 8000), ylim=(-0.41, -0.36))
    axes[1, 0].plot(before.t, before.k, color=_BLUE, label="averaged, long-axis mode")
    late = after[0].t > before.event.t
    axes[1, 0].plot(after[0].t[late], after[0].k[late], color=_RED, label="averaged, short-axis mode")
    axes[1, 0].axhline(0.999, color="#444444", lw=0.7, ls=":")
    axes[1, 0].set(title="(c) modulus; the event is at 0.999", xlabel="t [s]", ylabel="$k$")
    axes[1, 0].legend(frameon=False, fontsize=8)
    caption(
        figure,
        "At the separatrix the average has two continuations, by the phase at which it is crossed; dotted: the event.",
    )
    return save("tumbling_separatrix", folder, figure, numbers)
