"""ParametricInput: u(t; p) from formulas of the time and of named parameters, with its exact derivatives in them."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.errors import InputError, NotFiniteError, ShapeError
from lie_codegen.exact.expression import FORMULA_FUNCTIONS, parse_expression, time_symbol
from lie_codegen.kernel.saved import Saved
from lie_codegen.on_demand import sympy as sp
from lie_codegen.runtime.formula_input import FormulaInput, fourier_input
from lie_codegen.values import settle


@dataclass(frozen=True)
class Waves:
    """u = sum_f cosines_f cos(w_f t) + sines_f sin(w_f t), all functions of the parameters.

    Attributes:
        count: F.
        evaluate: one value, or an array (N,), a parameter -> F rates, then F n cosines, then F n sines, each a number or (N,).
        evaluate_one: the same of numbers alone, without numpy: a tenth of the time.
    """

    count: int
    evaluate: Callable[..., Sequence[Any]]
    evaluate_one: Callable[..., Sequence[float]]


@dataclass(frozen=True, eq=False, repr=False)
class ParametricInput(Saved):
    """u(t; p), callable: u(t, a=.5, w=1.1) is (n,) for a scalar t and (k, n) for (k,) times.

    Attributes:
        components: n formulas in t, pi and the parameters (functions sin, cos, sqrt, exp, ...).
        parameters: names, in the order of every derivative.
        period: a formula of the parameters, where u(t + period) = u(t); None where it is not periodic.
        breakpoints: times at which u is not smooth.

    Raises:
        ExpressionError: a text outside the grammar, with the column.
        InputError: no component, a name that cannot be one or is there twice.
    """

    components: tuple[str, ...]
    parameters: tuple[str, ...]
    period: str | None = None
    breakpoints: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if isinstance(self.components, str) or not self.components:
            raise InputError("ParametricInput: give a list of formulas, one a component")
        names = (self.parameters,) if isinstance(self.parameters, str) else tuple(self.parameters)
        for name in names:
            if not isinstance(name, str) or not name.isidentifier() or name in ("t", "pi") or name in FORMULA_FUNCTIONS:
                raise InputError(f"ParametricInput: {name!r} cannot name a parameter")
        if len(set(names)) < len(names):
            raise InputError(f"ParametricInput: parameters repeated in {', '.join(names)}")
        settle(
            self,
            components=tuple(str(each) for each in self.components),
            parameters=names,
            breakpoints=tuple(sorted(float(each) for each in self.breakpoints)),
        )
        _ = self._formulas
        if self.period is not None:
            settle(self, period=str(self.period))
            _ = self._period

    @property
    def dim(self) -> int:
        """n."""
        return len(self.components)

    def values(self, given: Mapping[str, Any], *, many: bool = False) -> tuple[Any, ...]:
        """The parameters in their order, as floats.

        Args:
            given: name -> number.
            many: (N,) arrays are taken, too.

        Raises:
            InputError: a parameter that is missing or unknown.
            ShapeError, NotFiniteError: one that is no number.
        """
        return parameter_values(self.parameters, given, many)

    def __call__(self, t: ArrayLike, **given: Any) -> Array:
        """u(t; p): (n,) for a scalar t, (k, n) for (k,) times."""
        times = np.asarray(t, dtype=float)
        flat = np.atleast_1d(times)
        found = self._stacked(self._function(flat, *parameter_values(self.parameters, given)), flat)
        return found if times.ndim else found[0]

    def as_formula(self, start: float, end: float) -> FormulaInput | None:
        """Without parameters, a sum of sines and cosines as compiled loops evaluate it; None otherwise.

        Args:
            start, end: the interval of time; the sum serves any.
        """
        if self.parameters or self.waves is None or self.breakpoints:
            return None
        numbers, F, n = np.array(self.waves.evaluate(), dtype=float), self.waves.count, self.dim
        cosines, sines = numbers[F:].reshape(2, F, n)
        return fourier_input(numbers[:F], cosines, sines)

    def derivatives(self, t: ArrayLike, **given: Any) -> Array:
        """du/dp: (k, m, n) at (k,) times, m parameters in their order.

        Args:
            t: a time or (k,) times.
            given: each parameter by its name, a number.

        Raises:
            InputError: a parameter that is missing or unknown.
            ShapeError, NotFiniteError: one that is no number.
        """
        times = np.atleast_1d(np.asarray(t, dtype=float))
        m = len(self.parameters)
        if not m:
            return np.zeros((len(times), 0, self.dim))
        return self._stacked(self._gradient(times, *parameter_values(self.parameters, given)), times).reshape(
            len(times), m, self.dim
        )

    def period_of(self, values: Sequence[float]) -> tuple[float, Array]:
        """The period and its derivatives (m,).

        Args:
            values: (m,) numbers, of the parameters in their order.

        Raises:
            InputError: there is none, or it is not positive.
        """
        if self.period is None:
            raise InputError("ParametricInput: give period=, a formula of the parameters such as '2*pi/w'")
        found, *slopes = (float(each) for each in self._period(*values))
        if not (np.isfinite(found) and found > 0):
            raise InputError(f"ParametricInput: the period {self.period} is {found:g} there; it must be positive")
        return found, np.array(slopes)

    @cached_property
    def _symbols(self) -> tuple[sp.Symbol, ...]:
        return tuple(sp.Symbol(name, real=True) for name in self.parameters)

    @cached_property
    def _formulas(self) -> tuple[sp.Expr, ...]:
        names = {"t": time_symbol(), "pi": sp.pi, **dict(zip(self.parameters, self._symbols, strict=True))}
        return tuple(parse_expression(text, names, FORMULA_FUNCTIONS) for text in self.components)

    @cached_property
    def _function(self) -> Callable[..., Any]:
        return _compiled((time_symbol(), *self._symbols), self._formulas)

    @cached_property
    def _gradient(self) -> Callable[..., Any]:
        entries = [sp.diff(formula, symbol) for symbol in self._symbols for formula in self._formulas]
        return _compiled((time_symbol(), *self._symbols), entries)

    @cached_property
    def _period(self) -> Callable[..., Any]:
        names = {"pi": sp.pi, **dict(zip(self.parameters, self._symbols, strict=True))}
        formula = parse_expression(str(self.period), names, FORMULA_FUNCTIONS)
        return _compiled(self._symbols, [formula, *(sp.diff(formula, symbol) for symbol in self._symbols)])

    @cached_property
    def waves(self) -> Waves | None:
        """The formulas as sums of sines and cosines of rates that depend on the parameters alone; None where they are not."""
        found: dict[sp.Expr, list[list[sp.Expr]]] = {}
        for place, formula in enumerate(self._formulas):
            terms = _wave_terms(formula)
            if terms is None:
                return None
            for rate, cosine, sine in terms:
                table = found.setdefault(rate, [[sp.S.Zero] * self.dim, [sp.S.Zero] * self.dim])
                table[0][place] += cosine
                table[1][place] += sine
        rates = list(found)
        entries = [
            *rates,
            *(c for rate in rates for c in found[rate][0]),
            *(s for rate in rates for s in found[rate][1]),
        ]
        return Waves(len(rates), _compiled(self._symbols, entries), _compiled(self._symbols, entries, "math"))

    def _stacked(self, entries: Sequence[Any], times: Array) -> Array:
        found = np.empty((*times.shape, len(entries)))
        for k, each in enumerate(entries):
            found[..., k] = each
        return found


def parameter_values(parameters: tuple[str, ...], given: Mapping[str, Any], many: bool = False) -> tuple[Any, ...]:
    """See `ParametricInput.values`; for ours, who need no guard between them."""
    for name in given:
        if name not in parameters:
            import difflib

            near = difflib.get_close_matches(name, parameters, 1)
            hint = f"; did you mean {near[0]}?" if near else ""
            raise InputError(f"no parameter {name!r}; they are {', '.join(parameters) or 'none'}{hint}")
    missing = [name for name in parameters if name not in given]
    if missing:
        raise InputError(f"parameters missing: {', '.join(missing)}")
    return tuple(_number(name, given[name], many) for name in parameters)


def _number(name: str, value: Any, many: bool) -> Any:
    if type(value) is float and math.isfinite(value):
        return value
    try:
        array = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        raise ShapeError(f"the parameter {name} is {value!r:.60}; give a number") from None
    if array.ndim > (1 if many else 0) or (many and array.ndim and not array.size):
        raise ShapeError(
            f"the parameter {name} has shape {array.shape}; give a number{' or (N,) numbers' if many else ''}"
        )
    if not np.all(np.isfinite(array)):
        raise NotFiniteError(f"the parameter {name} is NaN or infinite")
    return array if array.ndim else float(array)


def _compiled(symbols: Sequence[sp.Symbol], entries: Sequence[sp.Expr], module: str = "numpy") -> Callable[..., Any]:
    """The entries, built from the closed grammar alone, as one function of arrays, or of numbers with `math`."""
    function: Callable[..., Any] = sp.lambdify(symbols, list(entries), module, cse=True)
    return function


def _wave_terms(formula: sp.Expr) -> list[tuple[sp.Expr, sp.Expr, sp.Expr]] | None:
    """(rate, cosine, sine) of every term, rates with a positive leading sign; None where a term is no wave."""
    from sympy.simplify.fu import TR8

    terms = []
    for term in sp.Add.make_args(sp.expand(TR8(sp.expand(formula)))):
        if term == 0:
            continue
        factor, wave = term.as_independent(time_symbol(), as_Add=False)
        if wave == 1:
            terms.append((sp.S.Zero, factor, sp.S.Zero))
            continue
        if not isinstance(wave, sp.sin | sp.cos):
            return None
        angle = sp.expand(wave.args[0])
        rate, phase = angle.coeff(time_symbol(), 1), angle.coeff(time_symbol(), 0)
        if sp.expand(angle - rate * time_symbol() - phase) != 0 or rate.has(time_symbol()) or phase.has(time_symbol()):
            return None
        if rate.could_extract_minus_sign():  # cos(-x) = cos x, sin(-x) = -sin x
            rate, phase, factor = -rate, -phase, -factor if isinstance(wave, sp.sin) else factor
        c, s = sp.cos(phase), sp.sin(phase)
        terms.append((rate, factor * c, -factor * s) if isinstance(wave, sp.cos) else (rate, factor * s, factor * c))
    return terms
