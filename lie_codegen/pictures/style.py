"""One style for every figure: light grid, no frame above and right, one size of type, the same colours."""

from __future__ import annotations

import re
from contextlib import AbstractContextManager
from importlib import import_module
from typing import Any

from lie_codegen.errors import MissingDependencyError

#: Of lines and areas, in the order of use.
BLUE, RED, GREEN, ORANGE, PURPLE, GREY = "#1f5aa6", "#c8442f", "#2e8b57", "#d98c1f", "#7a4fa3", "#8a8f98"
COLOURS = (BLUE, RED, GREEN, ORANGE, PURPLE, GREY)

_SETTINGS: dict[str, Any] = {
    "font.size": 10,
    "figure.titlesize": 13,
    "axes.titlesize": 11,
    "axes.labelsize": 10,
    "xtick.labelsize": 9,
    "ytick.labelsize": 9,
    "legend.fontsize": 8.5,
    "legend.frameon": False,
    "axes.edgecolor": "0.3",
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "axes.axisbelow": True,
    "grid.color": "0.92",
    "axes.formatter.use_mathtext": True,
    "svg.hashsalt": "lie_codegen",  # the same file from the same numbers
}


def require_matplotlib() -> None:
    """Say which extra is missing, where matplotlib is.

    Raises:
        MissingDependencyError: it cannot be imported.
    """
    try:
        import_module("matplotlib")
    except ImportError:
        raise MissingDependencyError(
            "pictures need matplotlib: install lie_codegen with its extra, lie_codegen[plot]"
        ) from None


def style() -> AbstractContextManager[None]:
    """Figures made inside follow the style; the caller's own matplotlib settings are as before after it.

    Raises:
        MissingDependencyError: without matplotlib.
    """
    require_matplotlib()
    from matplotlib import rc_context
    from matplotlib.rcsetup import cycler

    context: AbstractContextManager[None] = rc_context({**_SETTINGS, "axes.prop_cycle": cycler(color=COLOURS)})
    return context


def caption(figure: Any, text: str) -> None:
    """A sentence or two under the panels: what is seen, and what was left out. Over a legend that lies there, as its title."""
    if figure.legends:
        figure.legends[-1].set_title(text, prop={"size": 9})
        figure.legends[-1].get_title().set_color("0.3")
    else:
        figure.supxlabel(text, fontsize=9, color="0.3", wrap=True)


def symbol(label: str) -> str:
    """A label as it is typeset: "w1" with its index below the line, any other as it is."""
    found = re.fullmatch(r"([A-Za-z])_?(\d+)", label)
    return f"${found[1]}_{{{found[2]}}}$" if found else label
