"""One step of a mechanical system on a group: X' = X hat(xi), I xi' = ad*_xi I xi + f(t, X, xi), to fourth order.

The state is the varying entries of X followed by xi, and by controller states if there are any, as one vector, so that
`scan` and `batch` take it. Munthe-Kaas, BIT 38 (1998) 92.
"""

from __future__ import annotations

import random
from typing import Any

from lie_codegen.control.disturbance import ForceBody as ForceBody
from lie_codegen.control.loop_kernels import loop_step
from lie_codegen.control.loop_model import loop_model
from lie_codegen.control.loop_ports import read_law
from lie_codegen.control.plants import group_plant
from lie_codegen.control.reference_motion import Reference
from lie_codegen.errors import InputError
from lie_codegen.exact.positive_matrix import positive_matrix
from lie_codegen.flow.product_step import Move, product_step
from lie_codegen.groups.derivation import derivation_of
from lie_codegen.groups.maps.element_pattern import pack, packed_size, unpack
from lie_codegen.groups.maps.matrices import random_element
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.groups.units import force_units
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.definition import kernel_factory
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.linear import Vector, constant_matrix
from lie_codegen.mechanics.kernels import acceleration


def check_loop(law: Kernel | None, reference: Reference | None) -> None:
    """A law that can be simulated, with the reference it needs.

    Raises:
        InputError: one of its inputs is of no kind (see `loop_ports`), or it lacks its reference.
    """
    read = read_law(law)
    if read is not None and read.has("reference") and reference is None:
        raise InputError(f"the law {read.kernel.name} tracks: give it a reference")


@kernel_factory()
def second_order_step(
    group: MatrixGroup,
    inertia: Any,
    force: ForceBody | None = None,
    *,
    law: Kernel | None = None,
    name: str = "second_order_step",
) -> Kernel:
    """The step (state, t, h) -> (state_next,).

    Under a tracking law the step takes the reference as inputs too: (X_d, xi_d, xi_d_dot) at t, t + h/2 and t + h, in
    arrays of three rows, X_d flat; so it is evaluated once for any number of runs.

    Args:
        group: any matrix group.
        inertia: symmetric positive definite; or "input": then `inertia` and `inertia_inverse`, (n, n), are inputs, so that
            one library serves every body.
        force: body force beside the law; None for none.
        law: an attitude or tracking law; None for none. Parameters of the law that are inputs become inputs of the step;
            its `inertia` is that of the body if that is an input too.
        name: C identifier.

    Raises:
        InputError: the inertia is not symmetric positive definite, or the law has an input of no kind.
    """
    read = read_law(law)
    moving = read is not None and read.has("reference")
    return loop_step(loop_model(group_plant(group, inertia), law, moving=moving, external=force), name)


@kernel_factory()
def held_force_step(group: MatrixGroup, inertia: Any, name: str = "held_force_step") -> Kernel:
    """The step (state, force, h) -> (state_next,) under a constant body force, as a sampled controller gives it.

    Raises:
        InputError: the inertia is not symmetric positive definite.
    """
    metric = positive_matrix(inertia, group.dim, "inertia")
    size, move = packed_size(group), Move(group)

    def body(ops: Arithmetic, state: Vector, force: Vector, h: Scalar) -> tuple[Any, ...]:
        X, xi = unpack(group, state[:size]), list(state[size:])
        inertia = constant_matrix(ops, metric), constant_matrix(ops, metric.inv())

        def rates(_: int, __: Scalar, ___: list[Any], eta: Vector) -> tuple[list[Vector], Vector]:
            return [eta], acceleration(ops, group, *inertia, eta, list(force))

        [Y], eta = product_step(ops, [move], [X], xi, rates, 0, h)
        return ([*pack(group, Y), *eta],)

    data = derivation_of(group).wei_norman

    def sampler(rng: random.Random) -> tuple[Any, ...]:
        xi, force = ([rng.uniform(-1, 1) for _ in range(group.dim)] for _ in range(2))
        return [*pack(group, random_element(group, data, rng)), *xi], force, rng.uniform(0, 0.05)

    port = (size + group.dim,)
    return Kernel(
        name=name,
        namespace=group.name,
        inputs=(
            Port("state", port, description="varying entries of X, row by row, then xi"),
            Port("force", (group.dim,), force_units(group), description="body force, constant over the step"),
            Port("h", (), "s"),
        ),
        outputs=(Port("state_next", port),),
        body=body,
        formula="X' = X hat(xi), I xi' = ad*_xi I xi + f with constant f: one RKMK4 step",
        source="Munthe-Kaas, BIT 38 (1998) 92; Bullo and Murray, CIT-CDS 97-003, (10)",
        sampler=sampler,
    )
