"""Periodic feedback u(t, g) and its first-order average: Proposition 1 of TR 93-59.

    g' = eps M(g) u(t, g),   gbar' = eps M(gbar) u_av(gbar),   u_av(g) = (1/T) int_0^T u(t, g) dt.     (17), (18)

If gbar* is an exponentially stable equilibrium of the averaged system, then for small eps the true system has one
exponentially stable T-periodic solution within O(eps) of it, and averages stay O(eps) close for all time.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lie_codegen.arrays import Array
from lie_codegen.averaging.order_check import OrderCheck, different_scales, order_report
from lie_codegen.errors import ComputationError, InputError, ShapeError
from lie_codegen.exact.expression import FORMULA_FUNCTIONS, parse_expression, time_symbol
from lie_codegen.exact.numbers import exact_number
from lie_codegen.exact.positive_matrix import real_number
from lie_codegen.flow.feedback_flow import feedback_flow
from lie_codegen.flow.feedback_law import Feedback
from lie_codegen.flow.libraries import integrators
from lie_codegen.groups.catalogue_load import GroupLike, as_group
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.groups.wei_norman.matrix import wei_norman
from lie_codegen.kernel.definition import kernel_factory, record_factory
from lie_codegen.kernel.expressions import expression_body
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.saved import Saved
from lie_codegen.on_demand import sympy as sp
from lie_codegen.shapes import shaped
from lie_codegen.signals.input_formulas import period_of
from lie_codegen.signals.signal_values import expressions_of
from lie_codegen.signals.trig_formula import NotTrigonometricError, trig_form
from lie_codegen.signals.trig_signal import TrigCalculus

_MARGIN = 1e-9


@dataclass(frozen=True, eq=False, repr=False)
class Stability(Saved):
    """What Proposition 1 says about one equilibrium of the averaged system.

    Attributes:
        g: (n,) the equilibrium gbar*.
        jacobian: (n, n) of the averaged rate per unit eps, at gbar*.
        eigenvalues: (n,) of the Jacobian.
        exponentially_stable: whether every real part is negative.
        of_both: whether u(t, gbar*) = 0 for all t, so that gbar* is an equilibrium of the true system too.
        statement: the conclusion in words.
    """

    g: Array
    jacobian: Array
    eigenvalues: NDArray[np.complex128]
    exponentially_stable: bool
    of_both: bool
    statement: str


@dataclass(frozen=True, eq=False, repr=False)
class FeedbackAverage(Saved):
    """The averaged feedback system of (18), exact.

    Attributes:
        group: the group, in whose chart of the second kind the feedback is written.
        g: (n) symbols g1 .. gn.
        u: (n, 1) the feedback u(t, g), as given.
        period: T.
        u_average: (n, 1) u_av(g).
        parameters: symbols beside t and g.
    """

    group: MatrixGroup
    g: tuple[sp.Symbol, ...]
    u: sp.ImmutableMatrix
    period: sp.Expr
    u_average: sp.ImmutableMatrix
    parameters: tuple[sp.Symbol, ...]

    @cached_property
    def rate(self) -> sp.ImmutableMatrix:
        """(n, 1) f(g) = M(g) u_av(g): gbar' = eps f(gbar)."""
        exact = wei_norman(self.group)
        return sp.ImmutableMatrix(exact.M.subs(dict(zip(exact.g, self.g, strict=True))) * self.u_average)

    @cached_property
    def jacobian(self) -> sp.ImmutableMatrix:
        """(n, n) df/dg."""
        return sp.ImmutableMatrix(self.rate.jacobian(sp.Matrix(self.g)))

    @property
    def kernel(self) -> Kernel:
        """(g, parameters) -> g_dot per unit eps, as a kernel named averaged_feedback."""
        return averaged_feedback_kernel(self)

    def linearise(self, g: ArrayLike, **values: Any) -> Stability:
        """Stability of the equilibrium g of the averaged system, at numeric parameters, by Lyapunov's indirect method.

        Raises:
            InputError: if g is not an equilibrium of the averaged system, or a parameter has no value.
        """
        point = shaped(g, (self.group.dim,), "linearise: g")
        numbers = self._numbers(values)
        residual = self._rate_at(numbers)(point)
        if np.max(np.abs(residual)) > 1e-8:
            raise InputError(
                f"linearise: {point.tolist()} is not an equilibrium: the averaged rate there is {residual.tolist()}"
            )
        at = {**numbers, **dict(zip(self.g, map(sp.Float, point), strict=True))}
        jacobian = np.array(self.jacobian.subs(at).tolist(), dtype=float)
        eigenvalues = np.linalg.eigvals(jacobian).astype(complex)
        stable = bool(np.max(eigenvalues.real) < -_MARGIN)
        both = self._vanishes_at(point, numbers)
        return Stability(point, jacobian, eigenvalues, stable, both, _statement(stable, both, eigenvalues))

    def order_check(
        self,
        g0: ArrayLike,
        *,
        eps: Sequence[float] = (0.2, 0.1, 0.05, 0.025),
        horizon: float = 2.5,
        **values: Any,
    ) -> OrderCheck:
        """The error sup |g - gbar| over [0, horizon/eps] from the same start, for each eps, and the order that it shows: 1.

        Both systems are integrated as `lc.simulate` does a feedback of g; |.| is the largest component.

        Args:
            g0: (n,) g(0) = gbar(0).
            eps: two or more positive values, sorted here to decrease.
            horizon: b.
            **values: numbers of the parameters, by name.

        Raises:
            InputError: bad eps or horizon, or a parameter without a value. ChartError: a solution leaves the chart.
        """
        numbers = self._numbers(values)
        start = shaped(g0, (self.group.dim,), "order_check: g0")
        given = {str(name): float(value) for name, value in numbers.items()}
        period = float(self.period.subs(numbers))
        chosen = different_scales("order_check", period, eps, horizon)
        X0 = np.asarray(integrators(self.group).product_exp(start))
        laws = [Feedback(feedback_kernel(self, given, averaged), "g") for averaged in (False, True)]
        sup, whole = [], []
        for value in chosen:
            # Forty times a period show the ripple within it; whole periods are among them.
            times = np.arange(max(2, round(40 * horizon / value / period) + 1)) * (period / 40)
            paths = [
                feedback_flow(self.group, law, times, np.array(value), X0, rtol=1e-11, chart=start).g for law in laws
            ]
            error = np.max(np.abs(paths[0] - paths[1]), axis=1)
            sup.append(float(np.max(error)))
            whole.append(float(np.max(error[::40])))
        return order_report(self.group.name, "feedback", 1, "coordinates", horizon, chosen, sup, whole)

    def equilibrium(self, guess: ArrayLike, **values: Any) -> Array:
        """(n,) an equilibrium of the averaged system near a guess, by Newton's method.

        Raises:
            ComputationError: if none is found.
        """
        numbers = self._numbers(values)
        rate = self._rate_at(numbers)
        slope = sp.lambdify([self.g], self.jacobian.subs(numbers).tolist(), "numpy")
        g = np.asarray(guess, dtype=float)
        for _ in range(60):
            value = rate(g)
            step = np.linalg.lstsq(np.array(slope(g), dtype=float), -value, rcond=None)[0]
            size = float(np.linalg.norm(step))
            g = g + step * min(1.0, 0.5 / size if size > 0 else 1.0)
            if size < 1e-13:
                break
        if not np.all(np.isfinite(g)) or np.max(np.abs(rate(g))) > 1e-9:
            raise ComputationError(f"equilibrium: Newton's method found none near {np.asarray(guess).tolist()}")
        return g

    def _numbers(self, values: Mapping[str, Any]) -> dict[sp.Symbol, sp.Expr]:
        missing = [str(s) for s in self.parameters if str(s) not in values]
        if missing:
            raise InputError(f"the parameters {', '.join(missing)} have no values; give them by name")
        return {s: sp.Float(float(values[str(s)])) for s in self.parameters}

    def _rate_at(self, numbers: Mapping[sp.Symbol, sp.Expr]) -> Any:
        function = sp.lambdify([self.g], list(self.rate.subs(numbers)), "numpy")
        return lambda g: np.array(function(g), dtype=float)

    def _vanishes_at(self, g: Array, numbers: Mapping[sp.Symbol, sp.Expr]) -> bool:
        at = {**numbers, **dict(zip(self.g, map(sp.Float, g), strict=True))}
        length = float(self.period.subs(numbers))
        function = sp.lambdify([time_symbol()], list(self.u.subs(at)), "numpy")
        return all(np.max(np.abs(np.array(function(t), dtype=float))) < 1e-9 for t in np.linspace(0, length, 37))


