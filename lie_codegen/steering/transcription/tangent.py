"""Linear maps of a group in CasADi: right translation of packed elements, ad, and the bracket paired with a covector."""

from __future__ import annotations

from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.groups.maps.element_pattern import varying_entries
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernel.brackets import ad, bracket_form
from lie_codegen.kernel.casadi_arithmetic import CasadiArithmetic
from lie_codegen.kernel.structural_zeros import is_zero
from lie_codegen.on_demand import casadi as ca

_OPS = CasadiArithmetic(routines=False)


def push(group: MatrixGroup, B: Array) -> tuple[Any, Any]:
    """R, c with pack(X B) = R pack(X) + c."""
    entries = varying_entries(group)
    parts = 2 if group.is_complex else 1
    size = parts * len(entries)

    def packed(X: Array) -> Array:
        picked = np.array([X[i, j] for i, j in entries], dtype=complex if group.is_complex else float)
        return np.ascontiguousarray(picked).view(float)

    rest = np.eye(group.degree, dtype=complex)
    for i, j in entries:
        rest[i, j] = 0
    kind: Any = complex if group.is_complex else float
    constant = packed((rest @ B).astype(kind) if group.is_complex else np.real(rest @ B))
    columns = np.zeros((size, size))
    for number in range(size):
        i, j = entries[number // parts]
        unit = np.zeros((group.degree, group.degree), dtype=complex)
        unit[i, j] = 1j if number % parts else 1
        moved = unit @ B
        columns[:, number] = packed(moved if group.is_complex else np.real(moved))
    return ca.sparsify(ca.DM(columns)), ca.sparsify(ca.DM(constant))


def pushed(group: MatrixGroup, moved: Any, B: Array) -> Any:
    """pack(X B) of moved = pack(X)."""
    R, c = push(group, B)
    return R @ moved + c


def ad_matrix(group: MatrixGroup, theta: Any) -> Any:
    """ad_theta: column j is [theta, e_j]."""
    return _sparse(ad(_OPS, group.algebra, ca.vertsplit(theta)))


def wedge(group: MatrixGroup, w: Any) -> Any:
    """P[i, k] = w . [e_i, e_k]."""
    return _sparse(bracket_form(_OPS, group.algebra, ca.vertsplit(w)))


def _sparse(rows: list[list[Any]]) -> Any:
    """The matrix of these entries; plain zeros are structural ones."""
    result = ca.SX(len(rows), len(rows))
    for i, row in enumerate(rows):
        for j, entry in enumerate(row):
            if not is_zero(entry):
                result[i, j] = entry
    return result
