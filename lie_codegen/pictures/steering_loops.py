"""The loops of a plan: curves of the integrated controls, whose areas, and area moments, drive the brackets."""

from __future__ import annotations

from itertools import combinations
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.pictures.style import symbol
from lie_codegen.steering.closed_form.chain import Chain
from lie_codegen.steering.closed_form.segments import FigureEight, Loop
from lie_codegen.steering.plan import Plan

COLOURS = ("#1f5aa6", "#c8442f", "#3c8d5a", "#8a5aa6", "#b08a2e", "#5b6470")
GREY = "#8a8f98"

_NOTHING = 1e-9


def draw_loops(axes: Any, plan: Plan, t: Array, velocity: Array) -> None:
    """Of a chain, each of its loops and figures of eight; of any other plan, each pair of controls with a bracket."""
    chain = plan.details.get("chain")
    if isinstance(chain, Chain):
        _segments(axes, plan, chain)
    else:
        _pairs(axes, plan, t, velocity)
    axes.set_aspect("equal", "datalim")
    axes.grid(color="0.92")
    if axes.get_legend_handles_labels()[1]:
        axes.legend(frameon=False, fontsize=8)


def _pairs(axes: Any, plan: Plan, t: Array, velocity: Array) -> None:
    """Closed by the chord to the start (dashed): to second order log X(T) = int u + sum of areas times brackets."""
    positions = [plan.group.labels.index(label) for label in plan.controls]
    u = velocity[:, positions]
    steps = (u[1:] + u[:-1]) / 2 * np.diff(t)[:, None]
    curve = np.vstack([np.zeros(len(positions)), np.cumsum(steps, axis=0)])
    c = plan.group.algebra.structure_constants
    pairs = [(i, j) for i, j in combinations(range(len(positions)), 2) if np.any(c[positions[i], positions[j]])]
    for (i, j), colour in zip(pairs, COLOURS * 3, strict=False):
        x, y = curve[:, i], curve[:, j]
        area = float(np.trapezoid(x * u[:, j] - y * u[:, i], t) / 2)
        axes.fill(x, y, color=colour, alpha=0.12)
        axes.plot(x, y, color=colour, label=f"{symbol(plan.controls[i])}, {symbol(plan.controls[j])}: area {area:.4g}")
        axes.plot([x[-1], x[0]], [y[-1], y[0]], color=colour, ls="--", lw=1)
        axes.plot(x[-1], y[-1], "o", color=colour, ms=4)
    title = "integrated controls, closed by the chord" if pairs else "no pair of controls has a bracket"
    axes.set(title=title)
    if len(pairs) == 1:
        [(i, j)] = pairs
        first, second = (f" [{unit}]" if unit else "" for unit in (plan.group.units[positions[k]] for k in (i, j)))
        axes.set(
            xlabel=rf"$\int$ {symbol(plan.controls[i])} $dt${first}",
            ylabel=rf"$\int$ {symbol(plan.controls[j])} $dt${second}",
        )


def _segments(axes: Any, plan: Plan, chain: Chain) -> None:
    s = np.linspace(0, 1, 401)
    closed = [(part, x) for part, x in chain.parts() if isinstance(part, Loop | FigureEight) and abs(x[0]) > _NOTHING]
    for (segment, x), colour in zip(closed, COLOURS * 3, strict=False):
        v = segment.velocity(x, s)
        curve = np.vstack([np.zeros(v.shape[1]), np.cumsum((v[1:] + v[:-1]) / 2, axis=0) / (len(s) - 1)])
        if isinstance(segment, Loop):
            first, second = curve[:, segment.pair[0]], curve[:, segment.pair[1]]
            a, b = (plan.controls[k] for k in segment.pair)
            label = f"{symbol(a)}, {symbol(b)}: area {x[0]:.4g}, [{symbol(a)}, {symbol(b)}]"
        else:
            first, second = curve @ np.array(segment.a), curve @ np.array(segment.b)
            a, b = (combination(each, plan.controls) for each in (segment.a, segment.b))
            label = f"$a$ = {symbol(a)}, $b$ = {symbol(b)}:\n moment {x[0]:.4g}, $[a, [a, b]]$"
        axes.fill(first, second, color=colour, alpha=0.12)
        axes.plot(first, second, color=colour, label=label)
    rounds = f", each driven {chain.repeats} times" if chain.repeats > 1 else ""
    axes.set(
        title="loops and figures of eight" + rounds,
        xlabel=r"$\int$ of the first $dt$",
        ylabel=r"$\int$ of the second $dt$",
    )


def combination(weights: Any, labels: tuple[str, ...]) -> str:
    """A linear combination of labels as text: "0.707 w1 + 0.707 v1"."""
    terms = [(weight, label) for weight, label in zip(weights, labels, strict=True) if weight]
    parts = [(label if abs(weight) == 1 else f"{abs(weight):.3g} {label}") for weight, label in terms]
    signs = ["-" if weight < 0 else "+" for weight, _ in terms]
    text = " ".join(f"{sign} {part}" for sign, part in zip(signs, parts, strict=True))
    return text.removeprefix("+ ")
