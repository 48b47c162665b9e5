"""Kernels of the perturbed free rigid body: coordinates, unperturbed motion, Table 2, averages, right-hand side."""

from __future__ import annotations

import random
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from lie_codegen.averaging.phase_routine import Nodes
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.definition import kernel_factory
from lie_codegen.kernel.elliptic import Jacobi, Ladder, jacobi, ladder, phase
from lie_codegen.kernel.expressions import ExpressionEvaluator
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.routine import call_routine
from lie_codegen.on_demand import sympy as sp
from lie_codegen.rigid_body.euler_second_order import phase_loop
from lie_codegen.rigid_body.euler_variational import (
    CN,
    DN,
    K_INTEGRAL,
    K_MODULUS,
    OMEGA,
    S_MEAN,
    SN,
    ZETA,
    EulerPerturbation,
)
from lie_codegen.rigid_body.principal_body import TAU, PrincipalBody

SOURCE = "Coppola, The method of averaging for Euler's equations of rigid body motion"
_SLOW = (Port("Omega", (), "rad/s"), Port("k", (), "1"), Port("phi", (), "1"))
_SPIN = Port("omega", (3,), "rad/s")
_TAU = Port("tau", (), "s", description="slow time eps t")


@kernel_factory()
def to_slow(body: PrincipalBody, namespace: str) -> Kernel:
    """omega -> (Omega, k, phi): Omega = sqrt(w3^2 + (w2 / G23)^2), k = sqrt((w1 / G13)^2 + (w2 / G23)^2) / Omega."""

    def make(ops: Arithmetic, evaluate: ExpressionEvaluator, omega: Sequence[Scalar]) -> tuple[Any, ...]:
        s = body.signs
        w1, w2, w3 = body.to_paper(omega)
        a, b = s[1] * w2 / evaluate(body.gamma(2, 3)), s[0] * w1 / evaluate(body.gamma(1, 3))
        spin = ops.sqrt(w3 * w3 + a * a)
        k = ops.sqrt(a * a + b * b) / spin
        return spin, k, phase(ops, a, b, s[2] * w3 / spin, ladder(ops, k))

    formula = "Omega, k and phase of the torque-free motion through omega"
    return _kernel(
        "to_slow", namespace, body.is_constant, (_SPIN,), _SLOW, make, formula, "inverse of (9)", _spin_sample(body)
    )


@kernel_factory()
def from_slow(body: PrincipalBody, namespace: str) -> Kernel:
    """(Omega, k, phi) -> omega, (9)."""

    def make(ops: Arithmetic, evaluate: ExpressionEvaluator, spin: Scalar, k: Scalar, phi: Scalar) -> tuple[Any, ...]:
        return (body.to_user(_motion(body, evaluate, spin, k, jacobi(ops, phi, ladder(ops, k)))),)

    formula = "omega = (s1 G13 k Omega cn, s2 G23 k Omega sn, s3 Omega dn)"
    return _kernel("from_slow", namespace, body.is_constant, _SLOW, (_SPIN,), make, formula, "(9)-(10)", sample_slow)


@kernel_factory()
def frequency(body: PrincipalBody, namespace: str) -> Kernel:
    """(Omega, k) -> Lambda, the rate of phi without perturbation."""
    expression = EulerPerturbation(body, (sp.S.Zero, sp.S.Zero, sp.S.Zero)).frequency

    def make(ops: Arithmetic, evaluate: ExpressionEvaluator, spin: Scalar, k: Scalar) -> tuple[Any, ...]:
        return (_at(ops, evaluate.memo, spin, k, ladder(ops, k))(expression),)

    return _kernel(
        "frequency", namespace, body.is_constant, _SLOW[:2], (Port("Lambda", (), "1/s"),), make,
        "Lambda = G13 G23 J3 Omega / (4 K)", "Table 2", sample_pair,
    )  # fmt: skip


@kernel_factory()
def constants_of_motion(body: PrincipalBody, namespace: str) -> Kernel:
    """omega -> (T, L): kinetic energy and magnitude of the angular momentum, (5)."""

    def make(ops: Arithmetic, evaluate: ExpressionEvaluator, omega: Sequence[Scalar]) -> tuple[Any, ...]:
        momentum = [evaluate(inertia) * w for inertia, w in zip(body.inertia, omega, strict=True)]
        energy = sum(m * w for m, w in zip(momentum, omega, strict=True)) * ops.constant(sp.Rational(1, 2))
        return energy, ops.sqrt(sum(m * m for m in momentum))

    outputs = (Port("T", (), "J"), Port("L", (), "N m s"))
    return _kernel("constants_of_motion", namespace, body.is_constant, (_SPIN,), outputs, make, "T and |L|", "(5)")


