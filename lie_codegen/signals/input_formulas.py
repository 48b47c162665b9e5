"""From texts, SymPy expressions and numbers to the waveform of a periodic input."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.errors import ExpressionError, InputError, NotFiniteError, PeriodError, ShapeError
from lie_codegen.exact.expression import FORMULA_FUNCTIONS, parse_expression, time_symbol
from lie_codegen.exact.numbers import exact_number
from lie_codegen.kernel.formula_program import formula_program
from lie_codegen.on_demand import sympy as sp
from lie_codegen.signals.sampled_signal import resolve
from lie_codegen.signals.trig_formula import NotTrigonometricError, trig_form
from lie_codegen.signals.waveform import SampledWaveform, TrigWaveform, Waveform

#: The time in every formula.
_PERIODIC_TO = 1e-9


def formula_waveform(
    components: Sequence[Any], given_period: Any, parameters: Sequence[str], breakpoints: Sequence[float]
) -> Waveform:
    """The waveform of formulas: exact where they are sums of sines and cosines, else sampled.

    Raises:
        ExpressionError, PeriodError, InputError: see `PeriodicInput`.
    """
    if not components:
        raise InputError("PeriodicInput: no component; give one formula for each direction of the group")
    symbols = {name: symbol_of(name) for name in parameters}
    formulas = tuple(formula_of(entry, symbols) for entry in components)
    period = None if given_period is None else period_of(given_period, symbols)
    if period is not None and not period.free_symbols and not float(period) > 0:
        raise PeriodError(f"PeriodicInput: the period {given_period} is not positive")
    try:
        form = trig_form(formulas, time_symbol(), period, "PeriodicInput")
        return TrigWaveform(form, tuple(symbols.values()))
    except NotTrigonometricError as error:
        return _sampled(components, formulas, period, breakpoints, str(error))


def _sampled(
    components: Sequence[Any],
    formulas: tuple[sp.Expr, ...],
    period: sp.Expr | None,
    breakpoints: Sequence[float],
    culprit: str,
) -> Waveform:
    free = set().union(*(formula.free_symbols for formula in formulas)) - {time_symbol()}
    if free:
        raise InputError(
            f"PeriodicInput: {culprit} is not a sum of sines and cosines, so the input is taken by its values, and the "
            f"parameters {', '.join(sorted(map(str, free)))} have none; put numbers in their place"
        )
    if period is None or period.free_symbols:
        raise PeriodError(f"PeriodicInput: {culprit} is not a sum of sines and cosines; give its period")
    length = float(period)
    function = compiled(formulas)
    probe = length * np.array([0.0131, 0.271828, 0.577215, 0.8314159])
    here, later = function(probe), function(probe + length)
    off = np.max(np.abs(later - here), axis=0)
    bad = np.flatnonzero(~(off <= _PERIODIC_TO * np.maximum(1.0, np.max(np.abs(here), axis=0))))
    if len(bad):
        raise PeriodError(
            f"PeriodicInput: component {bad[0] + 1}, {components[bad[0]]}, is not periodic with period {period}: it "
            f"changes by {off[bad[0]]:.3g} over one; pieces that start anew each period go to PeriodicInput.from_pieces"
        )
    panels, values = resolve(function, length, breakpoints)
    return SampledWaveform(panels, values, function, period)


def compiled(formulas: Sequence[sp.Expr]) -> Callable[[Array], Array]:
    """(...,) -> (..., n) from formulas of t alone: a `FormulaProgram`.

    SymPy knows more functions than the grammar of texts (Piecewise, Heaviside): where one stands, it makes the function itself.
    """
    try:
        return formula_program(formulas, [time_symbol()])
    except ExpressionError:
        functions = [sp.lambdify(time_symbol(), formula, "numpy", cse=True) for formula in formulas]

    def evaluate(t: Array) -> Array:
        times = np.asarray(t, dtype=float)
        return np.stack([np.broadcast_to(np.asarray(f(times), dtype=float), times.shape) for f in functions], axis=-1)

    return evaluate


def symbol_of(name: str) -> sp.Symbol:
    """The real symbol of a parameter.

    Raises:
        InputError: a name that is no identifier, or t or pi.
    """
    if not isinstance(name, str) or not name.isidentifier() or name in ("t", "pi"):
        raise InputError(f"PeriodicInput: {name!r} cannot name a parameter")
    return sp.Symbol(name, real=True)


def formula_of(entry: Any, symbols: Mapping[str, sp.Symbol]) -> sp.Expr:
    """A formula of t and the symbols from a text, a SymPy expression or a number.

    Raises:
        ExpressionError: a text outside the grammar.
        InputError: an undeclared symbol.
    """
    if isinstance(entry, str):
        return parse_expression(entry, {"t": time_symbol(), "pi": sp.pi, **symbols}, FORMULA_FUNCTIONS)
    if isinstance(entry, sp.Expr):
        known = {"t": time_symbol(), **symbols}
        for symbol in entry.free_symbols:
            if str(symbol) not in known:
                raise InputError(f"PeriodicInput: {symbol} in {entry} is not declared; name it in `parameters`")
        floats = {number: exact_value(float(number)) for number in entry.atoms(sp.Float)}
        return entry.xreplace({**floats, **{symbol: known[str(symbol)] for symbol in entry.free_symbols}})
    return exact_value(entry)


def formulas_of(entries: Sequence[Any], parameters: Sequence[str]) -> list[sp.Expr]:
    """Formulas with their parameters as symbols."""
    symbols = {name: symbol_of(name) for name in parameters}
    return [formula_of(entry, symbols) for entry in entries]


def substituted(
    entries: Sequence[Any], period: Any, parameters: Sequence[str], values: Mapping[str, Any]
) -> tuple[tuple[sp.Expr, ...], sp.Expr]:
    """Formulas and their period with numbers in place of some of the parameters, floats at their exact binary value."""
    numbers = {symbol_of(name): exact_value(value) for name, value in values.items()}
    symbols = {name: symbol_of(name) for name in parameters}
    exact = tuple(formula.subs(numbers) for formula in formulas_of(entries, parameters))
    return exact, period_of(period, symbols).subs(numbers)


def period_of(value: Any, symbols: Mapping[str, sp.Symbol]) -> sp.Expr:
    """A period given as text, number or SymPy expression in the given symbols.

    Raises:
        InputError: if it is not understood or depends on t.
    """
    return number_of(value, "period", symbols)


def number_of(value: Any, what: str, symbols: Mapping[str, sp.Symbol]) -> sp.Expr:
    """A number, or an expression in the symbols alone.

    Raises:
        InputError: if it is not understood or depends on t; names `what`.
    """
    result = formula_of(value, symbols)
    if result.has(time_symbol()):
        raise InputError(f"PeriodicInput: {what} {value!r} depends on t")
    return result


def exact_value(value: Any) -> sp.Expr:
    """A number exactly; a float at its binary value."""
    if isinstance(value, float | np.floating):
        if not np.isfinite(value):
            raise NotFiniteError(f"PeriodicInput: {value} is not finite")
        return sp.Rational(*float(value).as_integer_ratio())
    return exact_number(value)


def pieces_function(ends: Sequence[float], formulas: Sequence[Sequence[sp.Expr]]) -> Callable[[Array], Array]:
    """(k,) times in [0, T) -> (k, n) from the formulas of the piece each time is in."""
    functions = [compiled(row) for row in formulas]

    def evaluate(t: Array) -> Array:
        index = np.clip(np.searchsorted(ends, t, side="right"), 0, len(ends) - 1)
        result = np.empty((len(t), len(formulas[0])))
        for piece, function in enumerate(functions):
            here = index == piece
            result[here] = function(t[here])
        return result

    return evaluate


def coefficients_of(table: Any, what: str) -> list[list[sp.Expr]]:
    """Rows of exact numbers from rows of numbers or texts.

    Raises:
        ShapeError: if they are not rows; names `what`.
    """
    try:
        return [[exact_value(value) for value in row] for row in rows_of(table)]
    except TypeError:
        raise ShapeError(f"PeriodicInput.from_fourier: {what} must be rows of n coefficients") from None


def fourier_formulas(cosines: Any, sines: Any, mean: Any, period: Any) -> tuple[sp.Expr, ...]:
    """mean + sum_k cosines[k-1] cos(2 pi k t / T) + sines[k-1] sin(2 pi k t / T), a formula a component.

    Raises:
        ShapeError: they do not agree in n. NotFiniteError: NaN or infinity.
    """
    c, s = coefficients_of(cosines, "cosines"), coefficients_of(sines, "sines")
    m = coefficients_of([] if mean is None else [mean], "mean")
    widths = {len(row) for table in (c, s, m) for row in table}
    if len(widths) != 1:
        raise ShapeError(f"PeriodicInput.from_fourier: the coefficients have {sorted(widths)} components; give one n")
    [n] = widths
    omega = 2 * sp.pi / period_of(period, {})
    terms = [list(m[0]) if m else [sp.S.Zero] * n]
    terms += [[a * sp.cos((k + 1) * omega * time_symbol()) for a in row] for k, row in enumerate(c)]
    terms += [[b * sp.sin((k + 1) * omega * time_symbol()) for b in row] for k, row in enumerate(s)]
    return tuple(sp.Add(*(row[i] for row in terms)) for i in range(n))


def series_through(values: Any) -> tuple[Array, Array, Array]:
    """Mean (n,), cosines and sines (K, n) of the trigonometric polynomial through (N, n) samples of one period.

    Raises:
        ShapeError, NotFiniteError: naming `values`.
    """
    samples = np.asarray(values, dtype=float)
    if samples.ndim != 2 or len(samples) < 2:
        raise ShapeError(f"PeriodicInput.from_samples: values has shape {samples.shape}; give (N, n) with N >= 2")
    if not np.all(np.isfinite(samples)):
        raise NotFiniteError("PeriodicInput.from_samples: values holds NaN or infinity")
    spectrum = np.fft.rfft(samples, axis=0) / len(samples)
    weights = np.full(len(spectrum) - 1, 2.0)
    if len(samples) % 2 == 0:
        weights[-1] = 1.0  # the highest frequency of an even number of samples stands for itself and its mirror image
    return spectrum[0].real, weights[:, None] * spectrum[1:].real, -weights[:, None] * spectrum[1:].imag


def rows_of(table: Any) -> list[list[Any]]:
    """The rows of an array, a SymPy matrix or nested sequences.

    Raises:
        TypeError: what is no sequence of sequences; a text is none, whose letters are no entries.
    """
    if isinstance(table, np.ndarray | sp.MatrixBase):
        return list(table.tolist())
    if isinstance(table, str) or any(isinstance(row, str) for row in table):
        raise TypeError("texts are no rows")
    return [list(row) for row in table]
