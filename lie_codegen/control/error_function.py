"""Error functions and transport maps on any matrix group, as exact data.

phi(X, X_d) measures the configuration error, and the transport map takes the reference velocity to nu = P(X, X_d)
xi_d, so that xi_e = xi - nu is the velocity error. The pair must be compatible, d_2 phi + P^T d_1 phi = 0 (A2).
Bullo and Murray, CIT-CDS 97-003, section 3.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, cached_property, lru_cache
from typing import Any

from lie_codegen.errors import InputError, ShapeError
from lie_codegen.exact.budget import current_budget
from lie_codegen.exact.expression import FORMULA_FUNCTIONS, parse_expression
from lie_codegen.exact.positive_matrix import real_number
from lie_codegen.groups.catalogue_load import GroupLike, as_group
from lie_codegen.groups.derivation import derivation_of
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.identifiers import check_identifier
from lie_codegen.kernel.definition import record_factory
from lie_codegen.kernel.kernel import Port
from lie_codegen.kernel.matrix_formula import MatrixLog, matrix_formula, scalar_formula
from lie_codegen.kernel.parameter import is_input
from lie_codegen.kernel.saved import Saved
from lie_codegen.on_demand import sympy as sp
from lie_codegen.runtime.records import find_record, source_of, store_record
from lie_codegen.values import Deferred, Later

#: Transport maps that have a name: nu = Ad_{X^-1 X_d} xi_d, and nu = xi_d.
NAMED_TRANSPORTS = ("right", "left")


@dataclass(frozen=True)
class ErrorSymbols:
    """The symbols in which phi, tau and P are written: entries of X, X_d and their inverses.

    Real entries X11.., Xd11.., Xi11.. (inverse of X), Xdi11.. (inverse of X_d); for a complex group each splits into
    X11re and X11im; above 9 rows X1_1. The matrices are real (see `RealMatrices`) for complex groups.
    """

    group: MatrixGroup

    @property
    def X(self) -> sp.ImmutableMatrix:
        """The configuration."""
        return self.matrix("X")

    @property
    def X_d(self) -> sp.ImmutableMatrix:
        """The reference."""
        return self.matrix("Xd")

    @property
    def X_inverse(self) -> sp.ImmutableMatrix:
        """X^{-1}."""
        return self.matrix("Xi")

    @property
    def X_d_inverse(self) -> sp.ImmutableMatrix:
        """X_d^{-1}."""
        return self.matrix("Xdi")

    def matrix(self, prefix: str) -> sp.ImmutableMatrix:
        """The real matrix of symbols of one of X, Xd, Xi, Xdi."""
        return _symbols(self.group.degree, self.group.is_complex, prefix)

    @property
    def matrices(self) -> dict[str, sp.ImmutableMatrix]:
        """All four, by prefix."""
        return {prefix: self.matrix(prefix) for prefix in ("X", "Xd", "Xi", "Xdi")}

    @property
    def log_right(self) -> tuple[sp.Symbol, ...]:
        """(n) coordinates Lr1 .. Lrn of log(X_d^-1 X)."""
        return tuple(sp.Symbol(f"Lr{k + 1}") for k in range(self.group.dim))

    @property
    def log_left(self) -> tuple[sp.Symbol, ...]:
        """(n) coordinates Ll1 .. Lln of log(X X_d^-1)."""
        return tuple(sp.Symbol(f"Ll{k + 1}") for k in range(self.group.dim))

    @property
    def names(self) -> dict[str, sp.Symbol]:
        """Every symbol by its name, for the closed grammar."""
        symbols = {s for m in self.matrices.values() for entry in m.flat() for s in entry.free_symbols}
        return {symbol.name: symbol for symbol in (*symbols, *self.log_right, *self.log_left)}

    @property
    def logs(self) -> tuple[MatrixLog, ...]:
        """The products whose logarithm a text may take; on orthogonal groups the transpose of X_d is its inverse."""
        basis = derivation_of(self.group).real.basis
        products = [(self.X_d_inverse * self.X, self.log_right), (self.X * self.X_d_inverse, self.log_left)]
        if all(matrix == -matrix.T for matrix in basis):
            products += [(self.X_d.T * self.X, self.log_right), (self.X * self.X_d.T, self.log_left)]
        zero = sp.zeros(*basis[0].shape)
        return tuple(
            MatrixLog(sp.ImmutableMatrix(product), sp.ImmutableMatrix(sum((x * A for x, A in zip(names, basis, strict=True)), zero)),
                      sp.ImmutableMatrix(names))
            for product, names in products
        )  # fmt: skip


@lru_cache(maxsize=64)
def _symbols(d: int, is_complex: bool, prefix: str) -> sp.ImmutableMatrix:
    separator = "_" if d > 9 else ""

    def entry(i: int, j: int, suffix: str = "") -> sp.Symbol:
        return sp.Symbol(f"{prefix}{i + 1}{separator}{j + 1}{suffix}")

    if not is_complex:
        return sp.ImmutableMatrix(d, d, lambda i, j: entry(i, j))
    re = sp.Matrix(d, d, lambda i, j: entry(i, j, "re"))
    im = sp.Matrix(d, d, lambda i, j: entry(i, j, "im"))
    return sp.ImmutableMatrix(sp.Matrix.vstack(sp.Matrix.hstack(re, -im), sp.Matrix.hstack(im, re)))


@dataclass(frozen=True, eq=False, repr=False)
class ErrorFunction(Saved):
    """A pair (phi, transport map) on a group.

    Attributes:
        name: C identifier.
        group: the group it lives on.
        phi: the error function in the symbols of `ErrorSymbols`.
        transport: "right" (nu = Ad_{X^-1 X_d} xi_d), "left" (nu = xi_d), "element" (nu = Ad_tau xi_d) or "matrix".
        tau: (m, m) transport element, for "element".
        P: (n, n) matrix nu = P xi_d, for "matrix".
        constant: L such that phi is quadratic below it (A1), None when it is not known.
        description: one line.
        inputs: the gains that are no numbers but inputs of the law; see `error_inputs`.
    """

    name: str
    group: MatrixGroup
    phi: sp.Expr = Deferred()
    transport: str = "right"
    tau: sp.ImmutableMatrix | None = Deferred(None)
    P: sp.ImmutableMatrix | None = Deferred(None)
    constant: float | None = None
    description: str = field(default="", compare=False)
    inputs: tuple[Port, ...] = ()

    @cached_property
    def uses_log(self) -> bool:
        """Whether phi or the transport holds a logarithm: then it is smooth up to the cut alone, where a turn reaches 180 degrees."""
        symbols = ErrorSymbols(self.group)
        used = set().union(*(each.free_symbols for each in (self.phi, self.tau, self.P) if each is not None))
        return not used.isdisjoint({*symbols.log_right, *symbols.log_left})


@record_factory(group=as_group)
def error_function(
    group: GroupLike,
    phi: Any,
    transport: Any = "right",
    *,
    parameters: Mapping[str, Any] | None = None,
    constant: float | None = None,
    name: str = "user",
) -> ErrorFunction:
    """A user's pair.

    Args:
        group: any matrix group.
        phi: a SymPy expression in `ErrorSymbols`, or a text: entries as X11 and Xd12, or matrices as in
            "tr(K*(1 - Xd^-1*X))/2" (names X, Xd, ^-1, ' for the transpose, tr, norm2 for the sum of squares, log(Xd^-1*X) and
            log(X*Xd^-1), matrices of the algebra, and vee of these, (n, 1)).
        transport: "right", "left", {"tau": matrix or text} for nu = Ad_tau xi_d, or {"P": n x n rows} for nu = P xi_d.
        parameters: numbers and matrices by the names that the texts use; "input" for a number that is an input of the law.
        constant: L of (A1) if you know it; then the region of attraction is reported.
        name: C identifier.

    Raises:
        InputError: unknown transport, an unknown symbol, a constant beside numbers that are inputs; compatibility is checked by `check_compatibility`.
        ExpressionError: a text outside the grammar, with the column.
    """
    group = as_group(group, "error_function")
    given = dict(parameters or {})

    @cache
    def read() -> tuple[sp.Expr, sp.ImmutableMatrix | None, sp.ImmutableMatrix | None]:
        symbols = ErrorSymbols(group)
        values = _parameters(given, symbols)
        return _phi(phi, symbols, values), *_transport(transport, symbols, values)

    # texts that were found in order before are read when a formula is asked for: laws are known by their definitions
    source = source_of(group.definition_text, phi, transport, given, repr(current_budget()))
    if source is None or find_record("error function", source) is None:
        read()
        if source is not None:
            store_record("error function", source, True)
    inputs = tuple(
        Port(key, (), description="of the error function", any_sign=True) for key in given if is_input(given[key])
    )
    if inputs and constant is not None:
        raise InputError(
            f"error_function: constant = {constant:g} is of one phi, and {', '.join(port.name for port in inputs)} can be any: leave constant away"
        )
    kind = {"tau": "element", "P": "matrix"}[next(iter(transport))] if isinstance(transport, Mapping) else transport
    places = (Later(lambda: read()[0]), kind, Later(lambda: read()[1]), Later(lambda: read()[2]))
    return ErrorFunction(name, group, *places, constant, inputs=inputs)


def _parameters(parameters: Mapping[str, Any], symbols: ErrorSymbols) -> dict[str, Any]:
    values: dict[str, Any] = {}
    for key, value in parameters.items():
        if key in symbols.names or key in symbols.matrices:
            raise InputError(f"parameter {key!r} has the name of an entry of the configuration; rename it")
        rows = value.tolist() if hasattr(value, "tolist") else value
        if is_input(rows):
            values[key] = sp.Symbol(check_identifier(key, "parameter"))
        elif isinstance(rows, list | tuple):
            table = rows if rows and isinstance(rows[0], list | tuple) else [[entry] for entry in rows]
            values[key] = sp.ImmutableMatrix([[real_number(entry, key) for entry in row] for row in table])
        else:
            values[key] = real_number(rows, key)
    return values


def _phi(phi: Any, symbols: ErrorSymbols, values: Mapping[str, Any]) -> sp.Expr:
    if isinstance(phi, str):
        return _smooth(scalar_formula(phi, symbols.matrices, symbols.names, values, logs=symbols.logs))
    if not isinstance(phi, sp.Expr):
        raise InputError(f"phi must be a text or a SymPy expression, got {type(phi).__name__}")
    expression = phi.subs({sp.Symbol(key): value for key, value in values.items() if isinstance(value, sp.Expr)})
    _check_symbols("phi", expression.free_symbols - _inputs(values), symbols)
    return _smooth(expression)


def _smooth(phi: sp.Expr) -> sp.Expr:
    """Refuses acos: at the reference its slope is infinite and half of its digits are lost, and so of acos(...)^2.

    Raises:
        InputError: naming what to write instead.
    """
    if phi.has(sp.acos):
        raise InputError(
            "phi holds acos, whose slope is infinite at the reference: for the squared angle give error='so3_geodesic' (on any group "
            "'geodesic'), or norm2(log(Xd^-1*X)) in a formula"
        )
    return phi


def _transport(
    transport: Any, symbols: ErrorSymbols, values: Mapping[str, Any]
) -> tuple[sp.ImmutableMatrix | None, sp.ImmutableMatrix | None]:
    """(tau, P)."""
    if transport in NAMED_TRANSPORTS:
        return None, None
    if isinstance(transport, Mapping) and set(transport) == {"tau"}:
        return _matrix("tau", transport["tau"], symbols, values, symbols.X.rows), None
    if isinstance(transport, Mapping) and set(transport) == {"P"}:
        return None, _matrix("P", transport["P"], symbols, values, symbols.group.dim)
    raise InputError(
        f"transport {transport!r} is not known: give 'right' (Ad of X^-1 X_d), 'left' (the identity), "
        "{'tau': a matrix of the group} or {'P': an n x n matrix}"
    )


def _matrix(what: str, rows: Any, symbols: ErrorSymbols, values: Mapping[str, Any], size: int) -> sp.ImmutableMatrix:
    if isinstance(rows, str):
        matrix = matrix_formula(rows, symbols.matrices, symbols.names, values, logs=symbols.logs)
    elif isinstance(rows, sp.MatrixBase):
        matrix = sp.ImmutableMatrix(rows)
    else:
        names = {**symbols.names, **{key: value for key, value in values.items() if isinstance(value, sp.Expr)}}
        matrix = sp.ImmutableMatrix([[_entry(entry, names) for entry in row] for row in rows])
    if matrix.shape != (size, size):
        raise ShapeError(f"{what} is {matrix.rows} x {matrix.cols}; it must be {size} x {size}")
    _check_symbols(what, matrix.free_symbols - _inputs(values), symbols)
    return matrix


def _entry(entry: Any, names: Mapping[str, sp.Expr]) -> sp.Expr:
    if isinstance(entry, str):
        return parse_expression(entry, names, FORMULA_FUNCTIONS)
    return entry if isinstance(entry, sp.Expr) else real_number(entry, "an entry of the transport")


def _inputs(values: Mapping[str, Any]) -> set[sp.Symbol]:
    return {value for value in values.values() if isinstance(value, sp.Symbol)}


def _check_symbols(what: str, used: Sequence[sp.Symbol] | set[sp.Symbol], symbols: ErrorSymbols) -> None:
    unknown = sorted(str(symbol) for symbol in used if symbol.name not in symbols.names)
    if unknown:
        raise InputError(
            f"{what} holds {', '.join(unknown)}, which is neither an entry of X or X_d nor a parameter; "
            "entries are X11, Xd11, Xi11 (of the inverse of X) and Xdi11, and numbers go into parameters"
        )
