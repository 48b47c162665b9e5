"""How far a motion is from its reference."""

from __future__ import annotations

from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.errors import InputError
from lie_codegen.flow.attitude_metrics import rotation_angle
from lie_codegen.groups.build import library_of
from lie_codegen.runtime.rows import row_by_row


def loop_error(group: Any, X: Array, X_d: Array | None) -> Array:
    """(k,) or (k, N): the angle of X_d^-1 X, or the norm of its logarithm's coordinates; |q - r| off groups."""
    if group is None:
        r = 0.0 if X_d is None else X_d if X_d.ndim == X.ndim else X_d[:, None]
        return np.asarray(np.linalg.norm(X - r, axis=-1))
    relative = X
    if X_d is not None:
        target = X_d if X_d.ndim == X.ndim else X_d[:, None]
        relative = np.linalg.solve(np.broadcast_to(target, X.shape), X)
    flat = np.ascontiguousarray(relative.reshape(-1, *X.shape[-2:]))
    try:
        distance = rotation_angle(group, flat)
    except InputError:
        distance = np.linalg.norm(row_by_row(library_of(group).log, flat)[0], axis=-1)
    return np.asarray(distance).reshape(X.shape[:-2])
