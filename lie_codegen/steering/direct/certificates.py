"""Proofs that no controls within the bounds reach the goal in the time; anything that is not proved here is not called infeasible.

With anti-Hermitian velocities a path of speed |a| in a bi-invariant norm is at least as long as the principal logarithm of
X0^-1 T in that norm (Frobenius and spectral here, in all of U(d)). Ways of two controls alone are longer than that where they must turn
by brackets: `shortest` says how long at least. A column X e of motions with X' = X hat(a) moves at the speed
|hat(a) e|, and so at least the straight way. Both speeds are convex in the controls: their largest value is at a vertex of the box.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from itertools import product

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.steering.direct.assemble import Manoeuvre
from lie_codegen.steering.direct.shortest import least_length
from lie_codegen.steering.end import has_positions

_MOST_CONTROLS = 10
#: Relative margin, so that rounding proves nothing.
_SAFE = 1e-9


@dataclass(frozen=True)
class Certificate:
    """A proof of infeasibility: what the goal needs is more than the bounds allow.

    Attributes:
        kind: "distance" (the whole motion), "length" (of ways of these controls), "turn" or "position".
        need: length of the shortest way, in the unit of `kind`: a norm of the logarithm, rad, or m.
        most: the longest way that the bounds allow in the time.
    """

    kind: str
    need: float
    most: float

    def __str__(self) -> str:
        what = {
            "distance": "the goal is",
            "length": "along these controls the goal is",
            "turn": "the turn is",
            "position": "the position is",
        }[self.kind]
        return f"{what} {self.need:.6g} away, and the bounds allow at most {self.most:.6g} in the time"


def certificate(task: Manoeuvre) -> Certificate | None:
    """A proof that the goal cannot be reached, the strongest found; None where there is none."""
    box = _box(task)
    if box is None:
        return None
    found = [each for each in (_whole(task, box), _columns(task, box.speeds), _along(task)) if each is not None]
    return max(found, key=lambda each: each.need / max(each.most, 1e-300), default=None)


@dataclass(frozen=True, eq=False)
class _Box:
    """The vertices of a box of controls.

    Attributes:
        speeds: (2^m, d, d) hat of the velocity there.
        whole, widest: the largest Frobenius and spectral norm of these, where all velocities are anti-Hermitian.
    """

    speeds: Array
    whole: float | None
    widest: float | None


def _box(task: Manoeuvre) -> _Box | None:
    """The box of the controls; None where it has no vertices, too many, or depends on time."""
    if not task.system.steady or task.controls > _MOST_CONTROLS:
        return None
    if not np.all(np.isfinite(task.low)) or not np.all(np.isfinite(task.high)):
        return None
    system, now = task.system, np.zeros(1)
    return _vertices(
        system.group,
        system.directions_at(now).tobytes(),
        system.drift.at(now).tobytes(),
        task.low.tobytes(),
        task.high.tobytes(),
    )


@lru_cache(maxsize=16)
def _vertices(group: MatrixGroup, directions: bytes, drift: bytes, low: bytes, high: bytes) -> _Box:
    """The box of (m, n) directions and an (n,) drift: the same for every target of a system."""
    corners = np.array(list(product(*zip(np.frombuffer(low), np.frombuffer(high), strict=True))))
    velocities = np.frombuffer(drift) + corners @ np.frombuffer(directions).reshape(-1, group.dim)
    speeds = np.asarray(group.hat(velocities))
    if not _anti_hermitian(group):
        return _Box(speeds, None, None)
    # the singular values of an anti-Hermitian matrix are those of a Hermitian one, its eigenvalues
    sizes = np.abs(np.linalg.eigvalsh(1j * speeds))
    return _Box(speeds, float(np.max(np.linalg.norm(sizes, axis=1))), float(np.max(sizes)))


def _whole(task: Manoeuvre, box: _Box) -> Certificate | None:
    """By a bi-invariant norm; of every variant of the goal, or there is no proof."""
    end = task.end
    if end.elements is None or len(end.before) or len(end.after) or box.whole is None or box.widest is None:
        return None
    relative = np.linalg.solve(np.broadcast_to(task.system.start, end.elements.shape), end.elements)
    angles = np.abs(np.angle(np.linalg.eigvals(relative)))
    best: Certificate | None = None
    for need, most in (
        (np.min(np.linalg.norm(angles, axis=1)), box.whole),
        (np.min(np.max(angles, axis=1)), box.widest),
    ):
        best = _stronger(best, _proof("distance", float(need), most * task.duration))
    return best


@lru_cache(maxsize=64)
def _anti_hermitian(group: MatrixGroup) -> bool:
    """Whether every velocity of the group is."""
    return bool(np.allclose(group.basis, -np.conj(np.swapaxes(group.basis, 1, 2)), atol=1e-12))


def _along(task: Manoeuvre) -> Certificate | None:
    """By the length of ways of two controls without drift; of every variant of the goal, or there is no proof."""
    system, end, now = task.system, task.end, np.zeros(1)
    if end.elements is None or len(end.before) or len(end.after) or system.right or np.any(system.drift.at(now)):
        return None
    controls = system.directions_at(now)[0]
    needs = [least_length(system.group, controls, np.linalg.solve(system.start, each)) for each in end.elements]
    known = [each for each in needs if each is not None]
    if len(known) < len(needs):
        return None
    most = float(np.linalg.norm(np.maximum(np.abs(task.low), np.abs(task.high)))) * task.duration
    return _proof("length", min(known), most)


def _columns(task: Manoeuvre, speeds: Array) -> Certificate | None:
    """By the way of X e for the columns e of the goal, or of a whole element, where the velocity acts from the right."""
    end, group, system = task.end, task.system.group, task.system
    d, moving = group.degree, has_positions(group)
    corner = group.basis[:, : d - 1, : d - 1] if moving else group.basis
    rigid = not group.is_complex and np.allclose(corner, -np.swapaxes(corner, 1, 2), atol=1e-12)
    if not rigid or system.right or len(end.before) or len(end.after):
        return None
    best: Certificate | None = None
    if end.elements is None:
        # pointing, position: one column, whose rows the left matrix picks and scales
        e = end.right[:, 0]
        scale = float(np.max(np.abs(end.left)))
        way = float(np.linalg.norm(end.left @ system.start @ e - end.values[0][:, 0])) / scale
        pointing = e[-1] == 0 if moving else True
        most = float(np.max(np.linalg.norm(speeds @ e, axis=1))) * task.duration
        if pointing:
            way = 2 * float(np.arcsin(min(1.0, way / 2)))
        return _proof("turn" if pointing else "position", way, most)
    if moving:
        way = float(np.linalg.norm(end.elements[0][:-1, -1] - system.start[:-1, -1]))
        most = float(np.max(np.linalg.norm(speeds[:, :-1, -1], axis=1))) * task.duration
        best = _stronger(best, _proof("position", way, most))
        turn = system.start[:-1, :-1].T @ end.elements[0][:-1, :-1]
        angle = float(np.max(np.abs(np.angle(np.linalg.eigvals(turn)))))
        fastest = float(np.max(np.linalg.norm(speeds[:, :-1, :-1], ord=2, axis=(1, 2)))) * task.duration
        best = _stronger(best, _proof("turn", angle, fastest))
    return best


def _proof(kind: str, need: float, most: float) -> Certificate | None:
    return Certificate(kind, need, most) if need > most * (1 + _SAFE) + _SAFE else None


def _stronger(a: Certificate | None, b: Certificate | None) -> Certificate | None:
    if a is None or b is None:
        return b if a is None else a
    return max(a, b, key=lambda each: each.need / max(each.most, 1e-300))
