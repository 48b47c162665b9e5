"""Inertias and gains as exact symmetric matrices, refused when they cannot be what they claim to be."""

from __future__ import annotations

from typing import Any

import numpy as np

from lie_codegen.door import warn_caller
from lie_codegen.errors import InertiaWarning, InputError, NotFiniteError, ShapeError
from lie_codegen.exact.numbers import exact_number
from lie_codegen.on_demand import sympy as sp

#: Smallest eigenvalue, relative to the largest, that counts as positive.
_RELATIVE = 1e-12


def real_number(value: Any, what: str) -> sp.Expr:
    """An exact real number; a float is read as the decimal it prints as, which rounds back to the same double.

    Raises:
        InputError, NotFiniteError: not a finite real number; names `what`.
    """
    if isinstance(value, complex | np.complexfloating):
        if value.imag != 0:
            raise InputError(f"{what} is {value}; it must be real")
        value = value.real
    if isinstance(value, float | np.floating):
        if not np.isfinite(value):
            raise NotFiniteError(f"{what} is {value}; it must be finite")
        return sp.Rational(repr(float(value)))
    try:
        number = exact_number(value)
    except InputError as error:
        raise type(error)(f"{what}: {error}") from None
    if number.is_real is not True:
        raise InputError(f"{what} is {number}; it must be real")
    return number


def positive_number(value: Any, what: str) -> sp.Expr:
    """An exact positive number.

    Raises:
        InputError: not positive; names `what`.
    """
    number = real_number(value, what)
    if not number > 0:
        raise InputError(f"{what} = {number} must be positive")
    return number


def symmetric_matrix(value: Any, size: int, what: str) -> sp.ImmutableMatrix:
    """An exact symmetric matrix from a scalar (times the identity), a vector (the diagonal) or a matrix.

    Raises:
        ShapeError: another shape.
        InputError: not symmetric, or an entry is not a real number.
    """
    rows = value.tolist() if hasattr(value, "tolist") else value
    if not isinstance(rows, list | tuple):
        return sp.ImmutableMatrix(sp.eye(size) * real_number(rows, what))
    if len(rows) != size:
        raise ShapeError(f"{what} has {len(rows)} rows; give a number, {size} numbers, or a {size} x {size} matrix")
    if not any(isinstance(row, list | tuple) for row in rows):
        return sp.ImmutableMatrix(sp.diag(*[real_number(entry, f"{what}[{i}]") for i, entry in enumerate(rows)]))
    if any(not isinstance(row, list | tuple) or len(row) != size for row in rows):
        raise ShapeError(f"{what} must be a {size} x {size} matrix")
    matrix = sp.ImmutableMatrix(
        [[real_number(entry, f"{what}[{i}][{j}]") for j, entry in enumerate(row)] for i, row in enumerate(rows)]
    )
    for i in range(size):
        for j in range(i):
            if matrix[i, j] != matrix[j, i] and abs(float(matrix[i, j] - matrix[j, i])) > _RELATIVE * _size(matrix):
                raise InputError(
                    f"{what} is not symmetric: entry ({i + 1}, {j + 1}) is {matrix[i, j]} and entry ({j + 1}, {i + 1}) "
                    f"is {matrix[j, i]}"
                )
    return sp.ImmutableMatrix(size, size, lambda i, j: matrix[max(i, j), min(i, j)])


def positive_matrix(value: Any, size: int, what: str) -> sp.ImmutableMatrix:
    """An exact symmetric positive definite matrix; see `symmetric_matrix`.

    Raises:
        InputError: an eigenvalue is not positive; the message gives it.
    """
    matrix = symmetric_matrix(value, size, what)
    values = eigenvalues(matrix)
    if values[0] <= _RELATIVE * abs(values[-1]):
        raise InputError(f"{what} is not positive definite: its eigenvalues are {_listed(values)}")
    return matrix


def attitude_gain(value: Any, size: int, what: str) -> sp.ImmutableMatrix:
    """A gain K of phi = tr(K (1 - R))/2: symmetric with k_i + k_j > 0 for i != j (Bullo and Murray, Lemma A.1).

    Raises:
        InputError: two eigenvalues have a sum that is not positive.
    """
    matrix = symmetric_matrix(value, size, what)
    values = eigenvalues(matrix)
    if size > 1 and values[0] + values[1] <= _RELATIVE * abs(values[-1]):
        raise InputError(
            f"{what} has eigenvalues {_listed(values)}; the sum of any two must be positive, otherwise the error "
            "function is not zero at the reference alone"
        )
    return matrix


def body_inertia(value: Any, what: str = "inertia") -> sp.ImmutableMatrix:
    """Inertia tensor [kg m^2] of a rigid body.

    Raises:
        InputError: not symmetric positive definite.

    Warns:
        InertiaWarning: its principal moments violate the triangle inequality, which no rigid body does; it is still a
            legal metric, as the diag(6, 3, 1) of Geyer's Figure 1.
    """
    matrix = positive_matrix(value, 3, what)
    small, middle, large = eigenvalues(matrix)
    if large > (small + middle) * (1 + _RELATIVE):
        warn_caller(
            f"{what}: the principal moments {_listed(np.array([small, middle, large]))} violate the triangle "
            "inequality, so no rigid body has them; the laws hold all the same",
            InertiaWarning,
        )
    return matrix


def eigenvalues(matrix: sp.MatrixBase) -> np.ndarray:
    """Ascending eigenvalues of an exact symmetric matrix, as doubles."""
    return np.linalg.eigvalsh(as_floats(matrix))


def as_floats(matrix: sp.MatrixBase) -> np.ndarray:
    """The entries as doubles."""
    return np.array([[float(entry) for entry in row] for row in matrix.tolist()])


def _size(matrix: sp.MatrixBase) -> float:
    return max(1e-300, max(abs(float(entry)) for entry in matrix.flat()))


def _listed(values: np.ndarray) -> str:
    return ", ".join(f"{value:.6g}" for value in values)
