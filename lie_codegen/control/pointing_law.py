"""Pointing a body axis at a direction, from the direction as the body sees it and the angular velocity alone.

    phi = k_p (1 - y.b),   torque = -k_p y x b - K_d omega (+ c omega x I omega),   y = R^T z,   y' = y x omega
    V = phi + omega.I omega/2,   V' = -omega.K_d omega

as d/dt y.b = (y x omega).b = -omega.(y x b). No attitude is needed. The spin about y is damped too; with spin="free" K_d becomes
(1 - y y^T) K_d (1 - y y^T), and the momentum y.I omega about y is kept: all torques are perpendicular to y then.
Geyer, The Attitude Control Problem, section 9: the case of (7), one direction.
"""

from __future__ import annotations

import random
from collections.abc import Sequence
from typing import Any

from lie_codegen.control.attitude import gyroscopic_factor
from lie_codegen.control.attitude_ports import random_rotation
from lie_codegen.errors import InputError
from lie_codegen.exact.positive_matrix import body_inertia, positive_matrix, positive_number, real_number
from lie_codegen.groups.maps.admission import NEAR_GROUP
from lie_codegen.groups.maps.guard import kept_where
from lie_codegen.kernel.arithmetic import Arithmetic
from lie_codegen.kernel.definition import kernel_factory
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.linear import Vector, cross, dot, matvec, minus, negative, number, plus, scaled
from lie_codegen.kernel.parameter import input_ports, parameter, refuse_input, sample_inputs, values_of
from lie_codegen.on_demand import sympy as sp
from lie_codegen.shapes import entries_of

_SPINS = ("damped", "free")


@kernel_factory(units={"k_p": "N m/rad", "K_d": "N m s/rad", "inertia": "kg m^2"})
def pointing_law(
    axis: Sequence[Any] = (0, 0, 1),
    *,
    inertia: Any = None,
    k_p: Any = 1,
    K_d: Any = 1,
    gyroscopic: str = "none",
    spin: str = "damped",
    z: Sequence[Any] | None = None,
    name: str = "pointing_law",
) -> Kernel:
    """(y, omega) -> (torque): the body axis b is turned towards the direction y = R^T z that the body sees.

    Args:
        axis: b in body axes, of any length. Of the numbers behind it each may be "input": an input of that name, behind the others.
        inertia: [kg m^2], for gyroscopic "cancel" and "double".
        k_p: [N m/rad].
        K_d: [N m s/rad], a number, a diagonal or a matrix.
        gyroscopic: "none" (the law needs no inertia), "cancel" or "double", as `attitude_law`.
        z: the inertial direction that y shows, for a closed loop; the law itself does not use it.
        spin: "damped", or "free": the momentum about y is kept.
        name: C identifier.

    Raises:
        ShapeError, InputError: an axis that is zero or not three numbers, gains that are not positive, an inertia that is missing.
    """
    for name_of, direction in (("axis", axis), ("z", z)):
        refuse_input(direction, name_of, "it is a direction, no gain, and is made a unit vector when the law is made")
    b = _unit(axis, "axis")
    if z is not None:
        _unit(z, "z")
    factor = gyroscopic_factor(gyroscopic)
    if spin not in _SPINS:
        raise InputError(f"spin {spin!r} is not known; choose one of {', '.join(_SPINS)}")
    if factor and inertia is None:
        raise InputError(f"gyroscopic {gyroscopic!r} needs the inertia; 'none' does not")
    gains = (
        parameter(Port("k_p", (), "N m/rad", description="stiffness"), k_p, positive_number),
        parameter(
            Port("K_d", (3, 3), "N m s/rad", description="dissipation, symmetric"),
            K_d,
            lambda value, what: positive_matrix(value, 3, what),
        ),
    )
    metric = (
        parameter(Port("inertia", (3, 3), "kg m^2", description="of the body, symmetric"), inertia, body_inertia)
        if factor
        else None
    )
    if inertia is not None and not factor:
        refuse_input(inertia, "inertia", "with gyroscopic 'none' the law uses none")
        body_inertia(inertia)
    parameters = (*gains, *([metric] if metric else []))

    def body(ops: Arithmetic, y: Vector, omega: Vector, *given: Any) -> tuple[Any, ...]:
        p, D, *I = values_of(ops, parameters, given)  # noqa: E741
        target = [number(ops, entry) for entry in b]
        seen = minus(omega, scaled(dot(y, omega), y)) if spin == "free" else omega
        damping = matvec(D, seen)
        damping = minus(damping, scaled(dot(y, damping), y)) if spin == "free" else damping
        torque = plus(scaled(-p, cross(y, target)), negative(damping))
        for inertia_matrix in I:
            torque = plus(torque, scaled(factor, cross(omega, matvec(inertia_matrix, omega))))
        of_unit_length = ops.less(ops.fabs(dot(y, y) - 1), ops.constant(2 * NEAR_GROUP))
        return (kept_where(ops, [of_unit_length], torque),)

    return Kernel(
        name=name,
        namespace="so3",
        inputs=(
            Port("y", (3,), description="measured direction R' z in the body frame, of unit length"),
            Port("omega", (3,), "rad/s", description="body angular velocity"),
            *input_ports(parameters),
        ),
        outputs=(Port("torque", (3,), "N m", description="body torque tau of I omega' = -omega x I omega + tau"),),
        body=body,
        formula=f"tau = -k_p y x b - K_d omega + {factor} omega x I omega; spin {spin}",
        source="Geyer, The Attitude Control Problem, section 9; Bullo and Murray, CIT-CDS 97-003, Lemma 3.3",
        sampler=lambda rng: ([row[2] for row in random_rotation(rng)], _drawn(rng), *sample_inputs(parameters, rng)),
    )


def _drawn(rng: random.Random) -> list[float]:
    return [rng.uniform(-1, 1) for _ in range(3)]


def _unit(value: Sequence[Any], name: str) -> list[sp.Expr]:
    exact = [real_number(entry, f"{name}[{i}]") for i, entry in enumerate(entries_of(value, 3, name))]
    length = sp.sqrt(sum(entry**2 for entry in exact))
    if length == 0:
        raise InputError(f"{name} is zero; give a direction")
    return [entry / length for entry in exact]
