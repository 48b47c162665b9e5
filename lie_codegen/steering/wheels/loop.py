"""Feedback through wheels: a law's torque, shared out to motors with limits, sampled and held, as one compiled step."""

from __future__ import annotations

from typing import Any

from lie_codegen.groups.catalogue_load import GroupLike, as_group
from lie_codegen.groups.maps.element_pattern import packed_size, unpack
from lie_codegen.groups.maps.rkmk import times_taylor_exp
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.definition import kernel_factory
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.linear import Vector, constant_matrix, matmul, matvec, plus
from lie_codegen.mechanics.actuators import MomentumWheels
from lie_codegen.on_demand import sympy as sp
from lie_codegen.steering.wheels.kernels import Body, allocation_rows, torque_step

#: The inputs of a law that follows a reference.
TRACKING = ("X", "xi", "X_d", "xi_d", "xi_d_dot")


@kernel_factory(group=as_group)
def wheel_loop_step(
    group: GroupLike,
    frame: Any,
    inertia: Any,
    axes: Any,
    axial: Any,
    transverse: Any,
    law: Kernel,
    substeps: int,
) -> Kernel:
    """(state, target, .., stored, limits, noise, h) -> (state_next, torques): one sample of the law, held over `substeps` steps.

    What is measured is X exp(noise) and the rate with noise added. A motor gives at most its torque, and none that drives a
    wheel further beyond its speed limit.
    """
    group = as_group(group, "wheel_loop_step")
    wheels = MomentumWheels(inertia=inertia, axes=axes, axial=axial, transverse=transverse)
    p, size = wheels.count, packed_size(group)
    tracks = tuple(port.name for port in law.inputs) == TRACKING
    to_basis = sp.Matrix(frame).inv()

    def body(ops: Arithmetic, state: Vector, *given: Any) -> tuple[Any, ...]:
        target, *motion = given[: 3 if tracks else 1]
        stored, torque_limit, speed_limit, seen_X, seen_rate, h = given[3 if tracks else 1 :]
        numbers = Body(ops, group, sp.Matrix(frame), wheels)
        basis = constant_matrix(ops, to_basis)
        X, momenta = unpack(group, state[:size]), list(state[size:])
        rate = numbers.rate(numbers.carried(X, stored), momenta)
        measured = times_taylor_exp(group, ops, X, matvec(basis, seen_X))
        velocity = matvec(basis, plus(rate, seen_rate))
        force = _force(ops, law, numbers, measured, velocity, target, motion)
        # a force is a covector: <force, velocity> is the same in both bases, so that body axes take the transposed inverse
        torque = matvec(constant_matrix(ops, to_basis.T), force)
        wanted = matvec(constant_matrix(ops, sp.Matrix(allocation_rows(wheels))), torque)
        speeds = numbers.speeds(rate, momenta)
        torques = [
            _limited(ops, each, limit, speed, fastest)
            for each, limit, speed, fastest in zip(wanted, torque_limit, speeds, speed_limit, strict=True)
        ]
        part = h / substeps
        packed = list(state)
        for _ in range(substeps):
            packed = torque_step(
                numbers, unpack(group, packed[:size]), packed[size:], stored, (torques, torques, torques), part
            )
        return packed, torques

    return Kernel(
        name="wheel_loop_step",
        namespace=group.name,
        inputs=_inputs(group, p, tracks),
        outputs=(Port("state_next", (size + p,)), Port("torques", (p,), "N m")),
        body=body,
        formula=f"{law.name} sampled and held, shared out to {p} wheels",
        source=law.source,
    )


def _inputs(group: MatrixGroup, p: int, tracks: bool) -> tuple[Port, ...]:
    matrix = (group.degree, group.degree)
    target_ports = [Port("target", matrix, is_complex=group.is_complex, description="attitude to hold")]
    if tracks:
        target_ports += [Port("xi_d", (group.dim,)), Port("xi_d_dot", (group.dim,))]
    return (
        Port("state", (packed_size(group) + p,), description="varying entries of X, then axial momenta"),
        *target_ports,
        Port("stored", (3,), "N m s", description="total momentum in space"),
        Port("torque_limits", (p,), "N m"),
        Port("speed_limits", (p,), "rad/s"),
        Port("noise_X", (3,), "rad", description="error of the measured attitude, in body axes"),
        Port("noise_xi", (3,), "rad/s", description="error of the measured rate"),
        Port("h", (), "s", description="length of a sample"),
    )


def _force(
    ops: Arithmetic, law: Kernel, numbers: Body, X: Any, velocity: Vector, target: Any, motion: list[Vector]
) -> Vector:
    if motion:
        return list(law.evaluate(ops, X, velocity, target, *motion)[0])
    algebra = numbers.algebra
    error = algebra.write(matmul(algebra.inverse(algebra.read(target)), algebra.read(X)))
    return list(law.evaluate(ops, error, velocity)[0])


def _limited(ops: Arithmetic, torque: Scalar, limit: Scalar, speed: Scalar, fastest: Scalar) -> Scalar:
    """The torque of a motor, none where it would drive a wheel that is too fast already."""
    bounded = ops.where(ops.less(torque, -limit), -limit, ops.where(ops.less(limit, torque), limit, torque))
    outward = ops.less(0, bounded * speed)
    too_fast = ops.less(fastest, ops.fabs(speed))
    return ops.where(too_fast, ops.where(outward, 0 * bounded, bounded), bounded)
