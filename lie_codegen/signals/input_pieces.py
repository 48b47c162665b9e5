"""Inputs given by formulas on successive intervals: what was given, read, and the waveform of it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeAlias

from lie_codegen.errors import InputError, PeriodError, ShapeError
from lie_codegen.exact.expression import time_symbol
from lie_codegen.on_demand import sympy as sp
from lie_codegen.signals.input_formulas import formula_of, number_of, symbol_of
from lie_codegen.signals.piecewise_waveform import piecewise_waveform
from lie_codegen.signals.trig_formula import NotTrigonometricError
from lie_codegen.signals.waveform import Waveform

#: (end, formulas) of each piece, as they were given.
Pieces = tuple[tuple[Any, tuple[Any, ...]], ...]
#: Their ends, their formulas, and the symbols of the parameters.
Read: TypeAlias = "tuple[list[sp.Expr], list[list[sp.Expr]], tuple[sp.Symbol, ...]]"


def read_pieces(given: Pieces, parameters: Sequence[str]) -> Read:
    """The pieces as formulas.

    Raises:
        InputError: the ends do not increase from 0, or a formula is not understood.
        ShapeError: the pieces differ in the number of components.
    """
    symbols = {name: symbol_of(name) for name in parameters}
    ends = [number_of(end, "the end of a piece", {}) for end, _ in given]
    moments = [float(end) for end in ends]
    if not ends or any(b <= a for a, b in zip([0.0, *moments], moments, strict=False)):
        raise InputError(f"PeriodicInput.from_pieces: the ends {moments} must increase from above 0")
    formulas = [[formula_of(entry, symbols) for entry in entries] for _, entries in given]
    if len({len(row) for row in formulas}) != 1:
        raise ShapeError("PeriodicInput.from_pieces: every piece must have the same number of components")
    return ends, formulas, tuple(symbols.values())


def are_exact(ends: list[sp.Expr], formulas: list[list[sp.Expr]], symbols: tuple[sp.Symbol, ...]) -> bool:
    """Whether all pieces are polynomials in t with sines and cosines of commensurate rates, so that averages are exact.

    Raises:
        InputError: they are not, and have parameters: values alone do not say how the input depends on them.
    """
    try:
        piecewise_waveform(ends, formulas, time_symbol(), symbols)
    except (NotTrigonometricError, PeriodError):
        free = set().union(*(f.free_symbols for row in formulas for f in row)) - {time_symbol()}
        if free:
            raise InputError(
                f"PeriodicInput.from_pieces: the parameters {', '.join(sorted(map(str, free)))} need pieces that are "
                "polynomials in t with sines and cosines of commensurate rates"
            ) from None
        return False
    return True


def pieces_waveform(given: Pieces, parameters: Sequence[str]) -> Waveform:
    """The waveform of pieces that `are_exact`."""
    ends, formulas, symbols = read_pieces(given, parameters)
    return piecewise_waveform(ends, formulas, time_symbol(), symbols)
