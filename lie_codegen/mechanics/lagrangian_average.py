"""Averages of Lagrangian systems of three coordinates and more, or of order three and more: brackets by dual numbers."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from lie_codegen.errors import InputError
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.definition import kernel_factory
from lie_codegen.kernel.expressions import ExpressionEvaluator
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.linear import Vector, plus, scaled
from lie_codegen.kernel.runge_kutta import CLASSICAL, increment, vectors
from lie_codegen.kernel.saved import Saved
from lie_codegen.mechanics.bracket_series import BracketSeries, bracket_series, check_series
from lie_codegen.mechanics.lagrangian import LagrangianSystem
from lie_codegen.mechanics.lagrangian_fields import Dynamics, Fields
from lie_codegen.mechanics.vibrational_fields import VibrationalFields, fast_time, vibrational_fields
from lie_codegen.mechanics.vibrational_kernels import SOURCE
from lie_codegen.on_demand import sympy as sp
from lie_codegen.signals.periodic_input import PeriodicInput
from lie_codegen.signals.time_polynomial import fourier_terms


@dataclass(frozen=True, eq=False, repr=False)
class LagrangianSeries(Saved):
    """What the average of a Lagrangian system is made of: the series of the input and the formulas of the system.

    Attributes:
        system: reduced, where it was reduced.
        u: of zero mean but for `mean_to_drift`.
        order, gauge: of the average.
        mean_to_drift: the mean of u acts as a constant force.
    """

    system: LagrangianSystem
    u: PeriodicInput
    order: int
    gauge: str
    mean_to_drift: bool

    def __post_init__(self) -> None:
        check_series(self.order, self.gauge)
        if len(self.system.inputs) != self.u.dim:
            raise InputError(f"the input has {self.u.dim} components, the system {len(self.system.inputs)} inputs")
        if not self.mean_to_drift and any(mean != 0 for mean in self.means):
            raise InputError(
                f"the input has the mean {list(self.means)}: divided by eps it is a static force that averaging does not cover; subtract it, or give "
                "mean_to_drift=True to apply it as a constant force (not divided by eps) in the drift"
            )
        self.dynamics  # noqa: B018  (its formulas are checked)

    @cached_property
    def means(self) -> tuple[sp.Expr, ...]:
        """Of the components of u."""
        return tuple(wave.mean() for wave in fourier_terms(self.u))

    @cached_property
    def dynamics(self) -> Dynamics:
        """The formulas."""
        return Dynamics(self.system, self.means if self.mean_to_drift else [sp.S.Zero] * self.u.dim)

    @cached_property
    def series(self) -> BracketSeries:
        """Coefficients of brackets."""
        return bracket_series(tuple(wave.without_mean() for wave in fourier_terms(self.u)), self.order, self.gauge)

    def exact(self) -> VibrationalFields:
        """The symbolic fields, of order 1 or 2; of three coordinates they take minutes."""
        return vibrational_fields(
            self.system, self.u, order=self.order, gauge=self.gauge, mean_to_drift=self.mean_to_drift
        )

    @property
    def parameters(self) -> tuple[sp.Symbol, ...]:
        """Symbols that stayed arguments."""
        return tuple(dict.fromkeys((*self.system.parameter_symbols, *self.u.symbols)))

    @property
    def state(self) -> tuple[sp.Symbol, ...]:
        """(q, v)."""
        return self.system.state

    @property
    def period(self) -> sp.Expr:
        """T, in fast time."""
        return self.series.inputs[0].period


@kernel_factory()
def series_kernels(fields: LagrangianSeries, namespace: str) -> tuple[Kernel, ...]:
    """rate, actual, estimate, estimate_first, reconstruct and one kernel a term, as those of `vibrational_kernels`."""
    n, series = len(fields.state), fields.series
    eps, tau = (
        Port("eps", (), "1", description="ratio of the fast to the slow time scale"),
        Port("tau", (), "1", description="fast time t / eps"),
    )
    z, y = Port("z", (n,), description="averaged state (q, v)"), Port("y", (n,), description="actual state (q, v)")
    own = tuple(Port(str(p), ()) for p in fields.parameters)

    def kernel(name: str, inputs: tuple[Port, ...], output: str, make: Any, text: str) -> Kernel:
        def body(ops: Arithmetic, *arguments: Any) -> tuple[Any, ...]:
            given = dict(zip(fields.parameters, arguments[len(inputs) :], strict=True))
            return (make(ops, given, *arguments[: len(inputs)]),)

        return Kernel(name, namespace, (*inputs, *own), (Port(output, (n,)),), body, text, SOURCE)

    def at(ops: Arithmetic, given: Mapping[sp.Symbol, Scalar], state: Vector) -> Fields:
        return fields.dynamics.point(ops, state, given)

    def term(q: int) -> Any:
        def make(ops: Arithmetic, given: Any, state: Vector) -> Vector:
            evaluate = ExpressionEvaluator(ops, dict(given))
            return at(ops, given, state).sum({w: evaluate(c) for w, c in series.rates[q - 1].items()})

        return make

    def rate(ops: Arithmetic, given: Any, state: Vector, small: Scalar) -> Vector:
        evaluate, point = ExpressionEvaluator(ops, dict(given)), at(ops, given, state)
        total: Vector = [0] * n
        # Horner's rule in eps: Z_1 + eps (Z_2 + eps (Z_3 + ...)).
        for terms in reversed(series.rates):
            total = plus(scaled(small, total), point.sum({w: evaluate(c) for w, c in terms.items()}))
        return total

    def actual(ops: Arithmetic, given: Any, state: Vector, fast: Scalar, small: Scalar) -> Vector:
        evaluate, point = ExpressionEvaluator(ops, {**given, fast_time(): fast}), at(ops, given, state)
        total = point.word(0)
        for a, u in enumerate(series.inputs):
            total = plus(total, scaled(evaluate(u.expression(fast_time())) / small, point.word(("Y", a))))
        return total

    def shifted(ops: Arithmetic, given: Any, state: Vector, fast: Scalar, sign: int) -> Vector:
        evaluate, point, total = (
            ExpressionEvaluator(ops, {**given, fast_time(): fast}),
            at(ops, given, state),
            list(state),
        )
        for a, U in enumerate(series.primitives):
            total = plus(total, scaled(sign * evaluate(U.expression(fast_time())), point.word(("Y", a))))
        return total

    def flown(ops: Arithmetic, given: Any, state: Vector, fast: Scalar, small: Scalar, sign: int) -> Vector:
        """The unit-time flow of sign sum eps^q Lambda_q(tau), frozen: one step of fourth order, of a motion of size eps."""
        if not series.logarithms:
            return list(state)
        evaluate = ExpressionEvaluator(ops, {**given, fast_time(): fast})
        table: dict[Any, Scalar] = {}
        power: Scalar = sign * small
        for terms in series.logarithms:
            for word, wave in terms.items():
                value = power * evaluate(wave.expression(fast_time()))
                table[word] = table[word] + value if word in table else value
            power = power * small

        def slope(_: float, change: Vector) -> Vector:
            return at(ops, given, plus(state, change)).sum(table)

        return plus(state, increment(vectors(ops), CLASSICAL, slope, [0] * n, 1))

    def estimate(ops: Arithmetic, given: Any, state: Vector, fast: Scalar, small: Scalar) -> Vector:
        return flown(ops, given, shifted(ops, given, state, fast, -1), fast, small, -1)

    def estimate_first(ops: Arithmetic, given: Any, state: Vector, fast: Scalar, small: Scalar) -> Vector:
        return [x + 0 * small for x in shifted(ops, given, state, fast, -1)]

    def reconstruct(ops: Arithmetic, given: Any, state: Vector, fast: Scalar, small: Scalar) -> Vector:
        return shifted(ops, given, flown(ops, given, state, fast, small, 1), fast, 1)

    return (
        kernel("rate", (z, eps), "z_dot", rate, "z' = sum eps^(q-1) Z_q(z)"),
        kernel("actual", (y, tau, eps), "y_dot", actual, "y' = X(y) + (1/eps) Y_a u^a(tau)"),
        kernel("estimate", (y, tau, eps), "z", estimate, "z = flow(-Lambda(tau)) Phi^-1(y)"),
        kernel("estimate_first", (y, tau, eps), "z", estimate_first, "z = Phi^-1(y), to first order"),
        kernel("reconstruct", (z, tau, eps), "y", reconstruct, "y = Phi flow(Lambda(tau)) (z)"),
        *(kernel(f"term_{q}", (z,), "Z", term(q), f"Z_{q}(z)") for q in range(1, fields.order + 1)),
    )