@kernel_factory()
def averaged_feedback_kernel(average: FeedbackAverage, name: str = "averaged_feedback") -> Kernel:
    """(g, parameters) -> g_dot per unit eps."""
    group, n = average.group, average.group.dim
    inputs = [Port("g", (n,), ", ".join(group.units) if any(group.units) else "")]
    inputs += [Port(str(symbol), (), description="parameter of the feedback") for symbol in average.parameters]
    body = expression_body([average.g, *average.parameters], [list(average.rate)])
    formula = "g' / eps = M(g) (1/T) int_0^T u(t, g) dt"
    return Kernel(name, group.name, tuple(inputs), (Port("g_dot", (n,)),), body, formula, "TR 93-59, (18)")


@kernel_factory()
def feedback_kernel(
    average: FeedbackAverage, values: Mapping[str, Any], averaged: bool, name: str = "feedback"
) -> Kernel:
    """(t, g) -> u(t, g), or its mean, with numbers for the parameters."""
    numbers = {symbol: real_number(values[str(symbol)], str(symbol)) for symbol in average.parameters}
    formulas = (average.u_average if averaged else average.u).subs(numbers)
    n = average.group.dim
    ports = (Port("t", (), "s"), Port("g", (n,)))
    body = expression_body([time_symbol(), average.g], [list(formulas)])
    return Kernel(name, average.group.name, ports, (Port("u", (n,)),), body, "u(t, g)", "TR 93-59, (17), (18)")


