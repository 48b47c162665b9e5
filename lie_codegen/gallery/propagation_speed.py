"""Time against error of propagation, ours and general solvers', from the results of a whole benchmark that are kept beside this file."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from math import isfinite
from pathlib import Path
from typing import Any

from lie_codegen.gallery.leonard_style import plain
from lie_codegen.pictures.result import GalleryResult, new_figure, save
from lie_codegen.pictures.style import BLUE, GREEN, GREY, ORANGE, PURPLE, RED, caption

#: What `lie-codegen bench propagate --json` wrote.
RECORD = Path(__file__).with_suffix(".json")
#: Title of a panel -> the system of the benchmark.
PANELS = {"one qubit": "qubit", "two qubits": "two qubits", "three qubits": "three qubits", "attitude loop": "PD loop"}
#: Tool of the benchmark -> its name, colour and mark.
_TOOLS = {
    "lie_codegen": ("lie_codegen", BLUE, "o"),
    "heyoka": ("heyoka", RED, "s"),
    "qutip vern9": ("QuTiP", GREEN, "^"),
    "dynamiqs Dopri8": ("dynamiqs", ORANGE, "v"),
    "diffrax Dopri8": ("diffrax", PURPLE, "D"),
    "scipy DOP853": ("SciPy", GREY, "X"),
}
#: tool -> (milliseconds, error) at each tolerance.
Curves = Mapping[str, Sequence[tuple[float, float]]]


def propagation_speed(folder: Path, progress: Callable[[str], None] = lambda line: None) -> GalleryResult:
    """Processor time of a call against the error of what it gives, at the tolerances 1e-6, 1e-9 and 1e-12.

    Nothing is timed here: `lie-codegen bench propagate --json > lie_codegen/gallery/propagation_speed.json` measures again.
    """
    record = json.loads(RECORD.read_text(encoding="utf-8"))
    panels = {title: curves(record["rows"], system) for title, system in PANELS.items()}
    numbers = {
        "machine": record["machine"],
        "versions": record["versions"],
        "milliseconds and errors": {title: dict(found) for title, found in panels.items()},
    }
    return save("propagation_speed", folder, _draw(panels, record["machine"]), numbers)


def curves(rows: Sequence[Mapping[str, Any]], system: str) -> dict[str, list[tuple[float, float]]]:
    """Of one system, the tools that took part."""
    found: dict[str, list[tuple[float, float]]] = {}
    for row in rows:
        if row["what"] == system and row["who"] in _TOOLS and row["seconds"] is not None and isfinite(row["seconds"]):
            found.setdefault(row["who"], []).append((1e3 * row["seconds"], row["error"]))
    return found


def _draw(panels: Mapping[str, Curves], machine: str) -> Any:
    figure = new_figure(6, 6.4)
    axes = figure.subplots(2, 2, sharex=True, sharey=True)
    for panel, (title, found) in zip(axes.flat, panels.items(), strict=True):
        for tool, points in found.items():
            name, colour, mark = _TOOLS[tool]
            ms, error = zip(*points, strict=True)
            panel.loglog(
                ms, error, marker=mark, color=colour, label=name, lw=2.2 if tool == "lie_codegen" else 1.2, ms=6
            )
        panel.set_title(title, fontsize=13)
        panel.set_xticks([0.1, 1, 10], ["0.1", "1", "10"], fontsize=12)
        panel.set_yticks([1e-12, 1e-8, 1e-4], ["1e-12", "1e-8", "1e-4"], fontsize=12)
        panel.set_xticks([], minor=True)
        panel.set_yticks([], minor=True)
        plain(panel)
    for panel in axes[:, 0]:
        panel.set_ylabel("error", fontsize=12)
    for panel in axes[1]:
        panel.set_xlabel("milliseconds", fontsize=12)
    figure.suptitle("Propagation: time and error of a call", fontsize=14)
    handles, labels = axes[0, 0].get_legend_handles_labels()
    figure.legend(handles, labels, ncols=3, loc="outside lower center", fontsize=12)
    caption(figure, f"lie-codegen bench propagate; {machine.split(', ')[0]}, processor time")
    return figure
