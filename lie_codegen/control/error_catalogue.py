"""The error functions of Bullo and Murray with compatible transport maps, and one for every matrix group.

    so<n>_right   tr(K_p (1 - R_d^T R))/2, nu = Ad_{R^T R_d} xi_d                          section 5.3, (23)-(25)
    so<n>_left    tr(K_p (1 - R R_d^T))/2, nu = xi_d
    se<n>_1..6    the rows of Table 1 with K_1 (attitude) and K_2 (position); n = 2 or 3 and above
    frobenius     k_p |X_d^-1 X - 1|^2/2 on any matrix group, nu = Ad_{X^-1 X_d} xi_d
    geodesic      x^T K_p x/2, x = log(X_d^-1 X), on any matrix group, nu = Ad_{X^-1 X_d} xi_d; on SO(n) and SE(n) also so<n>_geodesic and
                  se<n>_geodesic. d phi = rjac_inv(x)^T K_p x, which is K_p x for K_p = k 1 on SO(3) alone: the force -K_p x of a matrix
                  K_p is no gradient. Smooth up to the cut, where a turn reaches 180 degrees.

Row 5 is printed with (R + R_d)(p - p_d), which is not compatible with (1, 0); the pair phi_3(g g_d^-1) is
(R + R_d)(R^T p - R_d^T p_d), and that is used.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Mapping
from typing import Any

from lie_codegen.control.error_function import ErrorFunction, ErrorSymbols, error_function
from lie_codegen.control.error_inputs import refuse_inputs
from lie_codegen.errors import InputError
from lie_codegen.exact.positive_matrix import attitude_gain, eigenvalues, positive_matrix, positive_number
from lie_codegen.groups.catalogue_load import GroupLike, as_group
from lie_codegen.groups.derivation import derivation_of
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernel.definition import record_factory
from lie_codegen.kernel.kernel import Port
from lie_codegen.kernel.parameter import input_symbols, is_input
from lie_codegen.on_demand import sympy as sp

Gains = Mapping[str, Any]

_ROWS = {
    "1": "gains in the inertial frame; symmetric, not invariant",
    "2": "gains in the reference frame; left-invariant, not symmetric",
    "3": "gains in the body frame; left-invariant, not symmetric",
    "4": "left-invariant and symmetric",
    "5": "right-invariant and symmetric",
    "6": "symmetric, not invariant",
}


def error_names(group: GroupLike) -> tuple[str, ...]:
    """The names of Bullo and Murray's pairs that `catalogue_error` knows for a group; it knows "geodesic" on every group besides.

    Args:
        group: object, catalogue name or file.

    Raises:
        UnknownGroupError: no such group.
    """
    group = as_group(group, "error_names")
    names = ["frobenius"]
    kind = _kind(group)
    if kind == "so":
        names = [f"so{group.degree}_right", f"so{group.degree}_left", *names]
    if kind == "se":
        names = [f"se{group.degree - 1}_{row}" for row in _ROWS] + names
    return tuple(names)


def _geodesic_names(group: MatrixGroup) -> tuple[str, ...]:
    """Of the pair of the logarithm, whose gain is a matrix on the algebra."""
    kind = _kind(group)
    return ("geodesic", *([f"{kind}{group.degree - (kind == 'se')}_geodesic"] if kind else []))


@record_factory()
def catalogue_error(group: MatrixGroup, name: str, gains: Gains) -> ErrorFunction:
    """A pair by name.

    Args:
        group: SO(n), SE(n), or any group for "frobenius".
        name: see the module.
        gains: K_p for SO(n) and "geodesic"; K_1 and K_2 for SE(n); k_p for "frobenius". A number, a diagonal or a matrix; or "input".

    Raises:
        InputError: no such pair on this group, a gain is missing, or it is not positive as it must be.
    """
    known = (*error_names(group), *_geodesic_names(group))
    if name not in known:
        import difflib

        close = difflib.get_close_matches(str(name), known, n=1)
        hint = f"; did you mean {close[0]!r}?" if close else ""
        raise InputError(f"no error function {name!r} on {group.name}; known there: {', '.join(known)}{hint}")
    if name == "frobenius":
        return _frobenius(group, gains)
    if name.endswith("geodesic"):
        return _geodesic(group, name, gains)
    matched = re.fullmatch(r"(so|se)\d+_(\w+)", name)
    variant = matched[2] if matched else ""
    return _rotations(group, name, variant, gains) if variant in ("right", "left") else _motions(group, variant, gains)


def as_error(group: MatrixGroup, error: Any, gains: Mapping[str, Any]) -> ErrorFunction:
    """An `ErrorFunction` from what `tracking_law` accepts, all its gains numbers.

    Raises:
        InputError: none of these, a pair of another group, or a gain that is "input".
    """
    return refuse_inputs(law_error(group, error, gains))


def law_error(group: MatrixGroup, error: Any, gains: Mapping[str, Any]) -> ErrorFunction:
    """The same for a law, where gains may be inputs.

    Raises:
        InputError: none of these, or a pair of another group.
    """
    if isinstance(error, ErrorFunction):
        if error.group != group:
            raise InputError(f"the error function {error.name} is one of {error.group.name}, not of {group.name}")
        return error
    if isinstance(error, str):
        return catalogue_error(group, error, gains)
    if isinstance(error, tuple | list) and len(error) == 2:
        parameters = {key: value for key, value in gains.items() if key.replace("_", "").lower() != "kd"}
        return error_function(group, error[0], error[1], parameters=parameters)
    raise InputError(
        f"error must be one of {', '.join(error_names(group))}, an ErrorFunction or (phi, transport), got {error!r}"
    )


def gain(gains: Gains, name: str, where: str) -> Any:
    """One gain; K_1, k_1, K1 and k1 are the same.

    Raises:
        InputError: it is missing.
    """
    wanted = _plain(name)
    for key, value in gains.items():
        if _plain(key) == wanted:
            return value
    raise InputError(f"{where} needs the gain {name}; given: {', '.join(gains) or 'none'}")


def _plain(name: str) -> str:
    return name.replace("_", "").lower()


def _kind(group: MatrixGroup) -> str:
    """ "so" or "se" where the matrices are those of the usual representation, else ""."""
    if group.is_complex:
        return ""
    d = group.degree
    block = [m[:d, :d] for m in group.exact_basis]
    if d >= 2 and group.dim == d * (d - 1) // 2 and all(m == -m.T for m in block):
        return "so"
    e = d - 1
    rigid = all(m[:e, :e] == -m[:e, :e].T and not any(m[e, :]) for m in group.exact_basis)
    return "se" if e >= 2 and group.dim == e * (e + 1) // 2 and rigid else ""


def _read_gain(
    gains: Gains, name: str, error: str, size: int = 0, matrix: Callable[[Any, int, str], Any] = positive_matrix
) -> tuple[Any, tuple[Port, ...]]:
    """A gain as a number (size 0) or a matrix; or its symbols, and the port that it is an input by."""
    value = gain(gains, name, f"the error function {error}")
    if not is_input(value):
        return (matrix(value, size, name) if size else positive_number(value, name)), ()
    said = "of the error function" + (", symmetric" if size else "")
    # The sum of any two eigenvalues of an attitude gain is positive; one of them may be negative.
    port = Port(name, (size, size) if size else (), description=said, any_sign=matrix is attitude_gain)
    return input_symbols(port), (port,)


def _frobenius(group: MatrixGroup, gains: Gains) -> ErrorFunction:
    symbols = ErrorSymbols(group)
    k, inputs = _read_gain(gains, "k_p", "frobenius")
    error = symbols.X_d_inverse * (symbols.X - symbols.X_d)  # X_d^-1 X - 1 without its cancellation
    return ErrorFunction(
        "frobenius", group, k * sp.Add(*[entry**2 for entry in error.flat()]) / 2, "right",
        description="sum of squares of X_d^-1 X - 1; left-invariant", inputs=inputs,
    )  # fmt: skip


def _geodesic(group: MatrixGroup, name: str, gains: Gains) -> ErrorFunction:
    n = group.dim
    K, inputs = _read_gain(gains, "K_p", name, n)
    phi = _square(K, sp.Matrix(ErrorSymbols(group).log_right)) / 2
    least = None
    if derivation_of(group).real.rigid is not None and n == 3 and not inputs:
        least = float(eigenvalues(K)[0]) * math.pi**2 / 2  # phi on the cut, |x| = pi
    return ErrorFunction(
        name,
        group,
        phi,
        "right",
        constant=least,
        description="x^T K_p x/2, x = log(X_d^-1 X); left-invariant, up to the cut",
        inputs=inputs,
    )


def _rotations(group: MatrixGroup, name: str, side: str, gains: Gains) -> ErrorFunction:
    symbols = ErrorSymbols(group)
    d = group.degree
    K, inputs = _read_gain(gains, "K_p", name, d, attitude_gain)
    R, R_d = symbols.X, symbols.X_d
    return ErrorFunction(name, group, _attitude(K, R - R_d, side), side, constant=_least_pair(K), inputs=inputs)


def _motions(group: MatrixGroup, row: str, gains: Gains) -> ErrorFunction:
    symbols = ErrorSymbols(group)
    e = group.degree - 1
    name = f"se{e}_{row}"
    K1, first = _read_gain(gains, "K_1", name, e, attitude_gain)
    K2, second = _read_gain(gains, "K_2", name, e)
    R, p = symbols.X[:e, :e], symbols.X[:e, e]
    S, q = symbols.X_d[:e, :e], symbols.X_d[:e, e]
    offset: dict[str, Callable[[], sp.MatrixBase]] = {
        "1": lambda: p - q,
        "2": lambda: S.T * (p - q),
        "3": lambda: R.T * (p - q),
        "4": lambda: (R.T + S.T) * (p - q),
        "5": lambda: (R + S) * difference,
        "6": lambda: difference,
    }
    difference = R.T * (p - q) + (R - S).T * q  # R^T p - S^T q: both terms are small near the reference
    phi = _attitude(K1, R - S, "right" if row in "1234" else "left") + _square(K2, offset[row]()) / 2
    kind, tau = {"1": ("element", _element(R.T * S, 0 * p)), "5": ("left", None), "6": (
        "element", _element(sp.eye(e), S.T * q - R.T * p))}.get(row, ("right", None))  # fmt: skip
    return ErrorFunction(name, group, phi, kind, tau, None, _least_pair(K1), _ROWS[row], (*first, *second))


def _attitude(K: sp.MatrixBase, difference: sp.MatrixBase, side: str) -> sp.Expr:
    """tr(K (1 - R_e))/2 from R - R_d, for R_e = R_d^T R ("right") or R R_d^T ("left").

    As (1 - R_e)^T (1 - R_e) = 2 - R_e - R_e^T and K is symmetric, it is tr(K (R - R_d)^T (R - R_d))/4: 1 - R_e, of second order
    in the angle, would be the difference of numbers of size 1, and half of its digits noise at 1e-8 rad.
    """
    columns = difference if side == "right" else difference.T
    return sp.Add(*[_square(K, columns[r, :].T) for r in range(columns.rows)]) / 4


def _square(K: sp.MatrixBase, x: sp.MatrixBase) -> sp.Expr:
    """x^T K x, term by term: SymPy would multiply a number into the differences x_i, and so undo them."""
    pairs = [(i, j) for i in range(x.rows) for j in range(i, x.rows) if K[i, j] != 0]
    return sp.Add(*[sp.Mul(K[i, j] * (1 if i == j else 2), x[i], x[j]) for i, j in pairs])


def _element(R: sp.MatrixBase, p: sp.MatrixBase) -> sp.ImmutableMatrix:
    bottom = sp.Matrix([[0] * R.cols + [1]])
    return sp.ImmutableMatrix(sp.Matrix.vstack(sp.Matrix.hstack(R, p), bottom))


def _least_pair(K: sp.MatrixBase) -> float | None:
    """min over i != j of k_i + k_j; None for a gain that is an input."""
    if K.free_symbols:
        return None
    values = eigenvalues(K)
    return float(values[0] + values[1])
