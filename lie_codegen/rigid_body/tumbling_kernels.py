"""Kernels of a tumbling body under torques: the averaged rate in a loop over the torus, the true rate, torques at a point."""

from __future__ import annotations

import random
from collections.abc import Sequence
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.averaging.phase_routine import Frozen, no_tangent
from lie_codegen.kernel.arithmetic import Arithmetic, FloatArithmetic, Scalar
from lie_codegen.kernel.elliptic import jacobi, ladder
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.routine import Routine, call_routine
from lie_codegen.rigid_body.rotation_formulas import (
    about_third,
    apply,
    frame_of,
    multiply,
    shape_at,
    shortest_arc,
    transpose,
)
from lie_codegen.rigid_body.rotation_kernels import TERMS, precession_routine
from lie_codegen.rigid_body.torques import Torque, cross, plate_force

NAMESPACE = "tumbling"
_TURNS, _TURNS_OF_FORMULAS = 8, 32
#: k of the separatrix event.
MARGIN = 0.999
_BODY = (Port("paper", (3, 3), "1", description="axes of the formulas by columns, in the user's axes"),
         Port("inertia", (3,), "kg m^2", description="moments along them; the second is the middle one"))  # fmt: skip


class TorqueModel:
    """Torques on a body with the places of their directions in the environment (t, then three numbers each)."""

    def __init__(self, J: Array, torques: Sequence[Torque]) -> None:
        self.J, self.torques = J, tuple(torques)
        self.size = 1 + 3 * len(self.torques)
        self.functions = [each for each in self.torques if each.is_function]
        self.has_smooth = any(each.plates is None for each in self.torques)
        self.turns = _TURNS_OF_FORMULAS if any(each.kind == "formula" for each in self.torques) else _TURNS
        self.key = (repr(J.tolist()), *(each.key for each in self.torques))

    def environment(self, ops: Arithmetic, t: Scalar, given: Sequence[Scalar]) -> list[Scalar]:
        """(t, directions) at time t; `given` are those that functions gave."""
        found, rest = [t], list(given)
        for each in self.torques:
            if each.kind == "formula":
                found += [0, 0, 0]
            elif each.is_function:
                found += each.scaled(ops, rest[:3])
                rest = rest[3:]
            else:
                found += each.direction_at(ops, t)
        return found

    def smooth(self, ops: Arithmetic, X: Any, omega: Any, e: Sequence[Scalar]) -> list[Scalar]:
        """The sum of all torques but those of plates, body axes."""
        J = [[ops.constant(float(entry)) for entry in row] for row in self.J]
        parts = [
            each.smooth(ops, J, X, omega, e[1 + 3 * i : 4 + 3 * i], e[0])
            for i, each in enumerate(self.torques) if each.plates is None
        ]  # fmt: skip
        return [sum(part[i] for part in parts) for i in range(3)]

    def total(self, ops: Arithmetic, X: Any, omega: Any, e: Sequence[Scalar]) -> list[Scalar]:
        """The torque in body axes, plates included."""
        total = self.smooth(ops, X, omega, e) if self.has_smooth else [0, 0, 0]
        zero = ops.constant(0)
        for numbers, place in self.plates():
            d = e[place : place + 3]
            b = [X[0][i] * d[0] + X[1][i] * d[1] + X[2][i] * d[2] for i in range(3)]
            n, r, rest = ([ops.constant(v) for v in part] for part in (numbers[:3], numbers[3:6], numbers[6:]))
            facing = n[0] * b[0] + n[1] * b[1] + n[2] * b[2]
            lit = ops.where(ops.less(zero, facing), facing, zero)
            total = [a + f for a, f in zip(total, plate_force(ops, b, n, r, rest, lit), strict=True)]
        return total

    def plates(self) -> list[tuple[list[float], int]]:
        """(normal, centre, area times pressure, specular, diffuse) of every plate, and where its direction is."""
        found = []
        for i, each in enumerate(self.torques):
            if each.plates is not None:
                p = each.plates
                columns = np.column_stack(
                    [p.normals, p.centres, p.areas * each.numbers["pressure"], p.specular, p.diffuse]
                )
                found += [(row, 1 + 3 * i) for row in columns.tolist()]
        return found


