"""The reduced attitude law: a body direction is turned to an inertial one that a sensor sees."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from lie_codegen.control.attitude_ports import random_rotation
from lie_codegen.errors import InputError, ShapeError
from lie_codegen.exact.positive_matrix import real_number
from lie_codegen.groups.maps.admission import NEAR_GROUP
from lie_codegen.groups.maps.guard import kept_where
from lie_codegen.groups.maps.rotation_log import half_angle_ratio
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.linear import (
    Vector,
    cross,
    dot,
    number,
    scaled,
)
from lie_codegen.kernel.parameter import Parameter, input_ports, sample_inputs, values_of
from lie_codegen.on_demand import sympy as sp


def reduced_law(k_p: Parameter, z: Sequence[Any]) -> Kernel:
    """(y) -> (omega, V, V_dot) of `attitude_law("reduced")`: omega = k_p alpha (z x y)/|z x y|.

    Args:
        k_p: the gain, a number or an input.
        z: the inertial direction, of any length.

    Raises:
        ShapeError: z has not three entries. InputError: z is zero or no direction of real numbers.
    """
    if len(z) != 3:
        raise ShapeError(f"z has {len(z)} entries; give the three of an inertial direction")
    exact = [real_number(entry, f"z[{i}]") for i, entry in enumerate(z)]
    length = sp.sqrt(sum(entry**2 for entry in exact))
    if length == 0:
        raise InputError("z is zero; give the inertial direction that the sensor sees")
    unit = [entry / length for entry in exact]

    def body(ops: Arithmetic, y: Vector, *given: Any) -> tuple[Any, ...]:
        axis = [number(ops, entry) for entry in unit]
        of_unit_length = ops.less(ops.fabs(dot(y, y) - 1), ops.constant(2 * NEAR_GROUP))
        normal, cosine = cross(axis, y), dot(axis, y)
        ratio = _angle_over_sine(ops, dot(normal, normal), cosine)
        error, [gain] = scaled(ratio, normal), values_of(ops, [k_p], given)
        square = dot(error, error)
        values = (scaled(gain, error), square / 2, -gain * square)
        return tuple(kept_where(ops, [of_unit_length], value) for value in values)

    return Kernel(
        name="attitude_reduced",
        namespace="so3",
        inputs=(
            Port("y", (3,), description="measured direction R' z in the body frame, of unit length"),
            *input_ports([k_p]),
        ),
        outputs=(
            Port("omega", (3,), "rad/s", description="commanded body angular velocity"),
            Port("V", (), "rad^2", description="alpha^2/2, alpha the angle from y to z"),
            Port("V_dot", (), "rad^2/s", description="-k_p alpha^2"),
        ),
        body=body,
        formula="omega = k_p alpha (z x y)/|z x y|; alpha(t) = alpha(0) e^{-k_p t}; singular at y = -z alone",
        source="Geyer, The Attitude Control Problem, Proposition 22, for y = R' z",
        sampler=lambda rng: ([row[2] for row in random_rotation(rng)], *sample_inputs([k_p], rng)),
    )


def _angle_over_sine(ops: Arithmetic, sine_squared: Scalar, cosine: Scalar) -> Scalar:
    """alpha/sin alpha for alpha in [0, pi), by the half angle: alpha = 2 atan2(sin alpha, 1 + cos alpha).

    At alpha = pi the direction is lost: the value there is 0, the law commands nothing, and any disturbance leaves
    that set.
    """
    away = ops.less(-1 + _ANTIPODE, cosine)
    safe = ops.where(away, 1 + cosine, 1)
    tangent_squared = ops.where(away, sine_squared, 0) / (safe * safe)
    return ops.where(away, half_angle_ratio(ops, 1, tangent_squared) / safe, 0)


#: Distance of the cosine from -1 below which the antipode is treated as reached.
_ANTIPODE = 1e-14
