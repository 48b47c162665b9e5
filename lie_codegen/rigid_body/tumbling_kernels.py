"""Kernels of a tumbling body under torques: averaged and true rates, the periodic part, torques at a point."""

from __future__ import annotations

import random
from collections.abc import Sequence
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.definition import doubles, kernel_factory
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.routine import call_routine
from lie_codegen.rigid_body.rotation_formulas import about_third, apply, cross, multiply, transpose
from lie_codegen.rigid_body.rotation_kernels import TERMS, precession_routine
from lie_codegen.rigid_body.torque_model import BODY, TorqueModel, motion_of, point_of
from lie_codegen.rigid_body.torques import Torque
from lie_codegen.rigid_body.tumbling_routines import average_routine, torus_routine

NAMESPACE = "tumbling"
#: k of the separatrix event.
MARGIN = 0.999


@kernel_factory(J=doubles)
def tumbling_kernels(J: Array, torques: Sequence[Torque], namespace: str = NAMESPACE) -> tuple[Kernel, ...]:
    """slow_rate, shape, ends, periodic, torque_at and direct_rate of a body under torques.

    Directions that are Python functions of t become an input `given`, three numbers each.
    """
    model = TorqueModel(J, torques)
    routine, torus, precession = (
        average_routine(model, namespace),
        torus_routine(model, namespace),
        precession_routine(),
    )
    given = (Port("given", (3 * len(model.functions),), description="directions at t"),) if model.functions else ()
    y = Port("y", (6,), description="H [N m s], D [(N m s)^2], phi, alpha hat [rad]")
    time, nodes = Port("t", (), "s"), Port("nodes", (), description="phases; 0: by k")
    carry = Port("carry", (), description="1: alpha hat is carried along, 0: its rate is left 0, which is faster")
    H, D = Port("H", (3,), "N m s"), Port("D", (), "(N m s)^2", description="H.H - 2 I3 T")

    def slow_rate(
        ops: Arithmetic, y: Any, t: Any, paper: Any, inertia: Any, nodes: Any, carry: Any, *rest: Any
    ) -> tuple[Any, ...]:
        e = model.environment(ops, t, rest[0] if rest else ())
        flat = [entry for row in paper for entry in row]
        found = call_routine(ops, routine, [*y[:4], *e, *flat, *inertia, nodes])
        k, rate, L, r3, c = found[5:]
        mean = call_routine(ops, precession, [k, r3, c], ops.less(ops.constant(0), carry))[0]
        return [*found[:4], rate, L / inertia[2] * mean], found[4]

    def shape(ops: Arithmetic, H: Any, D: Any, inertia: Any) -> tuple[Any, ...]:
        _, L, r, k, rate, c, _ = motion_of(ops, H, D, inertia)
        series = call_routine(ops, precession, [k, r[2], c])
        pi, unit = 4 * ops.atan(ops.constant(1)), L / inertia[2]
        b = [unit * a / (4 * pi * (n + 1) * rate) for n, a in enumerate(series[1:])]
        return k, rate, unit * series[0], b

    def ends(ops: Arithmetic, y: Any, inertia: Any, least: Any) -> tuple[Any, ...]:
        I1, I2, I3 = inertia
        square = y[0] * y[0] + y[1] * y[1] + y[2] * y[2]
        # k^2 < margin^2 without the quotient, whose denominator changes sign beyond the separatrix
        above = (I1 - I2) * I3 * y[3]
        below = (I2 - I3) * (square * (I1 - I3) - I1 * y[3])
        return ([ops.constant(MARGIN**2) - above / below, ops.sqrt(square) - least],)

    def periodic(ops: Arithmetic, y: Any, t: Any, paper: Any, inertia: Any, *rest: Any) -> tuple[Any, ...]:
        _, _, m, b = shape(ops, y[:3], y[3], inertia)
        e = model.environment(ops, t, rest[0] if rest else ())
        flat = [entry for row in paper for entry in row]
        found = call_routine(ops, torus, [*y, m, *b, *e, *flat, *inertia])
        return found[:4], found[4]

    def torque_at(
        ops: Arithmetic, H: Any, D: Any, phi: Any, alpha: Any, t: Any, paper: Any, inertia: Any, *rest: Any
    ) -> tuple[Any, ...]:
        C, L, r, _, _, _, moduli = motion_of(ops, H, D, inertia)
        l, A = point_of(ops, r, moduli, phi)  # noqa: E741
        X, inward = multiply(C, about_third(ops, alpha, A)), transpose(paper)
        w = [L * a / i for a, i in zip(l, inertia, strict=True)]
        attitude, omega = multiply(X, inward), apply(paper, w)
        torque = model.total(ops, attitude, omega, model.environment(ops, t, rest[0] if rest else ()))
        N = apply(inward, torque)
        slope = sum(2 * (inertia[i] - inertia[2]) * w[i] * N[i] for i in range(2))
        return [*apply(X, N), slope], torque, attitude, omega

    def direct_rate(ops: Arithmetic, z: Any, t: Any, *rest: Any) -> tuple[Any, ...]:
        q, w = z[:4], z[4:]
        N = model.total(ops, matrix_of(q), w, model.environment(ops, t, rest[0] if rest else ()))
        J = [[ops.constant(float(entry)) for entry in row] for row in J_rows]
        inverse = [[ops.constant(float(entry)) for entry in row] for row in J_inverse]
        free = cross(apply(J, w), w)
        return ([*quaternion_rate(ops, q, w), *apply(inverse, [a + b for a, b in zip(free, N, strict=True)])],)

    J_rows, J_inverse = J.tolist(), np.linalg.inv(J).tolist()
    free = tuple(Port(name, ()) for name in ("phi", "alpha"))
    z = Port("z", (7,), description="quaternion (scalar first), omega [rad/s]")
    source = "Benson and Scheeres, J. Guidance Control Dynamics 44 (2021)"
    return (
        Kernel("slow_rate", namespace, (y, time, *BODY, nodes, carry, *given), (Port("y_dot", (6,)), Port("power", (), "W")), slow_rate,
               "H' = <X N>, D' = 2 <sum (I_n - I3) w_n N_n>, phi' = Lambda, alpha hat' = m", source, _slow_sample(J, model)),
        Kernel("shape", namespace, (H, D, BODY[1]), (Port("k", ()), Port("Lambda", (), "1/s"), Port("m", (), "rad/s"), Port("b", (TERMS,))),
               shape, "modulus, rate of the phase, mean precession and its series", source, lambda rng: _shape_sample(J, rng)),
        Kernel("ends", namespace, (y, BODY[1], Port("least", (), "N m s")), (Port("values", (2,)),), ends,
               "margin^2 - k^2 and |H| - least", source, lambda rng: (*_y_sample(J, rng), 0.1)),
        Kernel("periodic", namespace, (y, time, *BODY, *given), (Port("W", (4,)), Port("largest", (), "N m")), periodic,
               "osculating (H, D) less the mean: the series of the rates on the torus, divided by its frequencies; the largest |N|", source,
               lambda rng: _slow_sample(J, model)(rng)[:4] + _unit(rng, model)),
        Kernel("torque_at", namespace, (H, D, *free, time, *BODY, *given),
               (Port("rates", (4,)), Port("N", (3,), "N m"), Port("X", (3, 3)), Port("omega", (3,), "rad/s")), torque_at,
               "X N and the rate of D at a point of the torus", source, lambda rng: _point_sample(J, model, rng)),
        Kernel("direct_rate", namespace, (z, time, *given), (Port("z_dot", (7,)),), direct_rate,
               "q' = q omega / 2, J omega' = J omega x omega + N(X, omega, t)", "Euler's equations"),
    )  # fmt: skip