def average_routine(model: TorqueModel, namespace: str) -> Routine:
    """(H, D, environment, paper, inertia, nodes) -> mean X N, D', mean omega.N, k, Lambda, L, r3, c."""
    r, k, A, w = Port("r", (3,)), Port("k", ()), Port("A", (3, 3)), Port("w", (3,))
    H, D, phi, e = Port("H", (3,)), Port("D", ()), Port("phi", ()), Port("e", (model.size,))
    paper, inertia = _BODY
    N = Port("N", (3,))

    def smooth(ops: Arithmetic, C: Any, alpha: Any, A: Any, w: Any, e: Any, paper: Any) -> tuple[Any, ...]:
        X = multiply(C, about_third(ops, alpha, A))
        inward = transpose(paper)
        N = apply(inward, model.smooth(ops, multiply(X, inward), apply(paper, w), e))
        return N, apply(X, N)

    names = {each: f"{namespace}_{each}" for each in ("start", "node", "smooth")}
    helpers = [
        Kernel("start", namespace, (H, D, inertia),
               (Port("C", (3, 3)), Port("L", ()), r, k, Port("rate", ()), Port("c", ())), _start),
        Kernel("node", namespace, (r, k, phi), (Port("l", (3,)), A), _node),
    ]  # fmt: skip
    if model.has_smooth:
        helpers.append(
            Kernel(
                "smooth",
                namespace,
                (Port("C", (3, 3)), Port("alpha", ()), A, w, e, paper),
                (N, Port("XN", (3,))),
                smooth,
            )
        )
    plates = model.plates()
    views = [{"numbers": [repr(v) for v in numbers], "place": place} for numbers, place in plates]
    settings = (
        ("key", model.key), ("environment", model.size), ("plates", Frozen(views)), ("turns", model.turns), ("start", names["start"]), ("node", names["node"]),
        ("smooth", names["smooth"] if model.has_smooth else ""),
    )  # fmt: skip

    def twin(values: Sequence[float]) -> Array:
        return _twin(model, np.asarray(values, dtype=float))

    return Routine(
        f"{namespace}_average",
        17 + model.size,
        10,
        "tumbling_average.c.jinja",
        settings,
        tuple(helpers),
        twin,
        no_tangent,
    )


def _start(ops: Arithmetic, H: Any, D: Any, inertia: Any) -> tuple[Any, ...]:
    square = H[0] * H[0] + H[1] * H[1] + H[2] * H[2]
    L = ops.sqrt(square)
    I1, _, I3 = inertia
    first = I1 * D / (square * (I1 - I3))
    shape = shape_at(ops, inertia, L, first, 1 - first)
    rate = shape.rate / (4 * ladder(ops, shape.k).K)
    return frame_of(ops, [h / L for h in H]), L, list(shape.r), shape.k, rate, shape.c


def _node(ops: Arithmetic, r: Any, k: Any, phi: Any) -> tuple[Any, ...]:
    at = jacobi(ops, phi, ladder(ops, k))
    l = [r[0] * at.cn, -r[1] * at.sn, r[2] * at.dn]  # noqa: E741
    return l, shortest_arc(l)


