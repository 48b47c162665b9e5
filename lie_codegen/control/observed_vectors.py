"""The vectors that an observer sees, exact, how the algebra acts on them, and whether they determine the state."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.errors import InputError, ShapeError
from lie_codegen.exact.positive_matrix import positive_number, real_number
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernel.parameter import Parameter
from lie_codegen.on_demand import sympy as sp

#: Singular values of {A_a c_i}, relative to the largest, that count as zero.
_RANK = 1e-9


def observed_vectors(directions: Any, points: Any, outputs: Any, d: int, *, rigid: bool) -> list[list[sp.Expr]]:
    """The c_i, exact."""
    found: list[list[sp.Expr]] = []
    size = d - 1 if rigid else d
    for given, last, what in ((directions, 0, "directions"), (points, 1, "points"), (outputs, None, "outputs")):
        if given is None:
            continue
        if what == "points" and not rigid:
            raise InputError("observer: points are seen on SE(n); on SO(n) give directions")
        rows = given.tolist() if hasattr(given, "tolist") else list(given)
        rows = rows if (rows and isinstance(rows[0], list | tuple)) or hasattr(rows[0], "tolist") else [rows]
        for i, row in enumerate(rows):
            entries = [real_number(x, f"{what}[{i}]") for x in (row.tolist() if hasattr(row, "tolist") else row)]
            if len(entries) != (d if last is None else size):
                raise ShapeError(
                    f"observer: {what}[{i}] has {len(entries)} entries; give {d if last is None else size}"
                )
            if last == 0 and not any(entries):
                raise InputError(f"observer: directions[{i}] is zero")
            found.append([*entries, sp.Integer(last)] if rigid and last is not None else entries)
    if not found:
        raise InputError("observer: give directions, points or outputs")
    return found


def known_value(gain: Parameter) -> float:
    """The gain as a double; NaN where it is an input."""
    return float("nan") if gain.value is None else float(gain.value)


def not_negative(value: Any, name: str) -> sp.Expr:
    """A gain that may be zero, exact.

    Raises:
        InputError: naming it: negative or no number.
    """
    found = real_number(value, name)
    if not found >= 0:
        raise InputError(f"{name} = {found} must not be negative")
    return found


def vector_weights(weights: Any, count: int) -> list[sp.Expr]:
    """One positive weight a vector, ones if none are given.

    Raises:
        ShapeError: another number of them. InputError: naming the one that is not positive.
    """
    if weights is None:
        return [sp.S.One] * count
    values = weights.tolist() if hasattr(weights, "tolist") else weights
    values = list(values) if isinstance(values, list | tuple) else [values] * count
    if len(values) != count:
        raise ShapeError(f"observer: {len(values)} weights for {count} vectors")
    return [positive_number(w, f"weights[{i}]") for i, w in enumerate(values)]


def acting_matrices(group: MatrixGroup) -> Array:
    """(n, d, d) the A_a as they act on the vectors: the group's own matrices, or ad_a, (ad_a)_cb = c_ab^c, where these are complex."""
    if not group.is_complex:
        return np.asarray(group.basis)
    constants = np.asarray(group.algebra.structure_constants, dtype=float)
    return np.asarray(np.swapaxes(constants, 1, 2))


def rank_of_outputs(acting: Array, vectors: Sequence[Sequence[float]]) -> int:
    """Of {A_a c_i}: n where the outputs determine the state near any place."""
    moved = np.einsum("aij,kj->aki", acting, np.array(vectors)).reshape(len(acting), -1)
    values = np.linalg.svd(moved, compute_uv=False)
    return int(np.sum(values > _RANK * max(1e-300, values[0])))
