"""What a periodic input is in numbers: kept in the cache by its texts, so that an input seen before is evaluated without SymPy."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.exact.budget import current_budget
from lie_codegen.kernel.formula_program import FormulaProgram
from lie_codegen.runtime.formula_input import FormulaInput
from lie_codegen.runtime.records import recalled
from lie_codegen.signals.formula_tables import PieceTable, piece_table, series_formula
from lie_codegen.signals.signal_values import PiecewiseValues, SeriesValues
from lie_codegen.signals.waveform import SampledWaveform, Waveform
from lie_codegen.values import Later


@dataclass(frozen=True)
class FormulaValues:
    """t -> formulas of t that are no sums of sines and cosines, called with (...,) times: (..., n).

    Attributes:
        period: the formulas are those of [0, period).
        program: what they are there.
    """

    period: float
    program: FormulaProgram

    def __call__(self, t: Array) -> Array:
        return self.program(np.mod(np.asarray(t, dtype=float), self.period))


@dataclass(frozen=True)
class InputNumbers:
    """A periodic input in doubles.

    Attributes:
        dim: n.
        exact: whether its averages are exact.
        T: the period; None where it depends on a parameter.
        values: t -> u(t); None where a parameter has no value, or a function was given.
        mean, zero_mean: the average over a period, and whether it is 0 exactly.
        series: as a Fourier series that a loop evaluates, or None.
        lines: as straight pieces, or None.
        breakpoints: where it jumps or bends within a period.
    """

    dim: int
    exact: bool
    T: float | None
    values: SeriesValues | PiecewiseValues | FormulaValues | None
    mean: tuple[float, ...] | None
    zero_mean: bool
    series: FormulaInput | None
    lines: PieceTable | None
    breakpoints: tuple[float, ...]


@dataclass(eq=False)
class KnownInput(Later):
    """The formulas of an input whose numbers are known from before."""

    waveform: Callable[[], Waveform]
    numbers: InputNumbers


def numbers_of(waveform: Waveform, breakpoints: tuple[float, ...]) -> InputNumbers:
    """The numbers of an input."""
    n = waveform.dim
    calculus, u = waveform.calculus({}, n)
    average = calculus.mean(u)
    open_numbers = bool(waveform.parameters)
    return InputNumbers(
        n,
        waveform.exact,
        None if waveform.period.free_symbols else float(waveform.period),
        None if open_numbers else _values(waveform, calculus, u),
        None if open_numbers else tuple(map(float, waveform.expressions(calculus, average, n, waveform.period))),
        waveform.vanishes(calculus, average),
        series_formula(waveform, n),
        piece_table(waveform, n),
        breakpoints,
    )


def _values(waveform: Waveform, calculus: Any, u: Any) -> Any:
    if isinstance(waveform, SampledWaveform):
        program = waveform.function
        return FormulaValues(float(waveform.period), program) if isinstance(program, FormulaProgram) else None
    return waveform.evaluator(calculus, u, waveform.dim)


def recalled_numbers(source: Any, make: Callable[[], InputNumbers]) -> InputNumbers:
    """The numbers by their record; without one they are made, which says what is wrong with the formulas.

    Args:
        source: plain data that determines the input, see `source_of` of the records.
    """
    return recalled("input", [source, repr(current_budget())], InputNumbers, make)