def _twin(model: TorqueModel, values: Array) -> Array:
    """The averages by Python."""
    ops: Any = FloatArithmetic()
    H, D, e = values[:3].tolist(), float(values[3]), values[4 : 4 + model.size].tolist()
    paper, inertia = values[4 + model.size : 13 + model.size].reshape(3, 3), values[13 + model.size : 16 + model.size]
    C, L, r, k, rate, c = _start(ops, H, D, inertia.tolist())
    least = 32 if model.has_smooth or k >= 0.7 else 16 if k >= 0.2 else 8
    count = int(values[-1]) or (least if k < 0.95 else 64 if k < 0.999 else 96)
    total, inward = np.zeros(5), paper.T
    weights = 2 * (inertia - inertia[2])
    for j in range(count):
        direction, A = (np.array(each) for each in _node(ops, r, k, j / count))
        w = L * direction / inertia

        def add(alpha: float, N: Array, weight: float, A: Array = A, w: Array = w, total: Array = total) -> None:
            X = np.array(C) @ np.array(about_third(ops, alpha, A.tolist()))
            total[:] += weight / count * np.concatenate([X @ N, [weights @ (w * N), w @ N]])

        if model.has_smooth:
            for i in range(model.turns):
                alpha = 2 * np.pi * i / model.turns
                X = np.array(C) @ np.array(about_third(ops, alpha, A.tolist())) @ inward
                N = inward @ np.array(model.smooth(ops, X.tolist(), (paper @ w).tolist(), e))
                add(alpha, N, 1 / model.turns)
        for numbers, place in model.plates():
            n, centre, d = A @ inward @ numbers[:3], A @ inward @ numbers[3:6], np.array(C).T @ e[place : place + 3]
            first, second = _lit_means(n[2] * d[2], complex(n[0] * d[0] + n[1] * d[1], n[0] * d[1] - n[1] * d[0]))
            pressure, specular, diffuse = numbers[6:]
            arm, push, drive = np.cross(centre, n), A @ w, A @ (weights * w)
            moved = (1 - specular) * np.cross(first @ centre, d) + (
                2 * specular * second + 2 / 3 * diffuse * first
            ) @ arm
            straight = 2 * specular * second[2, 2] + 2 / 3 * diffuse * first[2, 2]
            powers = [(1 - specular) * d @ first @ np.cross(v, centre) + straight * v @ arm for v in (drive, push)]
            total -= pressure / count * np.concatenate([np.array(C) @ moved, powers])
    return np.concatenate([total, [k, rate, L, r[2], c]])


def _lit_means(level: float, wave: complex) -> tuple[Array, Array]:
    """Means of u Rz(alpha) and u^2 Rz(alpha), u = max(0, level + Re(wave exp(-i alpha))), over alpha."""
    size = abs(wave)
    if not level > -size:
        return np.zeros((3, 3)), np.zeros((3, 3))
    half = np.pi if level >= size else float(np.arccos(-level / size))
    s, mixed = (0.0, 0.0) if level >= size else (float(np.sin(half)), float(np.sin(half) * np.cos(half)) / 2)
    middle = wave / size if size > 0 else 1.0
    even = half / 2 + mixed
    plain = (level * half + size * s, level**2 * half + 2 * level * size * s + size**2 * even)
    waved = (level * s + size * even, level**2 * s + 2 * level * size * even + size**2 * (s - s**3 / 3))
    found = []
    for m, v in zip(plain, waved, strict=True):
        z = v * middle / np.pi
        found.append(np.array([[z.real, -z.imag, 0], [z.imag, z.real, 0], [0, 0, m / np.pi]]))
    return found[0], found[1]


def tumbling_kernels(J: Array, torques: Sequence[Torque], namespace: str = NAMESPACE) -> tuple[Kernel, ...]:
    """slow_rate, shape, ends, torque_at and direct_rate of a body under torques.

    Directions that are Python functions of t become an input `given`, three numbers each.
    """
    model = TorqueModel(J, torques)
    routine, precession = average_routine(model, namespace), precession_routine()
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
        _, L, r, k, rate, c = _start(ops, H, D, inertia)
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

    def torque_at(
        ops: Arithmetic, H: Any, D: Any, phi: Any, alpha: Any, t: Any, paper: Any, inertia: Any, *rest: Any
    ) -> tuple[Any, ...]:
        C, L, r, k, _, _ = _start(ops, H, D, inertia)
        l, A = _node(ops, r, k, phi)  # noqa: E741
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
        Kernel("slow_rate", namespace, (y, time, *_BODY, nodes, carry, *given), (Port("y_dot", (6,)), Port("power", (), "W")), slow_rate,
               "H' = <X N>, D' = 2 <sum (I_n - I3) w_n N_n>, phi' = Lambda, alpha hat' = m", source, _slow_sample(J, model)),
        Kernel("shape", namespace, (H, D, _BODY[1]), (Port("k", ()), Port("Lambda", (), "1/s"), Port("m", (), "rad/s"), Port("b", (TERMS,))),
               shape, "modulus, rate of the phase, mean precession and its series", source, lambda rng: _shape_sample(J, rng)),
        Kernel("ends", namespace, (y, _BODY[1], Port("least", (), "N m s")), (Port("values", (2,)),), ends,
               "margin^2 - k^2 and |H| - least", source, lambda rng: (*_y_sample(J, rng), 0.1)),
        Kernel("torque_at", namespace, (H, D, *free, time, *_BODY, *given),
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
