"""Wheels as C: rates, torques and steps; a plan also as a function of time."""

from __future__ import annotations

from lie_codegen.codegen.parts import PackageParts
from lie_codegen.identifiers import check_identifier
from lie_codegen.steering.wheels.body import WheeledBody
from lie_codegen.steering.wheels.kernels import (
    arguments_of,
    wheel_speed_step,
    wheel_speeds_kernel,
    wheel_torque_step,
)


def system_parts(system: WheeledBody, name: str | None) -> PackageParts:
    """wheel_body_rate, wheel_motor_torques, wheel_speed_step and wheel_torque_step."""
    data = arguments_of(system)
    kernels = (*wheel_speeds_kernel(**data), wheel_speed_step(**data), wheel_torque_step(**data))
    return PackageParts(check_identifier(name or f"{system.group.name}_wheels", "name"), kernels)
