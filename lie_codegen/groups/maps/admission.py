"""What is taken for an element of a group: on it, projected onto it, or refused with the figure that is off.

With kappa = max(1, |X| |X^-1|), the sizes of the largest entries, and `defect` as in `groups.maps.defect`:
    defect <= 1e-12 kappa    taken as it is;
    defect <= 1e-5           the nearest element is taken and its distance reported: rotations in single precision and printed
                             with seven digits lie here; so are matrices whose entries are all within 1e-5 of the nearest
                             element's, as printed with five digits (their defect, of second degree in X, is up to twice that);
    above                    refused. A wrong component (a determinant of -1) is above at any tolerance.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.errors import NotFiniteError, NotOnGroupError, ShapeError
from lie_codegen.groups.build import build
from lie_codegen.groups.derivation import GroupDerivation
from lie_codegen.groups.maps.defect import Figure, figures_of
from lie_codegen.groups.maps.nearest import nearest
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernel.arithmetic import FloatArithmetic
from lie_codegen.kernel.complex_scalar import Complex

if TYPE_CHECKING:
    from lie_codegen.runtime.library import Library

#: On the group to rounding, relative to kappa.
ON_GROUP = 1e-12
#: Projected up to here.
NEAR_GROUP = 1e-5
#: Up to here the entries decide.
_DOUBTFUL = 5 * NEAR_GROUP


@dataclass(frozen=True)
class Admitted:
    """An element, and how far what was given was from it.

    Attributes:
        X: (d, d).
        projected: Frobenius distance to the matrix given; 0.0 where it was taken as it is.
    """

    X: Array
    projected: float


def admitted(group: MatrixGroup, X: ArrayLike, where: str) -> Admitted:
    """The element of the group that X stands for.

    Raises:
        ShapeError, NotFiniteError: naming `where`.
        NotOnGroupError: naming `where`, the condition that fails with its figure, and the distance of the nearest element.
    """
    matrix = _matrix(group, X, where)
    off = float(_library(group).defect(matrix))
    if off <= ON_GROUP:
        return Admitted(matrix, 0.0)
    with np.errstate(all="ignore"):
        try:
            kappa = max(1.0, float(np.max(np.abs(matrix)) * np.max(np.abs(np.linalg.inv(matrix)))))
        except np.linalg.LinAlgError:
            kappa = 1.0
    if off <= ON_GROUP * kappa:
        return Admitted(matrix, 0.0)
    if off <= _DOUBTFUL:
        found = nearest(group, matrix)
        if off <= NEAR_GROUP or np.max(np.abs(found.X - matrix)) <= NEAR_GROUP:
            return Admitted(found.X, float(found.distance))
    raise NotOnGroupError(f"{where} is not on the group {group.name}: {_why(group, matrix)}")


def admitted_all(group: MatrixGroup, X: Array, where: str) -> tuple[Array, Array]:
    """(N, d, d) elements and their (N,) distances, as `admitted` of each.

    Raises:
        NotOnGroupError: naming the first that is refused by its number.
    """
    several = np.ascontiguousarray(X, dtype=group.basis.dtype)
    if np.all(np.asarray(_library(group).defect.batch(several)) <= ON_GROUP):
        return several, np.zeros(len(several))
    each = [admitted(group, matrix, f"{where}[{number}]") for number, matrix in enumerate(several)]
    return np.array([one.X for one in each]), np.array([one.projected for one in each])


def _matrix(group: MatrixGroup, X: ArrayLike, where: str) -> Array:
    d = group.degree
    try:
        given = np.asarray(X)
        real = not group.is_complex
        if real and np.iscomplexobj(given) and np.any(given.imag != 0):
            raise ShapeError(f"{where}: complex entries, but {group.name} is a group of real matrices")
        matrix = np.ascontiguousarray(given.real if real else given, dtype=group.basis.dtype)
    except (TypeError, ValueError) as error:
        if isinstance(error, ShapeError):
            raise
        raise ShapeError(f"{where}: no array of numbers; give a ({d}, {d}) matrix") from None
    if matrix.shape != (d, d):
        raise ShapeError(f"{where} has shape {matrix.shape}; an element of {group.name} is ({d}, {d})")
    if not np.all(np.isfinite(matrix)):
        raise NotFiniteError(f"{where} holds NaN or infinity")
    return matrix


@lru_cache(maxsize=64)
def _library(group: MatrixGroup) -> Library:
    return build(group)


@lru_cache(maxsize=64)
def _derivation(group: MatrixGroup) -> GroupDerivation:
    return GroupDerivation(group)


def _why(group: MatrixGroup, matrix: Array) -> str:
    """The worst condition as a difference, the distance of the nearest element, and what to do."""
    determinant = complex(np.linalg.det(matrix))
    if abs(determinant) < 1e-300:
        return "it is singular"
    entries: Any = matrix.tolist()
    if group.is_complex:
        entries = [[Complex(z.real, z.imag) for z in row] for row in entries]
    figures: list[Figure] = figures_of(FloatArithmetic(), _derivation(group), entries)
    name, _, plain = max(figures, key=lambda figure: figure[1])
    worst = f"{name} = {_number(plain)}"
    phase = _phase(group, matrix, determinant)
    if phase:
        return f"{worst}; {phase}"
    try:
        found = nearest(group, matrix)
    except NotOnGroupError as error:
        return f"{worst}; no element is nearest to it ({error})"
    return f"{worst}; the nearest element is {float(found.distance):.3g} away: lc.nearest({group.name!r}, X) gives it"


def _number(plain: Any) -> str:
    return f"{complex(plain.re, plain.im):.3g}" if isinstance(plain, Complex) else f"{float(plain):.3g}"


def _phase(group: MatrixGroup, matrix: Array, determinant: complex) -> str:
    """Where a unitary matrix misses SU(n) by its phase alone: a gate, which physics knows up to a phase."""
    d = group.degree
    if not group.is_complex or np.max(np.abs(matrix.conj().T @ matrix - np.eye(d))) > NEAR_GROUP:
        return ""
    angle = -np.angle(determinant) / d
    turned = np.ascontiguousarray(np.exp(1j * angle) * matrix)
    if abs(determinant - 1) <= NEAR_GROUP or not float(_library(group).defect(turned)) <= NEAR_GROUP:
        return ""
    return (
        f"the matrix is unitary and a phase takes it there: X exp({angle:.10g}j), or this times exp(2 pi i k / {d}); "
        "lc.UpToPhase(X) lets a steering task choose"
    )
