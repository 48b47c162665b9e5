"""Kernels of a mechanical system and of its averages: rates, steps, the map to the averaged state and back."""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from lie_codegen.groups.maps.element_pattern import pack, packed_size, unpack
from lie_codegen.groups.maps.matrices import matrix_port, random_element
from lie_codegen.groups.maps.rkmk import TAYLOR_DEGREE, times_taylor_exp
from lie_codegen.groups.wei_norman.data import WeiNormanData
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.brackets import dexp_inverse
from lie_codegen.kernel.definition import double, kernel_factory
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.linear import Vector, plus, scaled
from lie_codegen.kernel.runge_kutta import CLASSICAL, increment, vectors
from lie_codegen.kernel.structural_zeros import add, product
from lie_codegen.mechanics.mechanical_fields import Fourier, MechanicalFields
from lie_codegen.mechanics.mechanical_system import MechanicalSystem
from lie_codegen.mechanics.polynomial_fields import Field
from lie_codegen.mechanics.polynomial_kernels import Monomials, evaluated, series, table_of

SOURCE = "averages of any order by the Floquet-Magnus recursion; Bullo, SIAM J. Control Optim. 41 (2002), for the first"
NAMESPACE = "vibration"
#: Steps of the unit-time flow of the frozen correction in generated code; it is a small motion, of size eps.
_FLOW_STEPS = 2

#: (part of the step, state (xi, Gamma)) -> (alpha, beta).
Rate = Callable[[float, Vector], tuple[Vector, Vector]]


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
        return (_actual(ops, fields)([x for part in parts for x in part], _waves(ops, fields.forcing, tau), eps)[1],)

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
        alpha, beta = _actual(ops, fields)(list(y), _waves(ops, fields.forcing, t / small), small)
        return ([*beta, *_advected_rate(ops, system, alpha, list(y[n:]))],)

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
        actual = _actual(ops, fields)
        waves = {part: _waves(ops, fields.forcing, tau + part * h / eps) for part in (0.0, 0.5, 1.0)}

        def rate(part: float, s: Vector) -> tuple[Vector, Vector]:
            return actual(s, waves[part], eps)

        return (moved(ops, fields.system, state, rate, h),)

    return _step(fields.system, "actual_step", (_tau(), _eps(), Port("h", (), "s")), body, "actual system")


@kernel_factory()
def reconstruct_kernel(fields: MechanicalFields, *, back: bool) -> Kernel:
    """(X, xi, advected.., tau, eps) -> (X_next, xi_next): the actual state of an averaged one, or back."""
    system, n, group = fields.system, fields.system.dim, fields.system.group
    name = "estimate" if back else "reconstruct"
    data = WeiNormanData(group)

    def body(ops: Arithmetic, X: Any, *arguments: Any) -> tuple[Any, ...]:
        *parts, tau, eps = arguments
        state = [*pack(group, X), *(x for part in parts for x in part)]
        table = _frozen(ops, fields, tau, eps, -1 if back else 1)
        shift = _shift(ops, fields, tau)

        def flow(_: float, s: Vector) -> tuple[Vector, Vector]:
            value = _with_scalars(Monomials(s), table, 2 * n)
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


def moved(ops: Arithmetic, system: MechanicalSystem, state: Sequence[Scalar], rate: Rate, h: Scalar) -> Vector:
    """One fourth-order step of X' = X hat(alpha), xi' = beta, Gamma' = -(rho(alpha) Gamma + r(alpha)): Munthe-Kaas for X."""
    group, n, size = system.group, system.dim, packed_size(system.group)
    X, s = unpack(group, state[:size]), list(state[size:])

    def slope(part: float, change: Vector) -> Vector:
        theta, here = change[:n], plus(s, change[n:])
        alpha, beta = rate(part, here)
        turned = dexp_inverse(ops, group.algebra, theta, alpha)
        return [*turned, *beta, *_advected_rate(ops, system, alpha, here[n:])]

    total = increment(vectors(ops), CLASSICAL, slope, [0] * (n + len(s)), h)
    return [*pack(group, times_taylor_exp(group, ops, X, total[:n], TAYLOR_DEGREE)), *plus(s, total[n:])]


def _advected_rate(ops: Arithmetic, system: MechanicalSystem, alpha: Vector, gamma: Vector) -> Vector:
    rho, r = system.advection
    result: Vector = [0] * len(gamma)
    for i, a, b in np.argwhere(rho):
        result[a] = add(result[a], product(ops.constant(-float(rho[i, a, b])), product(alpha[i], gamma[b])))
    for i, a in np.argwhere(r):
        result[a] = add(result[a], product(ops.constant(-float(r[i, a])), alpha[i]))
    return result


