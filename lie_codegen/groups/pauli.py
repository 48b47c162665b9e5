"""lc.pauli: SU(2^n) with a basis of Pauli strings, and the strings as matrices."""

from __future__ import annotations

from functools import lru_cache, reduce
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lie_codegen.algebra.lie_algebra import LieAlgebra
from lie_codegen.errors import InputError
from lie_codegen.exact.numbers import Number
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.on_demand import sympy as sp

#: Entries (column, factor) of the rows of each matrix: every row of a string has one.
_ROWS: dict[str, tuple[tuple[int, complex], tuple[int, complex]]] = {
    "I": ((0, 1), (1, 1)), "X": ((1, 1), (0, 1)), "Y": ((1, -1j), (0, 1j)), "Z": ((0, 1), (1, -1)),
}  # fmt: skip
#: a b = phase * c for one qubit.
_PRODUCT: dict[tuple[str, str], tuple[complex, str]] = {
    **{("I", p): (1, p) for p in "IXYZ"}, **{(p, "I"): (1, p) for p in "XYZ"}, **{(p, p): (1, "I") for p in "XYZ"},
    **{(a, b): (1j, c) for a, b, c in ("XYZ", "YZX", "ZXY")}, **{(b, a): (-1j, c) for a, b, c in ("XYZ", "YZX", "ZXY")},
}  # fmt: skip
_MOST_QUBITS = 3


def pauli(qubits: int | str) -> MatrixGroup | NDArray[np.complex128]:
    """SU(2^n) with the basis A_P = -i P / 2 of Pauli strings P of n qubits; or, given a string such as "ZX", its matrix P.

    The labels are the strings without the identity, "IX", "IY", "IZ", "XI", ..., so that the Hamiltonian H = sum_P h_P P is the
    velocity with components 2 h_P, and X' = -i H X is `lc.steer(..., equation="right")`. [A_P, A_Q] = +-A_R where P Q = +-i R,
    and 0 where P and Q commute.

    Args:
        qubits: n from 1 to 3, or a string of I, X, Y, Z.

    Raises:
        InputError: another number, or another letter.
    """
    if isinstance(qubits, str):
        return pauli_matrix(qubits)
    if isinstance(qubits, bool) or not isinstance(qubits, int | np.integer) or not 1 <= qubits <= _MOST_QUBITS:
        raise InputError(
            f"pauli: a number of qubits from 1 to {_MOST_QUBITS}, or a string such as 'ZX', got {qubits!r}"
        )
    return _group(int(qubits))


def pauli_matrix(string: str) -> NDArray[np.complex128]:
    """(2^n, 2^n) the matrix of a Pauli string, "ZX": Z on the first qubit, X on the second.

    Raises:
        InputError: an empty string, or a letter that is not I, X, Y or Z.
    """
    if not string or any(letter not in _ROWS for letter in string):
        raise InputError(f"pauli: {string!r} is no string of I, X, Y, Z")
    matrices = [
        np.array([[f if j == c else 0 for j in range(2)] for c, f in _ROWS[letter]], complex) for letter in string
    ]
    return np.asarray(reduce(np.kron, matrices))


@lru_cache(maxsize=_MOST_QUBITS)
def _group(n: int) -> MatrixGroup:
    labels = tuple("".join(letters) for letters in product("IXYZ", repeat=n))[1:]
    position = {label: k for k, label in enumerate(labels)}
    table: dict[tuple[int, int], dict[int, Number]] = {}
    for i, first in enumerate(labels):
        for j in range(i + 1, len(labels)):
            phase, string = _multiplied(first, labels[j])
            if phase.imag:  # strings that anticommute: P Q = phase R, [-i P / 2, -i Q / 2] = Im(phase) (-i R / 2)
                table[i, j] = {position[string]: sp.Integer(int(phase.imag))}
    algebra = LieAlgebra(f"pauli{n}", labels, table)
    basis = tuple(_exact(label) for label in labels)
    return MatrixGroup(algebra, basis, ("rad",) * len(labels), f"SU({2**n}) with the basis of Pauli strings, -i P / 2")


def _multiplied(a: str, b: str) -> tuple[complex, str]:
    phase: complex = 1
    letters = []
    for x, y in zip(a, b, strict=True):
        factor, letter = _PRODUCT[x, y]
        phase *= factor
        letters.append(letter)
    return phase, "".join(letters)


def _exact(string: str) -> sp.ImmutableMatrix:
    """-i P / 2."""
    d = 2 ** len(string)
    values: dict[complex, Any] = {1: -sp.I / 2, -1: sp.I / 2, 1j: sp.Rational(1, 2), -1j: -sp.Rational(1, 2)}
    rows = [[sp.S.Zero] * d for _ in range(d)]
    for r, row in enumerate(pauli_matrix(string)):
        column = int(np.flatnonzero(row)[0])
        rows[r][column] = values[complex(row[column])]
    return sp.ImmutableMatrix(rows)
