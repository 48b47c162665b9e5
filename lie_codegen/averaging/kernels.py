"""Averaged rates and averaged states as kernels: what `Averaged` evaluates in numpy, as C.

averaged_rate(eps, parameters) -> rate      sum_{q<=p} eps^q F_q
averaged_state(eps, t, parameters) -> X     the approximation of X(t) from the identity, error O(eps^p) on [0, b / eps]
periodic_input(t, parameters) -> u          u(t) itself
averaged_wei_norman(eps, g, parameters) -> g_dot    gbar' = eps M(gbar) u_av, (11)
"""

from __future__ import annotations

import random
from collections.abc import Sequence
from typing import Any

import numpy as np

from lie_codegen.averaging.averaged import Averaged
from lie_codegen.errors import InputError
from lie_codegen.exact.expression import time_symbol
from lie_codegen.groups.derivation import derivation_of
from lie_codegen.groups.maps.exponential import exp_matrix
from lie_codegen.groups.maps.matrices import matrix_port
from lie_codegen.groups.wei_norman.body import product_exp, rate
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.brackets import bracket
from lie_codegen.kernel.complex_scalar import Complex
from lie_codegen.kernel.definition import kernel_factory
from lie_codegen.kernel.expressions import ExpressionEvaluator
from lie_codegen.kernel.kernel import Kernel, Port, Sampler
from lie_codegen.kernel.linear import Vector, matmul, plus, scaled
from lie_codegen.kernel.renaming import in_namespace
from lie_codegen.on_demand import sympy as sp

_SOURCE = {
    "floquet": "Floquet-Magnus recursion, left-invariant form",
    "product": "Leonard and Krishnaprasad, TR 93-59, Theorem 3",
    "single": "Leonard and Krishnaprasad, TR 93-59, Theorem 4 and the area-moment rule",
}
_EPS = Port("eps", (), "1", description="amplitude that scales u")
_T = Port("t", (), "s", description="time")


def averaged_kernels(averaged: Averaged, statement: str = "", *, name: str | None = None) -> tuple[Kernel, ...]:
    """averaged_rate, averaged_state and periodic_input of an average; parameters become scalar inputs by their names.

    Args:
        averaged: the average; its X0 must be the identity (by left invariance, multiply from the left).
        statement: the measured order and constant, `order_check(...).statement`; the generated header states it.
        name: C identifier that begins every symbol; the group's name if None.

    Raises:
        InputError: a sampled input (its Lambda has no formula; see `averaged_rate`), or an X0 that is not I.
    """
    if not averaged.u.waveform.has_formula:
        raise InputError(
            "averaged_kernels: a sampled input, or one in pieces, has no one formula in t; only averaged_rate(averaged) can be made"
        )
    if not np.array_equal(averaged.X0, np.eye(averaged.group.degree)):
        raise InputError("averaged_kernels: X0 must be the identity; multiply the state from the left by your X0")
    kernels = (averaged_rate(averaged, statement), averaged_state(averaged, statement), periodic_input(averaged))
    return in_namespace(kernels, name)


@kernel_factory()
def averaged_rate(averaged: Averaged, statement: str = "") -> Kernel:
    """(eps, parameters) -> rate: the mean velocity sum eps^q F_q."""
    symbols = averaged.parameters

    def body(ops: Arithmetic, eps: Scalar, *values: Scalar) -> tuple[Any, ...]:
        return (_rate(averaged, ExpressionEvaluator(ops, dict(zip(symbols, values, strict=True))), eps),)

    group = averaged.group
    output = Port("rate", (group.dim,), _units(averaged), description=f"components {', '.join(group.labels)}")
    formula = _with("rate = sum_q eps^q F_q", averaged, statement)
    sampler = _sampler(averaged, [_EPS, *_parameters(symbols)])
    inputs = (_EPS, *_parameters(symbols))
    return Kernel("averaged_rate", group.name, inputs, (output,), body, formula, _SOURCE[averaged.form], sampler)


@kernel_factory()
def averaged_state(averaged: Averaged, statement: str = "") -> Kernel:
    """(eps, t, parameters) -> X."""
    group, symbols = averaged.group, averaged.parameters
    data = derivation_of(group)

    def body(ops: Arithmetic, eps: Scalar, t: Scalar, *values: Scalar) -> tuple[Any, ...]:
        evaluate = ExpressionEvaluator(ops, {time_symbol(): t, **dict(zip(symbols, values, strict=True))})
        if averaged.form == "floquet" or averaged.order == 1:
            mean = exp_matrix(ops, data, scaled(t, _rate(averaged, evaluate, eps)))
            waves = [_vector(evaluate, wave) for wave in averaged.exact_Lambda]
            if not waves:
                return (mean,)
            return (_times(group.is_complex, mean, exp_matrix(ops, data, _horner(eps, waves))),)
        exponents = _exponents(averaged, ops, evaluate, eps, t)
        if averaged.form == "product":
            return (product_exp(ops, data.wei_norman, exponents),)
        return (exp_matrix(ops, data, exponents),)

    inputs = (_EPS, _T, *_parameters(symbols))
    formulas = {
        "floquet": "X = exp(t sum_{q<=p} eps^q F_q) exp(sum_{q<p} eps^q Lambda_q(t))",
        "product": "X = exp(g_1 A_1) ... exp(g_n A_n), g = eps^2 t F_2 + eps int_0^t u",
        "single": "X = exp(eps int_0^t u + eps^2 t F_2 + ...)",
    }
    formula = _with(formulas[averaged.form if averaged.order > 1 else "floquet"], averaged, statement)
    output = matrix_port(group, "X", "averaged state, from the identity")
    sampler = _sampler(averaged, inputs)
    return Kernel("averaged_state", group.name, inputs, (output,), body, formula, _SOURCE[averaged.form], sampler)


