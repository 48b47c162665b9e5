"""Histograms, bands and maps of the samples of a study."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.errors import InputError, OutputFolderError, write_refusal
from lie_codegen.pictures.result import new_figure
from lie_codegen.pictures.steering_loops import COLOURS, GREY
from lie_codegen.whole_files import whole_file

_BAND = (0.05, 0.25, 0.5, 0.75, 0.95)
_MOST_PANELS = 12
_WIDE = 100


def draw_study(
    data: Mapping[str, Array],
    against: Mapping[str, Array],
    path: str | Path | None,
    *,
    labels: Mapping[str, Sequence[str]],
) -> Any:
    """A panel for each column of data; returns the figure, or the path that it was written to.

    Args:
        data: name -> (N,) numbers: a histogram; (N, k): the band of 5, 25, 50, 75 and 95 %, entry by entry.
        against: none, one or two inputs (N,): then a column (N,) is drawn against it, or as colour over both.
        path: a file, or None.
        labels: texts of inputs that are places in a list.

    Raises:
        InputError: nothing to draw, or inputs that are no numbers.
    """
    panels = dict(list(data.items())[:_MOST_PANELS])
    if not panels or all(len(column) == 0 for column in panels.values()):
        raise InputError("study: no samples are done that could be drawn")
    if len(against) > 2 or any(column.ndim != 1 for column in against.values()):
        raise InputError("study: a picture goes over one or two inputs that are one number a sample")
    columns = min(3, len(panels))
    rows = -(-len(panels) // columns)
    figure = new_figure(4.2 * columns, 3.2 * rows)
    for place, (name, column) in enumerate(panels.items()):
        axes = figure.add_subplot(rows, columns, place + 1)
        if column.ndim == 2:
            _band(axes, name, column)
        elif not against:
            _histogram(axes, name, column)
        elif len(against) == 1:
            _scatter(axes, name, column, against)
        else:
            _map(figure, axes, name, column, against)
        for axis, key in ((axes.xaxis, 0), (axes.yaxis, 1)):
            named = list(against)[key : key + 1]
            if named and named[0] in labels and (key == 0 or len(against) == 2):
                axis.set_ticks(range(len(labels[named[0]])), labels[named[0]])
    if path is None:
        return figure
    try:
        with whole_file(path) as fresh:
            figure.savefig(fresh, dpi=150)
    except ValueError as error:  # a format that matplotlib does not know
        raise OutputFolderError(f"{path}: cannot be written: {error}") from None
    except OSError as error:
        raise write_refusal(f"{path}: cannot be written", error) from None
    return Path(path)


def _histogram(axes: Any, name: str, column: Array) -> None:
    values = column.astype(float)
    count = min(80, max(10, int(np.sqrt(len(values)))))
    middle, high = np.quantile(values, (0.5, 0.95))
    least = float(np.min(values))
    if least > 0 and np.max(values) > _WIDE * middle:
        # a tail that is a hundred medians long would leave everything else in the first bar
        axes.set_xscale("log")
        axes.hist(values, bins=list(np.geomspace(least, np.max(values), count + 1)), color=COLOURS[0])
    else:
        axes.hist(values, bins=count, color=COLOURS[0])
    axes.axvline(middle, color="black", linewidth=1, label=f"median {middle:.4g}")
    axes.axvline(high, color="black", linewidth=1, linestyle="--", label=f"95 % {high:.4g}")
    axes.set_xlabel(name)
    axes.set_ylabel("samples")
    axes.legend(fontsize=8)


def _band(axes: Any, name: str, column: Array) -> None:
    low, lower, middle, upper, high = np.quantile(column, _BAND, axis=0)
    k = np.arange(column.shape[1])
    axes.fill_between(k, low, high, color=COLOURS[0], alpha=0.2, linewidth=0, label="5 to 95 %")
    axes.fill_between(k, lower, upper, color=COLOURS[0], alpha=0.4, linewidth=0, label="25 to 75 %")
    axes.plot(k, middle, color=COLOURS[0], label="median")
    axes.set_xlabel("entry")
    axes.set_ylabel(name)
    axes.legend(fontsize=8)


def _scatter(axes: Any, name: str, column: Array, against: Mapping[str, Array]) -> None:
    ((label, x),) = against.items()
    axes.plot(x, column, ".", markersize=2, color=COLOURS[0], alpha=min(1.0, 30 / np.sqrt(len(x))))
    axes.set_xlabel(label)
    axes.set_ylabel(name)


def _map(figure: Any, axes: Any, name: str, column: Array, against: Mapping[str, Array]) -> None:
    """Two inputs that form a grid are drawn as one, with the mean of the samples in each cell; others as coloured points."""
    (first, x), (second, y) = against.items()
    xs, ys = np.unique(x), np.unique(y)
    axes.set_facecolor(GREY)
    if len(xs) * len(ys) <= len(x):
        total, count = np.zeros((len(ys), len(xs))), np.zeros((len(ys), len(xs)))
        place = (np.searchsorted(ys, y), np.searchsorted(xs, x))
        np.add.at(total, place, column)
        np.add.at(count, place, 1)
        shown = axes.pcolormesh(xs, ys, np.where(count > 0, total / np.maximum(count, 1), np.nan), shading="nearest")
    else:
        shown = axes.scatter(x, y, c=column, s=4)
    figure.colorbar(shown, ax=axes, label=name)
    axes.set_xlabel(first)
    axes.set_ylabel(second)
