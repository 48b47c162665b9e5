"""Torques on a body in their environment, and its free motion at a point of the torus, over any arithmetic."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.elliptic import ladder, sn_cn_dn
from lie_codegen.kernel.kernel import Port
from lie_codegen.rigid_body.plates import plate_force
from lie_codegen.rigid_body.rotation_formulas import frame_of, shape_at, shortest_arc
from lie_codegen.rigid_body.torques import Torque

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

    def phases(self, k: float) -> int:
        """Nodes of the phase: means of plates alone over the precession angle are closed forms, and smooth in the phase."""
        if k >= 0.95:
            return 64 if k < 0.999 else 96
        return 32 if self.has_smooth or k >= 0.7 else 16 if k >= 0.2 else 8

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