@record_factory(group=as_group)
def feedback_average(
    group: GroupLike, u: Sequence[Any], *, period: Any = "2*pi", parameters: Sequence[str] = ()
) -> FeedbackAverage:
    """Average the feedback u(t, g), n formulas in t, g1 .. gn and the parameters.

    Args:
        group: object, catalogue name or file; g are its Wei-Norman coordinates.
        u: n texts or SymPy expressions, sums of sines and cosines in t with coefficients in g.
        period: T, a number or a formula of the parameters. [time unit]
        parameters: names that stay symbols.

    Raises:
        ExpressionError: a formula outside the grammar, with the column.
        PeriodError: frequencies in t without that period.
        InputError: a formula that is no sum of sines and cosines in t with coefficients in g.
        ShapeError: if there are not n formulas.
    """
    group = as_group(group, "feedback_average")
    if isinstance(u, str) or len(u) != group.dim:
        raise ShapeError(f"feedback_average: give {group.dim} formulas, one for each of {', '.join(group.labels)}")
    g = sp.symbols(f"g1:{group.dim + 1}", real=True)
    extra = {name: sp.Symbol(name, real=True) for name in parameters}
    names = {"t": time_symbol(), "pi": sp.pi, **{str(s): s for s in g}, **extra}
    formulas = [_formula(entry, names) for entry in u]
    length = period_of(period, extra)
    try:
        form = trig_form(formulas, time_symbol(), length, "feedback_average")
    except NotTrigonometricError as error:
        raise InputError(
            f"feedback_average: {error} is not a sum of sines and cosines in t with coefficients in g"
        ) from None
    calculus = TrigCalculus({}, form.ring)
    mean = expressions_of(calculus.mean(form.signal), group.dim, form.ring, time_symbol(), form.units)
    return FeedbackAverage(group, tuple(g), sp.ImmutableMatrix(formulas), length, mean, tuple(extra.values()))


def _formula(entry: Any, names: Mapping[str, sp.Expr]) -> sp.Expr:
    if isinstance(entry, str):
        return parse_expression(entry, names, FORMULA_FUNCTIONS)
    if isinstance(entry, sp.Expr):
        unknown = [str(s) for s in entry.free_symbols if str(s) not in names]
        if unknown:
            raise InputError(
                f"feedback_average: {', '.join(unknown)} in {entry} is not declared; name it in `parameters`"
            )
        return entry.xreplace({s: names[str(s)] for s in entry.free_symbols})
    return exact_number(entry)


def _statement(stable: bool, both: bool, eigenvalues: NDArray[np.complex128]) -> str:
    top = float(np.max(eigenvalues.real))
    if not stable:
        return f"no conclusion from Proposition 1: the largest real part is {top:.3g}, not negative"
    solution = (
        "the equilibrium itself, which u leaves at rest"
        if both
        else "one exponentially stable periodic solution within O(eps)"
    )
    return (
        f"exponentially stable for the averaged system (largest real part {top:.3g} per unit eps), so for small eps the true "
        f"system has {solution}, exponentially stable, and averages stay O(eps) close for all t >= 0 (Proposition 1)"
    )
