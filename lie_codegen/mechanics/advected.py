"""Vectors of space seen from the body: directions, points and momenta, advected by Gamma' = -(rho(alpha) Gamma + r(alpha)) along X' = X hat(alpha).

    direction   Gamma = X^-1 (v, 0): gravity, the axis of a shaken pivot, a magnetic field     rho(x) = hat(x)
    point       Gamma = X^-1 (p, 1): a buoy, a beacon                                          the same, r(x) the last column of hat(x)
    momentum    mu_b = Ad*_X mu, the conserved momentum of space                               rho(x) = -ad*_x
    adjoint     Gamma = Ad_{X^-1} v: directions where the matrices are complex (Bloch vectors) rho(x) = ad_x

On groups of rigid motions and other affine groups, whose hats end in a row of zeros, the last coordinate is left out.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.errors import InputError, ShapeError
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.identifiers import check_identifier
from lie_codegen.kernel.saved import Saved

KINDS = ("direction", "point", "momentum", "adjoint")


@dataclass(frozen=True, eq=False, repr=False)
class Advected(Saved):
    """One advected vector.

    Attributes:
        group: whose elements carry it.
        name: of it; its components are name1, name2, ...
        kind: "direction", "point", "momentum" or "adjoint".
        vector: (k,) in space, its value at X = 1.
    """

    group: MatrixGroup
    name: str
    kind: str
    vector: Array

    @property
    def size(self) -> int:
        """k."""
        return len(self.vector)

    @cached_property
    def matrices(self) -> tuple[Array, Array]:
        """rho(A_i), (n, k, k), and r(A_i), (n, k)."""
        group, k = self.group, self.size
        c = group.algebra.structure_constants
        if self.kind == "momentum":
            # <ad*_x m, y> = <m, [x, y]>: (ad*_{A_i})_{jk} = c_ijk
            return -c, np.zeros((group.dim, k))
        if self.kind == "adjoint":
            return np.swapaxes(c, 1, 2), np.zeros((group.dim, k))
        basis = group.basis
        offset = basis[:, :k, k] if self.kind == "point" else np.zeros((group.dim, k))
        return np.ascontiguousarray(basis[:, :k, :k]), np.ascontiguousarray(offset)

    def seen(self, X: Array) -> Array:
        """Gamma at configurations (..., d, d): (..., k)."""
        group, inverse = self.group, np.linalg.inv(X)
        if self.kind in ("momentum", "adjoint"):
            first, second = (X, inverse) if self.kind == "momentum" else (inverse, X)
            moved = group.project(first[..., None, :, :] @ group.basis @ second[..., None, :, :])  # Ad A_i, a row an i
            return np.asarray(
                moved @ self.vector if self.kind == "momentum" else np.einsum("...ik,i->...k", moved, self.vector)
            )
        k = self.size
        turned = inverse[..., :k, :k] @ self.vector
        return np.asarray(turned + inverse[..., :k, k] if self.kind == "point" else turned)


def advected_vectors(group: MatrixGroup, given: Mapping[str, Any] | None) -> tuple[Advected, ...]:
    """The vectors of {name: (kind, vector)}.

    Raises:
        InputError: a kind or a name that is unknown; ShapeError: a vector of another length.
    """
    result = []
    for name, entry in (given or {}).items():
        check_identifier(name, "advected")
        if not (isinstance(entry, list | tuple) and len(entry) == 2 and entry[0] in KINDS):
            raise InputError(
                f'advected {name!r}: give (kind, vector), as ("direction", (0, 0, 1)); kinds: {", ".join(KINDS)}'
            )
        kind, vector = entry[0], np.asarray(entry[1], dtype=float)
        sizes = _sizes(group, kind)
        if vector.ndim != 1 or len(vector) not in sizes:
            raise ShapeError(
                f"advected {name!r}: a {kind} of {group.name} has {' or '.join(map(str, sizes))} entries, got shape {vector.shape}"
            )
        if not np.all(np.isfinite(vector)):
            raise InputError(f"advected {name!r}: the vector is not finite")
        if kind == "direction" and group.is_complex:
            kind = "adjoint"
        if _is_affine(group) and kind in ("direction", "point") and len(vector) == group.degree:
            last = 1.0 if kind == "point" else 0.0
            if vector[-1] != last:
                raise InputError(f"advected {name!r}: the last entry of a {kind} is {last:g}, got {vector[-1]:g}")
            vector = vector[:-1]
        result.append(Advected(group, name, kind, vector))
    return tuple(result)


def _is_affine(group: MatrixGroup) -> bool:
    return not np.any(group.basis[:, -1, :])


def _sizes(group: MatrixGroup, kind: str) -> tuple[int, ...]:
    d = group.degree
    if kind in ("momentum", "adjoint") or group.is_complex:
        return (group.dim,) if kind != "point" else ()
    if _is_affine(group):
        return (d - 1, d)
    return (d,) if kind == "direction" else ()
