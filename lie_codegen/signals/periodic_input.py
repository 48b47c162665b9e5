"""PeriodicInput: n periodic functions of time, exact where they are trigonometric polynomials."""

from __future__ import annotations

import sys
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cache, cached_property
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.errors import InputError, PeriodError, ShapeError
from lie_codegen.exact.expression import time_symbol
from lie_codegen.kernel.saved import Saved
from lie_codegen.on_demand import sympy as sp
from lie_codegen.runtime.formula_input import FormulaInput
from lie_codegen.runtime.records import source_of
from lie_codegen.signals.formula_tables import lines_between
from lie_codegen.signals.input_formulas import (
    exact_value,
    formula_of,
    formula_waveform,
    fourier_formulas,
    number_of,
    period_of,
    pieces_function,
    rows_of,
    series_through,
    symbol_of,
)
from lie_codegen.signals.input_numbers import InputNumbers, numbers_of, recalled_numbers
from lie_codegen.signals.piecewise_waveform import piecewise_waveform
from lie_codegen.signals.sampled_signal import Interpolated, Panels, resolve
from lie_codegen.signals.trig_formula import NotTrigonometricError
from lie_codegen.signals.waveform import SampledWaveform, TrigWaveform, Waveform
from lie_codegen.values import Deferred, Later, settle

__all__ = ["PeriodicInput"]

#: (end, formulas) of each piece, as they were given.
Pieces = tuple[tuple[Any, tuple[Any, ...]], ...]


