"""What a tumbling body's kernels are made of: its torques over any arithmetic, and the loops over the torus of its free motion."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.averaging.phase_routine import no_tangent
from lie_codegen.kernel.arithmetic import Arithmetic, FloatArithmetic, Scalar
from lie_codegen.kernel.elliptic import DEPTH, ladder, sn_cn_dn
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.plain_data import Definition
from lie_codegen.kernel.routine import Routine
from lie_codegen.rigid_body.plates import plate_force
from lie_codegen.rigid_body.rotation_formulas import (
    about_third,
    apply,
    frame_of,
    multiply,
    shape_at,
    shortest_arc,
    transpose,
)
from lie_codegen.rigid_body.rotation_kernels import TERMS
from lie_codegen.rigid_body.torques import Torque
from lie_codegen.rigid_body.torus_map import NODES as TORUS_NODES
from lie_codegen.rigid_body.torus_map import SMALLEST_DIVISOR, torus_series

_TURNS, _TURNS_OF_FORMULAS = 8, 32
#: Ports of the axes in which a motion is averaged.
BODY = (Port("paper", (3, 3), "1", description="axes of the formulas by columns, in the user's axes"),
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
    paper, inertia = BODY
    moduli = Port("moduli", (DEPTH,))
    N = Port("N", (3,))

    def smooth(ops: Arithmetic, C: Any, alpha: Any, A: Any, w: Any, e: Any, paper: Any) -> tuple[Any, ...]:
        X = multiply(C, about_third(ops, alpha, A))
        inward = transpose(paper)
        N = apply(inward, model.smooth(ops, multiply(X, inward), apply(paper, w), e))
        return N, apply(X, N)

    names = {each: f"{namespace}_{each}" for each in ("start", "node", "smooth")}
    helpers = [
        Kernel("start", namespace, (H, D, inertia),
               (Port("C", (3, 3)), Port("L", ()), r, k, Port("rate", ()), Port("c", ()), moduli), motion_of),
        Kernel("node", namespace, (r, moduli, phi), (Port("l", (3,)), A), point_of),
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
    views = tuple(Definition(numbers=tuple(map(repr, numbers)), place=place) for numbers, place in plates)
    settings = (
        ("key", model.key), ("depth", DEPTH), ("environment", model.size), ("plates", views), ("turns", model.turns), ("start", names["start"]), ("node", names["node"]),
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


def torus_routine(model: TorqueModel, namespace: str) -> Routine:
    """(H, D, phi, alpha hat, m, series of alpha, environment, paper, inertia) -> W of (H, D), largest |N| on the torus."""
    A, w, e, N = Port("A", (3, 3)), Port("w", (3,)), Port("e", (model.size,)), Port("N", (3,))
    paper, inertia = BODY
    moduli = Port("moduli", (DEPTH,))
    H, D, r, k = Port("H", (3,)), Port("D", ()), Port("r", (3,)), Port("k", ())

    def sample(ops: Arithmetic, C: Any, alpha: Any, A: Any, w: Any, e: Any, paper: Any) -> tuple[Any, ...]:
        X, inward = multiply(C, about_third(ops, alpha, A)), transpose(paper)
        N = apply(inward, model.total(ops, multiply(X, inward), apply(paper, w), e))
        return N, apply(X, N)

    helpers = (
        Kernel("torus_start", namespace, (H, D, inertia),
               (Port("C", (3, 3)), Port("L", ()), r, k, Port("rate", ()), Port("c", ()), moduli), motion_of),
        Kernel("torus_node", namespace, (r, moduli, Port("phi", ())), (Port("l", (3,)), A), point_of),
        Kernel("torus_sample", namespace, (Port("C", (3, 3)), Port("alpha", ()), A, w, e, paper),
               (N, Port("XN", (3,))), sample),
    )  # fmt: skip

    def twin(values: Sequence[float]) -> Array:
        ops: Any = FloatArithmetic()
        H, D, phi, hat, m = list(values[:3]), *(float(each) for each in values[3:7])
        b, rest = np.asarray(values[7 : 7 + TERMS]), list(values[7 + TERMS :])
        e, axes = rest[: model.size], np.reshape(rest[model.size : model.size + 9], (3, 3))
        moments = np.asarray(rest[model.size + 9 :])
        C, L, r, _, rate, _, moduli = motion_of(ops, H, D, moments.tolist())

        def at(phi: float, alpha: float) -> tuple[Array, Array]:
            l, A = point_of(ops, r, moduli, phi)  # noqa: E741
            w = L * np.array(l) / moments
            N, moved = (np.array(each) for each in sample(ops, C, alpha, A, w.tolist(), e, axes.tolist()))
            return np.append(moved, 2 * np.sum((moments - moments[2]) * w * N)), N

        def samples(phi: Array, alpha: Array) -> tuple[Array, Array]:
            found = [at(float(p), float(a)) for p, a in zip(phi.ravel(), alpha.ravel(), strict=True)]
            return tuple(np.array(each).reshape((*phi.shape, -1)) for each in zip(*found, strict=True))  # type: ignore[return-value]

        series = torus_series(samples, float(rate), m, b)
        return np.append(series.correction(phi, hat), series.torque)

    cosines = tuple(repr(float(each)) for each in np.cos(2 * np.pi * np.arange(TORUS_NODES) / TORUS_NODES))
    settings = (
        ("key", model.key), ("depth", DEPTH), ("environment", model.size), ("nodes", TORUS_NODES), ("terms", TERMS), ("cosines", cosines),
        ("smallest", repr(SMALLEST_DIVISOR)), ("start", helpers[0].symbol), ("node", helpers[1].symbol), ("sample", helpers[2].symbol),
    )  # fmt: skip
    return Routine(
        f"{namespace}_torus", 19 + TERMS + model.size, 5, "tumbling_torus.c.jinja", settings, helpers, twin, no_tangent
    )


def motion_of(ops: Arithmetic, H: Any, D: Any, inertia: Any) -> tuple[Any, ...]:
    """C(H/L), L, r, k, Lambda, c and the moduli below k of the free motion."""
    square = H[0] * H[0] + H[1] * H[1] + H[2] * H[2]
    L = ops.sqrt(square)
    I1, _, I3 = inertia
    first = I1 * D / (square * (I1 - I3))
    shape = shape_at(ops, inertia, L, first, 1 - first)
    steps = ladder(ops, shape.k)
    rate = shape.rate / (4 * steps.K)
    return frame_of(ops, [h / L for h in H]), L, list(shape.r), shape.k, rate, shape.c, list(steps.moduli)


def point_of(ops: Arithmetic, r: Any, moduli: Any, phi: Any) -> tuple[Any, ...]:
    """l and A(l) at a phase."""
    sn, cn, dn = sn_cn_dn(ops, phi, moduli)
    l = [r[0] * cn, -r[1] * sn, r[2] * dn]  # noqa: E741
    return l, shortest_arc(l)


def _twin(model: TorqueModel, values: Array) -> Array:
    """The averages by Python."""
    ops: Any = FloatArithmetic()
    H, D, e = values[:3].tolist(), float(values[3]), values[4 : 4 + model.size].tolist()
    paper, inertia = values[4 + model.size : 13 + model.size].reshape(3, 3), values[13 + model.size : 16 + model.size]
    C, L, r, k, rate, c, moduli = motion_of(ops, H, D, inertia.tolist())
    least = 32 if model.has_smooth or k >= 0.7 else 16 if k >= 0.2 else 8
    count = int(values[-1]) or (least if k < 0.95 else 64 if k < 0.999 else 96)
    total, inward = np.zeros(4), paper.T
    weights = 2 * (inertia - inertia[2])
    for j in range(count):
        direction, A = (np.array(each) for each in point_of(ops, r, moduli, j / count))
        w = L * direction / inertia

        def add(alpha: float, N: Array, weight: float, A: Array = A, w: Array = w, total: Array = total) -> None:
            X = np.array(C) @ np.array(about_third(ops, alpha, A.tolist()))
            total[:] += weight / count * np.append(X @ N, weights @ (w * N))

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
            arm, drive = np.cross(centre, n), A @ (weights * w)
            moved = (1 - specular) * np.cross(first @ centre, d) + (
                2 * specular * second + 2 / 3 * diffuse * first
            ) @ arm
            straight = 2 * specular * second[2, 2] + 2 / 3 * diffuse * first[2, 2]
            slope = (1 - specular) * d @ first @ np.cross(drive, centre) + straight * drive @ arm
            total -= pressure / count * np.append(np.array(C) @ moved, slope)
    power = (2 * np.dot(H, total[:3]) - total[3]) / (2 * inertia[2])  # D = H.H - 2 I3 T
    return np.concatenate([total, [power, k, rate, L, r[2], c]])


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
