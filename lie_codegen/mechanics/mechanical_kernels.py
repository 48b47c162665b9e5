"""Kernels of a mechanical system and of its averages: rates, steps, the map to the averaged state and back."""

from __future__ import annotations

import random
from typing import Any

from lie_codegen.groups.derivation import derivation_of
from lie_codegen.groups.maps.element_pattern import pack, packed_size, unpack
from lie_codegen.groups.maps.matrices import matrix_port, random_element
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.definition import double, kernel_factory
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.linear import Vector, plus, scaled
from lie_codegen.mechanics.mechanical_fields import MechanicalFields
from lie_codegen.mechanics.mechanical_rates import (
    actual_rate,
    advected_rate,
    frozen_correction,
    moved,
    shifted_velocity,
    waves_at,
    with_scalars,
)
from lie_codegen.mechanics.mechanical_system import MechanicalSystem
from lie_codegen.mechanics.polynomial_kernels import Monomials, evaluated, series, table_of

SOURCE = "averages of any order by the Floquet-Magnus recursion; Bullo, SIAM J. Control Optim. 41 (2002), for the first"
NAMESPACE = "vibration"
#: Steps of the unit-time flow of the frozen correction in generated code; it is a small motion, of size eps.
_FLOW_STEPS = 2


@kernel_factory()
def rate_kernel(fields: MechanicalFields, name: str = "rate") -> Kernel:
    """(xi, advected.., eps) -> (alpha, beta): X' = X hat(alpha), xi' = beta of the averaged system."""
    system, n = fields.system, fields.system.dim
    tables = [table_of(fields.space, f) for f in fields.solution[0]]

    def body(ops: Arithmetic, *arguments: Any) -> tuple[Any, ...]:
        *parts, eps = arguments
        value = series(ops, Monomials([x for part in parts for x in part]), tables, eps, 2 * n)
        return value[:n], value[n:]

    return Kernel(
        name, NAMESPACE, (*_state_ports(system), _eps()), (Port("alpha", (n,)), Port("beta", (n,))), body,
        "X' = X hat(alpha), xi' = beta: sum eps^(q-1) F_q", SOURCE,
    )  # fmt: skip


@kernel_factory()
def actual_kernel(fields: MechanicalFields, name: str = "actual") -> Kernel:
    """(xi, advected.., tau, eps) -> beta: xi' of the actual system at fast time tau."""
    system, n = fields.system, fields.system.dim

    def body(ops: Arithmetic, *arguments: Any) -> tuple[Any, ...]:
        *parts, tau, eps = arguments
        return (
            actual_rate(ops, fields)([x for part in parts for x in part], waves_at(ops, fields.forcing, tau), eps)[1],
        )

    return Kernel(
        name, NAMESPACE, (*_state_ports(system), _tau(), _eps()), (Port("beta", (n,)),), body,
        "xi' = J^-1 (ad*_xi J xi + f - D xi + b_a u^a(tau) / eps)", SOURCE,
    )  # fmt: skip


@kernel_factory(eps=double)
def loop_kernel(fields: MechanicalFields, eps: float, name: str = "loop") -> Kernel:
    """(y, t) -> y_dot of y = (xi, advected vectors) under the forces of time t: what lc.floquet takes."""
    system, n = fields.system, fields.system.dim
    size = len(system.symbols)

    def body(ops: Arithmetic, y: Vector, t: Scalar) -> tuple[Any, ...]:
        small = ops.constant(eps)
        alpha, beta = actual_rate(ops, fields)(list(y), waves_at(ops, fields.forcing, t / small), small)
        return ([*beta, *advected_rate(ops, system, alpha, list(y[n:]))],)

    y = Port("y", (size,), description=", ".join(map(str, system.symbols)))
    return Kernel(
        name,
        NAMESPACE,
        (y, Port("t", (), "s")),
        (Port("y_dot", (size,)),),
        body,
        "the actual system, without X",
        SOURCE,
    )


def average_step(fields: MechanicalFields) -> Kernel:
    """(state, weights, h) -> (state_next,): one step of sum_q weights_q F_q; the state is varying entries of X, xi, Gamma.

    Weights (1, eps, eps^2, ..) are the average; zeros behind cut it to a lower order, which a check of orders needs.
    """
    n, tables = fields.system.dim, [table_of(fields.space, f) for f in fields.solution[0]]

    def body(ops: Arithmetic, state: Vector, weights: Vector, h: Scalar) -> tuple[Any, ...]:
        def rate(_: float, s: Vector) -> tuple[Vector, Vector]:
            monomials = Monomials(s)
            value: Vector = [0] * (2 * n)
            for weight, table in zip(weights, tables, strict=True):
                value = plus(value, scaled(weight, evaluated(ops, monomials, table, 2 * n)))
            return value[:n], value[n:]

        return (moved(ops, fields.system, state, rate, h),)

    weights = Port("weights", (fields.order,), description="1, eps, eps^2, ..")
    return _step(fields.system, "average_step", (weights, Port("h", (), "s")), body, "averaged system")