@dataclass(frozen=True, eq=False, repr=False, init=False)
class PeriodicInput(Saved):
    """u(t) with u(t + T) = u(t), callable: u(t) is (n,) for a scalar t and (..., n) for an array.

    Sums, products and integer powers of sines and cosines of commensurate frequencies are kept as exact trigonometric
    polynomials, with symbolic amplitudes and phases; any other formula of t is taken by its values (`exact` is False).

    Attributes:
        components: n formulas: texts in t, pi and the parameters (functions sin, cos, sqrt, ...), SymPy expressions, or
            numbers (floats at their exact binary value: write 0.1 as "0.1" or "1/10" for one tenth).
        period: T as a text, a number or a SymPy expression; the smallest common period if not given. [time unit]
        parameters: names of symbolic amplitudes and phases.
        breakpoints: times in (0, T) at which u or a derivative jumps.
        pieces: of an input in pieces, (end, formulas) of each.
        table: of a function, the edges of panels of [0, T] and its values at their Chebyshev nodes. They stand for the function in
            comparisons, and in a pickle or a file: the copy interpolates, to rounding where the function is smooth.
        function: that function, where it is known.
        waveform: what averages are derived from; made from the formulas if not given.

    Raises:
        ExpressionError: a text outside the grammar, with the column.
        PeriodError: incommensurate frequencies, or a T that is no common period (a common one is offered).
        InputError: no component, an undeclared symbol.
    """

    components: Sequence[Any] = Deferred()  # type: ignore[assignment]
    period: Any = Deferred(None)
    parameters: Sequence[str] = ()
    breakpoints: Sequence[float] = ()
    pieces: Pieces = field(default=(), repr=False)
    table: tuple[Array, ...] = field(default=(), repr=False)
    function: Any = field(default=None, repr=False, compare=False, metadata={"derived": True})

    def __init__(
        self,
        components: Sequence[Any],
        period: Any = None,
        parameters: Sequence[str] = (),
        breakpoints: Sequence[float] = (),
        waveform: Waveform | None = None,
        pieces: Pieces = (),
        table: tuple[Array, ...] = (),
        function: Any = None,
    ) -> None:
        given: Any = components
        if given is None or isinstance(given, str) or _is_expression(given):
            raise InputError(f"PeriodicInput: give a list of formulas, one a component, not {given!r}")
        settle(
            self,
            components=given if isinstance(given, _Seen) else tuple(given),
            period=period,
            parameters=(parameters,) if isinstance(parameters, str) else tuple(parameters),
            breakpoints=tuple(sorted(float(b) for b in breakpoints)),
            pieces=pieces,
            table=table,
            function=function,
            _given=period,
        )
        if waveform is not None:
            settle(self, waveform=waveform, _numbers=numbers_of(waveform, tuple(self.breakpoints)))
        if isinstance(given, _Seen):
            settle(self, _numbers=given.numbers, _derive=given.waveform)
            return
        _ = self._numbers  # refuses what is no input
        settle(self, period=Later(lambda: self.waveform.period))

    @cached_property
    def _numbers(self) -> InputNumbers:
        """What it is in doubles; known from before where it is given by texts and numbers."""
        formulas = not (self.pieces or self.table)
        given = (self.components, self._given_period, self.parameters, self.breakpoints)
        source = source_of("formulas", *given) if formulas else None

        def made() -> InputNumbers:
            return numbers_of(self.waveform, tuple(self.breakpoints))

        return made() if source is None else recalled_numbers(source, made)

    @cached_property
    def waveform(self) -> Waveform:
        """What averages are derived from: exact trigonometric polynomials, pieces of such, or values."""
        if "_derive" in vars(self):
            return cast(Waveform, vars(self)["_derive"]())
        if self.pieces:
            symbols = {name: symbol_of(name) for name in self.parameters}
            ends = [number_of(end, "the end of a piece", {}) for end, _ in self.pieces]
            formulas = [[formula_of(entry, symbols) for entry in row] for _, row in self.pieces]
            return piecewise_waveform(ends, formulas, time_symbol(), tuple(symbols.values()))
        if self.table:
            panels, values = Panels(self.table[0]), self.table[1]
            function = self.function or Interpolated(panels, values)
            return SampledWaveform(panels, values, function, period_of(self._given_period, {}))
        return formula_waveform(self.components, self._given_period, self.parameters, self.breakpoints)

    @property
    def _given_period(self) -> Any:
        return vars(self)["_given"]

    def __reduce__(self) -> tuple[Any, ...]:
        period = self.period if isinstance(self._given_period, Later) else self._given_period
        given = (self.components, period, self.parameters, self.breakpoints)
        return PeriodicInput, (*given, None, self.pieces, self.table)

    def as_formula(self, start: float, end: float) -> FormulaInput | None:
        """u on [start, end] as a compiled loop evaluates it; None where it is neither a Fourier series nor straight pieces."""
        if self._numbers.series is not None:
            return self._numbers.series
        return None if self._numbers.lines is None else lines_between(self._numbers.lines, self.T, start, end)

    @staticmethod
    def from_fourier(
        cosines: ArrayLike = (), sines: ArrayLike = (), *, mean: ArrayLike | None = None, period: Any = "2*pi"
    ) -> PeriodicInput:
        """u(t) = mean + sum_k cosines[k-1] cos(2 pi k t / T) + sines[k-1] sin(2 pi k t / T).

        Args:
            cosines, sines: (K, n) coefficients: numbers, texts or SymPy numbers; floats at their exact binary value.
            mean: (n,).
            period: T.

        Raises:
            ShapeError: if the three do not agree in n.
            NotFiniteError: NaN or infinity.
        """

        @cache
        def exact() -> PeriodicInput:
            return PeriodicInput(fourier_formulas(cosines, sines, mean, period), period)

        return _seen(source_of("fourier", cosines, sines, mean, period), exact)

    @staticmethod
    def from_callable(
        function: Callable[[Array], ArrayLike], period: Any, *, breakpoints: Sequence[float] = ()
    ) -> PeriodicInput:
        """A vectorised function on [0, T): (k,) -> (k, n), continued periodically; moments by quadrature.

        Raises:
            ShapeError: if the function does not return (k, n).
            NotFiniteError: if it is NaN or infinite somewhere.
        """
        exact = period_of(period, {})
        length = float(exact)
        probe = np.asarray(function(np.linspace(0, length, 3, endpoint=False)), dtype=float)
        if probe.ndim != 2 or probe.shape[0] != 3:
            raise ShapeError(f"PeriodicInput.from_callable: 3 times gave shape {probe.shape}; they must give (3, n)")

        def doubles(t: Array) -> Array:
            return np.asarray(function(t), dtype=float)

        panels, values = resolve(doubles, length, breakpoints)
        names = ("a function",) * probe.shape[1]
        return PeriodicInput(names, exact, (), tuple(breakpoints), table=(panels.edges, values), function=doubles)

    @staticmethod
    def from_samples(values: ArrayLike, period: Any) -> PeriodicInput:
        """The trigonometric polynomial through (N, n) samples at t = 0, T/N, .., (N-1) T/N (N odd or even).

        Raises:
            ShapeError, NotFiniteError: naming `values`.
        """
        mean, cosines, sines = series_through(values)
        return PeriodicInput.from_fourier(cosines, sines, mean=mean, period=period)

    @staticmethod
    def from_pieces(pieces: Sequence[tuple[Any, Sequence[Any]]], *, parameters: Sequence[str] = ()) -> PeriodicInput:
        """Formulas valid on successive intervals: [(t_1, formulas on [0, t_1)), .., (T, formulas on [t_{m-1}, T))].

        Each formula is in the time t of the whole period. Polynomials in t with sines and cosines of commensurate rates
        stay exact, such as (62)-(63) of TR 93-59; others are taken by their values.

        Raises:
            InputError: if the ends do not increase from 0, or a formula is not understood.
            ShapeError: if the pieces differ in the number of components.
        """
        given = tuple((end, tuple(entries)) for end, entries in pieces)

        @cache
        def exact() -> PeriodicInput:
            return _in_pieces(given, parameters)

        return _seen(source_of("pieces", given, parameters), exact, given)

    @property
    def _named(self) -> dict[str, sp.Symbol]:
        return {name: symbol_of(name) for name in self.parameters}

    @property
    def dim(self) -> int:
        """n, the number of components."""
        return self._numbers.dim

    @property
    def exact(self) -> bool:
        """Whether its averages are exact: sums of sines and cosines, or pieces of polynomials with them."""
        return self._numbers.exact

    @cached_property
    def T(self) -> float:
        """The period as a double."""
        return float(self.period) if self._numbers.T is None else self._numbers.T

    @property
    def symbols(self) -> tuple[sp.Symbol, ...]:
        """The parameters that occur, as SymPy symbols."""
        return self.waveform.parameters

    @cached_property
    def exact_mean(self) -> sp.ImmutableMatrix:
        """(n, 1) u_av = (1/T) int_0^T u."""
        calculus, u = self.waveform.calculus({}, self.dim)
        return self.waveform.expressions(calculus, calculus.mean(u), self.dim, time_symbol())

    @property
    def mean(self) -> Array:
        """(n,) u_av in doubles."""
        known = self._numbers.mean
        return np.array(known if known is not None else [float(value) for value in self.exact_mean])

    @property
    def zero_mean(self) -> bool:
        """Whether u_av = 0 identically."""
        return self._numbers.zero_mean

    @cached_property
    def jumps(self) -> tuple[float, ...]:
        """Times in [0, T) at which u is given to jump or bend: the breakpoints, and 0 if u(T-) differs from u(0)."""
        start, end = (
            self._evaluate(np.array([0.0, self.T * (1 - 1e-12)]))
            if not (self.parameters and self.symbols)
            else (0.0, 0.0)
        )
        scale = max(1.0, float(np.max(np.abs(start), initial=0.0)))
        around = float(np.max(np.abs(np.asarray(end) - start), initial=0.0)) > 1e-6 * scale
        return (*((0.0,) if around else ()), *self.breakpoints)

    @cached_property
    def expressions(self) -> sp.ImmutableMatrix:
        """(n, 1) the normal form: sums of sines and cosines of multiples of 2 pi t / T.

        Raises:
            InputError: for a sampled input.
        """
        calculus, u = self.waveform.calculus({}, self.dim)
        return self.waveform.expressions(calculus, u, self.dim, time_symbol())

    def __call__(self, t: ArrayLike) -> Array:
        """u(t): scalar t -> (n,), (...,) -> (..., n)."""
        return self._evaluate(np.asarray(t, dtype=float))

    def integral(self, t: ArrayLike) -> Array:
        """ut(t) = int_0^t u, any t: (...,) -> (..., n)."""
        return self._integrate(np.asarray(t, dtype=float))

    def breakpoints_between(self, start: float, end: float) -> Array:
        """The times in [start, end] at which the input may jump: its breakpoints and whole periods, repeated."""
        if not self.breakpoints:
            return np.empty(0)
        periods = np.arange(np.floor(start / self.T), np.ceil(end / self.T) + 1)
        times = np.sort((periods[:, None] * self.T + np.array([0.0, *self.breakpoints])).ravel())
        return np.asarray(times[(times >= start) & (times <= end)])

    def at(self, **values: Any) -> PeriodicInput:
        """The input with numbers (floats at their exact binary value) in place of parameters.

        Raises:
            InputError: for a name that is not a parameter.
        """
        for name in values:
            if name not in self.parameters:
                raise InputError(
                    f"PeriodicInput.at: {name!r} is not a parameter; they are {', '.join(self.parameters)}"
                )
        if not values:
            return self
        numbers = {symbol_of(name): exact_value(value) for name, value in values.items()}
        left = tuple(name for name in self.parameters if name not in values)
        if not isinstance(self.waveform, TrigWaveform):
            raise InputError("PeriodicInput.at: put the numbers into the formulas of an input in pieces")
        components = tuple(formula_of(each, self._named).subs(numbers) for each in self.components)
        period = period_of(self.period, self._named).subs(numbers)
        return PeriodicInput(components, period, left, self.breakpoints)

    def linear(self, matrix: Any) -> PeriodicInput:
        """C u for a constant (m, n) matrix (exact entries, or floats at their exact binary value).

        Raises:
            ShapeError: if the matrix has not n columns.
        """
        exact = sp.ImmutableMatrix([[exact_value(value) for value in row] for row in rows_of(matrix)])
        if exact.cols != self.dim:
            raise ShapeError(
                f"PeriodicInput.linear: the matrix has {exact.cols} columns, the input {self.dim} components"
            )
        if isinstance(self.waveform, TrigWaveform):
            components = tuple(exact * sp.Matrix([formula_of(each, self._named) for each in self.components]))
            return PeriodicInput(components, self.period, self.parameters, self.breakpoints)
        numeric = np.array(exact.tolist(), dtype=float)
        return PeriodicInput.from_callable(lambda t: self(t) @ numeric.T, self.period, breakpoints=self.breakpoints)

    @cached_property
    def _evaluate(self) -> Callable[[Array], Array]:
        if self._numbers.values is not None:
            return self._numbers.values
        waveform = self.waveform
        if isinstance(waveform, SampledWaveform):
            length, dim = waveform.panels.period, self.dim
            return lambda t: waveform.function(np.mod(t, length).ravel()).reshape(*t.shape, dim)
        calculus, u = waveform.calculus({}, self.dim)
        return waveform.evaluator(calculus, u, self.dim)

    @cached_property
    def _integrate(self) -> Callable[[Array], Array]:
        calculus, u = self.waveform.calculus({}, self.dim)
        constant = calculus.mean(u)
        wave = calculus.primitive(calculus.combine([(1, u), (-1, constant)]))
        periodic = self.waveform.evaluator(calculus, wave, self.dim)
        drift, omega = self.mean, float(self.waveform.omega)
        return lambda t: periodic(t) / omega + t[..., None] * drift


