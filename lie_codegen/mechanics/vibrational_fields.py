"""Vibrational averaging of y' = X(y) + (1/eps) Y_a(q) u^a(t / eps), exact vector fields to second order.

With tau = t / eps, U^a a primitive of u^a and y = w + U^a Y_a (exact, since vertical lifts commute),

    dw/dt = X + U^a [Ya, X] - U^a U^b <Ya : Yb> / 2.

Zero-mean gauge (U of zero mean; l_ab = mean U^a U^b, W_a and W_ab zero-mean primitives of U^a and U^a U^b - l_ab):

    Z1 = X - l_ab <Ya : Yb> / 2,
    Z2 = mean(W_a U^b) [[Ya, X], [Yb, X]] / 2 - mean(W_a (U^b U^c - l_bc)) <Ya : <Yb : Yc>> / 2.

Pull-back gauge (the paper's; U = int_0^tau u, m_a and m_ab means, C1 = mean U2 - T m_a / 2 with U2 = int_0^tau U, C2 alike):

    Z1 = X + m_a [Ya, X] - m_ab <Ya : Yb> / 2,
    Z2 = C1^a [[Ya, X], X] - C2^ab [<Ya : Yb>, X] / 2 + mean(U2^a U^b) [[Ya, X], [Yb, X]] / 2
         - (mean(U2^a U^b U^c) - T m_a m_bc / 2) <Ya : <Yb : Yc>> / 2.

Sanyal, Bloch and McClamroch, (14)-(17), with the sign of the last term of (16) and the hat of C2 corrected (the printed
sign leaves an error of second order in one period); Bullo, SIAM J. Control Optim. 41 (2002) for the other gauge.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property
from itertools import combinations_with_replacement, product

from lie_codegen.errors import InputError
from lie_codegen.kernel.saved import Saved
from lie_codegen.mechanics.lagrangian import LagrangianSystem
from lie_codegen.mechanics.routh import RouthReduction
from lie_codegen.mechanics.vector_fields import (
    Field,
    homogeneous_parts,
    is_vertical_lift,
    lie_bracket,
    symmetric_product,
    tidy,
)
from lie_codegen.on_demand import sympy as sp
from lie_codegen.signals.periodic_input import PeriodicInput
from lie_codegen.signals.time_polynomial import TimePolynomial, fourier_terms

GAUGES = ("zero_mean", "pull_back")


@cache
def fast_time() -> sp.Symbol:
    """tau = t / eps."""
    return sp.Symbol("tau", real=True)


@dataclass(frozen=True, eq=False, repr=False)
class VibrationalFields(Saved):
    """The exact averaged system.

    Attributes:
        state: symbols of (q, v).
        drift: X.
        lifts: (Y_1, .., Y_m).
        inputs: u^a, of zero mean.
        order: 1 or 2.
        gauge: "zero_mean" or "pull_back".
        parameters: symbols that stayed arguments.
    """

    state: tuple[sp.Symbol, ...]
    drift: Field
    lifts: tuple[Field, ...]
    inputs: tuple[TimePolynomial, ...]
    order: int
    gauge: str
    parameters: tuple[sp.Symbol, ...]

    @property
    def period(self) -> sp.Expr:
        """T, in fast time."""
        return self.inputs[0].period

    @cached_property
    def primitives(self) -> tuple[TimePolynomial, ...]:
        """U^a of the gauge."""
        zero_mean = self.gauge == "zero_mean"
        return tuple(u.primitive() if zero_mean else u.integral() for u in self.inputs)

    @cached_property
    def brackets(self) -> tuple[Field, ...]:
        """[Ya, X]."""
        return tuple(lie_bracket(lift, self.drift, self.state) for lift in self.lifts)

    @cached_property
    def products(self) -> dict[tuple[int, int], Field]:
        """<Ya : Yb> for a <= b."""
        pairs = combinations_with_replacement(range(len(self.lifts)), 2)
        # <Ya : Yb> = [Ya, [X, Yb]] = -[Ya, [Yb, X]]
        return {(a, b): -lie_bracket(self.lifts[a], self.brackets[b], self.state) for a, b in pairs}

    def product(self, a: int, b: int) -> Field:
        """<Ya : Yb>."""
        return self.products[min(a, b), max(a, b)]

    @cached_property
    def Z(self) -> list[Field]:
        """[Z_1, .., Z_order], exact: z' = Z_1 + eps Z_2."""
        return [self._first(), self._second()][: self.order]

    @cached_property
    def corrections(self) -> tuple[tuple[TimePolynomial, ...], dict[tuple[int, int], TimePolynomial]]:
        """(V_a, V_ab) of P(tau) = id + eps (V_a [Ya, X] - V_ab <Ya : Yb> / 2): integrals of the oscillating parts."""
        indices = range(len(self.lifts))
        pairs = {(a, b): self.primitives[a] * self.primitives[b] for a in indices for b in indices}
        if self.gauge == "zero_mean":
            return tuple(u.primitive() for u in self.primitives), {
                key: value.without_mean().primitive() for key, value in pairs.items()
            }
        return tuple(u.without_mean().integral() for u in self.primitives), {
            key: value.without_mean().integral() for key, value in pairs.items()
        }

    @cached_property
    def displacement(self) -> Field:
        """P_1(tau, w): P = id + eps P_1, a function of the fast time and the state."""
        single, double = self.corrections
        total = sp.zeros(len(self.state), 1)
        for a, bracket in enumerate(self.brackets):
            total += single[a].expression(fast_time()) * bracket
        for (a, b), value in double.items():
            total -= value.expression(fast_time()) / 2 * self.product(a, b)
        return sp.ImmutableMatrix(total)

    @cached_property
    def shift(self) -> Field:
        """U^a(tau) Y_a(q): y = w + shift."""
        total = sp.zeros(len(self.state), 1)
        for primitive, lift in zip(self.primitives, self.lifts, strict=True):
            total += primitive.expression(fast_time()) * lift
        return sp.ImmutableMatrix(total)

    @cached_property
    def actual(self) -> tuple[Field, Field]:
        """(X, Y_a u^a(tau)): y' = X + (1/eps) Y_a u^a."""
        total = sp.zeros(len(self.state), 1)
        for u, lift in zip(self.inputs, self.lifts, strict=True):
            total += u.expression(fast_time()) * lift
        return self.drift, sp.ImmutableMatrix(total)

    def _first(self) -> Field:
        U, indices = self.primitives, range(len(self.lifts))
        terms = [(U[a].mean(), self.brackets[a]) for a in indices]
        terms += [(-(U[a] * U[b]).mean() / 2, self.product(a, b)) for a, b in product(indices, repeat=2)]
        return _combination([(sp.S.One, self.drift), *terms])

    def _second(self) -> Field:
        U, indices, state = self.primitives, range(len(self.lifts)), self.state
        # Primitives without mean; or integrals from 0, so that the averaged state is the actual one at t = 0.
        if self.gauge == "zero_mean":
            integrals = [u.primitive() for u in U]
            single: list[sp.Expr] = [sp.S.Zero] * len(U)
        else:
            integrals = [u.integral() for u in U]
            single = [u.mean() for u in U]
        half = self.period / 2
        terms: list[tuple[sp.Expr, Field]] = []
        for a in indices:
            if self.gauge == "pull_back":
                coefficient = integrals[a].mean() - half * single[a]
                terms.append((coefficient, self._bracket(coefficient, self.brackets[a], self.drift)))
            for b in indices:
                pair = U[a] * U[b]
                if self.gauge == "pull_back":
                    coefficient = -(pair.integral().mean() - half * pair.mean()) / 2
                    terms.append((coefficient, self._bracket(coefficient, self.product(a, b), self.drift)))
                if a != b:
                    coefficient = (integrals[a] * U[b]).mean() / 2
                    terms.append((coefficient, self._bracket(coefficient, self.brackets[a], self.brackets[b])))
                for c in indices:
                    triple = U[b] * U[c]
                    mean = (
                        (integrals[a] * triple.without_mean()).mean()
                        if self.gauge == "zero_mean"
                        else ((integrals[a] * triple).mean() - half * single[a] * triple.mean())
                    )
                    if sp.expand(mean) != 0:
                        terms.append(
                            (-mean / 2, symmetric_product(self.lifts[a], self.product(b, c), self.drift, state))
                        )
        return _combination(terms, len(state))

    def _bracket(self, coefficient: sp.Expr, first: Field, second: Field) -> Field:
        if sp.expand(coefficient) == 0:
            return sp.ImmutableMatrix.zeros(len(self.state), 1)
        return lie_bracket(first, second, self.state)


