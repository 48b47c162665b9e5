"""Why a matrix is no element of a group: the condition that fails, how far the nearest element is, and what to do."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.errors import NotOnGroupError
from lie_codegen.groups.derivation import derivation_of
from lie_codegen.groups.maps.defect import Figure, figures_of
from lie_codegen.groups.maps.nearest import nearest
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernel.arithmetic import FloatArithmetic
from lie_codegen.kernel.complex_scalar import Complex

#: Distance from which a phase alone is blamed: as for elements that are projected.
_NEAR = 1e-5


def why_refused(group: MatrixGroup, matrix: Array, defect: Callable[[Array], float]) -> str:
    """The worst condition as a difference, the distance of the nearest element, and what to do.

    Args:
        group: the group.
        matrix: (d, d), finite.
        defect: how far a matrix is from the group, compiled.
    """
    determinant = complex(np.linalg.det(matrix))
    if abs(determinant) < 1e-300:
        return "it is singular"
    entries: Any = matrix.tolist()
    if group.is_complex:
        entries = [[Complex(z.real, z.imag) for z in row] for row in entries]
    figures: list[Figure] = figures_of(FloatArithmetic(), derivation_of(group), entries)
    name, _, plain = max(figures, key=lambda figure: figure[1])
    worst = f"{name} = {_number(plain)}"
    phase = _phase(group, matrix, determinant, defect)
    if phase:
        return f"{worst}; {phase}"
    try:
        found = nearest(group, matrix)
    except NotOnGroupError as error:
        return f"{worst}; no element is nearest to it ({error})"
    return f"{worst}; the nearest element is {float(found.distance):.3g} away: lc.nearest({group.name!r}, X) gives it"


def _number(plain: Any) -> str:
    return f"{complex(plain.re, plain.im):.3g}" if isinstance(plain, Complex) else f"{float(plain):.3g}"


def _phase(group: MatrixGroup, matrix: Array, determinant: complex, defect: Callable[[Array], float]) -> str:
    """Where a unitary matrix misses SU(n) by its phase alone: a gate, which physics knows up to a phase."""
    d = group.degree
    if not group.is_complex or np.max(np.abs(matrix.conj().T @ matrix - np.eye(d))) > _NEAR:
        return ""
    angle = -np.angle(determinant) / d
    turned = np.ascontiguousarray(np.exp(1j * angle) * matrix)
    if abs(determinant - 1) <= _NEAR or not defect(turned) <= _NEAR:
        return ""
    return (
        f"the matrix is unitary and a phase takes it there: X exp({angle:.10g}j), or this times exp(2 pi i k / {d}); "
        "lc.UpToPhase(X) lets a steering task choose"
    )