@dataclass(frozen=True, eq=False)
class _Seen(Later):
    """The formulas of an input whose numbers are known from before."""

    waveform: Callable[[], Waveform]
    numbers: InputNumbers


def _seen(source: Any, exact: Callable[[], PeriodicInput], pieces: Pieces = ()) -> PeriodicInput:
    """The input that `exact` makes, once; where its source is plain data that was seen before, when its formulas are asked for."""
    if source is None:
        return exact()
    numbers = recalled_numbers(source, lambda: exact()._numbers)
    if numbers.values is None:
        return exact()
    return PeriodicInput(
        _Seen(lambda: exact().components, lambda: exact().waveform, numbers),  # type: ignore[arg-type]
        Later(lambda: exact().period),
        breakpoints=numbers.breakpoints,
        pieces=pieces,
    )


def _in_pieces(given: Pieces, parameters: Sequence[str]) -> PeriodicInput:
    """The input of `from_pieces`, derived."""
    symbols = {name: symbol_of(name) for name in parameters}
    ends = [number_of(end, "the end of a piece", {}) for end, _ in given]
    moments = [float(end) for end in ends]
    if not ends or any(b <= a for a, b in zip([0.0, *moments], moments, strict=False)):
        raise InputError(f"PeriodicInput.from_pieces: the ends {moments} must increase from above 0")
    formulas = [[formula_of(entry, symbols) for entry in entries] for _, entries in given]
    if len({len(row) for row in formulas}) != 1:
        raise ShapeError("PeriodicInput.from_pieces: every piece must have the same number of components")
    inside = tuple(moments[:-1])
    names = ("in pieces",) * len(formulas[0])
    try:
        piecewise_waveform(ends, formulas, time_symbol(), tuple(symbols.values()))
        return PeriodicInput(names, ends[-1], tuple(symbols), inside, pieces=given)
    except (NotTrigonometricError, PeriodError):
        free = set().union(*(f.free_symbols for row in formulas for f in row)) - {time_symbol()}
        if free:
            raise InputError(
                f"PeriodicInput.from_pieces: the parameters {', '.join(sorted(map(str, free)))} need pieces that are "
                "polynomials in t with sines and cosines of commensurate rates"
            ) from None
    return PeriodicInput.from_callable(pieces_function(moments, formulas), ends[-1], breakpoints=inside)


def _is_expression(value: Any) -> bool:
    """Whether it is one SymPy expression; without SymPy there is none."""
    return "sympy" in sys.modules and isinstance(value, sp.Expr)
