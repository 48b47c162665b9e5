"""Mechanics on a group as kernels: xi' of the Euler-Poincare equations, energy, and momentum in space."""

from __future__ import annotations

import random
from collections.abc import Sequence
from typing import Any

from lie_codegen.exact.positive_matrix import positive_matrix
from lie_codegen.groups.catalogue_load import GroupLike, as_group
from lie_codegen.groups.derivation import derivation_of
from lie_codegen.groups.maps.matrices import GroupMatrices, matrix_port, random_element, velocity_units
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.groups.units import force_units
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.brackets import ad_star
from lie_codegen.kernel.definition import kernel_factory
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.linear import Matrix, Vector, constant_matrix, dot, matvec, plus
from lie_codegen.on_demand import sympy as sp


def acceleration_body(
    ops: Arithmetic, group: MatrixGroup, inertia: sp.MatrixBase, xi: Sequence[Scalar], force: Sequence[Scalar]
) -> Vector:
    """I^{-1}(ad*_xi I xi + f)."""
    return acceleration(ops, group, constant_matrix(ops, inertia), constant_matrix(ops, inertia.inv()), xi, force)


def acceleration(
    ops: Arithmetic, group: MatrixGroup, metric: Matrix, inverse: Matrix, xi: Sequence[Scalar], force: Sequence[Scalar]
) -> Vector:
    """The same from the scalars of I and of I^{-1}."""
    momentum = matvec(metric, xi)
    return matvec(inverse, plus(ad_star(ops, group.algebra, xi, momentum), force))


@kernel_factory(group=as_group)
def euler_poincare_kernel(group: GroupLike, inertia: Any, name: str = "acceleration") -> Kernel:
    """(xi, force) -> (xi_dot, energy): I xi' = ad*_xi I xi + f and <I xi, xi>/2; Bullo and Murray, CIT-CDS 97-003, (10).

    Args:
        group: object, catalogue name or file.
        inertia: symmetric positive definite: a number, (n,) or (n, n).
        name: C identifier.

    Raises:
        InputError: the inertia is not symmetric positive definite.
    """
    group = as_group(group, "euler_poincare_kernel")
    metric = positive_matrix(inertia, group.dim, "inertia")

    def body(ops: Arithmetic, xi: Vector, force: Vector) -> tuple[Any, ...]:
        energy = dot(matvec(constant_matrix(ops, metric), xi), xi) / 2
        return acceleration_body(ops, group, metric, xi, force), energy

    return Kernel(
        name=name,
        namespace=group.name,
        inputs=(
            Port("xi", (group.dim,), velocity_units(group), description="body velocity"),
            Port("force", (group.dim,), force_units(group), description="body force"),
        ),
        outputs=(Port("xi_dot", (group.dim,), velocity_units(group, "s^2")), Port("energy", (), "J")),
        body=body,
        formula="I xi' = ad*_xi I xi + f",
        source="Bullo and Murray, CIT-CDS 97-003, (10)",
    )


@kernel_factory(group=as_group)
def spatial_momentum_kernel(group: GroupLike, inertia: Any, name: str = "spatial_momentum") -> Kernel:
    """(X, xi) -> Ad*_{X^-1} I xi, which a free body keeps.

    Args:
        group: object, catalogue name or file.
        inertia: symmetric positive definite: a number, (n,) or (n, n).
        name: C identifier.

    Raises:
        InputError: the inertia is not symmetric positive definite.
    """
    group = as_group(group, "spatial_momentum_kernel")
    metric = positive_matrix(inertia, group.dim, "inertia")
    real, data = derivation_of(group).real, derivation_of(group).wei_norman

    def body(ops: Arithmetic, X: Any, xi: Vector) -> tuple[Any, ...]:
        matrices = GroupMatrices(ops, real)
        element = matrices.read(X)
        return (coadjoint(matrices, matrices.inverse(element), element, matvec(constant_matrix(ops, metric), xi)),)

    def sampler(rng: random.Random) -> tuple[Any, ...]:
        return random_element(group, data, rng), [rng.uniform(-1, 1) for _ in range(group.dim)]

    return Kernel(
        name=name,
        namespace=group.name,
        inputs=(matrix_port(group, "X"), Port("xi", (group.dim,), velocity_units(group))),
        outputs=(Port("momentum", (group.dim,)),),
        body=body,
        formula="p = Ad*_{X^-1} I xi; constant without forces",
        source="Marsden and Ratiu as cited by Bullo and Murray, CIT-CDS 97-003, section 2.3",
        sampler=sampler,
    )


def coadjoint(matrices: GroupMatrices, X: Any, X_inverse: Any, momentum: Sequence[Scalar]) -> Vector:
    """Ad*_X p: <Ad*_X p, y> = <p, Ad_X y>."""
    n = matrices.real.group.dim
    return [dot(momentum, matrices.Ad(X, X_inverse, [int(a == b) for b in range(n)])) for a in range(n)]
