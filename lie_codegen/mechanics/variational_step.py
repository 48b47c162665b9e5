"""A variational integrator on matrix groups: second order, symplectic, and it keeps the spatial momentum to rounding.

    mu + h f/2 = (dcay^{-1}_{h xi})^* I xi,   X_next = X cay(h xi),   mu_next = Ad*_{cay(h xi)} (mu + h f/2) + h
    f_next/2

with mu the body momentum, f(X) a force of position, cay(x) = (1 - x/2)^{-1}(1 + x/2) and dcay^{-1}_x y = (1 - x/2) y
(1 + x/2). The implicit equation is solved by Newton's method; the momentum is then transported by Ad* itself, so
that Ad*_{X^{-1}} mu is kept whatever the solver left over. For groups whose algebra holds x y x with every x and y:
SO(n), SE(n), SL(2), SU(2). Kobilarov and Marsden, IEEE Trans. Robotics 27 (2011) 641.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from typing import Any

from lie_codegen.errors import InputError
from lie_codegen.exact.positive_matrix import positive_matrix
from lie_codegen.groups.catalogue_load import GroupLike, as_group
from lie_codegen.groups.derivation import derivation_of
from lie_codegen.groups.maps.element_pattern import pack, packed_size, unpack
from lie_codegen.groups.maps.matrices import GroupMatrices, random_element
from lie_codegen.groups.matrix_pattern import RealMatrices
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.block_solve import solve
from lie_codegen.kernel.definition import kernel_factory
from lie_codegen.kernel.dual import DualArithmetic, tangent_of, value_of
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.linear import (
    Matrix,
    Vector,
    constant_matrix,
    dot,
    identity,
    matadd,
    matmul,
    matvec,
    plus,
    scaled,
)
from lie_codegen.kernel.small_inverse import inverse
from lie_codegen.kernel.structural_zeros import is_zero, product
from lie_codegen.mechanics.kernels import coadjoint
from lie_codegen.on_demand import sympy as sp

_NEWTON = 3

#: (ops, X) -> (n,) body force of a potential.
PotentialForce = Callable[[Arithmetic, Any], Vector]


@kernel_factory(group=as_group)
def variational_step(
    group: GroupLike, inertia: Any, force: PotentialForce | None = None, name: str = "variational_step"
) -> Kernel:
    """The step (state, h) -> (state_next, energy); the state is the varying entries of X, then the body momentum mu.

    Args:
        group: a group whose algebra holds x y x.
        inertia: symmetric positive definite.
        force: -d_1 V, body force of a potential V(X); None for a free body.
        name: C identifier.

    Raises:
        InputError: the inertia is not positive definite, or the Cayley map leaves the group.
    """
    group = as_group(group, "variational_step")
    metric = positive_matrix(inertia, group.dim, "inertia")
    real = derivation_of(group).real
    check_cayley(real)
    size = packed_size(group)

    def body(ops: Arithmetic, state: Vector, h: Scalar) -> tuple[Any, ...]:
        matrices = GroupMatrices(ops, real)
        port_X, mu = unpack(group, state[:size]), list(state[size:])
        half = h / 2
        pushed = mu if force is None else plus(mu, scaled(half, force(ops, port_X)))
        xi = _solved(ops, real, metric, pushed, h)
        turn = cayley(matrices, scaled(h, xi))
        X = matrices.write(matmul(matrices.read(port_X), turn))
        moved = coadjoint(matrices, turn, cayley(matrices, scaled(-h, xi)), pushed)
        arrived = moved if force is None else plus(moved, scaled(half, force(ops, X)))
        raised = matvec(constant_matrix(ops, metric.inv()), arrived)
        return [*pack(group, X), *arrived], dot(raised, arrived) / 2

    data = derivation_of(group).wei_norman

    def sampler(rng: random.Random) -> tuple[Any, ...]:
        momentum = [rng.uniform(-1, 1) for _ in range(group.dim)]
        return [*pack(group, random_element(group, data, rng)), *momentum], rng.uniform(0.01, 0.05)

    port = (size + group.dim,)
    return Kernel(
        name=name,
        namespace=group.name,
        inputs=(Port("state", port, description="varying entries of X, then body momentum"), Port("h", (), "s")),
        outputs=(Port("state_next", port), Port("energy", (), "J", description="kinetic, <mu, I^-1 mu>/2")),
        body=body,
        formula="mu = (dcay^-1_{h xi})* I xi, X_next = X cay(h xi), mu_next = Ad*_{cay(h xi)} mu",
        source="Kobilarov and Marsden, IEEE Trans. Robotics 27 (2011) 641",
        sampler=sampler,
    )


def check_cayley(real: RealMatrices) -> None:
    """The Cayley map stays on the group: x y x is in the algebra for all x, y, decided exactly.

    Raises:
        InputError: it does not; names a pair.
    """
    n = real.group.dim
    for i in range(n):
        for k in range(i, n):
            for j in range(n):
                A, B, C = real.basis[i], real.basis[j], real.basis[k]
                value = A * B * C + C * B * A
                x = [sum((c * value[place] for place, c in row.items()), sp.S.Zero) for row in real.coordinates]
                inside = sum((a * m for a, m in zip(x, real.basis, strict=True)), sp.zeros(real.size, real.size))
                if (value - inside).expand() != sp.zeros(real.size, real.size):
                    labels = real.group.labels
                    raise InputError(
                        f"{real.group.name}: the Cayley map leaves the group ({labels[i]} {labels[j]} {labels[k]} is not in "
                        "the algebra), so this variational integrator does not apply; use second_order_step"
                    )


def cayley(matrices: GroupMatrices, x: Sequence[Scalar]) -> Matrix:
    """(1 - x/2)^{-1}(1 + x/2)."""
    half = matrices.hat([product(entry, matrices.ops.constant(sp.Rational(1, 2))) for entry in x])
    one = identity(matrices.real.size)
    return matmul(inverse(matrices.ops, matadd(one, half, -1)), matadd(one, half))


def _momentum(ops: Arithmetic, real: RealMatrices, metric: sp.MatrixBase, xi: Vector, h: Scalar) -> Vector:
    """(dcay^{-1}_{h xi})^* I xi."""
    matrices = GroupMatrices(ops, real)
    half = matrices.hat(scaled(h / 2, xi))
    one = identity(real.size)
    before, after = matadd(one, half, -1), matadd(one, half)
    lowered = matvec(constant_matrix(ops, metric), xi)
    result = []
    for basis in real.basis:
        moved = matmul(before, matmul(constant_matrix(ops, basis), after))
        result.append(dot(lowered, matrices.vee(moved)))
    return result


def _solved(ops: Arithmetic, real: RealMatrices, metric: sp.MatrixBase, target: Vector, h: Scalar) -> Vector:
    """The xi with momentum `target`, by Newton's method from I^{-1} target."""
    n = real.group.dim
    xi = matvec(constant_matrix(ops, metric.inv()), target)
    dual = DualArithmetic(ops)
    for _ in range(_NEWTON):
        moving = [dual.variable(x, {k: 1}) for k, x in enumerate(xi)]
        value = _momentum(dual, real, metric, moving, h)
        rows = [[tangent_of(entry, k, dual.level) for k in range(n)] for entry in value]
        sparse = {(i, k): rows[i][k] for i in range(n) for k in range(n) if not is_zero(rows[i][k])}
        residual = {i: t - value_of(v, dual.level) for i, (t, v) in enumerate(zip(target, value, strict=True))}
        [change] = solve(sparse, [residual], n)
        xi = [x + change.get(i, 0) for i, x in enumerate(xi)]
    return xi
