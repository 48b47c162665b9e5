"""plot_loops: one call from many loops to the band that their error stays in."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any, overload

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.errors import InputError
from lie_codegen.pictures.plot_plan import picture_path
from lie_codegen.pictures.result import new_figure, write_figure

_BLUE, _GREY, _RED = "#31688e", "#8a8a8a", "#b5483a"


@overload
def plot_loops(run: Any, path: None = None, *, band: Sequence[float] = (5, 95)) -> Any: ...


@overload
def plot_loops(run: Any, path: str | Path, *, band: Sequence[float] = (5, 95)) -> Path: ...


def plot_loops(run: Any, path: str | Path | None = None, *, band: Sequence[float] = (5, 95)) -> Any:
    """Draws the error of closed loops over time into a file (png, svg, pdf): median, band, and the worst; below, the size of their
    commands. Returns its path; without one the figure, which a notebook shows.

    Args:
        run: what `lc.closed_loop` or the loop of `lc.momentum_wheels` gives: t, error (k,) or (k, N), and u or torques (k, .., m).
        path: the file, or None.
        band: percentiles between which the band lies.

    Raises:
        InputError: it is no closed loop, the percentiles are none, or the name of the file ends in no kind of picture.
        MissingDependencyError: without matplotlib.
        OutputFolderError: the file cannot be written.
    """
    target = None if path is None else picture_path(path)
    t, error = np.asarray(getattr(run, "t", ())), getattr(run, "error", None)
    if error is None or len(t) != len(error):
        raise InputError(f"plot_loops takes a closed loop with its error, got {type(run).__name__}")
    low, high = (float(each) for each in band)
    if not 0 <= low < high <= 100:
        raise InputError(f"plot_loops: band is two percentiles, the lower first, got {tuple(band)}")
    command = getattr(run, "u", None)
    command = getattr(run, "torques", None) if command is None else command
    figure = new_figure(7, 5 if command is not None else 3)
    rows = figure.subplots(2 if command is not None else 1, 1, sharex=True, squeeze=False)[:, 0]
    _drawn(rows[0], t, np.asarray(error), low, high, "error [rad]" if _turns(run) else "error")
    if command is not None:
        sizes = np.linalg.norm(np.asarray(command), axis=-1)
        _drawn(rows[1], t, sizes, low, high, "size of the command")
    if rows[0].get_legend_handles_labels()[1]:
        rows[0].legend(frameon=False, loc="upper right")
    rows[-1].set_xlabel("t [s]")
    return figure if target is None else write_figure(figure, target)


def _turns(run: Any) -> bool:
    """Whether the error is an angle: of rotations it is."""
    X = np.asarray(run.X)
    return X.ndim >= 3 and X.shape[-1] == 3 and np.allclose(np.swapaxes(X, -1, -2) @ X, np.eye(3), atol=1e-6)


def _drawn(axes: Any, t: Array, values: Array, low: float, high: float, label: str) -> None:
    """Lines of one loop, or median, band and largest of many; a logarithmic scale where that shows more."""
    many = values.reshape(len(t), -1)
    middle = np.nanmedian(many, axis=1)
    axes.plot(t, middle, color=_BLUE, label="median" if many.shape[1] > 1 else None)
    if many.shape[1] > 1:
        edges = np.nanpercentile(many, [low, high], axis=1)
        axes.fill_between(
            t, edges[0], edges[1], color=_BLUE, alpha=0.25, label=f"{low:g} to {high:g} % of {many.shape[1]}"
        )
        axes.plot(t, np.nanmax(many, axis=1), color=_RED, linewidth=0.8, label="largest")
    positive = middle[middle > 0]
    if positive.size and np.max(positive) > 100 * np.min(positive):
        axes.set_yscale("log")
    axes.set_ylabel(label)
    axes.grid(color=_GREY, alpha=0.2)