def matrix_of(q: Sequence[Scalar]) -> list[list[Scalar]]:
    """The rotation of a quaternion of any length, scalar first."""
    a, b, c, d = q
    s = 2 / (a * a + b * b + c * c + d * d)
    return [
        [1 - s * (c * c + d * d), s * (b * c - a * d), s * (b * d + a * c)],
        [s * (b * c + a * d), 1 - s * (b * b + d * d), s * (c * d - a * b)],
        [s * (b * d - a * c), s * (c * d + a * b), 1 - s * (b * b + c * c)],
    ]


def quaternion_rate(ops: Arithmetic, q: Sequence[Scalar], w: Sequence[Scalar]) -> list[Scalar]:
    """q omega / 2."""
    a, b, c, d = q
    half = ops.constant(1) / 2
    return [
        half * (-b * w[0] - c * w[1] - d * w[2]),
        half * (a * w[0] + c * w[2] - d * w[1]),
        half * (a * w[1] + d * w[0] - b * w[2]),
        half * (a * w[2] + b * w[1] - c * w[0]),
    ]


def _y_sample(J: Array, rng: random.Random) -> tuple[Any, Any]:
    """(y, inertia) of a motion well away from the separatrix, principal axes ordered as for the largest moment."""
    moments = np.sort(np.linalg.eigvalsh(J))
    w = np.array([rng.uniform(-0.2, 0.2), rng.uniform(-0.2, 0.2), rng.uniform(0.8, 1.2)])
    D = float(np.sum(moments * (moments - moments[2]) * w**2))
    L = float(np.linalg.norm(moments * w))
    h = [rng.uniform(-1, 1), rng.uniform(-1, 1), rng.uniform(0.5, 1)]
    size = float(np.linalg.norm(h))
    return [*(L * each / size for each in h), D, rng.uniform(0, 1), rng.uniform(0, 6)], moments.tolist()


def _shape_sample(J: Array, rng: random.Random) -> tuple[Any, ...]:
    y, inertia = _y_sample(J, rng)
    return y[:3], y[3], inertia


def _unit(rng: random.Random, model: TorqueModel) -> tuple[Any, ...]:
    return ([rng.uniform(0.2, 1) for _ in range(3 * len(model.functions))],) if model.functions else ()


def _slow_sample(J: Array, model: TorqueModel) -> Any:
    def sample(rng: random.Random) -> tuple[Any, ...]:
        y, inertia = _y_sample(J, rng)
        return y, rng.uniform(0, 1), np.eye(3).tolist(), inertia, 0.0, 1.0, *_unit(rng, model)

    return sample


def _point_sample(J: Array, model: TorqueModel, rng: random.Random) -> tuple[Any, ...]:
    y, inertia = _y_sample(J, rng)
    return y[:3], y[3], y[4], y[5], rng.uniform(0, 1), np.eye(3).tolist(), inertia, *_unit(rng, model)
