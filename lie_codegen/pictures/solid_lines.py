"""Boxes and cylinders as lines: their rims in the plane, nets of points and edges in space."""

from __future__ import annotations

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.steering.blocks import Block

#: Points of a circle, and lines along a cylinder.
_CIRCLE, _LINES = 48, 8
_SQUARE = np.array([[1, 1], [-1, 1], [-1, -1], [1, -1], [1, 1]])


def outline(solid: Block) -> Array:
    """(k, 2) the closed rim of a solid in the plane: of its inner rectangle, moved out by its rounding."""
    one = solid.solid()
    if one.rounding[0]:
        phase = np.linspace(0, 2 * np.pi, 101)
        out = np.column_stack([np.cos(phase), np.sin(phase)])
        own = np.sign(out) * one.halves[0] + one.rounding[0] * out
        own[-1] = own[0]
    else:
        own = _SQUARE * one.halves[0]
    return np.asarray(one.centers[0] + own @ one.axes[0].T)


def surface(solid: Block) -> Array:
    """(3, a, b) a net of points on a solid in space."""
    one = solid.solid()
    a, b = np.meshgrid(np.linspace(0, 2 * np.pi, 25), np.linspace(0, np.pi, 13))
    out = np.stack([np.cos(a) * np.sin(b), np.sin(a) * np.sin(b), np.cos(b)], axis=-1)
    if one.rounding[0]:
        own = np.sign(out) * one.halves[0] + one.rounding[0] * out
    elif one.tubes[0]:
        own = out / np.maximum(np.linalg.norm(out[..., :2], axis=-1), np.abs(out[..., 2]))[..., None] * one.extents[0]
    else:
        own = out / np.max(np.abs(out), axis=-1)[..., None] * one.halves[0]
    return np.moveaxis(one.centers[0] + own @ one.axes[0].T, -1, 0)


def edges(solid: Block) -> list[Array]:
    """(k, 3) lines on a solid: its rim in the plane, the edges of a box, two circles and lines along a cylinder, over its half balls too."""
    one = solid.solid()
    if one.centers.shape[1] == 2:
        return [np.pad(outline(solid), ((0, 0), (0, 1)))]
    if one.tubes[0] or one.rounding[0]:
        own = _round_edges(float(one.extents[0, 0]), float(one.halves[0, 2]), bool(one.rounding[0]))
    else:
        faces = [np.column_stack([_SQUARE, np.full(5, side)]) for side in (-1, 1)]
        own = [each * one.halves[0] for each in (*faces, *(np.array([[*at, -1], [*at, 1]]) for at in _SQUARE[:4]))]
    return [np.asarray(one.centers[0] + line @ one.axes[0].T) for line in own]


def _round_edges(radius: float, half: float, rounded: bool) -> list[Array]:
    """Of a cylinder along the last axis."""
    phase = np.linspace(0, 2 * np.pi, _CIRCLE + 1)
    around = radius * np.column_stack([np.cos(phase), np.sin(phase)])
    lines = [np.column_stack([around, np.full(len(phase), side * half)]) for side in (-1, 1)]
    # from the middle of one end along the side to the middle of the other
    rise = np.linspace(0, np.pi / 2, 9) if rounded else np.zeros(1)
    out = radius * np.concatenate([np.cos(rise[::-1]), np.cos(rise)])
    up = np.concatenate([-half - radius * np.sin(rise[::-1]), half + radius * np.sin(rise)])
    for turn in 2 * np.pi * np.arange(_LINES) / _LINES:
        lines.append(np.column_stack([out * np.cos(turn), out * np.sin(turn), up]))
    return lines
