"""lc.plates: convex sets of flat plates, and the force of light or gas on one of them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.errors import InputError, NotFiniteError, ShapeError
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.saved import Saved
from lie_codegen.rigid_body.rotation_formulas import cross


@dataclass(frozen=True, eq=False, repr=False)
class Plates(Saved):
    """A convex set of flat plates in body axes; a panel is two plates, back to back. Self-shadowing is out of scope.

    Attributes:
        normals: (n, 3) outward, of unit length.
        centres: (n, 3) [m] from the centre of mass.
        areas: (n,) [m^2].
        specular, diffuse: (n,) reflected fractions.
    """

    normals: Array
    centres: Array
    areas: Array
    specular: Array
    diffuse: Array


def plates(
    normals: ArrayLike, centres: ArrayLike, areas: ArrayLike, specular: ArrayLike = 0.0, diffuse: ArrayLike = 0.0
) -> Plates:
    """Flat plates in body axes.

    Args:
        normals: (n, 3) outward normals, of any length.
        centres: (n, 3) [m] centres from the centre of mass.
        areas: (n,) [m^2], or one for all.
        specular, diffuse: (n,) fractions of the light that is reflected so, or one for all.

    Raises:
        InputError: a zero normal, a negative area, fractions below 0 or of sum above 1; the plate is named.
    """
    n, r = np.array(normals, dtype=float), np.array(centres, dtype=float)
    if n.ndim != 2 or n.shape[1] != 3 or r.shape != n.shape:
        raise ShapeError(f"plates: normals have shape {n.shape} and centres {r.shape}; both must be (n, 3)")
    try:
        rest = [np.broadcast_to(np.asarray(each, dtype=float), (len(n),)).copy() for each in (areas, specular, diffuse)]
    except ValueError:
        raise ShapeError(f"plates: areas, specular and diffuse are one number each, or {len(n)}") from None
    if not all(np.all(np.isfinite(each)) for each in (n, r, *rest)):
        raise NotFiniteError("plates: a number is NaN or infinite")
    length = np.linalg.norm(n, axis=1)
    for bad, why in (
        (length == 0, "has a normal of length zero"),
        (rest[0] < 0, "has a negative area"),
        ((rest[1] < 0) | (rest[2] < 0), "reflects a negative fraction"),
        (rest[1] + rest[2] > 1 + 1e-12, "reflects more than it receives: specular + diffuse > 1"),
    ):
        if np.any(bad):
            raise InputError(f"plates: plate {int(np.argmax(bad)) + 1} {why}")
    return Plates(n / length[:, None], r, *rest)


def plate_force(ops: Arithmetic, b: Any, n: Any, r: Any, numbers: Any, lit: Scalar) -> list[Scalar]:
    """-P A lit r x [(1 - rho_s) b + (2 rho_s n.b + 2/3 rho_d) n]; numbers (P A, rho_s, rho_d), lit = max(0, n.b)."""
    pressure, specular, diffuse = numbers
    along = 2 * specular * lit + 2 * diffuse / ops.constant(3)
    arm = [(1 - specular) * x + along * y for x, y in zip(b, n, strict=True)]
    return [-(pressure * lit) * each for each in cross(r, arm)]


def checked_plates(body: Any) -> Plates:
    """The plates.

    Raises:
        InputError: it is something else.
    """
    if not isinstance(body, Plates):
        raise InputError(f"expected plates of lc.plates, got {type(body).__name__}")
    return body
