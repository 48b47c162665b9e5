"""Runge-Kutta-Munthe-Kaas steps of X' = X hat(u(t)), and the same equation in Wei-Norman coordinates."""

from __future__ import annotations

import random
from collections.abc import Sequence
from fractions import Fraction
from typing import Any

from lie_codegen.groups.catalogue_load import GroupLike, as_group
from lie_codegen.groups.maps.short_exponential import short_pattern, times_short_exp
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.groups.wei_norman.body import product_exp, rate
from lie_codegen.groups.wei_norman.data import WeiNormanData
from lie_codegen.kernel.arithmetic import Arithmetic, FloatArithmetic, Scalar
from lie_codegen.kernel.brackets import dexp_inverse
from lie_codegen.kernel.complex_scalar import Complex
from lie_codegen.kernel.definition import kernel_factory
from lie_codegen.kernel.kernel import Body, Kernel, Port
from lie_codegen.kernel.linear import Vector, matmul, plus
from lie_codegen.kernel.runge_kutta import CLASSICAL, increment, vectors
from lie_codegen.kernel.structural_zeros import is_zero, product

#: Taylor terms of exp in a step: below 1e-17 relative for |h u| <= 1/4, which `simulate` keeps to.
TAYLOR_DEGREE = 12


def rkmk4_increment(
    group: MatrixGroup, ops: Arithmetic, u0: Sequence[Scalar], um: Sequence[Scalar], u1: Sequence[Scalar], h: Scalar
) -> list[Scalar]:
    """Theta with X(t + h) = X(t) exp(Theta) + O(h^5), from u at both ends and the middle of the step.

    Theta' = dexpinv(u) = u + [Theta, u] / 2 + [Theta, [Theta, u]] / 12 - ..., signs for X' = X hat(u).
    Munthe-Kaas, BIT 38 (1998) 92.
    """

    def rate(c: float, theta: Vector) -> Vector:
        return dexp_inverse(ops, group.algebra, theta, {0.0: u0, 0.5: um, 1.0: u1}[c])

    return list(increment(vectors(ops), CLASSICAL, rate, [0] * group.dim, h))


def times_taylor_exp(
    group: MatrixGroup,
    ops: Arithmetic,
    X: Sequence[Sequence[Any]],
    theta: Sequence[Scalar],
    degree: int = TAYLOR_DEGREE,
) -> Any:
    """X exp(hat(theta)) by Horner's rule on the Taylor polynomial, X (I + A (I + A/2 (I + A/3 ...))), or the short form of it."""
    generator = hat_body(group, ops, theta)
    pattern = short_pattern(group)
    if pattern is not None and degree > pattern.zeros + 1:
        return times_short_exp(ops, pattern, X, generator, theta, degree)
    value: list[list[Any]] = [list(row) for row in X]
    for order in range(degree, 0, -1):
        factor = ops.constant(Fraction(1, order))
        value = [
            [_moved(entry, total, factor) for entry, total in zip(*rows, strict=True)]
            for rows in zip(X, matmul(value, generator), strict=True)
        ]
    return value


def _moved(entry: Any, total: Any, factor: Scalar) -> Any:
    return entry if is_zero(total) else entry + total * factor


def hat_body(group: MatrixGroup, ops: Arithmetic, x: Sequence[Scalar]) -> list[list[Any]]:
    """hat(x), row by row; plain zeros where every basis matrix has one."""
    size = group.degree
    result: list[list[Any]] = [[0] * size for _ in range(size)]
    for component, matrix in zip(x, group.exact_basis, strict=True):
        for i in range(size):
            for j in range(size):
                if matrix[i, j] != 0:
                    re, im = matrix[i, j].as_real_imag()
                    term: Any = product(_coefficient(ops, re), component)
                    if group.is_complex:
                        term = Complex(term, product(_coefficient(ops, im), component))
                    result[i][j] = term if is_zero(result[i][j]) else result[i][j] + term
    return result


