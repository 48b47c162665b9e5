"""Where a motion must end, as equations: L (exp(before) X exp(after)) R = one of the values."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.groups.matrix_group import MatrixGroup


@dataclass(frozen=True)
class End:
    """A goal as equations: L (exp(before) X exp(after)) R = one of the values.

    Attributes:
        left, right: L (p, d), R (d, s).
        values: (variants, p, s).
        before, after: (k, n) free directions of the algebra on either side.
        elements: (variants, d, d) where the goal is an element up to the free directions, else None.
        phases: of the variants, rad, where the goal is a gate up to its phase.
        levels: of the subspace that a gate acts on, where it is not the whole space.
    """

    left: Array = field(repr=False)
    right: Array = field(repr=False)
    values: Array = field(repr=False)
    before: Array = field(repr=False)
    after: Array = field(repr=False)
    elements: Array | None = field(default=None, repr=False)
    phases: tuple[float, ...] = ()
    levels: tuple[int, ...] = ()


def element_end(
    group: MatrixGroup,
    elements: Array,
    before: Array,
    after: Array,
    phases: tuple[float, ...] = (),
    levels: tuple[int, ...] = (),
) -> End:
    """The end where X is one of the elements, up to the free directions."""
    eye = np.eye(group.degree)
    scale = np.ones(group.degree)
    if has_positions(group):
        # metres and radians: positions count in units of the largest distance in sight
        far = float(np.max(np.linalg.norm(elements[:, :-1, -1], axis=1)))
        scale[-1] = 1 / far if far > 1e-3 else 1.0
    right = eye * scale
    return End(eye, right, elements @ right, before, after, elements, phases, levels)


def has_positions(group: MatrixGroup) -> bool:
    """Whether the last row of every X is (0, ..., 0, 1), so that the last column is a position."""
    return not group.is_complex and not np.any(group.basis[:, -1]) and bool(np.any(group.basis[:, :-1, -1]))
