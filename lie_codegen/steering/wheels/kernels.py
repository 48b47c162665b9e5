"""Motion of a body with wheels as steps for loops in C: X exactly on the group, the total momentum kept by construction.

The state is X and the axial momenta h_i = j_i (b_i . w + O_i), whose rates are the motor torques. With J' = J - sum j_i b_i b_i^T and the
momentum in the body G = R^T H,

    w = J'^{-1} (G - sum h_i b_i),    h' = torque,    X' = X hat(w),

so G at a stage X exp(theta) is exp(-hat theta) G: no momentum is lost to integration, for H is a constant and w follows from it.
Runge-Kutta-Munthe-Kaas of fourth order; for |h w| <= 1/4 the exponential of the step is exact to rounding.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from fractions import Fraction
from functools import lru_cache
from typing import Any

from lie_codegen.algebra.lie_algebra import LieAlgebra
from lie_codegen.groups.catalogue_load import GroupLike, as_group
from lie_codegen.groups.derivation import derivation_of
from lie_codegen.groups.maps.element_pattern import pack, packed_size, unpack
from lie_codegen.groups.maps.matrices import GroupMatrices, matrix_port
from lie_codegen.groups.maps.rkmk import times_taylor_exp
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.brackets import dexp_inverse
from lie_codegen.kernel.definition import kernel_factory
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.linear import Matrix, Vector, constant_matrix, cross, matvec, minus, plus, scaled, transpose
from lie_codegen.kernel.runge_kutta import CLASSICAL, increment, vectors
from lie_codegen.mechanics.actuators import MomentumWheels
from lie_codegen.mechanics.body_frame import body_frame
from lie_codegen.on_demand import sympy as sp

#: Taylor terms of exp(-hat theta) at a stage: the error is of the sixth order, below that of the step.
_STAGE_TERMS = 5


class Body:
    """The numbers of a body with wheels in one arithmetic."""

    def __init__(self, ops: Arithmetic, group: MatrixGroup, frame: sp.MatrixBase, wheels: MomentumWheels) -> None:
        self.ops, self.group = ops, group
        self.algebra = GroupMatrices(ops, derivation_of(group).real)
        locked, axes, axial = sp.Matrix(wheels.locked_inertia), sp.Matrix(wheels.axes), sp.diag(*wheels.axial)
        floating = (locked - axes.T * axial * axes).applyfunc(sp.radsimp)
        self.locked_inverse = constant_matrix(ops, locked.inv())
        self.floating = constant_matrix(ops, floating)
        self.floating_inverse = constant_matrix(ops, floating.inv())
        self.axes = constant_matrix(ops, axes)  # (p, 3)
        self.momenta = constant_matrix(ops, axes.T * axial)  # (3, p)
        self.axial = [ops.constant(value) for value in wheels.axial]
        self.to_basis = constant_matrix(ops, sp.Matrix(frame).inv())
        self.frame = constant_matrix(ops, sp.Matrix(frame))

    def carried(self, X: Any, stored: Vector) -> Vector:
        """R^T H: Ad of the inverse, in body axes."""
        element = self.algebra.read(X)
        inverse = self.algebra.inverse(element)
        return matvec(self.frame, self.algebra.Ad(inverse, element, matvec(self.to_basis, stored)))

    def rate(self, carried: Vector, momenta: Vector) -> Vector:
        """w of axial momenta."""
        return matvec(self.floating_inverse, minus(carried, matvec(transpose(self.axes), momenta)))

    def speeds(self, rate: Vector, momenta: Vector) -> Vector:
        """O_i = h_i / j_i - b_i . w."""
        return [h / j - x for h, j, x in zip(momenta, self.axial, matvec(self.axes, rate), strict=True)]

    def moved(self, X: Any, carried: Vector, h: Scalar, rate_at: Callable[[Vector, float], Vector]) -> Any:
        """X after a step: rate_at(G, c) is w in body axes at t + c h, c = 0, 1/2, 1."""
        ops = self.ops

        def slope(c: float, theta: Vector) -> Vector:
            return dexp_inverse(ops, _turning(), theta, rate_at(turned(ops, theta, carried), c))

        theta = increment(vectors(ops), CLASSICAL, slope, [0, 0, 0], h)
        return times_taylor_exp(self.group, ops, X, matvec(self.to_basis, theta))


@lru_cache(maxsize=1)
def _turning() -> LieAlgebra:
    """[a, b] = a x b: angular velocities in body axes."""
    one = sp.Integer(1)  # structure constants are exact numbers
    return LieAlgebra("cross", ("x", "y", "z"), {(0, 1): {2: one}, (0, 2): {1: -one}, (1, 2): {0: one}})


def turned(ops: Arithmetic, theta: Vector, G: Vector) -> Vector:
    """exp(-hat theta) G by its Taylor polynomial."""
    value, term = list(G), list(G)
    for order in range(1, _STAGE_TERMS + 1):
        term = scaled(ops.constant(Fraction(1, order)), cross(term, theta))  # -theta x term
        value = plus(value, term)
    return value


def _wheels(inertia: Any, axes: Any, axial: Any, transverse: Any) -> MomentumWheels:
    return MomentumWheels(inertia=inertia, axes=axes, axial=axial, transverse=transverse)


def arguments_of(system: Any) -> dict[str, Any]:
    """What the factories below take, of a `WheelSystem`: exact data."""
    wheels = system.wheels
    return {
        "group": system.group,
        "frame": body_frame(system.group, "momentum_wheels").tolist(),
        "inertia": wheels.inertia.tolist(),
        "axes": sp.Matrix(system.directions).tolist(),
        "axial": list(wheels.axial),
        "transverse": list(wheels.transverse),
    }


@kernel_factory(group=as_group)
def wheel_speed_step(group: GroupLike, frame: Any, inertia: Any, axes: Any, axial: Any, transverse: Any) -> Kernel:
    """(X, stored, s0, sm, s1, h) -> X_next under wheel speeds at t, t + h/2, t + h."""
    group = as_group(group, "wheel_speed_step")
    wheels = _wheels(inertia, axes, axial, transverse)
    p = wheels.count

    def body(ops: Arithmetic, X: Any, stored: Vector, s0: Vector, sm: Vector, s1: Vector, h: Scalar) -> tuple[Any, ...]:
        numbers = Body(ops, group, sp.Matrix(frame), wheels)

        def rate_at(G: Vector, c: float) -> Vector:
            speeds = {0.0: s0, 0.5: sm, 1.0: s1}[c]
            return matvec(numbers.locked_inverse, minus(G, matvec(numbers.momenta, speeds)))

        return (numbers.moved(X, numbers.carried(X, stored), h, rate_at),)

    return Kernel(
        name="wheel_speed_step",
        namespace=group.name,
        inputs=(
            matrix_port(group, "X"),
            Port("stored", (3,), "N m s", description="total momentum in space"),
            *(Port(name, (p,), "rad/s") for name in ("s0", "sm", "s1")),
            Port("h", (), "s"),
        ),
        outputs=(matrix_port(group, "X_next"),),
        body=body,
        formula="X' = X hat(C O + J^-1 R^T H), one RKMK4 step",
        source="Leonard and Krishnaprasad, TR 93-59, (68); Munthe-Kaas, BIT 38 (1998) 92",
        sampler=None,
    )


@kernel_factory(group=as_group)
def wheel_torque_step(group: GroupLike, frame: Any, inertia: Any, axes: Any, axial: Any, transverse: Any) -> Kernel:
    """(state, stored, torque0, torquem, torque1, h) -> state_next; the state is X packed, then the axial momenta."""
    group = as_group(group, "wheel_torque_step")
    wheels = _wheels(inertia, axes, axial, transverse)
    p, size = wheels.count, packed_size(group)

    def body(
        ops: Arithmetic, state: Vector, stored: Vector, a: Vector, b: Vector, c: Vector, h: Scalar
    ) -> tuple[Any, ...]:
        numbers = Body(ops, group, sp.Matrix(frame), wheels)
        X, momenta = unpack(group, state[:size]), list(state[size:])
        return (torque_step(numbers, X, momenta, stored, (a, b, c), h),)

    ports = [Port(name, (p,), "N m") for name in ("torque0", "torquem", "torque1")]
    return Kernel(
        name="wheel_torque_step",
        namespace=group.name,
        inputs=(
            Port("state", (size + p,), description="varying entries of X, then axial momenta"),
            Port("stored", (3,), "N m s", description="total momentum in space"),
            *ports,
            Port("h", (), "s"),
        ),
        outputs=(Port("state_next", (size + p,)),),
        body=body,
        formula="X' = X hat(J'^-1 (R^T H - B h)), h' = torque, one RKMK4 step",
        source="Leonard and Krishnaprasad, TR 93-59, section 6.1; Munthe-Kaas, BIT 38 (1998) 92",
    )


def torque_step(
    numbers: Body, X: Any, momenta: Vector, stored: Vector, torques: Sequence[Vector], h: Scalar
) -> list[Any]:
    """The packed state after a step; h is a quadrature of the torques: Simpson's rule, and its values at the stages."""
    ops = numbers.ops
    first, middle, last = torques
    # the parabola through the three torques, integrated to the middle and to the end
    half = [
        m
        + h * (ops.constant(Fraction(5, 24)) * a + ops.constant(Fraction(1, 3)) * b - ops.constant(Fraction(1, 24)) * c)
        for m, a, b, c in zip(momenta, first, middle, last, strict=True)
    ]
    end = [m + h / 6 * (a + 4 * b + c) for m, a, b, c in zip(momenta, first, middle, last, strict=True)]

    def rate_at(G: Vector, c: float) -> Vector:
        return numbers.rate(G, {0.0: momenta, 0.5: half, 1.0: end}[c])

    return [*pack(numbers.group, numbers.moved(X, numbers.carried(X, stored), h, rate_at)), *end]