@kernel_factory()
def variational(perturbation: EulerPerturbation, namespace: str) -> Kernel:
    """(Omega, k, phi) -> (F_Omega, F_k, G, Lambda), Table 2, per unit eps."""
    expressions = (*perturbation.variational, perturbation.frequency)

    def make(ops: Arithmetic, evaluate: ExpressionEvaluator, spin: Scalar, k: Scalar, phi: Scalar) -> tuple[Any, ...]:
        steps = ladder(ops, k)
        at = _at(ops, evaluate.memo, spin, k, steps, jacobi(ops, phi, steps))
        return tuple(at(expression) for expression in expressions)

    outputs = (Port("F_Omega", (), "rad/s^2"), Port("F_k", (), "1/s"), Port("G", (), "1/s"), Port("Lambda", (), "1/s"))
    formula = "Omega' = eps F_Omega, k' = eps F_k, phi' = Lambda + eps G"
    return _kernel(
        "variational", namespace, perturbation.is_autonomous, _SLOW, outputs, make, formula, "Table 2", sample_slow
    )


@kernel_factory()
def averaged(perturbation: EulerPerturbation, namespace: str, nodes: int) -> Kernel:
    """(Omega, k) -> (F_Omega, F_k, G), averaged: Table 3 where it applies, else the trapezoid rule in phi."""
    closed = perturbation.averaged
    body = _closed_form(closed) if closed is not None else _trapezoid(perturbation, namespace, nodes)
    outputs = (Port("F_Omega", (), "rad/s^2"), Port("F_k", (), "1/s"), Port("G", (), "1/s"))
    source = "Table 3" if closed is not None else f"Table 2, mean of {nodes} phases"
    return _kernel(
        "averaged", namespace, perturbation.is_autonomous, _SLOW[:2], outputs, body,
        "averages over phi of the variational equations", source, sample_pair,
    )  # fmt: skip


@kernel_factory()
def rate(perturbation: EulerPerturbation, namespace: str) -> Kernel:
    """(omega, eps) -> omega', the full equations (3); dw in g is the unperturbed acceleration."""
    body = perturbation.body
    w = list(sp.symbols("o1 o2 o3", real=True))
    free = body.unperturbed_acceleration(w)
    forced = perturbation.on(w, free)

    def make(ops: Arithmetic, evaluate: ExpressionEvaluator, omega: Sequence[Scalar], eps: Scalar) -> tuple[Any, ...]:
        at = ExpressionEvaluator(ops, {**evaluate.memo, **dict(zip(w, body.to_paper(omega), strict=True))})
        return (body.to_user([at(f) + eps * at(g) for f, g in zip(free, forced, strict=True)]),)

    inputs = (_SPIN, Port("eps", (), "1"))
    outputs = (Port("omega_dot", (3,), "rad/s^2"),)
    formula = "w1' = J1 w2 w3 + eps g1, w2' = -J2 w3 w1 + eps g2, w3' = J3 w1 w2 + eps g3"
    return _kernel("rate", namespace, perturbation.is_autonomous, inputs, outputs, make, formula, "(3)")


def _closed_form(expressions: Sequence[sp.Expr]) -> Callable[..., tuple[Any, ...]]:
    def make(ops: Arithmetic, evaluate: ExpressionEvaluator, spin: Scalar, k: Scalar) -> tuple[Any, ...]:
        at = _at(ops, evaluate.memo, spin, k, ladder(ops, k))
        return tuple(at(expression) for expression in expressions)

    return make


def _trapezoid(perturbation: EulerPerturbation, namespace: str, nodes: int) -> Callable[..., tuple[Any, ...]]:
    """The means by the loop over phases of first order."""
    loop = phase_loop(perturbation, namespace, Nodes(((float("inf"), nodes),), 1))
    n = 2 if perturbation.is_autonomous else 3

    def make(ops: Arithmetic, evaluate: ExpressionEvaluator, spin: Scalar, k: Scalar) -> tuple[Any, ...]:
        slow = [] if perturbation.is_autonomous else [evaluate(TAU)]
        result = call_routine(ops, loop, [spin, k, *slow, ops.constant(0), ops.constant(1)])
        return result[0], result[1], result[n + 1]

    return make


