"""Periodic inputs as tables of doubles that a compiled loop evaluates: Fourier coefficients, or straight pieces."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.on_demand import sympy as sp
from lie_codegen.runtime.formula_input import FormulaInput, fourier_input, lines_input
from lie_codegen.signals.piecewise_waveform import PiecewiseWaveform
from lie_codegen.signals.signal_values import SignalTable, table_of
from lie_codegen.signals.waveform import TrigWaveform, Waveform

_DIGITS = 50


@dataclass(frozen=True)
class FourierTable:
    """u(t) = sum_f cosines_f cos(w_f t) + sines_f sin(w_f t).

    Attributes:
        rates, rates_low: (F,) w_f, the sum of the two is good to twice double precision.
        cosines, sines: (F, n).
    """

    rates: Array
    rates_low: Array
    cosines: Array
    sines: Array


@dataclass(frozen=True)
class PieceTable:
    """One period of straight pieces.

    Attributes:
        starts: (m,) of the pieces, the first is 0.
        left, right: (m, n) at the start and the end of each.
    """

    starts: Array
    left: Array
    right: Array


def series_formula(waveform: Waveform, n: int) -> FormulaInput | None:
    """n components as a Fourier series that a loop evaluates, at all times; None where they are none."""
    series = fourier_table(waveform, n)
    if series is None:
        return None
    return fourier_input(series.rates, series.cosines, series.sines, rates_low=series.rates_low)


def lines_between(pieces: PieceTable, period: float, start: float, end: float) -> FormulaInput:
    """Straight pieces, repeated over [start, end]."""
    first, last = int(np.floor(start / period)), max(int(np.ceil(end / period)), int(np.floor(start / period)) + 1)
    whole = np.arange(first, last)
    times = np.append((whole[:, None] * period + pieces.starts).ravel(), last * period)
    return lines_input(times, np.tile(pieces.left, (len(whole), 1)), np.tile(pieces.right, (len(whole), 1)))


def fourier_table(waveform: Waveform, n: int) -> FourierTable | None:
    """The series of n trigonometric polynomials without parameters; None for any other waveform."""
    if not isinstance(waveform, TrigWaveform) or waveform.parameters:
        return None
    calculus, signal = waveform.calculus({}, n)
    table = _numbers(signal, n, calculus.ring, waveform.form.units)
    rates = [sp.N(int(f) * waveform.omega, _DIGITS) for f in table.frequencies]
    high = np.array([float(w) for w in rates])
    low = np.array([float(w - sp.Float(h, _DIGITS)) for w, h in zip(rates, high, strict=True)])
    return FourierTable(high, low, table.cosines, table.sines)


def piece_table(waveform: Waveform, n: int) -> PieceTable | None:
    """One period of n components whose pieces are constant or linear in t, without parameters; None for any other."""
    if not isinstance(waveform, PiecewiseWaveform) or waveform.parameters:
        return None
    calculus, pieces = waveform.calculus({}, n)
    tables = [_numbers(piece, n, calculus.ring, waveform.units) for piece in pieces]
    if any(np.any(table.powers > 1) or np.any(table.frequencies != 0) for table in tables):
        return None
    ends = np.array([float(end) for end in waveform.ends])
    lengths = [float(length) for length in waveform.lengths]
    left = np.array([table(np.array(0.0)) for table in tables])
    right = np.array([table(np.array(length)) for table, length in zip(tables, lengths, strict=True)])
    return PieceTable(np.concatenate([[0.0], ends[:-1]]), left, right)


def _numbers(signal: Any, dim: int, ring: Any, units: Any) -> SignalTable:
    return table_of(signal, dim, ring, tuple(float(g) for g in ring.generators), tuple(float(unit) for unit in units))
