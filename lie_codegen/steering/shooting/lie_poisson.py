"""The extremals of minimum-energy steering, piece by piece, as the kernels that the shooting solver loops over.

    minimise 1/2 int_0^1 sum_i w_i u_i^2 dt   subject to   X' = X sum_i u_i A_i,  X(0) = I,  X(1) = target

Pontryagin: u_i = <mu, A_i> / w_i, mu' = ad*_u mu, that is mu'_j = sum_i u_i c[i, j, k] mu_k (Lie-Poisson). With
Psi = d mu / d mu(0) and Xi = vee(X^-1 dX / d mu(0)), column by column,
    psi'_j = sum_i (du_i c[i, j, k] mu_k + u_i c[i, j, k] psi_k),   xi' = du + [xi, u],   du_i = psi_i / w_i.
Everything is a polynomial, so that the same text runs on one double or on a vector of them.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

from lie_codegen.groups.maps.element_pattern import pack, packed_size, unpack
from lie_codegen.groups.maps.rkmk import hat_body
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.brackets import ad_star, bracket
from lie_codegen.kernel.definition import kernel_factory
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.linear import matmul, plus
from lie_codegen.kernel.runge_kutta import CLASSICAL, HALF_WAY, combined, increment, vectors
from lie_codegen.kernel.structural_zeros import add
from lie_codegen.steering.shooting.lie_poisson_ends import advance, correction, endpoint, offset


@kernel_factory()
def shooting_kernels(group: MatrixGroup, controls: tuple[int, ...]) -> tuple[Kernel, ...]:
    """All that the shooting solver needs to know about a group; elements of the group are packed."""
    return (
        costate_step(group, controls),
        path_step(group, controls),
        leap(group, controls),
        flow_step(group, controls),
        column_step(group, controls),
        endpoint(group),
        advance(group),
        offset(group),
        correction(group),
    )


@kernel_factory()
def transport(group: MatrixGroup, controls: tuple[int, ...]) -> Kernel:
    """(u, mu, X) -> (ad*_u mu, X hat(u)): bilinear in u and (mu, X)."""

    def body(ops: Arithmetic, u: Any, mu: Any, X: Any) -> tuple[Any, ...]:
        return _coadjoint(group, controls, ops, u, mu), _moving(group, controls, ops, u, X)

    return Kernel(
        "transport",
        group.name,
        (Port("u", (len(controls),)), Port("mu", (group.dim,)), Port("X", (packed_size(group),))),
        (Port("mu_rate", (group.dim,)), Port("X_rate", (packed_size(group),))),
        body,
        formula="mu' = ad*_u mu, X' = X hat(u)",
    )


@kernel_factory()
def costate_step(group: MatrixGroup, controls: tuple[int, ...]) -> Kernel:
    """(u at the start, in the middle and at the end, mu) -> mu in the middle (third order) and at the end of a step.

    Classical Runge-Kutta with its dense output; the controls are given and multiplied by h.
    """
    n, m = group.dim, len(controls)

    def body(ops: Arithmetic, u0: Any, u1: Any, u2: Any, mu: Any) -> tuple[Any, ...]:
        slopes: list[list[Scalar]] = []

        def rate(c: float, y: Sequence[Scalar]) -> list[Scalar]:
            slopes.append(_coadjoint(group, controls, ops, {0.0: u0, 0.5: u1, 1.0: u2}[c], y))
            return slopes[-1]

        after = _runge_kutta(ops, rate, mu)
        return plus(mu, combined(vectors(ops), HALF_WAY, slopes, 1)), after

    return Kernel(
        "costate_step",
        group.name,
        (*(Port(name, (m,)) for name in ("u0", "u1", "u2")), Port("mu", (n,))),
        (Port("mu_middle", (n,)), Port("mu_next", (n,))),
        body,
        formula="a Runge-Kutta step of mu' = ad*_u mu, and mu half way",
    )


@kernel_factory()
def path_step(group: MatrixGroup, controls: tuple[int, ...]) -> Kernel:
    """(u at the start, in the middle and at the end, X) -> X after a Runge-Kutta step of X' = X hat(u)."""
    size, m = packed_size(group), len(controls)

    def body(ops: Arithmetic, u0: Any, u1: Any, u2: Any, X: Any) -> tuple[Any, ...]:
        u = {0.0: u0, 0.5: u1, 1.0: u2}
        return (_runge_kutta(ops, lambda c, Y: _moving(group, controls, ops, u[c], Y), X),)

    return Kernel(
        "path_step",
        group.name,
        (*(Port(name, (m,)) for name in ("u0", "u1", "u2")), Port("X", (size,))),
        (Port("X_next", (size,)),),
        body,
        formula="a Runge-Kutta step of X' = X hat(u)",
    )


@kernel_factory()
def leap(group: MatrixGroup, controls: tuple[int, ...]) -> Kernel:
    """(v, before, here) -> before + 2 h f(here) for (mu, X), where v_i = 2 h / w_i: a substep of the midpoint rule."""
    n, size = group.dim, packed_size(group)

    def body(ops: Arithmetic, v: Any, mu_before: Any, X_before: Any, mu: Any, X: Any) -> tuple[Any, ...]:
        mu_rate, X_rate = _rates(group, controls, ops, v, mu, X)
        return plus(mu_before, mu_rate), plus(X_before, X_rate)

    return Kernel(
        "leap",
        group.name,
        (
            Port("v", (len(controls),)),
            Port("mu_before", (n,)),
            Port("X_before", (size,)),
            Port("mu", (n,)),
            Port("X", (size,)),
        ),
        (Port("mu_next", (n,)), Port("X_next", (size,))),
        body,
        formula="before + 2 h f(here), v_i = 2 h / w_i",
    )


