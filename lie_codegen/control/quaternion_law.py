"""Attitude tracking from everywhere with the quaternion in memory: one bit beside what X says, and hysteresis.

    E = R_d^T R,  s = the quaternion of E that lies nearer to the last one;   s -> -s where s_0 <= -delta
    f = -k s_v - K_d xi_e + f_FF,   V = 2 k (1 - s_0) + |xi_e|_I^2 / 2,   V' = -xi_e.K_d xi_e

s and -s are one attitude: without a jump the law would turn a body that is nearly home once around (unwinding), with a jump at s_0 = 0 noise could
hold it at half a turn. A jump lowers V by 4 k delta or more, so there are at most V(0) / (4 k delta). Mayhew, Sanfelice and Teel, Quaternion-based
hybrid control for robust global attitude tracking, IEEE Trans. Automatic Control 56 (2011).
"""

from __future__ import annotations

import random
from typing import Any

from lie_codegen.control.attitude_ports import random_rotation
from lie_codegen.control.guarded_law import on_group_alone
from lie_codegen.control.tracking_law import FEEDFORWARDS, feedforward_force, motion_ports
from lie_codegen.errors import InputError
from lie_codegen.exact.positive_matrix import body_inertia, positive_matrix, positive_number
from lie_codegen.groups.catalogue_load import GroupLike, as_group
from lie_codegen.groups.derivation import derivation_of
from lie_codegen.groups.maps.rotation_log import quaternion_of
from lie_codegen.groups.units import force_units
from lie_codegen.kernel.arithmetic import Arithmetic
from lie_codegen.kernel.brackets import bracket
from lie_codegen.kernel.definition import kernel_factory
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.linear import Matrix, Vector, dot, matmul, matvec, minus, negative, plus, scaled, transpose
from lie_codegen.kernel.parameter import input_ports, parameter, sample_inputs, values_of


@kernel_factory(group=as_group)
def quaternion_law(
    group: GroupLike = "so3",
    *,
    inertia: Any,
    k_p: Any,
    K_d: Any,
    hysteresis: Any = "1/2",
    feedforward: str = "levi_civita",
    name: str = "quaternion_law",
) -> Kernel:
    """(X, xi, X_d, xi_d, xi_d_dot, q) -> (force, q_next): tracking from every attitude, q a quaternion that is held between calls.

    The jump is made before the torque of the same call, so that q_next is what the torque was computed with. Between two calls
    the error must turn by less than half a turn, or the quaternion nearer to the last one is the wrong one. A start q = 0 remembers
    nothing: the shorter way is taken.

    Args:
        group: SO(3).
        inertia: of the body. It, k_p, K_d and hysteresis may be "input": inputs of those names, behind the others.
        k_p: stiffness [N m]; near the reference k_p / 2 a radian.
        K_d: dissipation.
        hysteresis: delta in (0, 1): a body goes on the longer way up to 2 arccos(-delta), 240 degrees for 1/2, before it turns round. It
            must exceed what noise does to s_0, half of its angle.
        feedforward: as `tracking_law`.
        name: C identifier.

    Raises:
        InputError: another group, a gain that is not positive, a hysteresis outside of (0, 1), an unknown feedforward.
    """
    group = as_group(group, "quaternion_law")
    real = derivation_of(group).real
    if group.dim != 3 or real.rigid is None:
        raise InputError(f"quaternion_law is one of SO(3) with the axes as its basis, not of {group.name}")
    if feedforward not in FEEDFORWARDS:
        raise InputError(f"feedforward {feedforward!r} is not known; choose one of {', '.join(FEEDFORWARDS)}")
    parameters = (
        parameter(Port("inertia", (3, 3), "kg m^2", description="of the body, symmetric"), inertia, body_inertia),
        parameter(Port("k_p", (), "N m", description="stiffness"), k_p, positive_number),
        parameter(
            Port("K_d", (3, 3), "N m s/rad", description="dissipation, symmetric"),
            K_d,
            lambda value, what: positive_matrix(value, 3, what),
        ),
        parameter(Port("hysteresis", (), description="of the jump, in (0, 1)"), hysteresis, _fraction),
    )

    def body(
        ops: Arithmetic, X: Matrix, xi: Vector, X_d: Matrix, xi_d: Vector, xi_d_dot: Vector, q: Vector, *given: Any
    ) -> tuple[Any, ...]:
        metric, stiffness, D, delta = values_of(ops, parameters, given)
        E = matmul(transpose(X_d), X)
        shorter = quaternion_of(ops, E)
        nearer = ops.where(ops.less(dot(shorter, q), 0), ops.constant(-1), ops.constant(1))
        jumps = ops.less(nearer * shorter[0], -delta)
        s = scaled(ops.where(jumps, -nearer, nearer), shorter)
        nu, turned = matvec(transpose(E), xi_d), matvec(transpose(E), xi_d_dot)
        nu_dot = minus(turned, bracket(ops, group.algebra, xi, nu))
        forward = feedforward_force(ops, real, metric, feedforward, xi, nu, nu_dot, turned)
        pull = plus(scaled(stiffness, s[1:]), matvec(D, minus(xi, nu)))
        return plus(negative(pull), forward), s

    def sampler(rng: random.Random) -> tuple[Any, ...]:
        vectors = [[rng.uniform(-1, 1) for _ in range(3)] for _ in range(3)]
        last = [rng.uniform(-1, 1) for _ in range(4)]
        return (
            random_rotation(rng),
            vectors[0],
            random_rotation(rng),
            *vectors[1:],
            last,
            *sample_inputs(parameters, rng),
        )

    made = Kernel(
        name=name,
        namespace=group.name,
        inputs=(
            *motion_ports(group),
            Port("q", (4,), description="quaternion of the error at the last call, scalar first; 0: none"),
            *input_ports(parameters),
        ),
        outputs=(
            Port("force", (3,), force_units(group), description="body torque"),
            Port("q_next", (4,), description="the quaternion that the torque uses"),
        ),
        body=body,
        formula="f = -k s_v - K_d xi_e + f_FF; s -> -s where s_0 <= -delta",
        source="Mayhew, Sanfelice and Teel, IEEE Trans. Automatic Control 56 (2011)",
        sampler=sampler,
    )
    return on_group_alone(made, group, ("X", "X_d"))


def _fraction(value: Any, what: str) -> Any:
    number = positive_number(value, what)
    if not float(number) < 1:
        raise InputError(
            f"quaternion_law: {what} = {value} must lie between 0 and 1: a quaternion's s_0 is never below -1"
        )
    return number
