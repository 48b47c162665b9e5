"""The rates that the kernels of a mechanical system and of its averages step by: actual and averaged forces, the shift and the frozen correction."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np

from lie_codegen.groups.maps.element_pattern import pack, packed_size, unpack
from lie_codegen.groups.maps.rkmk import TAYLOR_DEGREE, times_taylor_exp
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.brackets import dexp_inverse
from lie_codegen.kernel.linear import Vector, plus, scaled
from lie_codegen.kernel.runge_kutta import CLASSICAL, increment, vectors
from lie_codegen.kernel.structural_zeros import add, product
from lie_codegen.mechanics.mechanical_fields import Fourier, MechanicalFields
from lie_codegen.mechanics.mechanical_system import MechanicalSystem
from lie_codegen.mechanics.polynomial_fields import Field
from lie_codegen.mechanics.polynomial_kernels import Monomials, evaluated, table_of

#: (part of the step, state (xi, Gamma)) -> (alpha, beta).
Rate = Callable[[float, Vector], tuple[Vector, Vector]]


def moved(ops: Arithmetic, system: MechanicalSystem, state: Sequence[Scalar], rate: Rate, h: Scalar) -> Vector:
    """One fourth-order step of X' = X hat(alpha), xi' = beta, Gamma' = -(rho(alpha) Gamma + r(alpha)): Munthe-Kaas for X."""
    group, n, size = system.group, system.dim, packed_size(system.group)
    X, s = unpack(group, state[:size]), list(state[size:])

    def slope(part: float, change: Vector) -> Vector:
        theta, here = change[:n], plus(s, change[n:])
        alpha, beta = rate(part, here)
        turned = dexp_inverse(ops, group.algebra, theta, alpha)
        return [*turned, *beta, *advected_rate(ops, system, alpha, here[n:])]

    total = increment(vectors(ops), CLASSICAL, slope, [0] * (n + len(s)), h)
    return [*pack(group, times_taylor_exp(group, ops, X, total[:n], TAYLOR_DEGREE)), *plus(s, total[n:])]


def advected_rate(ops: Arithmetic, system: MechanicalSystem, alpha: Vector, gamma: Vector) -> Vector:
    """Gamma' = -(rho(alpha) Gamma + r(alpha)) of all advected vectors in a row."""
    rho, r = system.advection
    result: Vector = [0] * len(gamma)
    for i, a, b in np.argwhere(rho):
        result[a] = add(result[a], product(ops.constant(-float(rho[i, a, b])), product(alpha[i], gamma[b])))
    for i, a in np.argwhere(r):
        result[a] = add(result[a], product(ops.constant(-float(r[i, a])), alpha[i]))
    return result


def actual_rate(
    ops: Arithmetic, fields: MechanicalFields
) -> Callable[[Vector, list[tuple[Scalar, Scalar]], Scalar], tuple[Vector, Vector]]:
    """(state (xi, advected), waves, eps) -> (alpha, beta), each (n,), of the actual system: its drift and the forces u^a / eps."""
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


def waves_at(ops: Arithmetic, forcing: Fourier, tau: Scalar) -> list[tuple[Scalar, Scalar]]:
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


def shifted_velocity(ops: Arithmetic, fields: MechanicalFields, tau: Scalar) -> Callable[[Vector, int], Vector]:
    """(state, sign) -> xi + sign U^a(tau) Y_a(Gamma)."""
    n, U = fields.system.dim, fields.forcing.primitive()
    waves = waves_at(ops, U, tau)
    start = fields.shift(np.zeros(())) - U.values(np.zeros(()))
    lifts = [table_of(fields.space, lift) for lift in fields.lifts]

    def shift(s: Vector, sign: int) -> Vector:
        xi, monomials = list(s[:n]), Monomials(s)
        for a, lift in enumerate(lifts):
            strength = add(_signal(ops, U, a, waves), ops.constant(float(start[a])) if start[a] else 0)
            xi = plus(xi, scaled(product(sign, strength), evaluated(ops, monomials, lift, 2 * n)[n:]))
        return xi

    return shift


def frozen_correction(
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


def with_scalars(monomials: Monomials, table: dict[Any, dict[int, Scalar]], size: int) -> Vector:
    """(size,) values of polynomials whose coefficients are scalars of an arithmetic: exponents -> component -> coefficient."""
    result: Vector = [0] * size
    for exponents, row in table.items():
        value = monomials(exponents)
        for component, number in row.items():
            result[component] = add(result[component], product(number, value))
    return result