def _actual(
    ops: Arithmetic, fields: MechanicalFields
) -> Callable[[Vector, list[tuple[Scalar, Scalar]], Scalar], tuple[Vector, Vector]]:
    n = fields.system.dim
    drift = table_of(fields.space, fields.drift)
    lifts = [table_of(fields.space, lift) for lift in fields.lifts]

    def rate(s: Vector, waves: list[tuple[Scalar, Scalar]], eps: Scalar) -> tuple[Vector, Vector]:
        monomials = Monomials(s)
        total = evaluated(ops, monomials, drift, 2 * n)
        for a, lift in enumerate(lifts):
            strength = _signal(ops, fields.forcing, a, waves) / eps
            total = plus(total, scaled(strength, evaluated(ops, monomials, lift, 2 * n)))
        return total[:n], total[n:]

    return rate


def _waves(ops: Arithmetic, forcing: Fourier, tau: Scalar) -> list[tuple[Scalar, Scalar]]:
    """(cos, sin) of n w tau for n = 0 .. H, the higher ones from the first."""
    return _harmonics(ops, tau, 2 * np.pi / forcing.period, forcing.highest)


def _harmonics(ops: Arithmetic, tau: Scalar, frequency: float, highest: int) -> list[tuple[Scalar, Scalar]]:
    angle = tau if abs(frequency - 1) < 1e-15 else ops.constant(frequency) * tau
    c, s = ops.cos(angle), ops.sin(angle)
    waves: list[tuple[Scalar, Scalar]] = [(1, 0), (c, s)]
    for _ in range(highest - 1):
        x, y = waves[-1]
        waves.append((x * c - y * s, y * c + x * s))
    return waves


def _signal(ops: Arithmetic, forcing: Fourier, a: int, waves: list[tuple[Scalar, Scalar]]) -> Scalar:
    total: Scalar = 0
    for n, value in enumerate(forcing.coefficients[a]):
        for part, wave in ((2 * value.real, waves[n][0]), (-2 * value.imag, waves[n][1])):
            if abs(part) > 1e-16 * np.abs(forcing.coefficients[a]).max():
                total = add(total, product(ops.constant(float(part)), wave))
    return total


def _shift(ops: Arithmetic, fields: MechanicalFields, tau: Scalar) -> Callable[[Vector, int], Vector]:
    """(state, sign) -> xi + sign U^a(tau) Y_a(Gamma)."""
    n, U = fields.system.dim, fields.forcing.primitive()
    waves = _waves(ops, U, tau)
    start = fields.shift(np.zeros(())) - U.values(np.zeros(()))
    lifts = [table_of(fields.space, lift) for lift in fields.lifts]

    def shift(s: Vector, sign: int) -> Vector:
        xi, monomials = list(s[:n]), Monomials(s)
        for a, lift in enumerate(lifts):
            strength = add(_signal(ops, U, a, waves), ops.constant(float(start[a])) if start[a] else 0)
            xi = plus(xi, scaled(product(sign, strength), evaluated(ops, monomials, lift, 2 * n)[n:]))
        return xi

    return shift


def _frozen(
    ops: Arithmetic, fields: MechanicalFields, tau: Scalar, eps: Scalar, sign: int
) -> dict[Any, dict[int, Scalar]]:
    """sign sum eps^q Lambda_q(tau) as a table of scalars."""
    table: dict[Any, dict[int, Scalar]] = {}
    if fields.order == 1:
        return table
    M, space = fields.nodes, fields.space
    waves = _harmonics(ops, tau, 2 * np.pi / fields.forcing.period, M // 2)
    power: Scalar = product(sign, eps)
    for field in fields.solution[1]:
        spectrum = np.fft.rfft(_all_nodes(field, M), axis=1) / M
        size = np.abs(spectrum).max(initial=0.0)
        for e, c, row in zip(
            space.exponents(field.codes).tolist(), space.components(field.codes).tolist(), spectrum, strict=True
        ):
            value: Scalar = 0
            for k, z in enumerate(row):
                twice = 1 if k == 0 else 2
                for part, wave in ((twice * z.real, waves[k][0]), (-twice * z.imag, waves[k][1])):
                    if abs(part) > 1e-15 * size:
                        value = add(value, product(ops.constant(float(part)), wave))
            old = table.setdefault(tuple(e), {}).get(c, 0)
            table[tuple(e)][c] = add(old, product(power, value))
        power = product(power, eps)
    return table


def _all_nodes(field: Field, nodes: int) -> Any:
    return np.broadcast_to(field.values, (len(field.codes), nodes))


def _with_scalars(monomials: Monomials, table: dict[Any, dict[int, Scalar]], size: int) -> Vector:
    result: Vector = [0] * size
    for exponents, row in table.items():
        value = monomials(exponents)
        for component, number in row.items():
            result[component] = add(result[component], product(number, value))
    return result


def _step(system: MechanicalSystem, name: str, ports: tuple[Port, ...], body: Any, what: str) -> Kernel:
    group = system.group
    data = WeiNormanData(group)
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