@kernel_factory(group=as_group)
def wheel_speeds_kernel(
    group: GroupLike, frame: Any, inertia: Any, axes: Any, axial: Any, transverse: Any
) -> tuple[Kernel, ...]:
    """wheel_body_rate (X, stored, speeds) -> omega, and wheel_motor_torques (speeds_dot, omega_dot) -> torques."""
    group = as_group(group, "wheel_speeds_kernel")
    wheels = _wheels(inertia, axes, axial, transverse)
    p = wheels.count

    def rate(ops: Arithmetic, X: Any, stored: Vector, speeds: Vector) -> tuple[Any, ...]:
        numbers = Body(ops, group, sp.Matrix(frame), wheels)
        inside = minus(numbers.carried(X, stored), matvec(numbers.momenta, speeds))
        return (matvec(numbers.locked_inverse, inside),)

    def torques(ops: Arithmetic, speeds_dot: Vector, omega_dot: Vector) -> tuple[Any, ...]:
        numbers = Body(ops, group, sp.Matrix(frame), wheels)
        turning = matvec(numbers.axes, omega_dot)
        return ([j * (s + w) for j, s, w in zip(numbers.axial, speeds_dot, turning, strict=True)],)

    source = "Leonard and Krishnaprasad, TR 93-59, (68)"
    omega = Port("omega", (3,), "rad/s", description="in body axes")
    return (
        Kernel(
            name="wheel_body_rate",
            namespace=group.name,
            inputs=(
                matrix_port(group, "X"),
                Port("stored", (3,), "N m s", description="total momentum in space"),
                Port("speeds", (p,), "rad/s"),
            ),
            outputs=(omega,),
            body=rate,
            formula="J omega + sum j_i b_i O_i = R^T H",
            source=source,
        ),
        Kernel(
            name="wheel_motor_torques",
            namespace=group.name,
            inputs=(Port("speeds_dot", (p,), "rad/s^2"), Port("omega_dot", (3,), "rad/s^2")),
            outputs=(Port("torques", (p,), "N m"),),
            body=torques,
            formula="torque_i = j_i (O_i' + b_i . omega')",
            source=source,
        ),
    )


def allocation_rows(wheels: MomentumWheels) -> Matrix:
    """(p, 3) exact: motor torques of least squares for a body torque; a motor that speeds its wheel up turns the body back."""
    axes = sp.Matrix(wheels.axes)
    rows: Matrix = (-axes * (axes.T * axes).inv()).applyfunc(sp.radsimp).tolist()
    return rows
