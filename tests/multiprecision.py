"""exp and its Jacobians in fixed point with 220 binary digits, derivatives by differences: an oracle that shares no code.

Numbers are Python integers in units of 2^-220 in numpy object arrays; complex matrices are taken in their real form.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from lie_codegen.groups.matrix_group import MatrixGroup

BITS = 220
ONE = 1 << BITS
#: Central differences are right to 1e-24 in first and second derivatives.
STEP_BITS = 40

#: Integer vector -> flat integer vector.
Function = Callable[[np.ndarray], np.ndarray]


def fixed(values: np.ndarray) -> np.ndarray:
    """Doubles as fixed-point integers, exactly up to 2^-220."""
    ratios = [float(value).as_integer_ratio() for value in np.ravel(values)]
    return np.array([(a << BITS) // b for a, b in ratios], dtype=object).reshape(np.shape(values))


def to_floats(values: np.ndarray) -> np.ndarray:
    """Fixed-point integers as the nearest doubles."""
    return np.array([int(value) / ONE for value in np.ravel(values)])


def times(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return np.asarray((a @ b) >> BITS)


def series(A: np.ndarray, shift: int) -> np.ndarray:
    """sum_k A^k / (k + shift)! with shift 0 or 1, until the terms vanish."""
    term = np.array([[ONE * int(i == j) for j in range(len(A))] for i in range(len(A))], dtype=object)
    total, k = term.copy(), 0
    while np.any(abs(term) > 1):
        k += 1
        # Towards zero, so that the terms do vanish.
        term = np.array([int(x) // (k + shift) if x >= 0 else -(-int(x) // (k + shift)) for x in times(term, A).flat],
                        dtype=object).reshape(A.shape)  # fmt: skip
        total = total + term
    return total


def inverse(M: np.ndarray) -> np.ndarray:
    """Newton's iteration from the inverse in doubles."""
    Y = fixed(np.linalg.inv(to_floats(M).reshape(M.shape)))
    two = fixed(2 * np.eye(len(M)))
    for _ in range(6):
        Y = times(Y, two - times(M, Y))
    return Y


def oracle(group: MatrixGroup, name: str) -> Function:
    """The kernel `name` (exp, ljac, rjac, ljac_inv, rjac_inv), flat in C order, complex entries as (re, im)."""
    if name == "exp":
        basis = [np.block([[A.real, -A.imag], [A.imag, A.real]]) if group.is_complex else A for A in group.basis]
    else:
        sign = -1 if name.startswith("r") else 1
        basis = [sign * c.T for c in group.algebra.structure_constants]
    generators = [fixed(A) for A in basis]
    d = group.degree

    def function(x: np.ndarray) -> np.ndarray:
        A = np.sum([(component * G) >> BITS for component, G in zip(x, generators, strict=True)], axis=0)
        value = series(A, 0 if name == "exp" else 1)
        if name.endswith("_inv"):
            return inverse(value).ravel()
        if name == "exp" and group.is_complex:
            return np.stack([value[:d, :d], value[d:, :d]], axis=-1).ravel()
        return value.ravel()

    return function


def value_and_derivatives(f: Function, x: np.ndarray, u: np.ndarray, v: np.ndarray) -> list[np.ndarray]:
    """f, Df u and D^2 f (u, v) at x, rounded to doubles."""
    centre, first, second = fixed(x), fixed(u) >> STEP_BITS, fixed(v) >> STEP_BITS

    def at(a: int, b: int) -> np.ndarray:
        return f(centre + a * first + b * second)

    slope = (at(1, 0) - at(-1, 0)) << (STEP_BITS - 1)
    curvature = (at(1, 1) - at(1, -1) - at(-1, 1) + at(-1, -1)) << (2 * STEP_BITS - 2)
    return [to_floats(at(0, 0)), to_floats(slope), to_floats(curvature)]
