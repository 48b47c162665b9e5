"""Accuracy near the identity: values, first and second derivatives of exp and log, ours and the neighbours'."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from math import isfinite
from pathlib import Path
from typing import Any

from lie_codegen.gallery import derivative_errors as study
from lie_codegen.gallery.leonard_style import plain
from lie_codegen.pictures.result import GalleryResult, new_figure, save
from lie_codegen.pictures.style import BLUE, GREEN, RED, caption

_COLOURS = {"lie_codegen": BLUE, "jaxlie": RED, "liecasadi": GREEN}
_ORDERS = ("value", "first derivative", "second derivative")
#: Where the picture puts an error of zero, NaN (a cross) or worse, and the angle zero.
_FLOOR, _CEILING, _ZERO = 1e-17, 1e19, 1e-9

#: library -> function -> order -> error at each angle.
Table = Mapping[str, Mapping[str, Mapping[str, list[float]]]]


def hessian_errors(folder: Path, progress: Callable[[str], None] = lambda line: None) -> GalleryResult:
    """Relative errors of f, Df u and D^2 f (u, v) against 60-digit arithmetic, over angles from 0 to 3 rad.

    f is exp of SE(3), exp of SO(3) and log of SO(3). Each neighbour is measured if it is installed, and named in the numbers if
    it is not. NaN stands in the numbers as null.
    """
    makers = {"lie_codegen": study.ours, "jaxlie": study.jaxlie, "liecasadi": study.liecasadi}
    progress("60 digits")
    places = {function: [study.place(function, angle) for angle in study.ANGLES] for function in study.FUNCTIONS}
    table: dict[str, Any] = {}
    versions: dict[str, str] = {}
    for library, maker in makers.items():
        progress(library)
        try:
            table[library] = {function: _row(maker(function), places[function]) for function in study.FUNCTIONS}
        except ImportError:
            versions[library] = "not installed"
        else:
            versions[library] = study.installed_version(library)
    numbers = {
        "libraries": versions,
        "worst relative error": _mapped(table, lambda row: _plain(_worst(row))),
        "angles [rad]": list(study.ANGLES),
        "relative errors": _mapped(table, lambda row: [_plain(error) for error in row]),
    }
    return save("hessian_errors", folder, _draw(table), numbers)


def _row(derivatives: study.Derivatives, places: list[study.Place]) -> dict[str, list[float]]:
    rows = [study.errors(derivatives, at) for at in places]
    return {order: [row[k] for row in rows] for k, order in enumerate(_ORDERS)}


def _worst(row: list[float]) -> float:
    return max(row) if all(isfinite(error) for error in row) else float("nan")


def _plain(error: float) -> float | None:
    return float(f"{error:.2e}") if isfinite(error) else None


def _mapped(table: Table, of: Callable[[list[float]], Any]) -> dict[str, Any]:
    return {
        library: {function: {order: of(row) for order, row in orders.items()} for function, orders in functions.items()}
        for library, functions in table.items()
    }


def _draw(table: Table) -> Any:
    figure = new_figure(12, 9)
    panels = figure.subplots(len(study.FUNCTIONS), len(_ORDERS), sharex=True, sharey=True)
    angles = [angle or _ZERO for angle in study.ANGLES]
    for panel_row, function in zip(panels, study.FUNCTIONS, strict=True):
        for axes, order in zip(panel_row, _ORDERS, strict=True):
            for library, functions in table.items():
                row = functions[function][order]
                heights = [min(max(error, _FLOOR), _CEILING) if isfinite(error) else _CEILING for error in row]
                axes.loglog(angles, heights, ".-", color=_COLOURS[library], lw=1.2, ms=5, label=library)
                lost = [(a, _CEILING) for a, error in zip(angles, row, strict=True) if not isfinite(error)]
                axes.plot(*zip(*lost, strict=True) if lost else ([], []), "x", color=_COLOURS[library], ms=8, mew=2)
            axes.set(title=f"{function}: {order}", ylim=(_FLOOR / 3, _CEILING * 30))
            plain(axes)
        panel_row[0].set_ylabel("relative error")
    for axes in panels[-1]:
        axes.set_xlabel("angle [rad]")
        axes.set_xticks([_ZERO, 1e-8, 1e-6, 1e-4, 1e-2, 1], ["0", "1e-8", "1e-6", "1e-4", "0.01", "1"])
        axes.set_xticks([], minor=True)
    panels[0, 0].set_yticks([1e-16, 1e-8, 1, 1e8, 1e16], ["1e-16", "1e-8", "1", "1e8", "1e16"])
    figure.suptitle("Accuracy near the identity, of values and of two derivatives")
    absent = [library for library in _COLOURS if library not in table]
    caption(
        figure,
        "Against 60 digits; crosses: no number came."
        + (f" Not installed here, so not shown: {', '.join(absent)}." if absent else ""),
    )
    panels[0, 0].legend(frameon=False, loc="upper right")
    return figure