@kernel_factory()
def averaged_rate(perturbation: EulerPerturbation, namespace: str) -> Kernel | None:
    """(y, t, eps) -> y' of the averaged system, y = (Omega, k, phi), by Table 3; None where it does not apply."""
    closed = perturbation.averaged
    if closed is None:
        return None

    def body(ops: Arithmetic, y: Sequence[Scalar], t: Scalar, eps: Scalar) -> tuple[Any, ...]:
        memo = {} if perturbation.is_autonomous else {TAU: eps * t}
        at = _at(ops, memo, y[0], y[1], ladder(ops, y[1]))
        means = [eps * at(expression) for expression in closed]
        return ([means[0], means[1], at(perturbation.frequency) + means[2]],)

    inputs = (Port("y", (3,), description="Omega, k, phi"), Port("t", (), "s"), Port("eps", (), "1"))

    def sample(rng: random.Random) -> tuple[Any, ...]:
        return list(sample_slow(rng)), 0.0, 0.01

    formula = "Omega' = eps mean F_Omega, k' = eps mean F_k, phi' = Lambda + eps mean G"
    return Kernel(
        "averaged_rate", namespace, inputs, (Port("y_dot", (3,)),), body, formula, f"{SOURCE}, (21), Table 3", sample
    )


def _at(
    ops: Arithmetic, memo: Mapping[sp.Basic, Scalar], spin: Scalar, k: Scalar, steps: Ladder, at: Jacobi | None = None
) -> ExpressionEvaluator:
    values = {**memo, OMEGA: spin, K_MODULUS: k, K_INTEGRAL: steps.K, S_MEAN: steps.S}
    if at is not None:
        values |= {SN: at.sn, CN: at.cn, DN: at.dn, ZETA: at.z}
    return ExpressionEvaluator(ops, values)


def _motion(body: PrincipalBody, evaluate: ExpressionEvaluator, spin: Scalar, k: Scalar, at: Jacobi) -> list[Scalar]:
    s, amplitude = body.signs, k * spin
    first, second = evaluate(body.gamma(1, 3)), evaluate(body.gamma(2, 3))
    return [s[0] * first * amplitude * at.cn, s[1] * second * amplitude * at.sn, s[2] * spin * at.dn]


def _kernel(
    name: str,
    namespace: str,
    autonomous: bool,
    inputs: tuple[Port, ...],
    outputs: tuple[Port, ...],
    make: Callable[..., tuple[Any, ...]],
    formula: str,
    where: str,
    sampler: Callable[[random.Random], tuple[Any, ...]] | None = None,
) -> Kernel:
    """A kernel whose body gets an evaluator of expressions in tau; tau is the last input unless autonomous."""

    def body(ops: Arithmetic, *arguments: Any) -> tuple[Any, ...]:
        values = {} if autonomous else {TAU: arguments[-1]}
        own = arguments if autonomous else arguments[:-1]
        return make(ops, ExpressionEvaluator(ops, values), *own)

    def sample(rng: random.Random) -> tuple[Any, ...]:
        own = sampler(rng) if sampler else tuple(_uniform(port, rng) for port in inputs)
        return own if autonomous else (*own, 0.0)

    ports = inputs if autonomous else (*inputs, _TAU)
    return Kernel(name, namespace, ports, outputs, body, formula, f"{SOURCE}, {where}", sample)


def _uniform(port: Port, rng: random.Random) -> Any:
    return [rng.uniform(-1, 1) for _ in range(port.shape[0])] if port.shape else rng.uniform(0, 0.1)


def sample_slow(rng: random.Random) -> tuple[Any, ...]:
    """(Omega, k, phi) away from both ends of the range of k."""
    return rng.uniform(0.5, 2), rng.uniform(0.1, 0.9), rng.uniform(-0.5, 0.5)


def sample_pair(rng: random.Random) -> tuple[Any, ...]:
    """(Omega, k)."""
    return sample_slow(rng)[:2]


def _spin_sample(body: PrincipalBody) -> Callable[[random.Random], tuple[Any, ...]]:
    def sample(rng: random.Random) -> tuple[Any, ...]:
        # a spin of sign s3 about the third axis and small rates about the others: k well below 1
        j1, j2, j3 = (abs(float(j.subs(TAU, 0))) for j in body.coefficients)
        reach = 0.5 * min((j1 / j3) ** 0.5, (j2 / j3) ** 0.5)
        small = [rng.uniform(-reach, reach), rng.uniform(-reach, reach)]
        return (body.to_user([*small, body.signs[2] * 1.0]),)

    return sample