def _coefficient(ops: Arithmetic, value: Any) -> Scalar:
    return int(value) if value.is_Integer else ops.constant(value)


@kernel_factory(group=as_group)
def rkmk4_step(group: GroupLike, name: str = "rkmk4_step") -> Kernel:
    """One step of X' = X hat(u): (X, u0, um, u1, h) -> X_next, for `scan`.

    u0, um, u1 are u at t, t + h/2, t + h; exact on the group, global error O(h^4); |h u| <= 1/4 keeps the
    exponential exact to rounding. Munthe-Kaas, BIT 38 (1998) 92.

    Args:
        group: object, catalogue name or file.
        name: C identifier.

    Raises:
        UnknownGroupError: no such group.
        IdentifierError: name is no C identifier.
    """

    group = as_group(group, "rkmk4_step")

    def body(ops: Arithmetic, X: Any, u0: Any, um: Any, u1: Any, h: Any) -> tuple[Any, ...]:
        return (times_taylor_exp(group, ops, X, rkmk4_increment(group, ops, u0, um, u1, h)),)

    formula = "X_next = X exp(Theta), Theta by one RKMK4 step of Theta' = dexpinv(u)"
    return flow_step(group, name, body, formula, "Munthe-Kaas, BIT 38 (1998) 92")


def flow_step(group: MatrixGroup, name: str, body: Body, formula: str, source: str) -> Kernel:
    """The kernel of a step (X, u0, um, u1, h) -> X_next of X' = X hat(u), u at t, t + h/2 and t + h."""
    n, d = group.dim, group.degree
    data = WeiNormanData(group)

    def sampler(rng: random.Random) -> tuple[Any, ...]:
        X = product_exp(FloatArithmetic(), data, [rng.uniform(-1, 1) for _ in range(n)])
        return (X, *([rng.uniform(-1, 1) for _ in range(n)] for _ in range(3)), rng.uniform(0, 0.1))

    return Kernel(
        name=name,
        namespace=group.name,
        inputs=(
            Port("X", (d, d), is_complex=group.is_complex),
            *(Port(each, (n,)) for each in ("u0", "um", "u1")),
            Port("h", (), "s"),
        ),
        outputs=(Port("X_next", (d, d), is_complex=group.is_complex),),
        body=body,
        formula=formula,
        source=source,
        sampler=sampler,
    )


@kernel_factory(group=as_group)
def wei_norman_step(group: GroupLike, name: str = "wei_norman_step") -> Kernel:
    """One classical RK4 step of g' = M(g) u: (g, u0, um, u1, h) -> g_next, for `scan`; TR 93-59, (12)-(15).

    u0, um, u1 are u at t, t + h/2, t + h.

    Args:
        group: object, catalogue name or file.
        name: C identifier.

    Raises:
        UnknownGroupError: no such group.
        IdentifierError: name is no C identifier.
    """
    group = as_group(group, "wei_norman_step")
    n = group.dim
    data = WeiNormanData(group)

    def body(ops: Arithmetic, g: Any, u0: Any, um: Any, u1: Any, h: Any) -> tuple[Any, ...]:
        def slope(c: float, change: Vector) -> Vector:
            return rate(ops, data, plus(g, change), {0.0: u0, 0.5: um, 1.0: u1}[c])

        return (plus(g, increment(vectors(ops), CLASSICAL, slope, [0] * n, h)),)

    return Kernel(
        name=name,
        namespace=group.name,
        inputs=(Port("g", (n,)), *(Port(name, (n,)) for name in ("u0", "um", "u1")), Port("h", (), "s")),
        outputs=(Port("g_next", (n,)),),
        body=body,
        formula="one RK4 step of g' = M(g) u",
        source="Wei and Norman, Proc. AMS 15 (1964) 327; Leonard and Krishnaprasad, TR 93-59, (12)-(15)",
        sampler=lambda rng: (*([rng.uniform(-0.3, 0.3) for _ in range(n)] for _ in range(4)), rng.uniform(0, 0.1)),
    )
