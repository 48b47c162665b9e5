"""What exact averages cost: the time of F_1 .. F_p against the order, the harmonics, the parameters and the group."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from time import process_time
from typing import Any

from lie_codegen.averaging.averaged import average
from lie_codegen.exact.budget import Budget
from lie_codegen.gallery.leonard_style import SEQUENCE, plain
from lie_codegen.groups.catalogue_load import group
from lie_codegen.pictures.result import GalleryResult, new_figure, save
from lie_codegen.pictures.style import caption
from lie_codegen.signals.periodic_input import PeriodicInput

#: No order is tried beyond one that takes this long. [s]
_LIMIT = 0.7
#: Each is run this often; the least time is told, which others on the machine disturb least.
_RUNS = 7
#: Time is the limit here, not the count of products.
_PRODUCTS = 100_000_000


def growth_cases() -> dict[str, tuple[str, PeriodicInput]]:
    """Label -> (group, input)."""
    cases: dict[str, tuple[str, PeriodicInput]] = {
        f"so3, {h} harmonic{'s' if h > 1 else ''}": ("so3", harmonics(3, h)) for h in (1, 2, 4)
    }
    cases["se3, 4 inputs"] = (
        "se3",
        PeriodicInput(["cos(t)+1/10", "sin(t)", "cos(2*t)", "sin(2*t)+1/3", "0", "0"], "2*pi"),
    )
    cases["su3, 8 inputs"] = ("su3", harmonics(8, 1))
    texts = ["A*cos(t)", "B*sin(t) + C*cos(2*t)", "D*cos(t)"]
    cases["so3, 4 amplitudes"] = ("so3", PeriodicInput(texts, "2*pi", ("A", "B", "C", "D")))
    texts = ["A*cos(t + p)", "B*sin(t + q)", "C*cos(2*t)"]
    cases["so3, 3 amplitudes, 2 phases"] = ("so3", PeriodicInput(texts, "2*pi", ("A", "B", "C", "p", "q")))
    return cases


def harmonics(dim: int, count: int) -> PeriodicInput:
    """Full sums of sines and cosines with rational coefficients, all different."""
    rows = range(1, dim + 1)
    return PeriodicInput.from_fourier(
        [[f"{i + 1}/{k * (i + k)}" for i in rows] for k in range(1, count + 1)],
        [[f"{2 * i - 1}/{k * k + i}" for i in rows] for k in range(1, count + 1)],
        mean=[f"1/{i + 3}" for i in rows],
    )


def averaging_growth(folder: Path, progress: Callable[[str], None] = lambda line: None) -> GalleryResult:
    """Processor seconds, the least of seven runs, for F_1 .. F_p and Lambda_1 .. Lambda_{p-1}, exactly, on one core."""
    seconds: dict[str, list[float]] = {}
    for label, (name, u) in growth_cases().items():
        progress(label)
        chosen = group(name)
        average(chosen, u, 2)
        row: list[float] = []
        for order in range(1, 13):
            with Budget(products=_PRODUCTS):
                row.append(min(_seconds(chosen, u, order) for _ in range(_RUNS)))
            if row[-1] > _LIMIT:
                break
        seconds[label] = row
    return save("averaging_growth", folder, _draw(seconds), {"seconds_by_order_from_1": seconds})


def _seconds(chosen: Any, u: PeriodicInput, order: int) -> float:
    start = process_time()
    average(chosen, u, order)
    return process_time() - start


def _draw(seconds: dict[str, list[float]]) -> Any:
    figure = new_figure(9, 6)
    axes = figure.subplots()
    figure.suptitle("Exact averages: time of $F_1 \\ldots F_p$ on one core")
    for (label, row), colour in zip(seconds.items(), SEQUENCE, strict=False):
        axes.semilogy(range(1, len(row) + 1), row, "o-", color=colour, mfc="none", ms=4, label=label)
    axes.set(
        xlabel="order p",
        ylabel="processor time [s]",
        xticks=range(1, 13),
    )
    caption(figure, f"The least of {_RUNS} runs; no order is tried beyond one that takes {_LIMIT:g} s.")
    axes.legend()
    plain(axes)
    return figure
