"""Figure 1 of TR 93-59: periodic controls, the areas of their loops, and the flow along a bracket they cause.

Four pulses, and a smooth pair of the same kind. In the paper x(T) - x(0) = eps^2 Area [F_1, F_2](x(0)) + higher order; on the
Heisenberg group this is exact, and on SO(3) the rest is of third order in eps.
"""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from lie_codegen.averaging.areas import areas
from lie_codegen.flow.batched_exponential import logm
from lie_codegen.flow.reference_flow import reference_flow
from lie_codegen.gallery.leonard_style import eps_axis, plain
from lie_codegen.groups.catalogue_load import group
from lie_codegen.pictures.result import GalleryResult, new_figure, save
from lie_codegen.pictures.style import BLUE, GREEN, RED, caption
from lie_codegen.signals.periodic_input import PeriodicInput

_EPS = (0.4, 0.2, 0.1, 0.05)


def inputs() -> tuple[PeriodicInput, PeriodicInput]:
    """The four pulses of Figure 1(a), and a smooth pair in the place of Figure 1(c); the third component is zero."""
    pulses = [(1, ["1", "0", "0"]), (2, ["0", "1", "0"]), (3, ["-1", "0", "0"]), (4, ["0", "-1", "0"])]
    smooth = ["pi/2*cos(pi/2*t) - pi/8*cos(pi*t)", "pi/2*sin(pi/2*t) + pi/6*sin(pi*t)", "0"]
    return PeriodicInput.from_pieces(pulses), PeriodicInput(smooth, 4)


def periodic_controls(folder: Path, progress: Callable[[str], None] = lambda line: None) -> GalleryResult:
    """Figure 1 (a) to (d), and the measured flow along [A_1, A_2]."""
    progress("areas of the loops, and one period on the Heisenberg group and on SO(3)")
    pair = inputs()
    loops = [areas(u)[0, 1] for u in pair]
    moved = {name: [_moves(name, u) for u in pair] for name in ("h3", "so3")}
    numbers: dict[str, Any] = {
        "period": 4.0,
        "area_pulses": str(loops[0]),
        "area_smooth": str(loops[1]),
        "eps": list(_EPS),
    }
    for name, values in moved.items():
        for label, area, move in zip(("pulses", "smooth"), loops, values, strict=True):
            rest = [abs(m[2] - eps**2 * float(area)) for m, eps in zip(move, _EPS, strict=True)]
            whole = [np.linalg.norm(m - [0, 0, eps**2 * float(area)]) for m, eps in zip(move, _EPS, strict=True)]
            numbers[f"{name}_{label}_bracket_component"] = [float(m[2]) for m in move]
            numbers[f"{name}_{label}_difference_along_bracket"] = [float(r) for r in rest]
            numbers[f"{name}_{label}_difference"] = [float(w) for w in whole]
    return save("periodic_controls", folder, _draw(pair, loops, moved), numbers)


def _moves(name: str, u: PeriodicInput) -> list[Any]:
    """log X(T) for each eps: (3,) each."""
    chosen = group(name)
    return [chosen.project(logm(_last(chosen, u, eps))) for eps in _EPS]


def _last(chosen: Any, u: PeriodicInput, eps: float) -> Any:
    flow = reference_flow(chosen, u, eps, u.T)
    return flow.X[int(np.argmax(flow.t))]


def _draw(pair: tuple[PeriodicInput, PeriodicInput], loops: list[Any], moved: dict[str, list[Any]]) -> Any:
    figure = new_figure(12, 7)
    panels = figure.subplots(2, 3)
    figure.suptitle("Periodic controls and the areas they enclose (TR 93-59, Figure 1)", fontsize=13)
    t = np.linspace(0, 4, 2001)[:-1]
    names = ("(a) four pulses", "(c) a smooth pair")
    for row, u, area, name, letter in zip(panels, pair, loops, names, ("b", "d"), strict=True):
        values, tilde = u(t), u.integral(t)
        row[0].plot(t, values[:, 0], color=BLUE, label="$u_1$")
        row[0].plot(t, values[:, 1], color=RED, label="$u_2$")
        row[0].set(title=f"{name}", xlabel="t", ylabel="u")
        row[0].legend(frameon=False, loc="upper right", ncols=2)
        row[1].fill(tilde[:, 0], tilde[:, 1], color=BLUE, alpha=0.15)
        row[1].plot(*np.vstack([tilde, tilde[:1]])[:, :2].T, color=BLUE)
        centre = tilde.mean(axis=0)
        row[1].text(centre[0], centre[1], f"area {float(area):.4g}", ha="center", va="center")
        row[1].set(title=f"({letter}) its loop", xlabel="$\\tilde u_1$", ylabel="$\\tilde u_2$", aspect="equal")
    eps = np.array(_EPS)
    marks = (("h3", "Heisenberg", GREEN), ("so3", "SO(3)", RED))
    for panel, area, index in ((panels[0, 2], loops[0], 0), (panels[1, 2], loops[1], 1)):
        fine = np.geomspace(eps.min() * 0.8, eps.max() * 1.2, 50)
        panel.loglog(fine, fine**2 * abs(float(area)), color=BLUE, label="$\\epsilon^2$ area")
        for name, label, colour in marks:
            panel.loglog(eps, [abs(m[2]) for m in moved[name][index]], "o", mfc="none", color=colour, label=label)
        off = [np.linalg.norm(m - [0, 0, e**2 * float(area)]) for m, e in zip(moved["so3"][index], eps, strict=True)]
        panel.loglog(eps, off, "x", color=RED, label="SO(3), what is left")
        panel.set(title="motion along $[A_1, A_2]$ in one period")
        eps_axis(panel, _EPS)
        panel.legend(frameon=False, fontsize=8)
    plain(*panels.ravel())
    caption(
        figure,
        "Right: the motion along the bracket after one period, whose leading part is the area; crosses: what the area leaves out.",
    )
    return figure
