"""Axes and colours shared by the figures of TR 93-59."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

SAND = "#e9dfc9"
#: For families of curves, dark to light.
SEQUENCE = ("#1b2a49", "#1f5aa6", "#3b8a55", "#d9a03f", "#c8442f", "#8e4585", "#5f6b7a", "#2a9d8f")


def plain(*panels: Any) -> None:
    """Light grid, no box."""
    for axes in panels:
        axes.grid(color="0.92")
        axes.spines[["top", "right"]].set_visible(False)


def bare(axes: Any) -> None:
    """A 3-D panel without ticks or panes, equal on all axes."""
    axes.set_axis_off()
    axes.set_box_aspect((1, 1, 1), zoom=1.45)


def eps_axis(axes: Any, values: Sequence[float]) -> None:
    """A logarithmic axis labelled at the values of eps that were measured."""
    axes.set_xticks(list(values), [f"{value:g}" for value in values])
    axes.set_xticks([], minor=True)
    axes.set_xlabel("$\\epsilon$")
