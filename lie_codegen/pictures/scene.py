"""What a page that moves shows: bodies over time, curves, facts; plain data that becomes JSON."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.errors import InputError
from lie_codegen.groups.build import library_of
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.pictures.solid_lines import edges
from lie_codegen.runtime.rows import row_by_row
from lie_codegen.steering.blocks import Block
from lie_codegen.steering.constraints import Ball, Cone, Obstacle

BODIES = ("box", "satellite", "vehicle", "car", "arrow")
_AXES = 1.0


@dataclass(frozen=True)
class Motion:
    """A body over time: (k, 3, 3) attitudes, (k, 3) positions or None; kind is rotation, pose, plane or point."""

    kind: str
    R: Array
    p: Array | None


@dataclass(frozen=True)
class Curves:
    """Curves over time in one frame: (k, m) values."""

    name: str
    unit: str
    labels: Sequence[str]
    values: Array


@dataclass(frozen=True)
class Scene:
    """All of a page."""

    title: str
    words: str
    t: Array
    motions: Sequence[Motion]
    curves: Sequence[Curves]
    facts: Sequence[tuple[str, str]]
    names: Sequence[str] = ()
    target: Motion | None = None
    obstacles: Sequence[Obstacle] = ()
    solver: Mapping[str, Any] = field(default_factory=dict)


def motion_of(group: MatrixGroup, X: Array) -> Motion:
    """(k, d, d) elements as a body that moves: rotations (SO(3); Ad_X of SU(2): the Bloch sphere), poses in space or in a
    plane; for other groups a point, the first three components of the logarithm."""
    basis, d = group.basis, group.degree
    blocks = basis[:, :-1, :-1]
    if not group.is_complex and d == 3 and np.allclose(basis, -np.swapaxes(basis, 1, 2)):
        return Motion("rotation", np.asarray(X), None)
    if group.is_complex and group.dim == 3:
        images = group.project(X[:, None] @ basis @ np.linalg.inv(X)[:, None])
        adjoint = np.swapaxes(images, 1, 2)
        if np.allclose(adjoint @ np.swapaxes(adjoint, 1, 2), np.eye(3), atol=1e-6):
            return Motion("rotation", adjoint, None)
    moves = not group.is_complex and d in (3, 4) and not np.any(basis[:, -1]) and bool(np.any(basis[:, :-1, -1]))
    if moves and np.any(blocks) and np.allclose(blocks, -np.swapaxes(blocks, 1, 2)):
        if d == 4:
            return Motion("pose", X[:, :3, :3], X[:, :3, 3])
        R = np.tile(np.eye(3), (len(X), 1, 1))
        R[:, :2, :2] = X[:, :2, :2]
        return Motion("plane", R, np.column_stack([X[:, :2, 2], np.zeros(len(X))]))
    x = row_by_row(library_of(group).log, np.ascontiguousarray(X))[0]
    p = np.zeros((len(X), 3))
    p[:, : min(3, group.dim)] = np.nan_to_num(x[:, :3])
    return Motion("point", np.tile(np.eye(3), (len(X), 1, 1)), p)


def distance_curve(group: MatrixGroup, X: Array, target: Array, name: str) -> Curves:
    """|log(target^-1 X)| along a path."""
    x = row_by_row(library_of(group).log, np.ascontiguousarray(np.linalg.solve(target, X)))[0]
    return Curves(name, "", [""], np.linalg.norm(x, axis=1)[:, None])


def scene_data(scene: Scene, body: str | None, faces: Sequence[Any] | None) -> dict[str, Any]:
    """The scene as JSON data, with what the page needs to know to draw it.

    Raises:
        InputError: no such body.
    """
    if body is not None and body not in BODIES:
        raise InputError(f"view: body is one of {', '.join(BODIES)}, or a glTF file; given {body!r}")
    first = scene.motions[0]
    places = (
        np.concatenate([m.p for m in scene.motions if m.p is not None]) if first.p is not None else np.zeros((1, 3))
    )
    low, high = _frame(places, [o for o in scene.obstacles if not isinstance(o, Cone)])
    span = float(np.max(high - low)) if first.p is not None else 0.0
    size = 0.5 if first.p is None else max(1e-9, 0.14 * span) if span > 0 else 0.5
    reach = 1.35 if first.p is None else max(span * 0.62 + size, size * 2)
    own = body or {"rotation": "box", "pose": "vehicle", "plane": "car", "point": "box"}[first.kind]
    cones = [o for o in scene.obstacles if isinstance(o, Cone)]
    return {
        "title": scene.title,
        "words": scene.words,
        "legend": _legend(scene, first),
        "t": scene.t.tolist(),
        "time_unit": "s",
        "play_seconds": 6.0,
        "motions": [
            {
                "kind": motion.kind,
                "body": own,
                "size": size if motion.kind != "point" else 0.3 * size,
                "axes": _AXES if motion.p is None else 1.6 * size,
                "R": motion.R.reshape(-1).tolist(),
                **({"p": motion.p.reshape(-1).tolist()} if motion.p is not None else {}),
            }
            for motion in scene.motions
        ],
        "faces": faces,
        "middle": ((low + high) / 2).tolist() if first.p is not None else [0.0, 0.0, 0.0],
        "reach": reach,
        "sphere": 1.0 if first.p is None else 0,
        "ground": first.kind == "pose",
        "grid": _round(span / 8 if span > 0 else 1.0),
        "target": None if scene.target is None else _target(scene.target, _AXES if first.p is None else 1.6 * size),
        "cones": [
            {"axis": list(o.parameters()[:3]), "direction": list(o.parameters()[3:6]), "angle": float(o.half_angle)}
            for o in cones
        ],
        "balls": [
            {"centre": [float(c) for c in o.center], "radius": float(o.radius)}
            for o in scene.obstacles
            if isinstance(o, Ball)
        ],
        "solids": [[line.tolist() for line in edges(o)] for o in scene.obstacles if isinstance(o, Block)],
        "series": [
            {"name": c.name, "unit": c.unit, "labels": list(c.labels), "values": [_finite(v) for v in c.values.T]}
            for c in scene.curves
        ],
        "facts": [list(pair) for pair in scene.facts],
        "solver": dict(scene.solver),
    }


def _frame(places: Array, solids: Sequence[Ball | Block]) -> tuple[Array, Array]:
    """Least and largest coordinates that are shown: of the places and of solids near them (a long wall does not make the way small)."""
    low, high = places.min(axis=0), places.max(axis=0)
    beyond = 0.5 * float(np.max(high - low))
    ends = [np.pad(corner, ((0, 0), (0, 3 - corner.shape[1]))) for o in solids for corner in o.solid().corners()]
    shown = np.clip(np.concatenate([places, *ends]), low - beyond, high + beyond)
    return shown.min(axis=0), shown.max(axis=0)


def _legend(scene: Scene, first: Motion) -> str:
    what = {
        "rotation": "The axes of the body and where they have pointed",
        "pose": "The body and its way",
        "plane": "The vehicle and its way, seen from above",
        "point": "The first three components of log X",
    }[first.kind]
    if len(scene.motions) > 1 and len(scene.names) > 1:
        what += f"; solid {scene.names[0]}, dashed {scene.names[1]}"
    turn = "" if first.kind == "plane" else " Drag to turn, pinch or wheel to zoom."
    dragged = bool(scene.solver) and first.kind in ("rotation", "plane")  # the page says so itself where it can be
    target = " Dashed: the target." if scene.target is not None and first.kind != "point" and not dragged else ""
    return f"{what}.{turn}{target}"


def _target(target: Motion, axes: float) -> dict[str, Any]:
    """Where the plan is to end: its axes, of a point none."""
    p = np.zeros((1, 3)) if target.p is None else target.p
    return {"R": target.R[0].ravel().tolist(), "p": p[0].tolist(), "axes": 0.0 if target.kind == "point" else axes}


def _finite(column: Array) -> list[float | None]:
    return [float(value) if np.isfinite(value) else None for value in column]


def _round(step: float) -> float:
    """The nearest of 1, 2, 5 times a power of ten."""
    power = 10.0 ** np.floor(np.log10(step))
    return float(power * min((1, 2, 5, 10), key=lambda each: abs(each - step / power)))
