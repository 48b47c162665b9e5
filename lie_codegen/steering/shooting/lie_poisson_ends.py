"""Where a start of the shooting solver ends, beside its target: what Gauss-Newton and the seeds need."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from lie_codegen.groups.maps.element_pattern import pack, packed_size, unpack
from lie_codegen.groups.maps.rkmk import hat_body, times_taylor_exp
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.brackets import dexp_inverse
from lie_codegen.kernel.complex_scalar import Complex
from lie_codegen.kernel.definition import kernel_factory
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.linear import dot, matmul, matvec, plus

#: Taylor degree of the exponential in the seed's logarithm, for |theta| below 1.
SEED_EXPONENTIAL_DEGREE = 8


@kernel_factory()
def endpoint(group: MatrixGroup) -> Kernel:
    """(target, X) -> (F, q, G) with r = X - target: F = |r|^2, q_k = <X A_k, r>, G_kl = <X A_k, X A_l>.

    What Gauss-Newton needs, in the entries' Euclidean metric. F vanishes at the target alone (on SO(3) the skew part of
    target^-1 X also vanishes at half a turn from it), and no inverse is taken.
    """
    n, size = group.dim, packed_size(group)

    def body(ops: Arithmetic, target: Any, X: Any) -> tuple[Any, ...]:
        r = [x - goal for x, goal in zip(X, target, strict=True)]
        moves = right_moves(group, ops, X)
        q = [dot(move, r) for move in moves]
        G = [[dot(moves[max(k, j)], moves[min(k, j)]) for j in range(n)] for k in range(n)]
        return dot(r, r), q, G

    return Kernel(
        "endpoint",
        group.name,
        (Port("target", (size,)), Port("X", (size,))),
        (Port("F", ()), Port("q", (n,)), Port("G", (n, n))),
        body,
        formula="r = X - target, F = |r|^2, q_k = <X A_k, r>, G_kl = <X A_k, X A_l>",
    )


def right_moves(group: MatrixGroup, ops: Arithmetic, X: Sequence[Scalar]) -> list[list[Scalar]]:
    """X A_k, packed, for each k, from X packed."""
    matrix = unpack(group, X)
    units = [[1 if j == k else 0 for j in range(group.dim)] for k in range(group.dim)]
    return [pack(group, matmul(matrix, hat_body(group, ops, unit))) for unit in units]


@kernel_factory()
def advance(group: MatrixGroup) -> Kernel:
    """(X, theta) -> X exp(hat(theta)) by a Taylor polynomial, for small theta."""
    size = packed_size(group)

    def body(ops: Arithmetic, X: Any, theta: Any) -> tuple[Any, ...]:
        return (pack(group, times_taylor_exp(group, ops, unpack(group, X), theta, SEED_EXPONENTIAL_DEGREE)),)

    return Kernel(
        "advance",
        group.name,
        (Port("X", (size,)), Port("theta", (group.dim,))),
        (Port("X_next", (size,)),),
        body,
        formula="X_next = X exp(hat(theta)), Taylor",
    )


@kernel_factory()
def offset(group: MatrixGroup) -> Kernel:
    """X -> coordinates of X - I, projected on the algebra (Frobenius)."""
    d = group.degree
    weights = group.coordinate_rows

    def body(ops: Arithmetic, X: Any) -> tuple[Any, ...]:
        matrix = unpack(group, X)
        entries = [Complex.of(_minus(matrix[i][j], 1 if i == j else 0)) for i in range(d) for j in range(d)]
        parts = [entry.re for entry in entries] + [entry.im for entry in entries]
        rows = [[ops.constant(float(w)) if abs(w) > 1e-14 else 0 for w in row] for row in weights]
        return (matvec(rows, parts),)

    return Kernel(
        "offset",
        group.name,
        (Port("X", (packed_size(group),)),),
        (Port("x", (group.dim,)),),
        body,
        formula="x = vee of the projection of X - I on the algebra",
    )


@kernel_factory()
def correction(group: MatrixGroup) -> Kernel:
    """(x, y) -> z with exp(x) exp(y) = exp(z) to first order in y: z = x + y + [x, y] / 2 + [x, [x, y]] / 12."""
    n = group.dim

    def body(ops: Arithmetic, x: Any, y: Any) -> tuple[Any, ...]:
        return (plus(x, dexp_inverse(ops, group.algebra, x, y)),)

    return Kernel(
        "correction",
        group.name,
        (Port("x", (n,)), Port("y", (n,))),
        (Port("z", (n,)),),
        body,
        formula="z = x + y + [x, y] / 2 + [x, [x, y]] / 12",
    )


def _minus(value: Any, number: int) -> Any:
    return value - number if number else value
