"""Allocation of a body force to thrusters: f = B u with thruster i at r_i pushing along d_i, B_i = (r_i x d_i, d_i)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lie_codegen.errors import InputError, ShapeError
from lie_codegen.kernel.definition import doubles, record_factory
from lie_codegen.kernel.parameter import refuse_input
from lie_codegen.kernel.saved import Saved


@dataclass(frozen=True, eq=False, repr=False)
class Allocation(Saved):
    """Thrusters and how they share a force.

    Attributes:
        B: (n, k) body force per unit of thrust.
        inverse: (k, n) weighted pseudo-inverse W^{-1} B' (B W^{-1} B')^{-1}: the least u' W u with B u = f.
        one_sided: whether thrusts must not be negative.
        balance: (k,) positive u with B u = 0, of unit largest entry, for one-sided thrusters; None otherwise.
    """

    B: NDArray[np.float64]
    inverse: NDArray[np.float64]
    one_sided: bool
    balance: NDArray[np.float64] | None


def thruster_matrix(positions: ArrayLike, directions: ArrayLike) -> NDArray[np.float64]:
    """(6, k) B of thrusters at (k, 3) positions along (k, 3) directions, in the order torque, force.

    Raises:
        ShapeError: the arrays are not both (k, 3).
        InputError: a direction is zero.
    """
    r, d = np.asarray(positions, dtype=float), np.asarray(directions, dtype=float)
    if r.ndim != 2 or r.shape != d.shape or r.shape[1] != 3:
        raise ShapeError(f"positions {r.shape} and directions {d.shape} must both be (k, 3)")
    length = np.linalg.norm(d, axis=1)
    if np.any(length == 0):
        raise InputError(f"thruster {int(np.argmin(length)) + 1} has no direction")
    d = d / length[:, None]
    return np.vstack([np.cross(r, d).T, d.T])


@record_factory(B=doubles)
def allocate(B: ArrayLike, *, weights: Sequence[float] | None = None, one_sided: bool = False) -> Allocation:
    """The allocation of least weighted effort.

    Args:
        B: (n, k) body force per unit of thrust.
        weights: (k,) positive prices of the thrusters; equal if not given.
        one_sided: thrusters only push, as gas jets do; then a positive combination without effect must exist.

    Raises:
        InputError: the thrusters do not span the forces (names the rank), a weight is not positive, or one-sided
        thrusters that
            cannot push every way.
    """
    matrix = np.asarray(B, dtype=float)
    if matrix.ndim != 2:
        raise ShapeError(f"B has shape {matrix.shape}; give (n, k)")
    n, k = matrix.shape
    refuse_input(
        weights, "allocate: weights", "the pseudo-inverse is computed once; make another allocation for other prices"
    )
    price = np.ones(k) if weights is None else np.asarray(weights, dtype=float)
    if price.shape != (k,) or np.any(price <= 0):
        raise InputError(f"weights must be {k} positive numbers")
    rank = int(np.linalg.matrix_rank(matrix))
    if rank < n:
        raise InputError(
            f"{k} thrusters span {rank} of {n} force components: the vehicle is not fully actuated; add thrusters or allocate "
            "only the components they reach"
        )
    scaled = matrix / price
    inverse = scaled.T @ np.linalg.inv(scaled @ matrix.T)
    return Allocation(matrix, inverse, one_sided, _balance(matrix) if one_sided else None)


def _balance(B: NDArray[np.float64]) -> NDArray[np.float64]:
    from scipy.optimize import linprog

    k = B.shape[1]
    found = linprog(np.ones(k), A_eq=B, b_eq=np.zeros(B.shape[0]), bounds=[(1, None)] * k)
    if not found.success:
        raise InputError(
            "one-sided thrusters: no positive combination is without effect, so some forces are out of reach"
        )
    u: NDArray[np.float64] = found.x / np.max(found.x)
    return u
