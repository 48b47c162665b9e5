"""What every element of a group keeps: conditions that a matrix off the group is caught by, with no false alarm."""

from __future__ import annotations

from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lie_codegen.errors import NotOnGroupError
from lie_codegen.groups.matrix_group import MatrixGroup

Array = NDArray[Any]

_OFF = 1e-8


def check_invariants(group: MatrixGroup, X: Array, where: str) -> None:
    """Refuse a matrix that is certainly not on the group.

        det X = exp(tr hat(x)) > 0 (real), 1 if every A_i is traceless;
        A_i v = 0 => X v = v;  w' A_i = 0 => w' X = w';
        A_i^H S + S A_i = 0 => X^H S X = S (and with the transpose);  X hat(a) X^-1 is in the algebra.

    Necessary, not sufficient: a matrix that passes may still be in another component or another group.

    Raises:
        NotOnGroupError: naming `where` and the condition.
    """
    determinant = np.linalg.det(X)
    if abs(determinant) < 1e-300:
        raise NotOnGroupError(f"{where} is not on {group.name}: it is singular")
    if not group.is_complex and determinant < 0:
        raise NotOnGroupError(f"{where} is not on {group.name}: its determinant {determinant:.6g} is negative")
    traces, right, left, forms = _kept(group)
    size = max(1.0, float(np.max(np.abs(X))))
    inverse = np.linalg.inv(X)
    condition = size * max(1.0, float(np.max(np.abs(inverse))))
    if not np.any(traces) and abs(determinant - 1) > _OFF * condition * group.degree:
        raise NotOnGroupError(f"{where} is not on {group.name}: its determinant is {determinant:.6g}, not 1")
    for off, what in ((X @ right - right, "a vector"), (left @ X - left, "a row vector")):
        _refuse(group, off, size, where, f"{what} that the group fixes")
    for form, adjoint in forms:
        turned = X.conj().T if adjoint else X.T
        _refuse(group, turned @ form @ X - form, size**2, where, "a form that the group preserves")
    for matrix in group.basis:
        moved = X @ matrix @ inverse
        scale = condition * max(1.0, float(np.max(np.abs(matrix))))
        _refuse(group, moved - group.hat(group.project(moved)), scale, where, "the algebra, under X A X^-1,")


def _refuse(group: MatrixGroup, off: Array, scale: float, where: str, what: str) -> None:
    worst = float(np.max(np.abs(off), initial=0.0))
    if worst > _OFF * scale:
        raise NotOnGroupError(f"{where} is not on {group.name}: {what} changes by {worst:.3g}")


@lru_cache(maxsize=64)
def _kept(group: MatrixGroup) -> tuple[Array, Array, Array, tuple[tuple[Array, bool], ...]]:
    """Traces of the basis, fixed columns, fixed rows, and forms with whether they are sesquilinear."""
    basis, d = group.basis, group.degree
    right = _null(np.concatenate(list(basis)))
    left = _null(np.concatenate([matrix.T for matrix in basis])).T
    forms = []
    for adjoint in (False, True) if group.is_complex else (False,):
        # vec, row by row: B S + S A <-> (B (x) I + I (x) A') vec S
        rows = [
            np.kron(matrix.conj().T if adjoint else matrix.T, np.eye(d)) + np.kron(np.eye(d), matrix.T)
            for matrix in basis
        ]
        forms += [(column.reshape(d, d), adjoint) for column in _null(np.concatenate(rows)).T]
    return np.trace(basis, axis1=1, axis2=2), right, left, tuple(forms)


def _null(matrix: Array) -> Array:
    _, values, rows = np.linalg.svd(matrix)
    rank = int(np.sum(values > 1e-12 * max(1.0, float(values[0]))))
    return np.asarray(rows[rank:].conj().T)