def vibrational_fields(
    system: LagrangianSystem | RouthReduction,
    u: PeriodicInput,
    *,
    order: int = 2,
    gauge: str = "zero_mean",
    mean_to_drift: bool = False,
) -> VibrationalFields:
    """The averaged system of y' = X + (1/eps) Y_a u^a(t / eps).

    Args:
        system: of `lagrangian_system` or `routh_reduce`; its inputs are the components of u, in order. State feedback is
            part of the forces.
        u: periodic in fast time, a trigonometric polynomial; its parameters stay arguments of the result.
        order: 1 or 2.
        gauge: "zero_mean" (for design) or "pull_back" (the paper's: z = y at the start of each period).
        mean_to_drift: take the mean of u as the plain constant force mean^a Y_a in X, not as (1/eps) mean^a Y_a.

    Raises:
        InputError: an input of non-zero mean, another number of components than inputs, a drift more than quadratic in
            the velocities, an input field that depends on the velocities, an unknown order or gauge.
    """
    if isinstance(system, RouthReduction):
        system = system.system
    if not isinstance(system, LagrangianSystem):
        raise InputError(f"expected a system of lagrangian_system or routh_reduce, got {type(system).__name__}")
    if order not in (1, 2):
        raise InputError(f"order {order!r}: vibrational averages are of order 1 or 2")
    if gauge not in GAUGES:
        raise InputError(f"gauge {gauge!r}: expected one of {', '.join(GAUGES)}")
    if u.dim != len(system.inputs):
        raise InputError(
            f"the input has {u.dim} components and the system {len(system.inputs)} inputs "
            f"({', '.join(system.inputs) or 'none'})"
        )
    drift, lifts, waves = system.drift, system.input_fields, fourier_terms(u)
    means = [wave.mean() for wave in waves]
    if any(mean != 0 for mean in means):
        if not mean_to_drift:
            culprit = next(i for i, mean in enumerate(means) if mean != 0)
            raise InputError(
                f"component {culprit + 1} of the input has the mean {means[culprit]}: divided by eps it is a static "
                "force that averaging does not cover, and the flow of the input is not periodic; subtract it, or give "
                "mean_to_drift=True to apply the mean as a constant force (not divided by eps) in the drift"
            )
        drift = sp.ImmutableMatrix(
            (drift + sum((m * y for m, y in zip(means, lifts, strict=True)), drift * 0)).applyfunc(tidy)
        )
        waves = tuple(wave.without_mean() for wave in waves)
    check_structure(drift, lifts, system.state, system.inputs)
    parameters = tuple(dict.fromkeys((*system.parameter_symbols, *u.symbols)))
    return VibrationalFields(system.state, drift, tuple(lifts), waves, order, gauge, parameters)


def check_structure(drift: Field, lifts: Sequence[Field], state: Sequence[sp.Symbol], inputs: Sequence[str]) -> None:
    """Refuse what the terminating pull-back series does not cover.

    Raises:
        InputError: naming the input, or the degree of the drift.
    """
    for name, lift in zip(inputs, lifts, strict=True):
        if not is_vertical_lift(lift, state):
            raise InputError(
                f"the force of input {name!r} depends on the velocities; it must depend on positions alone"
            )
    highest = max(homogeneous_parts(drift, state), default=0)
    if highest > 1:
        raise InputError(
            f"the drift is of degree {highest + 1} in the velocities; vibrational averaging needs at most 2"
        )


def _combination(terms: Sequence[tuple[sp.Expr, Field]], size: int | None = None) -> Field:
    length = size if size is not None else terms[0][1].rows
    total = sp.zeros(length, 1)
    for coefficient, field in terms:
        if sp.expand(coefficient) != 0:
            total += coefficient * field
    return sp.ImmutableMatrix(total.applyfunc(tidy))