def actual_step(fields: MechanicalFields) -> Kernel:
    """(state, tau, eps, h) -> (state_next,): one step of the actual system from fast time tau."""

    def body(ops: Arithmetic, state: Vector, tau: Scalar, eps: Scalar, h: Scalar) -> tuple[Any, ...]:
        actual = actual_rate(ops, fields)
        waves = {part: waves_at(ops, fields.forcing, tau + part * h / eps) for part in (0.0, 0.5, 1.0)}

        def rate(part: float, s: Vector) -> tuple[Vector, Vector]:
            return actual(s, waves[part], eps)

        return (moved(ops, fields.system, state, rate, h),)

    return _step(fields.system, "actual_step", (_tau(), _eps(), Port("h", (), "s")), body, "actual system")


@kernel_factory()
def reconstruct_kernel(fields: MechanicalFields, *, back: bool) -> Kernel:
    """(X, xi, advected.., tau, eps) -> (X_next, xi_next): the actual state of an averaged one, or back."""
    system, n, group = fields.system, fields.system.dim, fields.system.group
    name = "estimate" if back else "reconstruct"
    data = derivation_of(group).wei_norman

    def body(ops: Arithmetic, X: Any, *arguments: Any) -> tuple[Any, ...]:
        *parts, tau, eps = arguments
        state = [*pack(group, X), *(x for part in parts for x in part)]
        table = frozen_correction(ops, fields, tau, eps, -1 if back else 1)
        shift = shifted_velocity(ops, fields, tau)

        def flow(_: float, s: Vector) -> tuple[Vector, Vector]:
            value = with_scalars(Monomials(s), table, 2 * n)
            return value[:n], value[n:]

        size = packed_size(group)
        if back:
            state = [*state[:size], *shift(state[size:], -1), *state[size + n :]]
        for _ in range(_FLOW_STEPS if table else 0):
            state = moved(ops, system, state, flow, ops.constant(1 / _FLOW_STEPS))
        xi = list(state[size : size + n]) if back else shift(state[size:], 1)
        return unpack(group, state[:size]), xi

    def sampler(rng: random.Random) -> tuple[Any, ...]:
        rest = [[rng.uniform(-1, 1) for _ in range(port.size)] for port in _state_ports(system)]
        return random_element(group, data, rng), *rest, rng.uniform(0, 6), rng.uniform(0.01, 0.05)

    return Kernel(
        name, NAMESPACE, (matrix_port(group, "X"), *_state_ports(system), _tau(), _eps()),
        (matrix_port(group, f"X_{name}d"), Port(f"xi_{name}d", (n,))), body,
        "z = flow_1(-Lambda(tau)) o shift(tau)^-1 (y)" if back else "y = shift(tau) o flow_1(Lambda(tau)) (z)", SOURCE, sampler,
    )  # fmt: skip


def _step(system: MechanicalSystem, name: str, ports: tuple[Port, ...], body: Any, what: str) -> Kernel:
    group = system.group
    data = derivation_of(group).wei_norman
    extent = packed_size(group) + len(system.symbols)

    def sampler(rng: random.Random) -> tuple[Any, ...]:
        rest = [rng.uniform(-1, 1) for _ in system.symbols]
        numbers = {"tau": rng.uniform(0, 6), "eps": rng.uniform(0.01, 0.1), "h": rng.uniform(0, 1e-3)}
        numbers_of = [numbers[p.name] if not p.shape else [0.01**q for q in range(p.size)] for p in ports]
        return [*pack(group, random_element(group, data, rng)), *rest], *numbers_of

    return Kernel(
        name, NAMESPACE,
        (Port("state", (extent,), description="varying entries of X, row by row, then xi, then advected vectors"), *ports),
        (Port("state_next", (extent,)),), body, f"one fourth-order step of the {what}",
        "Munthe-Kaas, BIT 38 (1998) 92", sampler,
    )  # fmt: skip


def _state_ports(system: MechanicalSystem) -> tuple[Port, ...]:
    own = Port("xi", (system.dim,), description="body velocity")
    return (own, *(Port(a.name, (a.size,), description=f"{a.kind} seen from the body") for a in system.advected))


def _eps() -> Port:
    return Port("eps", (), "1", description="ratio of the fast to the slow time scale")


def _tau() -> Port:
    return Port("tau", (), "1", description="fast time t / eps")
