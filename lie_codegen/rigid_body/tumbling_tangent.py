"""The derivative of the averages over the torus along a direction of (H, D, environment), and the light on a plate."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.averaging.phase_routine import no_tangent
from lie_codegen.kernel.arithmetic import Arithmetic, FloatArithmetic, Scalar
from lie_codegen.kernel.dual import DualArithmetic, tangent_of, value_of
from lie_codegen.kernel.elliptic import DEPTH
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.routine import Routine, Tangent, call_routine
from lie_codegen.rigid_body.rotation_formulas import cross
from lie_codegen.rigid_body.torque_model import BODY, TorqueModel, motion_of, point_of

#: (C, alpha, A, w, e, paper) -> N, X N of the torques that are no plates.
Smooth = Callable[..., tuple[Any, ...]]


def plate_share(
    n: Any, lever: Any, d: Any, drive: Any, first: Any, second: Any, numbers: Any
) -> tuple[list[Scalar], Scalar]:
    """Means of X N before C, and of the rate of D, of a plate at one phase.

    Args:
        n, lever: normal and centre, turned by A(l).
        d: the direction of light, turned back by C.
        drive: A(l) of 2 (I_n - I3) w_n.
        first, second: means of u and of u^2 times (1, cos alpha, sin alpha), u = max(0, n.b).
        numbers: area times pressure, specular, diffuse.
    """
    pressure, specular, diffuse = numbers
    arm = cross(lever, n)
    dull = 2 * diffuse / 3
    plain = cross(_turned(first, lever), d)
    bright, faint = _turned(second, arm), _turned(first, arm)
    moved = [-pressure * ((1 - specular) * plain[i] + 2 * specular * bright[i] + dull * faint[i]) for i in range(3)]
    across = _turned(first, cross(drive, lever))
    along = sum(drive[i] * arm[i] for i in range(3))
    shining = (1 - specular) * sum(across[i] * d[i] for i in range(3))
    return moved, -pressure * (shining + (2 * specular * second[0] + dull * first[0]) * along)


def _turned(mean: Any, v: Any) -> list[Scalar]:
    """The mean of Rz(alpha) v."""
    return [mean[1] * v[0] - mean[2] * v[1], mean[2] * v[0] + mean[1] * v[1], mean[0] * v[2]]


@dataclass(frozen=True)
class LitArc:
    """Where n.b = level + size cos(alpha - alpha_0) is positive: |alpha - alpha_0| < half.

    Attributes:
        level, size: as above.
        middle: exp(i alpha_0).
        I: of cos^p over the arc, p = 0 .. 3, over 2.
    """

    level: float
    size: float
    middle: complex
    I: tuple[float, float, float, float]  # noqa: E741

    @classmethod
    def of(cls, level: float, wave: complex) -> LitArc:
        """Of n.b = level + Re(wave exp(-i alpha))."""
        size = abs(wave)
        middle = wave / size if size > 0 else 1.0 + 0j
        if not level > -size:
            return cls(level, size, middle, (0.0, 0.0, 0.0, 0.0))
        half = np.pi if level >= size else float(np.arccos(-level / size))
        s, mixed = (0.0, 0.0) if level >= size else (float(np.sin(half)), float(np.sin(half) * np.cos(half)) / 2)
        return cls(level, size, middle, (half, s, half / 2 + mixed, s - s**3 / 3))

    @property
    def means(self) -> tuple[Array, Array]:
        """Of u and u^2 times (1, cos alpha, sin alpha)."""
        a, b, I = self.level, self.size, self.I  # noqa: E741
        first = self._placed(a * I[0] + b * I[1], complex(a * I[1] + b * I[2]))
        second = self._placed(
            a * a * I[0] + 2 * a * b * I[1] + b * b * I[2], complex(a * a * I[1] + 2 * a * b * I[2] + b * b * I[3])
        )
        return first, second

    def rates(self, level: float, wave: complex) -> tuple[Array, Array]:
        """How they change with level and wave: <u'> and <2 u u'>, for u vanishes at the ends of the arc."""
        a, b, I = self.level, self.size, self.I  # noqa: E741
        along = wave * np.conj(self.middle)
        x, y = float(along.real), float(along.imag)
        across, mixed = I[0] - I[2], I[1] - I[3]  # of sin^2 and cos sin^2
        first = self._placed(level * I[0] + x * I[1], complex(level * I[1] + x * I[2], y * across))
        cross_term = a * x + b * level
        second = self._placed(
            2 * (a * level * I[0] + cross_term * I[1] + b * x * I[2]),
            2 * complex(a * level * I[1] + cross_term * I[2] + b * x * I[3], a * y * across + b * y * mixed),
        )
        return first, second

    def _placed(self, mean: float, wave: complex) -> Array:
        """(mean, cos, sin) of what is symmetric about alpha_0 by its real part."""
        z = wave * self.middle
        return np.array([mean, z.real, z.imag]) / np.pi


def average_tangent(model: TorqueModel, namespace: str, smooth: Smooth, plates: tuple[Any, ...]) -> Tangent:
    """What `average_routine` is differentiated by; body axes and the number of phases are constants."""
    size = model.size
    r, k, A, w = Port("r", (3,)), Port("k", ()), Port("A", (3, 3)), Port("w", (3,))
    C, H, D, phi, alpha = Port("C", (3, 3)), Port("H", (3,)), Port("D", ()), Port("phi", ()), Port("alpha", ())
    e, moduli = Port("e", (size,)), Port("moduli", (DEPTH,))
    paper, inertia = BODY
    start = (C, Port("L", ()), r, k, Port("rate", ()), Port("c", ()), moduli)
    node = (Port("l", (3,)), A)
    means = Port("first", (3,)), Port("second", (3,))
    light = (Port("n", (3,)), Port("lever", (3,)), Port("d", (3,)), Port("drive", (3,)), *means)
    share = (Port("moved", (3,)), Port("slope", ()))
    numbers = Port("numbers", (3,))
    torque = (Port("N", (3,)), Port("XN", (3,)))
    names = {each: f"{namespace}_{each}_rate" for each in ("start", "node", "smooth", "plate")}

    def plate(ops: Arithmetic, *given: Any) -> tuple[Any, ...]:
        return plate_share(*given)

    helpers = [
        _moving("start", namespace, (H, D), (inertia,), start, motion_of),
        _moving("node", namespace, (r, moduli), (phi,), node, point_of),
    ]
    if model.has_smooth:
        body = _arranged(smooth)
        helpers.append(_moving("smooth", namespace, (C, A, w, e), (alpha, paper), torque, body))
    if plates:
        helpers.append(_moving("plate", namespace, light, (numbers,), share, plate))
    settings = (
        ("key", model.key), ("depth", DEPTH), ("environment", size), ("plates", plates), ("turns", model.turns),
        ("start", names["start"]), ("node", names["node"]), ("plate", names["plate"]),
        ("smooth", names["smooth"] if model.has_smooth else ""),
    )  # fmt: skip

    def twin(values: Sequence[float]) -> Array:
        return _twin(model, smooth, np.asarray(values, dtype=float))

    moved = Routine(
        f"{namespace}_average_rate", 21 + 2 * size, 10, "tumbling_average_tangent.c.jinja", settings, tuple(helpers), twin, no_tangent
    )  # fmt: skip

    def tangent(ops: Any, inputs: Sequence[Scalar], outputs: Sequence[Scalar], rates: Sequence[Scalar]) -> list[Scalar]:
        return call_routine(ops, moved, [*inputs, *(ops.constant(0) + each for each in rates[: 4 + size])])

    return tangent


def _arranged(smooth: Smooth) -> Any:
    def body(ops: Arithmetic, C: Any, A: Any, w: Any, e: Any, alpha: Any, paper: Any) -> tuple[Any, ...]:
        return smooth(ops, C, alpha, A, w, e, paper)

    return body


def _moving(
    name: str, namespace: str, moving: tuple[Port, ...], held: tuple[Port, ...], outputs: tuple[Port, ...], body: Any
) -> Kernel:
    """name_rate(moving, held, rates of the moving) -> outputs, their rates."""

    def both(ops: Arithmetic, *given: Any) -> tuple[Any, ...]:
        values, directions = given[: len(moving) + len(held)], given[len(moving) + len(held) :]
        return along_direction(ops, body, values[: len(moving)], values[len(moving) :], directions)

    rates = tuple(Port(f"d{port.name}", port.shape) for port in moving)
    out = tuple(Port(f"d{port.name}", port.shape) for port in outputs)
    return Kernel(f"{name}_rate", namespace, (*moving, *held, *rates), (*outputs, *out), both)


def along_direction(ops: Any, body: Any, moving: Any, held: Any, directions: Any) -> tuple[Any, ...]:
    """The outputs of a body and their derivatives along a direction of its first inputs."""
    dual = DualArithmetic(ops)
    found = body(dual, *(_variables(dual, a, b) for a, b in zip(moving, directions, strict=True)), *held)
    level = dual.level
    values = tuple(_each(value, lambda x: value_of(x, level)) for value in found)
    return (*values, *(_each(value, lambda x: tangent_of(x, 0, level)) for value in found))


def _variables(dual: DualArithmetic, value: Any, rate: Any) -> Any:
    if isinstance(value, list | tuple | np.ndarray):
        return [_variables(dual, a, b) for a, b in zip(value, rate, strict=True)]
    return dual.variable(value, {0: rate})


def _each(value: Any, of: Callable[[Any], Any]) -> Any:
    return [_each(each, of) for each in value] if isinstance(value, list | tuple) else of(value)


def _twin(model: TorqueModel, smooth: Smooth, values: Array) -> Array:
    """The rates by Python."""
    ops: Any = FloatArithmetic()
    size = model.size
    e, de = values[4 : 4 + size], values[21 + size :]
    paper, inertia = values[4 + size : 13 + size].reshape(3, 3), values[13 + size : 16 + size]
    at = along_direction(
        ops, motion_of, (values[:3].tolist(), float(values[3])), (inertia.tolist(),),
        (values[17 + size : 20 + size].tolist(), float(values[20 + size])),
    )  # fmt: skip
    C, L, r, k, _, _, moduli, dC, dL, dr, dk, drate, dc, dmoduli = at
    turn, dturn = np.array(C), np.array(dC, dtype=float)
    count = int(values[16 + size]) or model.phases(k)
    sums, rates, inward = np.zeros(4), np.zeros(4), paper.T
    lit, dlit = np.zeros(3), np.zeros(3)
    weights = 2 * (inertia - inertia[2])
    for j in range(count):
        direction, A, turning, dA = along_direction(ops, point_of, (r, moduli), (j / count,), (dr, dmoduli))
        frame, dframe = np.array(A), np.array(dA, dtype=float)
        l, dl = np.array(direction), np.array(turning, dtype=float)  # noqa: E741
        w, dw = L * l / inertia, (dL * l + L * dl) / inertia
        if model.has_smooth:
            for i in range(model.turns):
                N, XN, dN, dXN = along_direction(
                    ops, _arranged(smooth), (C, A, w.tolist(), e.tolist()), (2 * np.pi * i / model.turns, paper.tolist()),
                    (dC, dA, dw.tolist(), de.tolist()),
                )  # fmt: skip
                sums += np.append(XN, weights @ (w * N)) / (count * model.turns)
                moved = weights @ (dw * N + w * np.array(dN, dtype=float))
                rates += np.append(np.array(dXN, dtype=float), moved) / (count * model.turns)
        for numbers, place in model.plates():
            first = inward @ np.array(numbers[:3]), inward @ np.array(numbers[3:6])
            n, dn, lever, dlever = frame @ first[0], dframe @ first[0], frame @ first[1], dframe @ first[1]
            d = turn.T @ e[place : place + 3]
            dd = dturn.T @ e[place : place + 3] + turn.T @ de[place : place + 3]
            drive, ddrive = frame @ (weights * w), dframe @ (weights * w) + frame @ (weights * dw)
            arc = LitArc.of(n[2] * d[2], _wave(n, d))
            change = arc.rates(dn[2] * d[2] + n[2] * dd[2], _wave(dn, d) + _wave(n, dd))
            given, directions = (n, lever, d, drive, *arc.means), (dn, dlever, dd, ddrive, *change)
            moved, slope, dmoved, dslope = along_direction(
                ops, lambda _, *rest: plate_share(*rest), given, (numbers[6:],), directions
            )
            lit += np.array(moved) / count
            dlit += np.array(dmoved) / count
            sums[3] += slope / count
            rates[3] += dslope / count
    sums[:3] += turn @ lit
    rates[:3] += dturn @ lit + turn @ dlit
    H, dH = values[:3], values[17 + size : 20 + size]
    power = (2 * (dH @ sums[:3] + H @ rates[:3]) - rates[3]) / (2 * inertia[2])
    return np.concatenate([rates, np.array([power, dk, drate, dL, dr[2], dc], dtype=float)])


def _wave(n: Array, d: Array) -> complex:
    return complex(n[0] * d[0] + n[1] * d[1], n[0] * d[1] - n[1] * d[0])
