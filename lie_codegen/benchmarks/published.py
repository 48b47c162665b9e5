"""lie-codegen bench published: steering tasks with a known best value, by closed forms, two methods that agree, or print; ours beside it.

Each row says whether ours is as good: a cost or a time at most 2e-5 above the known one (printed to six digits or seven), a count at least as large,
an error or infidelity below what is asked. Sources: Dubins (1957); Boscain and Mason, J. Math. Phys. 47 (2006) 062101, the flip of a qubit;
Bilimoria and Wie, J. Guid. Control Dyn. 16 (1993) 446, a cube; else costs on which a direct method and transversal shooting agreed.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.errors import InputError, SteeringError
from lie_codegen.flow.batched_exponential import expm
from lie_codegen.groups.catalogue_load import group
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.groups.pauli import pauli
from lie_codegen.steering.front import steer
from lie_codegen.steering.goals import Pointing, Position, UpToPhase

_CLOSE = 2e-5
_H = np.array([[1, 1], [1, -1]]) / np.sqrt(2)
_X, _Z = np.array([[0, 1], [1, 0]]), np.diag([1, -1])
_QUBIT: dict[str, Any] = {"drift": [0, 0, 1], "bounds": {"sx": 1, "sy": 0.5}}
_CNOT = np.eye(4)[[0, 1, 3, 2]]
_LOCAL = ("XI", "YI", "IX", "IY")
_THREE = ("XII", "YII", "IXI", "IYI", "IIX", "IIY")


@dataclass(frozen=True)
class PublishedRow:
    """One task.

    Attributes:
        task: in words.
        known, ours: the values.
        kind: "cost" (smaller is better), "count" (larger is) or "error" (below `known`).
        seconds: wall time.
    """

    task: str
    known: float
    ours: float
    kind: str
    seconds: float

    @property
    def good(self) -> bool:
        """Whether ours is as good."""
        if self.kind == "count":
            return self.ours >= self.known
        return self.ours <= self.known * (1 + _CLOSE if self.kind == "cost" else 1)


def _cost(*args: Any, **options: Any) -> Callable[[], float]:
    return lambda: steer(*args, **options).cost


def _duration(*args: Any, **options: Any) -> Callable[[], float]:
    return lambda: steer(*args, objective="time", **options).duration


def _cliffords() -> float:
    """Of the 48 elements +-C of SU(2) over the 24 Clifford gates, how many are reached."""
    s = np.diag([np.exp(-1j * np.pi / 4), np.exp(1j * np.pi / 4)])
    found: list[Array] = [np.eye(2, dtype=complex)]
    for element in found:  # grows while it is read, until products give nothing new
        for generator in (s, -1j * _H):
            new = element @ generator
            if all(np.max(np.abs(new - other)) > 1e-9 for other in found):
                found.append(new)
    return float(sum(_reaches("su2", gate, ("sx", "sy"), 6.0, **_QUBIT) for gate in found))


def _reaches(*args: Any, **options: Any) -> bool:
    try:
        return bool(steer(*args, **options).error < 1e-8)
    except SteeringError:
        return False


def _qubits(count: int) -> MatrixGroup:
    made = pauli(count)
    if not isinstance(made, MatrixGroup):
        raise InputError("pauli of a number is a group")
    return made


def _seeds(duration: float, bound: float) -> Callable[[], float]:
    """Of 12 seeds, a start for each phase of a CNOT in a round, how many arrive."""
    options: dict[str, Any] = {
        "drift": {"ZZ": 1},
        "bounds": bound,
        "pieces": 30,
        "objective": "none",
        "starts": 1,
    }

    def count() -> float:
        gate = UpToPhase(_CNOT)
        return float(sum(_reaches(_qubits(2), gate, _LOCAL, duration, seed=seed, **options) for seed in range(12)))

    return count


def _three(order: Sequence[int]) -> Callable[[], float]:
    """Infidelity of a gate that permutes the states of a chain of three qubits."""
    options: dict[str, Any] = {"drift": {"ZZI": 1, "IZZ": 1}, "bounds": 4, "pieces": 60, "objective": "none"}
    return lambda: 1 - steer(_qubits(3), UpToPhase(np.eye(8)[list(order)]), _THREE, 12.0, **options).details["fidelity"]


def _random(name: str, controls: tuple[str, ...], drift: dict[str, float]) -> Callable[[], float]:
    """Of 25 ends of random bounded controls on another grid, how many are reached."""

    def count() -> float:
        G = _qubits(2) if name == "pauli2" else group(name)
        rng = np.random.default_rng(17)
        rows = [G.labels.index(label) for label in controls]
        base = np.array([drift.get(label, 0.0) for label in G.labels])
        reached = 0
        for _ in range(25):
            u = np.tile(base, (37, 1))
            u[:, rows] += rng.uniform(-1, 1, (37, len(rows)))
            X = np.eye(G.degree, dtype=G.basis.dtype)
            for step in expm(G.hat(5.0 / 37 * u)):
                X = X @ step
            reached += _reaches(G, X, controls, 5.0, method="direct", drift=drift or None, bounds=1, polish=False)
        return float(reached)

    return count


def _robust() -> float:
    spread = [{"drift": (0, 0, s), "gain": g} for s, g in product((-0.2, 0, 0.2), (0.95, 1.05))]
    return float(steer("su2", -1j * _X, ("sx", "sy"), 8.0, bounds=1, spread=spread).details["worst_infidelity"])


def _swings() -> float:
    """Largest error of 1,000 random attitudes."""
    rng, so3 = np.random.default_rng(5), group("so3")
    worst = 0.0
    for q in rng.normal(size=(1000, 4)):
        axis = q[1:] / np.linalg.norm(q[1:])
        R = expm(so3.hat(2 * np.arctan2(np.linalg.norm(q[1:]), q[0]) * axis))
        worst = max(worst, steer(so3, R, ("w1", "w2"), 24.0, method="swing_twist").error)
    return worst


def _pose(x: float, y: float, angle: float = 0.0) -> Array:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, x], [s, c, y], [0, 0, 1]])


def _rotation(x: Sequence[float]) -> Array:
    return np.asarray(expm(group("so3").hat(x)))


def _tasks() -> list[tuple[str, float, str, Callable[[], float]]]:
    flip: dict[str, Any] = {"drift": (0, 0, 2)}
    turn, direction = ("w1", "w2"), (0.48, -0.6, 0.64)
    down = Pointing((0, 0, 1), (0, 0, -1))
    cube: dict[str, Any] = {"method": "direct", "dynamics": "second_order", "inertia": 1.0, "bounds": 1, "rounds": 1}
    wave = ("cos(1.3*t)", "sin(1.3*t)", 0)
    systems = {
        "so3": (("w1",), {"w3": 1.0}), "se2": (("omega",), {"vx": 1.0}), "su2": (("sx",), {"sz": 1.0}), "sl2": (("h",), {"e": 1.0, "f": -1.0}),
        "su3": (("l1", "l3", "l7"), {}), "se3": (("w1", "w2", "w3"), {"v1": 1.0}), "pauli2": (_LOCAL, {"ZZ": 1.0}),
    }  # fmt: skip
    return [
        ("SU(2), drift, bounds: -i Hadamard", 2.40915, "cost", _cost("su2", -1j * _H, ("sx", "sy"), 6.0, **_QUBIT)),
        ("SU(2), drift, bounds: +i Hadamard", 2.89735, "cost", _cost("su2", 1j * _H, ("sx", "sy"), 6.0, **_QUBIT)),
        ("SU(2), drift, bounds: i X", 1.64536, "cost", _cost("su2", 1j * _X, ("sx", "sy"), 6.0, **_QUBIT)),
        ("48 Clifford elements reached", 44, "count", _cliffords),
        *((f"CNOT, T = {T:g}, |u| <= {b:g}: seeds of 12 that arrive", 12, "count", _seeds(T, b)) for T, b in ((6, 4), (6, 1), (3, 4), (2, 8))),
        ("CNOT, T = 6, |u| <= 4", 8.6643, "cost", _cost(_qubits(2), UpToPhase(_CNOT), _LOCAL, 6.0, drift={"ZZ": 1}, bounds=4, pieces=30)),
        ("Toffoli, chain of three", 1e-9, "error", _three((0, 1, 2, 3, 4, 5, 7, 6))),
        ("Fredkin, chain of three", 1e-9, "error", _three((0, 1, 2, 3, 4, 6, 5, 7))),
        *((f"{name}: random feasible targets of 25", 25, "count", _random(name, *each)) for name, each in systems.items()),
        ("car that turns on the spot, .5 m sideways", 1.9163844, "cost", _duration("se2", _pose(0, 0.5), ("omega", "vx"), 3.0, bounds=1)),
        ("the same, 1 m", 2.6362321, "cost", _duration("se2", _pose(0, 1.0), ("omega", "vx"), 3.0, bounds=1)),
        ("flip of a qubit, E = 1, M = 1/2", 4.892901, "cost", _duration("so3", down, ((2, 0, 0),), 5.0, bounds=0.5, **flip)),
        ("flip of a qubit, E = 1, M = 1/5", 12.0799, "cost", _duration("so3", down, ((2, 0, 0),), 12.0, bounds=0.2, **flip)),
        ("half turn of a cube by torques", 3.2430833, "cost", _duration("so3", np.diag([-1.0, -1.0, 1.0]), ("w1", "w2", "w3"), 3.5, **cube)),
        ("SO(3), a line of sight: the third axis", float(np.arccos(0.64) ** 2), "cost", _cost("so3", Pointing((0, 0, 1), direction), turn, 1.0)),
        ("SO(3), a line of sight: the first axis", 2.473659, "cost", _cost("so3", Pointing((1, 0, 0), direction), turn, 1.0)),
        *((f"SE(2), to the place {p}", c, "cost", _cost("se2", Position(p), ("omega", "vx"), 1.0)) for p, c in (((0, 1), 5.161601), ((-1, 0.5), 1.880744), ((0.5, 2), 9.288260))),
        ("SO(3), fuel", 3.182836, "cost", _cost("so3", _rotation([0.4, -0.3, 0.9]), turn, 5.0, bounds=1, objective="fuel")),
        ("SO(3), a control that turns", 1.40429, "cost", _cost("so3", _rotation([0.4, -0.3, 0.7]), (wave,), 6.0)),
        ("X gate, drift +-.2, gain +-5 %: worst infidelity", 7e-3, "error", _robust),
        ("swing and circle, 1,000 attitudes: worst error", 1e-12, "error", _swings),
    ]  # fmt: skip


def bench_published(only: str = "", say: Callable[[str], None] | None = None) -> tuple[list[PublishedRow], list[str]]:
    """The rows, and the tasks in which ours is not as good."""
    rows = []
    for task, known, kind, solve in _tasks():
        if only.lower() not in task.lower():
            continue
        if say is not None:
            say(task)
        began = time.perf_counter()
        try:
            ours = float(solve())
        except SteeringError:
            ours = float("nan")
        rows.append(PublishedRow(task, known, ours, kind, time.perf_counter() - began))
    return rows, [f"{row.task}: {row.ours:.8g}, known {row.known:.8g}" for row in rows if not row.good]


def table(rows: Sequence[PublishedRow], missed: Sequence[str]) -> str:
    """The rows as a text."""
    lines = [f"{'':62}{'known':>14}{'ours':>14}{'s':>9}"]
    lines += [f"{row.task:62}{row.known:14.8g}{row.ours:14.8g}{row.seconds:9.2f}" for row in rows]
    return "\n".join([*lines, *(f"missed: {miss}" for miss in missed)])
