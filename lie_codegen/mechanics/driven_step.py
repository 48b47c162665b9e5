"""One step of a mechanical system on a group under a wrench given in time: X' = X hat(xi), J xi' = ad*_xi J xi + f(t).

J is an input, so that one compiled step, and one nonlinear program, serve every inertia. `second_order_step` is for forces
that depend on the state.
"""

from __future__ import annotations

import random
from typing import Any

from lie_codegen.groups.catalogue_load import GroupLike, as_group
from lie_codegen.groups.derivation import derivation_of
from lie_codegen.groups.maps.element_pattern import pack, packed_size, unpack
from lie_codegen.groups.maps.matrices import random_element
from lie_codegen.groups.maps.rkmk import TAYLOR_DEGREE, times_taylor_exp
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.groups.units import force_units
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.brackets import ad_star, dexp_inverse
from lie_codegen.kernel.definition import kernel_factory
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.linear import Matrix, Vector, matvec, plus
from lie_codegen.kernel.runge_kutta import CLASSICAL, increment, vectors


def driven_increments(
    group: MatrixGroup,
    ops: Arithmetic,
    xi: Vector,
    J: Matrix,
    inverse: Matrix,
    f0: Vector,
    fm: Vector,
    f1: Vector,
    h: Scalar,
) -> tuple[Vector, Vector]:
    """Theta and the change of xi with X_next = X exp(Theta): one RKMK4 step of Theta' = dexpinv(xi), J xi' = ad*_xi J xi + f."""

    n = group.dim

    def rate(c: float, moved: Vector) -> Vector:
        theta, eta, force = moved[:n], plus(xi, moved[n:]), {0.0: f0, 0.5: fm, 1.0: f1}[c]
        turning = ad_star(ops, group.algebra, eta, matvec(J, eta))
        return [*dexp_inverse(ops, group.algebra, theta, eta), *matvec(inverse, plus(turning, force))]

    total = increment(vectors(ops), CLASSICAL, rate, [0] * (2 * n), h)
    return total[:n], total[n:]


@kernel_factory(group=as_group)
def driven_step(group: GroupLike, degree: int = TAYLOR_DEGREE, name: str = "driven_step") -> Kernel:
    """(state, inertia, inverse, f0, fm, f1, h) -> (state_next,): fourth order, on the group for |h xi| <= 1/4.

    The state is the varying entries of X, then xi; f0, fm, f1 are the body force at t, t + h/2, t + h. Munthe-Kaas,
    BIT 38 (1998) 92.

    Args:
        group: any matrix group.
        degree: of the Taylor polynomial of the exponential.
        name: C identifier.

    Raises:
        UnknownGroupError: no such group.
        IdentifierError: name is no C identifier.
    """
    group = as_group(group, "driven_step")
    n, size = group.dim, packed_size(group)

    def body(
        ops: Arithmetic, state: Vector, J: Matrix, inverse: Matrix, f0: Vector, fm: Vector, f1: Vector, h: Scalar
    ) -> tuple[Any, ...]:
        X, xi = unpack(group, state[:size]), list(state[size:])
        theta, change = driven_increments(group, ops, xi, J, inverse, f0, fm, f1, h)
        return ([*pack(group, times_taylor_exp(group, ops, X, theta, degree)), *plus(xi, change)],)

    data = derivation_of(group).wei_norman

    def sampler(rng: random.Random) -> tuple[Any, ...]:
        def vector() -> Vector:
            return [rng.uniform(-1, 1) for _ in range(n)]

        diagonal = [rng.uniform(1, 2) for _ in range(n)]
        J = [[diagonal[i] if i == j else 0.0 for j in range(n)] for i in range(n)]
        inverse = [[1 / diagonal[i] if i == j else 0.0 for j in range(n)] for i in range(n)]
        state = [*pack(group, random_element(group, data, rng)), *vector()]
        return state, J, inverse, vector(), vector(), vector(), rng.uniform(0, 0.05)

    forces = (("f0", "t"), ("fm", "t + h/2"), ("f1", "t + h"))
    return Kernel(
        name=name,
        namespace=group.name,
        inputs=(
            Port("state", (size + n,), description="varying entries of X, row by row, then xi"),
            Port("inertia", (n, n), description="symmetric positive definite"),
            Port("inverse", (n, n), description="of the inertia"),
            *(Port(name, (n,), force_units(group), description=f"body force at {when}") for name, when in forces),
            Port("h", (), "s"),
        ),
        outputs=(Port("state_next", (size + n,)),),
        body=body,
        formula="X' = X hat(xi), J xi' = ad*_xi J xi + f(t): one RKMK4 step",
        source="Munthe-Kaas, BIT 38 (1998) 92; Bullo and Murray, CIT-CDS 97-003, (10)",
        sampler=sampler,
    )
