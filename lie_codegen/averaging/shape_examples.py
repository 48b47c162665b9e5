"""Bodies that move by their shape: three-link swimmer, falling cat, momentum wheels, point-mass oscillator.

Snakeboard and roller racer are not here: their momentum is not conserved, and its equation is quadratic in (r', p).
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from lie_codegen.averaging.shape_connection import ShapeConnection, connection
from lie_codegen.errors import InputError
from lie_codegen.mechanics.actuators import MomentumWheels, PointMassOscillator
from lie_codegen.mechanics.formulas import quantity
from lie_codegen.on_demand import sympy as sp

_R1, _R2 = sp.symbols("r1 r2", real=True)


def example_connection(name: str, **numbers: Any) -> ShapeConnection:
    """A connection of the examples.

    Args:
        name: "three_link_swimmer" (half_length=1/6, ratio=2, drag=1) on SE(2), shapes r1, r2: left link at angle -r1, right link at r2;
            "falling_cat" (mass=1, distance=.3, inertia=(.06, .06, .02)) on SO(3): two equal bodies on a universal joint, Q = Rx(r1) Ry(r2);
            "momentum_wheels" (wheels=lc.MomentumWheels(..)) on SO(3), shapes the wheel angles;
            "oscillator" (inertia=(3, 4, 5), reduced_mass=.7, or oscillator=lc.PointMassOscillator(..)) on SO(3), shapes y1, y2, y3.
        **numbers: as above.

    Raises:
        InputError: an unknown name or number.
    """
    if name not in EXAMPLES:
        raise InputError(f"example_connection: no example {name!r}; there are {', '.join(EXAMPLES)}")
    try:
        return EXAMPLES[name](**numbers)
    except TypeError as error:
        raise InputError(f"example_connection({name!r}): {error}") from None


def three_link_swimmer(half_length: Any = "1/6", ratio: Any = 2, drag: Any = 1) -> ShapeConnection:
    """Purcell's swimmer at low Reynolds number, base at the centre of the middle link; drag D = diag(ratio c (2L)^3 / 12, c 2L, ratio c 2L) a link."""
    L, kappa, c = (quantity(x, what) for x, what in ((half_length, "half_length"), (ratio, "ratio"), (drag, "drag")))
    D = sp.diag(kappa * c * (2 * L) ** 3 / 12, 2 * c * L, 2 * kappa * c * L)
    M = sp.zeros(5, 5)
    for angle, joint in ((sp.S.Zero, 0), (-_R1, -L), (_R2, L)):
        centre = sp.Matrix([joint, 0]) + _turn(angle) * sp.Matrix([joint, 0])
        # rows: angular velocity, velocity along and across the link; columns: omega, vx, vy, r1', r2'
        spin = sp.Matrix([[1, 0, 0, sp.diff(angle, _R1), sp.diff(angle, _R2)]])
        velocity = sp.Matrix.hstack(sp.Matrix([-centre[1], centre[0]]), sp.eye(2), centre.diff(_R1), centre.diff(_R2))
        J = sp.Matrix.vstack(spin, _turn(-angle) * velocity)
        M += J.T * D * J
    return connection("se2", shape=("r1", "r2"), metric=M.applyfunc(sp.expand))


def falling_cat(mass: Any = 1, distance: Any = "0.3", inertia: Any = ("0.06", "0.06", "0.02")) -> ShapeConnection:
    """Two equal bodies on a universal joint, centres of mass at -d e3 and d Q e3 from it, inertia in own axes; zero angular momentum."""
    m, d = quantity(mass, "mass"), quantity(distance, "distance")
    inner = sp.diag(*(quantity(x, "inertia") for x in inertia))
    c1, s1, c2, s2 = sp.cos(_R1), sp.sin(_R1), sp.cos(_R2), sp.sin(_R2)
    Q = sp.Matrix([[1, 0, 0], [0, c1, -s1], [0, s1, c1]]) * sp.Matrix([[c2, 0, s2], [0, 1, 0], [-s2, 0, c2]])
    apart = d * (Q[:, 2] + sp.Matrix([0, 0, 1]))
    rates = sp.Matrix.hstack(*(_vee(Q.T * Q.diff(r)) for r in (_R1, _R2)))
    second = sp.Matrix.hstack(Q.T, rates)
    # the centre of mass is free: the relative motion carries the reduced mass m / 2
    relative = sp.Matrix.hstack(-_hat(apart), apart.diff(_R1), apart.diff(_R2))
    first = sp.Matrix.hstack(sp.eye(3), sp.zeros(3, 2))
    M = first.T * inner * first + second.T * inner * second + m / 2 * relative.T * relative
    return connection("so3", shape=("r1", "r2"), metric=M.applyfunc(sp.expand))


def momentum_wheels(wheels: MomentumWheels) -> ShapeConnection:
    """Wheels in a rigid body: A = -C, constant, TR 93-59, (68); shapes th1 .. thp."""
    J = wheels.locked_inertia
    columns = [j * wheels.axes.row(i).T for i, j in enumerate(wheels.axial)]
    M12 = sp.Matrix.hstack(*columns)
    M = sp.Matrix.vstack(sp.Matrix.hstack(J, M12), sp.Matrix.hstack(M12.T, sp.diag(*wheels.axial)))
    return connection("so3", shape=tuple(f"th{i + 1}" for i in range(wheels.count)), metric=M)


def oscillator(
    inertia: Any = (3, 4, 5), reduced_mass: Any = "0.7", oscillator: PointMassOscillator | None = None
) -> ShapeConnection:
    """A point mass moved along y in a rigid body: A(y) = alpha_m I_lock^-1 hat(y), TR 93-59, (70)."""
    if oscillator is not None:
        I0 = sp.Matrix(oscillator.inertia)
        m = oscillator.reduced_mass
    else:
        I0, m = sp.diag(*(quantity(x, "inertia") for x in inertia)), quantity(reduced_mass, "reduced_mass")
    y = sp.Matrix(sp.symbols("y1:4", real=True))
    locked = I0 + m * ((y.T * y)[0] * sp.eye(3) - y * y.T)
    M = sp.Matrix.vstack(sp.Matrix.hstack(locked, m * _hat(y)), sp.Matrix.hstack(m * _hat(y).T, m * sp.eye(3)))
    return connection("so3", shape=("y1", "y2", "y3"), metric=M)


EXAMPLES: dict[str, Callable[..., ShapeConnection]] = {
    "three_link_swimmer": three_link_swimmer,
    "falling_cat": falling_cat,
    "momentum_wheels": momentum_wheels,
    "oscillator": oscillator,
}


def _turn(angle: sp.Expr) -> sp.Matrix:
    return sp.Matrix([[sp.cos(angle), -sp.sin(angle)], [sp.sin(angle), sp.cos(angle)]])


def _hat(v: sp.Matrix) -> sp.Matrix:
    return sp.Matrix([[0, -v[2], v[1]], [v[2], 0, -v[0]], [-v[1], v[0], 0]])


def _vee(m: sp.Matrix) -> sp.Matrix:
    return sp.Matrix([m[2, 1], m[0, 2], m[1, 0]])