@kernel_factory()
def averaged_wei_norman(averaged: Averaged) -> Kernel:
    """(eps, g, parameters) -> g_dot: the averaged Wei-Norman equations (11); Phi(gbar(t)) = X(0) exp(eps t U_av), Theorem 1."""
    group, symbols = averaged.group, averaged.parameters
    data = derivation_of(group)

    def body(ops: Arithmetic, eps: Scalar, g: Sequence[Scalar], *values: Scalar) -> tuple[Any, ...]:
        evaluate = ExpressionEvaluator(ops, dict(zip(symbols, values, strict=True)))
        return (rate(ops, data.wei_norman, g, scaled(eps, _vector(evaluate, averaged.exact_F[0]))),)

    inputs = (_EPS, Port("g", (group.dim,), ", ".join(group.units) if any(group.units) else ""), *_parameters(symbols))
    output = Port("g_dot", (group.dim,), _units(averaged))
    formula = "gbar' = eps M(gbar) u_av, u_av = (1/T) int_0^T u"
    source = "Leonard and Krishnaprasad, TR 93-59, (11) and Theorem 1"
    return Kernel("averaged_wei_norman", group.name, inputs, (output,), body, formula, source)


@kernel_factory()
def periodic_input(averaged: Averaged) -> Kernel:
    """(t, parameters) -> u."""
    group, symbols = averaged.group, averaged.parameters
    entries = averaged.u.expressions

    def body(ops: Arithmetic, t: Scalar, *values: Scalar) -> tuple[Any, ...]:
        evaluate = ExpressionEvaluator(ops, {time_symbol(): t, **dict(zip(symbols, values, strict=True))})
        return (_vector(evaluate, entries),)

    inputs = (_T, *_parameters(symbols))
    output = Port("u", (group.dim,), _units(averaged), description=f"components {', '.join(group.labels)}")
    formula = f"u(t), period {averaged.u.period}"
    return Kernel("periodic_input", group.name, inputs, (output,), body, formula, "", _sampler(averaged, inputs))


def _rate(averaged: Averaged, evaluate: ExpressionEvaluator, eps: Scalar) -> Vector:
    return _horner(eps, [_vector(evaluate, f) for f in averaged.exact_F])


def _exponents(averaged: Averaged, ops: Arithmetic, evaluate: ExpressionEvaluator, eps: Scalar, t: Scalar) -> Vector:
    """The exponents of the product and single forms; see `Averaged.coordinates`."""
    tilde = _vector(evaluate, averaged.exact_Lambda[0])
    second = _vector(evaluate, averaged.exact_F[1])
    terms = [tilde, scaled(t, second)]
    if averaged.order == 3:
        terms[1] = plus(terms[1], _vector(evaluate, averaged.exact_Lambda[1]))
        crossed = bracket(ops, averaged.group.algebra, second, tilde)
        third = plus(_vector(evaluate, averaged.exact_F[2]), [value / 2 for value in crossed])
        terms.append(scaled(t, third))
    return _horner(eps, terms)


def _vector(evaluate: ExpressionEvaluator, entries: sp.ImmutableMatrix) -> Vector:
    return [evaluate(entry) for entry in entries]


def _horner(eps: Scalar, terms: Sequence[Vector]) -> Vector:
    """sum_q eps^q terms[q-1]."""
    total = scaled(eps, terms[-1])
    for term in reversed(terms[:-1]):
        total = scaled(eps, plus(term, total))
    return total


def _times(is_complex: bool, a: Any, b: Any) -> Any:
    """The product of two port matrices."""
    if not is_complex:
        return matmul(a, b)
    size = range(len(a))
    return [[sum((Complex.of(a[i][k]) * b[k][j] for k in size), Complex(0)) for j in size] for i in size]


def _parameters(symbols: Sequence[sp.Symbol]) -> tuple[Port, ...]:
    return tuple(Port(str(symbol), (), description="parameter of the input") for symbol in symbols)


def _units(averaged: Averaged) -> str:
    units = [f"{unit}/s" if unit else "1/s" for unit in averaged.group.units]
    return ", ".join(units) if any(averaged.group.units) else ""


def _with(formula: str, averaged: Averaged, statement: str) -> str:
    claim = statement or f"error O(eps^{averaged.order}) on [0, b/eps]; not measured"
    return f"{formula}. {claim}"


def _sampler(averaged: Averaged, ports: Sequence[Port]) -> Sampler:
    """eps and t within a few periods, parameters of order one and positive (they may be frequencies)."""
    period = averaged.u.period
    length = 10.0 if period.free_symbols else float(period)

    def sample(rng: random.Random) -> tuple[Any, ...]:
        ranges = {"eps": (0.01, 0.2), "t": (0.0, 2 * length)}
        return tuple(rng.uniform(*ranges.get(port.name, (0.2, 1.0))) for port in ports)

    return sample
