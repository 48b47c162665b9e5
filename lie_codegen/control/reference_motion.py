"""Reference trajectories as data: formulas of t, waypoints to pass through, or a plan. Velocities are derived, never asked for.

    formulas   X_d(t) = X_0 exp(g_1(t) A_1) ... exp(g_n(t) A_n);  xi_d = M(g)^{-1} g', xi_d' its exact derivative
    waypoints  X_d(t) = X_i exp(hat(p_i(s))),  s = (t - t_i)/(t_{i+1} - t_i), p_i a quintic of the algebra

All are twice continuously differentiable, as Theorem 4.2 asks (Bullo and Murray, CIT-CDS 97-003).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lie_codegen.errors import InputError
from lie_codegen.exact.budget import current_budget
from lie_codegen.exact.expression import FORMULA_FUNCTIONS, parse_expression, time_symbol
from lie_codegen.exact.numbers import exact_number
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernel.definition import doubles, record_factory
from lie_codegen.kernel.saved import Saved
from lie_codegen.on_demand import sympy as sp
from lie_codegen.runtime.records import find_record, source_of, store_record
from lie_codegen.values import Deferred, Later


@dataclass(frozen=True, eq=False, repr=False)
class FormulaReference(Saved):
    """X_d(t) = X_0 exp(g_1(t) A_1) ... exp(g_n(t) A_n).

    Attributes:
        group: the group.
        g: (n) expressions of t, `time_symbol()`.
        start: (d, d) X_0 as doubles; the identity if None.
    """

    group: MatrixGroup
    g: tuple[sp.Expr, ...] = Deferred()  # type: ignore[assignment]
    start: NDArray[Any] | None = None

    @cached_property
    def rates(self) -> tuple[sp.Expr, ...]:
        """(n) g'."""
        return tuple(sp.diff(entry, time_symbol()) for entry in self.g)

    @cached_property
    def accelerations(self) -> tuple[sp.Expr, ...]:
        """(n) g''."""
        return tuple(sp.diff(entry, time_symbol()) for entry in self.rates)


@dataclass(frozen=True, eq=False, repr=False)
class WaypointReference(Saved):
    """Quintic segments of the algebra from waypoint to waypoint; at rest before the first and after the last.

    Attributes:
        group: the group.
        times: (k,) increasing [s].
        elements: (k, d, d) waypoints.
        coefficients: (k - 1, 6, n) of p_i(s) = sum_m c_m s^m.
    """

    group: MatrixGroup
    times: NDArray[Any]
    elements: NDArray[Any]
    coefficients: NDArray[Any]


@dataclass(frozen=True, eq=False, repr=False)
class PlanReference(WaypointReference):
    """A planned manoeuvre on [0, duration]: quintic segments that leave and meet the plan with its velocity and acceleration.

    Attributes:
        group, times, elements, coefficients: as those of `WaypointReference`.
        smoothed: (j, 2) from when to when a jump of the controls is rounded off.
        error: largest difference to an entry of X of the plan, at three places a segment, away from the jumps.
        smoothing_error: the same within the jumps' surroundings, 0.0 where there is none.
    """

    smoothed: NDArray[Any]
    error: float
    smoothing_error: float


Reference = FormulaReference | WaypointReference


@record_factory(start=doubles)
def formula_reference(group: MatrixGroup, coordinates: Sequence[Any], *, start: Any = None) -> FormulaReference:
    """A reference from formulas of t, one for each coordinate of the second kind.

    Args:
        group: the group.
        coordinates: (n,) texts such as "0.3*sin(2*t)", or SymPy expressions of t.
        start: (d, d) element on the left, the identity if not given.

    Raises:
        InputError: not n formulas, a symbol other than t, or abs, whose velocity jumps.
        ExpressionError: a text outside the grammar, with the column.
    """
    if isinstance(coordinates, str) or len(coordinates) != group.dim:
        raise InputError(f"a reference on {group.name} needs {group.dim} formulas, for {', '.join(group.labels)}")

    @cache
    def read() -> tuple[sp.Expr, ...]:
        return tuple(formula_of_time(entry) for entry in coordinates)

    # texts that were found in order before are read when a formula is asked for: its kernel is known by the texts
    source = source_of(list(coordinates), repr(current_budget()))
    if source is None or find_record("reference", source) is None:
        read()
        if source is not None:
            store_record("reference", source, True)
    return FormulaReference(group, Later(read), None if start is None else np.array(start))  # type: ignore[arg-type]


def formula_of_time(entry: Any) -> sp.Expr:
    """A text or an expression of t, twice differentiable.

    Raises:
        InputError: a symbol other than t, or abs. ExpressionError: a text outside the grammar.
    """
    if isinstance(entry, str):
        formula = parse_expression(entry, {"t": time_symbol(), "pi": sp.pi}, FORMULA_FUNCTIONS)
        if formula.has(sp.Abs):
            raise InputError(f"{entry!r} has a kink, where its velocity jumps; a smooth stand-in is sqrt(x^2 + 0.01)")
        return formula
    if isinstance(entry, float):
        return sp.Rational(repr(entry))
    value = entry if isinstance(entry, sp.Expr) else exact_number(entry)
    value = value.subs({symbol: time_symbol() for symbol in value.free_symbols if symbol.name == "t"})
    if value.free_symbols - {time_symbol()}:
        raise InputError(
            f"{entry} holds {', '.join(map(str, value.free_symbols - {time_symbol()}))}; a reference is a formula of t"
        )
    return value
