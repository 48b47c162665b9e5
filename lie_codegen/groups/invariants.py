"""What every element of a group keeps: conditions that a matrix off the group is caught by, with no false alarm."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import lru_cache, partial
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

    Args:
        group: the group.
        X: (d, d), or (N, d, d).
        where: what it is, for the message.

    Raises:
        NotOnGroupError: naming `where` (with its number, of several) and the condition.
    """
    several = X.reshape(-1, *X.shape[-2:])
    names = [where] if X.ndim == 2 else [f"{where}[{number}]" for number in range(len(several))]
    determinant = np.linalg.det(several)
    _refuse(group, np.abs(determinant) < 1e-300, names, lambda k: "it is singular")
    if not group.is_complex:
        _refuse(group, determinant < 0, names, lambda k: f"its determinant {determinant[k]:.6g} is negative")
    traces, right, left, forms = _kept(group)
    size = np.maximum(1.0, _largest(several))
    inverse = np.linalg.inv(several)
    condition = size * np.maximum(1.0, _largest(inverse))
    if not np.any(traces):
        off = np.abs(determinant - 1) > _OFF * condition * group.degree
        _refuse(group, off, names, lambda k: f"its determinant is {determinant[k]:.6g}, not 1")
    adjoints = {False: several.transpose(0, 2, 1), True: several.conj().transpose(0, 2, 1)}
    changes = [
        (several @ right - right, size, "a vector that the group fixes"),
        (left @ several - left, size, "a row vector that the group fixes"),
        *((adjoints[kind] @ form @ several - form, size**2, "a form that the group preserves") for form, kind in forms),
    ]
    for matrix in group.basis:
        moved = several @ matrix @ inverse
        scale = condition * max(1.0, float(np.max(np.abs(matrix))))
        changes.append((moved - group.hat(group.project(moved)), scale, "the algebra, under X A X^-1,"))
    for change, scale, what in changes:
        worst = _largest(change)
        _refuse(group, worst > _OFF * scale, names, partial(_changed, what, worst))


def _changed(what: str, worst: Array, number: int) -> str:
    return f"{what} changes by {worst[number]:.3g}"


def _largest(values: Array) -> Array:
    """(N,) the largest entry of each."""
    return np.asarray(np.max(np.abs(values), axis=(1, 2), initial=0.0))


def _refuse(group: MatrixGroup, bad: Array, names: Sequence[str], why: Callable[[int], str]) -> None:
    found = np.flatnonzero(bad)
    if len(found):
        raise NotOnGroupError(f"{names[found[0]]} is not on {group.name}: {why(int(found[0]))}")


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