@kernel_factory()
def flow_step(group: MatrixGroup, controls: tuple[int, ...]) -> Kernel:
    """(v, mu, X) -> (mu, X) after a classical Runge-Kutta step h, where v_i = h / w_i."""
    n, size = group.dim, packed_size(group)

    def body(ops: Arithmetic, v: Any, mu: Any, X: Any) -> tuple[Any, ...]:
        def rate(_: float, state: Sequence[Scalar]) -> list[Scalar]:
            mu_rate, X_rate = _rates(group, controls, ops, v, state[:n], state[n:])
            return [*mu_rate, *X_rate]

        after = _runge_kutta(ops, rate, [*mu, *X])
        return after[:n], after[n:]

    return Kernel(
        "flow_step",
        group.name,
        (Port("v", (len(controls),)), Port("mu", (n,)), Port("X", (size,))),
        (Port("mu_next", (n,)), Port("X_next", (size,))),
        body,
        formula="a Runge-Kutta step h of mu' = ad*_u mu, X' = X hat(u); v_i = h / w_i",
    )


@kernel_factory()
def column_step(group: MatrixGroup, controls: tuple[int, ...]) -> Kernel:
    """One column of the variational equations over a Runge-Kutta step h, where v_i = h / w_i.

    (v, mu at the start, in the middle and at the end, psi, xi) -> (psi, xi):
    psi' = ad*_du mu + ad*_u psi, xi' = du + [xi, u], du_i = psi_i / w_i.
    """
    n, m = group.dim, len(controls)

    def body(ops: Arithmetic, v: Any, mu0: Any, mu1: Any, mu2: Any, psi: Any, xi: Any) -> tuple[Any, ...]:
        nodes = {c: (_velocity(controls, v, mu), mu) for c, mu in ((0.0, mu0), (0.5, mu1), (1.0, mu2))}

        def rate(c: float, state: Sequence[Scalar]) -> list[Scalar]:
            (u, mu), psi, xi = nodes[c], state[:n], state[n:]
            du = _velocity(controls, v, psi)
            psi_rate = plus(_coadjoint(group, controls, ops, du, mu), _coadjoint(group, controls, ops, u, psi))
            xi_rate = bracket(ops, group.algebra, xi, _spread(group, controls, u))
            for value, position in zip(du, controls, strict=True):
                xi_rate[position] = add(value, xi_rate[position])
            return [*psi_rate, *xi_rate]

        after = _runge_kutta(ops, rate, [*psi, *xi])
        return after[:n], after[n:]

    return Kernel(
        "column_step",
        group.name,
        (Port("v", (m,)), *(Port(name, (n,)) for name in ("mu0", "mu1", "mu2", "psi", "xi"))),
        (Port("psi_next", (n,)), Port("xi_next", (n,))),
        body,
        formula="a Runge-Kutta step h of psi' = ad*_du mu + ad*_u psi, xi' = du + [xi, u]; v_i = h / w_i",
    )


def _runge_kutta(
    ops: Arithmetic, rate: Callable[[float, list[Scalar]], list[Scalar]], y: Sequence[Scalar]
) -> list[Scalar]:
    """y after one classical step; rate(c, y) is h f at the time c h."""
    return plus(y, increment(vectors(ops), CLASSICAL, lambda c, change: rate(c, plus(y, change)), [0] * len(y), 1))


def _rates(
    group: MatrixGroup, controls: tuple[int, ...], ops: Arithmetic, v: Any, mu: Sequence[Scalar], X: Sequence[Scalar]
) -> tuple[list[Scalar], list[Any]]:
    """h times the rates of mu and X."""
    u = _velocity(controls, v, mu)
    return _coadjoint(group, controls, ops, u, mu), _moving(group, controls, ops, u, X)


def _velocity(controls: tuple[int, ...], v: Sequence[Scalar], mu: Sequence[Scalar]) -> list[Scalar]:
    return [factor * mu[position] for factor, position in zip(v, controls, strict=True)]


def _coadjoint(
    group: MatrixGroup, controls: tuple[int, ...], ops: Arithmetic, u: Sequence[Scalar], mu: Sequence[Scalar]
) -> list[Scalar]:
    return ad_star(ops, group.algebra, _spread(group, controls, u), mu)


def _moving(group: MatrixGroup, controls: tuple[int, ...], ops: Arithmetic, u: Sequence[Scalar], X: Any) -> list[Any]:
    return pack(group, matmul(unpack(group, X), hat_body(group, ops, _spread(group, controls, u))))


def _spread(group: MatrixGroup, controls: tuple[int, ...], u: Sequence[Scalar]) -> list[Scalar]:
    full: list[Scalar] = [0] * group.dim
    for value, position in zip(u, controls, strict=True):
        full[position] = value
    return full
