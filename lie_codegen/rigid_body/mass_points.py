"""The inertia of a body made of mass points, about its centre of mass, with principal axes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.errors import InputError, NotFiniteError, ShapeError
from lie_codegen.kernel.saved import Saved

#: Two moments that differ by less, relative to the largest, are equal.
_EQUAL = 1e-9


@dataclass(frozen=True, eq=False, repr=False)
class MassInertia(Saved):
    """What `inertia_from_masses` finds.

    Attributes:
        mass: total [kg].
        center: (3,) centre of mass [m].
        inertia: (3, 3) sum m (|r|^2 1 - r r^T) about it, in the axes of the points [kg m^2].
        moments: (3,) principal moments, ascending.
        axes: (3, 3) principal axes as columns, right-handed: axes^T inertia axes = diag(moments).
        unique_axes: whether the axes are determined up to sign; not where two moments are equal.
    """

    mass: float
    center: Array
    inertia: Array
    moments: Array
    axes: Array
    unique_axes: bool


def inertia_from_masses(masses: ArrayLike, points: ArrayLike) -> MassInertia:
    """The inertia of mass points about their centre of mass.

        J = sum m (|r|^2 1 - r r^T)

    Geyer prints the integral of rho hat(p)^2, which is minus this.

    Args:
        masses: (k,) [kg], not negative.
        points: (k, 3) [m].

    Raises:
        ShapeError, NotFiniteError: shapes that do not fit, NaN.
        InputError: a negative mass, no mass, or points on one line, about which there is no inertia.
    """
    m, p = np.asarray(masses, dtype=float), np.asarray(points, dtype=float)
    if m.ndim != 1 or p.shape != (len(m), 3) or not len(m):
        raise ShapeError(f"inertia_from_masses: masses {m.shape} and points {p.shape}; give (k,) and (k, 3)")
    if not (np.all(np.isfinite(m)) and np.all(np.isfinite(p))):
        raise NotFiniteError("inertia_from_masses: NaN or infinity among masses or points")
    if np.any(m < 0) or not np.any(m > 0):
        raise InputError("inertia_from_masses: masses must not be negative, and not all zero")
    center = m @ p / np.sum(m)
    r = p - center
    J = np.einsum("k,ki,ki->", m, r, r) * np.eye(3) - np.einsum("k,ki,kj->ij", m, r, r)
    moments, axes = np.linalg.eigh(J)
    if moments[0] <= 1e-12 * moments[-1]:
        raise InputError(
            f"inertia_from_masses: the moments {', '.join(f'{x:.6g}' for x in moments)} are those of points on one line; a body needs "
            "three masses that are not on one"
        )
    # Signs: the largest entry of the first two axes is positive, the third makes the frame right-handed.
    for k in range(2):
        axes[:, k] *= np.sign(axes[np.argmax(np.abs(axes[:, k])), k])
    axes[:, 2] = np.cross(axes[:, 0], axes[:, 1])
    unique = bool(np.min(np.diff(moments)) > _EQUAL * moments[-1])
    return MassInertia(float(np.sum(m)), center, J, moments, axes, unique)
