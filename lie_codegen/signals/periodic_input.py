"""PeriodicInput: n periodic functions of time, exact where they are trigonometric polynomials."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.errors import InputError, NotFiniteError, PeriodError, ShapeError
from lie_codegen.exact.expression import time_symbol
from lie_codegen.kernel.saved import Saved
from lie_codegen.on_demand import sympy as sp
from lie_codegen.runtime.formula_input import FormulaInput
from lie_codegen.signals.formula_tables import PieceTable, lines_between, piece_table, series_formula
from lie_codegen.signals.input_formulas import (
    coefficients_of,
    exact_value,
    formula_of,
    formula_waveform,
    number_of,
    period_of,
    pieces_function,
    rows_of,
    symbol_of,
)
from lie_codegen.signals.piecewise_waveform import piecewise_waveform
from lie_codegen.signals.sampled_signal import Interpolated, Panels, resolve
from lie_codegen.signals.trig_formula import NotTrigonometricError
from lie_codegen.signals.waveform import SampledWaveform, TrigWaveform, Waveform, linear_image, with_values

__all__ = ["PeriodicInput"]


@dataclass(frozen=True, eq=False, repr=False)
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

    Raises:
        ExpressionError: a text outside the grammar, with the column.
        PeriodError: incommensurate frequencies, or a T that is no common period (a common one is offered).
        InputError: no component, an undeclared symbol.
    """

    components: Sequence[Any]
    period: Any = None
    parameters: Sequence[str] = ()
    breakpoints: Sequence[float] = ()
    waveform: Waveform = field(default=None, repr=False, compare=False, metadata={"derived": True})  # type: ignore[assignment]
    pieces: tuple[tuple[Any, ...], ...] = field(default=(), repr=False)
    table: tuple[Array, ...] = field(default=(), repr=False)

    def __post_init__(self) -> None:
        names = (self.parameters,) if isinstance(self.parameters, str) else tuple(self.parameters)
        object.__setattr__(self, "parameters", names)
        if isinstance(self.components, str | sp.Expr):
            raise InputError(f"PeriodicInput: give a list of formulas, one a component, not {self.components!r}")
        object.__setattr__(self, "components", tuple(self.components))
        if self.waveform is None:
            object.__setattr__(self, "waveform", self._made(names))
        object.__setattr__(self, "period", self.waveform.period)
        inside = tuple(sorted(float(b) for b in self.breakpoints))
        object.__setattr__(self, "breakpoints", inside)

    def _made(self, names: tuple[str, ...]) -> Waveform:
        """The waveform, from pieces, a table or formulas."""
        if self.pieces:
            symbols = tuple(symbol_of(name) for name in names)
            return piecewise_waveform(
                [end for end, _ in self.pieces], [list(row) for _, row in self.pieces], time_symbol(), symbols
            )
        if self.table:
            panels, values = Panels(self.table[0]), self.table[1]
            return SampledWaveform(panels, values, Interpolated(panels, values), period_of(self.period, {}))
        return formula_waveform(self.components, self.period, names, self.breakpoints)

    def __reduce__(self) -> tuple[Any, ...]:
        given = (self.components, self.period, self.parameters, self.breakpoints)
        return PeriodicInput, (*given, None, self.pieces, self.table)

    def as_formula(self, start: float, end: float) -> FormulaInput | None:
        """u on [start, end] as a compiled loop evaluates it; None where it is neither a Fourier series nor straight pieces."""
        if self._series is not None:
            return self._series
        return None if self._pieces is None else lines_between(self._pieces, self.T, start, end)

    @cached_property
    def _series(self) -> FormulaInput | None:
        return series_formula(self.waveform, self.dim)

    @cached_property
    def _pieces(self) -> PieceTable | None:
        return piece_table(self.waveform, self.dim)

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
        c, s = coefficients_of(cosines, "cosines"), coefficients_of(sines, "sines")
        m = coefficients_of([] if mean is None else [mean], "mean")
        widths = {len(row) for table in (c, s, m) for row in table}
        if len(widths) != 1:
            raise ShapeError(
                f"PeriodicInput.from_fourier: the coefficients have {sorted(widths)} components; give one n"
            )
        [n] = widths
        omega = 2 * sp.pi / period_of(period, {})
        zero = [sp.S.Zero] * n
        terms = [list(m[0]) if m else zero]
        terms += [[a * sp.cos((k + 1) * omega * time_symbol()) for a in row] for k, row in enumerate(c)]
        terms += [[b * sp.sin((k + 1) * omega * time_symbol()) for b in row] for k, row in enumerate(s)]
        return PeriodicInput(tuple(sp.Add(*(row[i] for row in terms)) for i in range(n)), period)

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
        panels, values = resolve(lambda t: np.asarray(function(t), dtype=float), length, breakpoints)
        waveform = SampledWaveform(panels, values, lambda t: np.asarray(function(t), dtype=float), exact)
        names = ("a function",) * probe.shape[1]
        return PeriodicInput(names, exact, (), tuple(breakpoints), waveform, table=(panels.edges, values))

    @staticmethod
    def from_samples(values: ArrayLike, period: Any) -> PeriodicInput:
        """The trigonometric polynomial through (N, n) samples at t = 0, T/N, .., (N-1) T/N (N odd or even).

        Raises:
            ShapeError, NotFiniteError: naming `values`.
        """
        samples = np.asarray(values, dtype=float)
        if samples.ndim != 2 or len(samples) < 2:
            raise ShapeError(f"PeriodicInput.from_samples: values has shape {samples.shape}; give (N, n) with N >= 2")
        if not np.all(np.isfinite(samples)):
            raise NotFiniteError("PeriodicInput.from_samples: values holds NaN or infinity")
        spectrum = np.fft.rfft(samples, axis=0) / len(samples)
        top = len(spectrum) - 1
        weights = np.full(top, 2.0)
        if len(samples) % 2 == 0:
            weights[-1] = 1.0
        cosines = weights[:, None] * spectrum[1:].real
        sines = -weights[:, None] * spectrum[1:].imag
        return PeriodicInput.from_fourier(cosines, sines, mean=spectrum[0].real, period=period)

    @staticmethod
    def from_pieces(pieces: Sequence[tuple[Any, Sequence[Any]]], *, parameters: Sequence[str] = ()) -> PeriodicInput:
        """Formulas valid on successive intervals: [(t_1, formulas on [0, t_1)), .., (T, formulas on [t_{m-1}, T))].

        Each formula is in the time t of the whole period. Polynomials in t with sines and cosines of commensurate rates
        stay exact, such as (62)-(63) of TR 93-59; others are taken by their values.

        Raises:
            InputError: if the ends do not increase from 0, or a formula is not understood.
            ShapeError: if the pieces differ in the number of components.
        """
        symbols = {name: symbol_of(name) for name in parameters}
        ends = [number_of(end, "the end of a piece", {}) for end, _ in pieces]
        moments = [float(end) for end in ends]
        if not ends or any(b <= a for a, b in zip([0.0, *moments], moments, strict=False)):
            raise InputError(f"PeriodicInput.from_pieces: the ends {moments} must increase from above 0")
        formulas = [[formula_of(entry, symbols) for entry in entries] for _, entries in pieces]
        if len({len(row) for row in formulas}) != 1:
            raise ShapeError("PeriodicInput.from_pieces: every piece must have the same number of components")
        inside = tuple(moments[:-1])
        names = ("in pieces",) * len(formulas[0])
        try:
            waveform = piecewise_waveform(ends, formulas, time_symbol(), tuple(symbols.values()))
            given = tuple((end, tuple(row)) for end, row in zip(ends, formulas, strict=True))
            return PeriodicInput(names, ends[-1], tuple(symbols), inside, waveform, given)
        except (NotTrigonometricError, PeriodError):
            free = set().union(*(f.free_symbols for row in formulas for f in row)) - {time_symbol()}
            if free:
                raise InputError(
                    f"PeriodicInput.from_pieces: the parameters {', '.join(sorted(map(str, free)))} need pieces that are "
                    "polynomials in t with sines and cosines of commensurate rates"
                ) from None
        return PeriodicInput.from_callable(pieces_function(moments, formulas), ends[-1], breakpoints=inside)

    @property
    def _named(self) -> dict[str, sp.Symbol]:
        return {name: symbol_of(name) for name in self.parameters}

    @property
    def dim(self) -> int:
        """n, the number of components."""
        return self.waveform.dim

    @property
    def exact(self) -> bool:
        """Whether its averages are exact: sums of sines and cosines, or pieces of polynomials with them."""
        return self.waveform.exact

    @cached_property
    def T(self) -> float:
        """The period as a double."""
        return float(self.period)

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
        return np.array([float(value) for value in self.exact_mean])

    @cached_property
    def zero_mean(self) -> bool:
        """Whether u_av = 0 identically."""
        calculus, u = self.waveform.calculus({}, self.dim)
        return self.waveform.vanishes(calculus, calculus.mean(u))

    @cached_property
    def jumps(self) -> tuple[float, ...]:
        """Times in [0, T) at which u is given to jump or bend: the breakpoints, and 0 if u(T-) differs from u(0)."""
        start, end = self._evaluate(np.array([0.0, self.T * (1 - 1e-12)])) if not self.symbols else (0.0, 0.0)
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
        return PeriodicInput(components, period, left, self.breakpoints, with_values(self.waveform, numbers))

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
            form = linear_image(self.waveform.form, exact)
            moved = TrigWaveform(form, self.waveform.order)
            components = tuple(exact * sp.Matrix([formula_of(each, self._named) for each in self.components]))
            return PeriodicInput(components, self.period, self.parameters, self.breakpoints, moved)
        numeric = np.array(exact.tolist(), dtype=float)
        inner = self.waveform
        return PeriodicInput.from_callable(lambda t: self(t) @ numeric.T, inner.period, breakpoints=self.breakpoints)

    @cached_property
    def _evaluate(self) -> Callable[[Array], Array]:
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
