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
from lie_codegen.errors import InputError, ShapeError
from lie_codegen.exact.expression import time_symbol
from lie_codegen.kernel.saved import Saved
from lie_codegen.on_demand import sympy as sp
from lie_codegen.runtime.formula_input import FormulaInput
from lie_codegen.runtime.records import source_of
from lie_codegen.signals.formula_tables import lines_between
from lie_codegen.signals.input_formulas import (
    exact_value,
    formula_waveform,
    formulas_of,
    fourier_formulas,
    period_of,
    pieces_function,
    rows_of,
    series_through,
    substituted,
)
from lie_codegen.signals.input_numbers import InputNumbers, KnownInput, numbers_of, recalled_numbers
from lie_codegen.signals.input_pieces import Pieces, are_exact, pieces_waveform, read_pieces
from lie_codegen.signals.input_waveform import integral_of, table_waveform, values_of
from lie_codegen.signals.sampled_signal import resolve
from lie_codegen.signals.waveform import TrigWaveform, Waveform
from lie_codegen.values import Deferred, Later, settle

__all__ = ["PeriodicInput"]


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
            components=given if isinstance(given, KnownInput) else tuple(given),
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
        if isinstance(given, KnownInput):
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
            return pieces_waveform(self.pieces, self.parameters)
        if self.table:
            return table_waveform(self.table, self._given_period, self.function)
        return formula_waveform(self.components, self._given_period, self.parameters, self.breakpoints)

    @property
    def _given_period(self) -> Any:
        return vars(self)["_given"]

    def __reduce__(self) -> tuple[Any, ...]:
        period = self.period if isinstance(self._given_period, Later) else self._given_period
        given = (self.components, period, self.parameters, self.breakpoints)
        return PeriodicInput, (*given, None, self.pieces, self.table)

    def as_formula(self, start: float, end: float) -> FormulaInput | None:
        """u as a compiled loop evaluates it; None where it is neither a Fourier series nor straight pieces.

        Args:
            start, end: the interval of time on which it has to serve.
        """
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
        """A vectorised function on [0, T), continued periodically; moments by quadrature.

        Args:
            function: (k,) times -> (k, n).
            period: T, a number or a text such as "2*pi".
            breakpoints: times in [0, T) at which it is not smooth.

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
        """The trigonometric polynomial through samples at t = 0, T/N, .., (N-1) T/N (N odd or even).

        Args:
            values: (N, n).
            period: T, a number or a text such as "2*pi".

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

        Args:
            pieces: (end of the interval, n formulas) in the order of time.
            parameters: names that stay symbols.

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
        """ut(t) = int_0^t u: (..., n), any t.

        Args:
            t: (...) times.

        Raises:
            ArgumentError: t is no number.
        """
        return self._integrate(np.asarray(t, dtype=float))

    def breakpoints_between(self, start: float, end: float) -> Array:
        """The times at which the input may jump: its breakpoints and whole periods, repeated.

        Args:
            start, end: the interval, its ends included.
        """
        if not self.breakpoints:
            return np.empty(0)
        periods = np.arange(np.floor(start / self.T), np.ceil(end / self.T) + 1)
        times = np.sort((periods[:, None] * self.T + np.array([0.0, *self.breakpoints])).ravel())
        return np.asarray(times[(times >= start) & (times <= end)])

    def at(self, **values: Any) -> PeriodicInput:
        """The input with numbers (floats at their exact binary value) in place of parameters.

        Args:
            values: name -> number, as keywords; the others stay parameters.

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
        if not isinstance(self.waveform, TrigWaveform):
            raise InputError("PeriodicInput.at: put the numbers into the formulas of an input in pieces")
        left = tuple(name for name in self.parameters if name not in values)
        components, period = substituted(self.components, self.period, self.parameters, values)
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
            components = tuple(exact * sp.Matrix(formulas_of(self.components, self.parameters)))
            return PeriodicInput(components, self.period, self.parameters, self.breakpoints)
        numeric = np.array(exact.tolist(), dtype=float)
        return PeriodicInput.from_callable(lambda t: self(t) @ numeric.T, self.period, breakpoints=self.breakpoints)

    @cached_property
    def _evaluate(self) -> Callable[[Array], Array]:
        known = self._numbers.values
        return values_of(self.waveform, self.dim) if known is None else known

    @cached_property
    def _integrate(self) -> Callable[[Array], Array]:
        return integral_of(self.waveform, self.dim, self.mean)


def _seen(source: Any, exact: Callable[[], PeriodicInput], pieces: Pieces = ()) -> PeriodicInput:
    """The input that `exact` makes, once; where its source is plain data that was seen before, when its formulas are asked for."""
    if source is None:
        return exact()
    numbers = recalled_numbers(source, lambda: exact()._numbers)
    if numbers.values is None:
        return exact()
    return PeriodicInput(
        KnownInput(lambda: exact().components, lambda: exact().waveform, numbers),  # type: ignore[arg-type]
        Later(lambda: exact().period),
        breakpoints=numbers.breakpoints,
        pieces=pieces,
    )


def _in_pieces(given: Pieces, parameters: Sequence[str]) -> PeriodicInput:
    """The input of `from_pieces`, derived."""
    ends, formulas, symbols = read_pieces(given, parameters)
    moments = [float(end) for end in ends]
    inside = tuple(moments[:-1])
    if are_exact(ends, formulas, symbols):
        names = ("in pieces",) * len(formulas[0])
        return PeriodicInput(names, ends[-1], tuple(parameters), inside, pieces=given)
    return PeriodicInput.from_callable(pieces_function(moments, formulas), ends[-1], breakpoints=inside)


def _is_expression(value: Any) -> bool:
    """Whether it is one SymPy expression; without SymPy there is none."""
    return "sympy" in sys.modules and isinstance(value, sp.Expr)
