"""Formulas of matrices as text: "tr(K1*(1 - Xd^-1*X))/2 + norm2(X' * b)/2", in the grammar of `exact.expression`.

tr is the trace, norm2 the sum of squares of all entries (of a number its square), skew(A) = (A - A')/2; log of a matrix is known for
the products that the caller names, and vee of such a log is its (n, 1) coordinates; a number standing where a matrix is needed is that
multiple of the identity. X^-1 and Xd^-1 are known; nothing else can be inverted.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

from lie_codegen.errors import ExpressionError
from lie_codegen.exact.budget import current_budget, over
from lie_codegen.exact.expression import FORMULA_FUNCTIONS, Numbers, Parser
from lie_codegen.on_demand import sympy as sp

_MAX_EXPONENT = 16
_OF_MATRICES = ("tr", "norm2", "skew")
_INVERSES = {"X": "Xi", "Xd": "Xdi"}

Value = Any  # sp.Expr or sp.ImmutableMatrix


class MatrixLog(NamedTuple):
    """A product of matrices, its logarithm as a matrix of symbols, and the coordinates of that."""

    product: sp.ImmutableMatrix
    matrix: sp.ImmutableMatrix
    coordinates: sp.ImmutableMatrix


def formula(
    text: str,
    matrices: Mapping[str, sp.ImmutableMatrix],
    names: Mapping[str, sp.Expr],
    values: Mapping[str, Value],
    *,
    hermitian: bool = False,
    logs: Sequence[MatrixLog] = (),
) -> Value:
    """What a text denotes, a scalar or a matrix; with `hermitian` norm2 sums the squared moduli of complex entries.

    Raises:
        ExpressionError: outside the grammar, an unknown name, or shapes that do not fit.
    """
    functions = {name: function for name, function in FORMULA_FUNCTIONS.items() if name != "atan2"}
    known = {**names, "pi": sp.pi, **values, **{name: matrices[name] for name in _INVERSES if name in matrices}}
    return Parser(text, Matrices(known, functions, {}, matrices, tuple(sorted(values)), hermitian, tuple(logs))).parse()


def scalar_formula(
    text: str,
    matrices: Mapping[str, sp.ImmutableMatrix],
    names: Mapping[str, sp.Expr],
    values: Mapping[str, Value],
    *,
    hermitian: bool = False,
    logs: Sequence[MatrixLog] = (),
) -> sp.Expr:
    """The scalar a text denotes.

    Raises:
        ExpressionError: outside the grammar, an unknown name, shapes that do not fit, or a matrix as the result.
    """
    value = formula(text, matrices, names, values, hermitian=hermitian, logs=logs)
    if isinstance(value, sp.MatrixBase):
        if value.shape == (1, 1):
            return value[0, 0]
        raise ExpressionError(f"{text!r} is a {value.rows} x {value.cols} matrix, not a number; take its tr or norm2")
    return value


def matrix_formula(
    text: str,
    matrices: Mapping[str, sp.ImmutableMatrix],
    names: Mapping[str, sp.Expr],
    values: Mapping[str, Value],
    *,
    logs: Sequence[MatrixLog] = (),
) -> sp.ImmutableMatrix:
    """The matrix a text denotes.

    Raises:
        ExpressionError: outside the grammar, or a scalar as the result.
    """
    value = formula(text, matrices, names, values, logs=logs)
    if not isinstance(value, sp.MatrixBase):
        raise ExpressionError(f"{text!r} is a number, not a matrix")
    return sp.ImmutableMatrix(value)


@dataclass(frozen=True)
class Matrices(Numbers):
    """What the parts of a text mean where names may stand for matrices.

    Attributes:
        matrices: X, Xd and their inverses Xi, Xdi.
        values: names of the caller's numbers and matrices, for the message.
        hermitian: norm2 sums squared moduli.
        logs: the products whose logarithms are known.
    """

    matrices: Mapping[str, sp.ImmutableMatrix]
    values: tuple[str, ...]
    hermitian: bool
    logs: tuple[MatrixLog, ...]

    @property
    def operators(self) -> str:
        return "'"

    def add(self, a: Value, b: Value) -> Value:
        a, b = _aligned(a, b)
        return a + b

    def subtract(self, a: Value, b: Value) -> Value:
        a, b = _aligned(a, b)
        return a - b

    def multiply(self, a: Value, b: Value) -> Value:
        if isinstance(a, sp.MatrixBase) and isinstance(b, sp.MatrixBase) and a.cols != b.rows:
            raise ExpressionError(f"{a.rows} x {a.cols} times {b.rows} x {b.cols} has no meaning")
        return _product(a, b) if isinstance(a, sp.MatrixBase) and isinstance(b, sp.MatrixBase) else a * b

    def divide(self, a: Value, b: Value) -> Value:
        if isinstance(b, sp.MatrixBase) or b.is_zero:
            raise ExpressionError("only a number other than 0 can divide")
        return a / b

    def power(self, base: Value, exponent: Value) -> Value:
        if isinstance(exponent, sp.MatrixBase):
            raise ExpressionError("an exponent must be an integer, not a matrix")
        if not isinstance(base, sp.MatrixBase):
            return super().power(base, exponent)
        if exponent == -1:
            for name in _INVERSES.keys() & self.matrices.keys():
                if base == self.matrices[name]:
                    return self.matrices[_INVERSES[name]]
        if not (exponent.is_Integer and exponent >= -1 and exponent <= _MAX_EXPONENT):
            raise ExpressionError(f"an exponent of a matrix must be an integer of at most {_MAX_EXPONENT}")
        if exponent < 0:
            raise ExpressionError("of matrices only X^-1 and Xd^-1 are known inverses")
        if base.rows != base.cols:
            raise ExpressionError(f"a {base.rows} x {base.cols} matrix has no powers")
        return _power(sp.ImmutableMatrix(base), int(exponent))

    def name(self, text: str) -> Value:
        if text not in self.names:
            known = ", ".join(["X", *(["Xd"] if "Xd" in self.names else []), *self.values, "entries as X11"])
            raise ExpressionError(f"no name {text!r}; known: {known}")
        return self.names[text]

    def call(self, text: str, arguments: Sequence[Value]) -> Value:
        argument = arguments[0]
        matrix = isinstance(argument, sp.MatrixBase)
        if text == "norm2":
            return sp.Add(*[self._square(entry) for entry in (argument.flat() if matrix else [argument])])
        if text in _OF_MATRICES:
            if not matrix or argument.rows != argument.cols:
                raise ExpressionError(f"{text} takes a square matrix")
            return argument.trace() if text == "tr" else (argument - argument.T) / 2
        if text in ("log", "vee") and matrix:
            return self._logarithm(text, argument)
        if text not in self.functions:
            known = ", ".join([*_OF_MATRICES, *sorted(self.functions)])
            raise ExpressionError(f"no function {text!r}; known: {known}")
        if matrix:
            raise ExpressionError(f"{text} takes a number, not a matrix")
        return super().call(text, arguments)

    def _square(self, entry: sp.Expr) -> sp.Expr:
        if not self.hermitian:
            return entry**2
        re, im = entry.as_real_imag()
        return re**2 + im**2

    def _logarithm(self, text: str, argument: sp.MatrixBase) -> Value:
        """log of a product that the caller knows, or vee of such a log."""
        for each in self.logs:
            if text == "log" and argument == each.product:
                return each.matrix
            if text == "vee" and argument == each.matrix:
                return each.coordinates
        what = "log takes Xd^-1*X or X*Xd^-1" if text == "log" else "vee takes a log of these: vee(log(Xd^-1*X))"
        raise ExpressionError(f"of matrices {what}")


def _power(base: sp.ImmutableMatrix, exponent: int) -> sp.ImmutableMatrix:
    """By squaring. SymPy's own power simplifies every entry on the way, which takes it half a minute for (X^2)^4 of a 4 x 4 matrix."""
    result, square = sp.ImmutableMatrix(sp.eye(base.rows)), base
    while exponent:
        if exponent % 2:
            result = _product(result, square)
        exponent //= 2
        if exponent:
            square = _product(square, square)
    return result


def _product(a: sp.MatrixBase, b: sp.MatrixBase) -> sp.ImmutableMatrix:
    """a b, not multiplied out.

    In memory the entries share their parts, so that it is small whatever the powers; but all that follows (derivatives, C) goes through
    every part as often as it is written. So it is the length of the written formula that counts, and it is known before it is made.

    Raises:
        ExpressionError: the length is over the budget.
    """
    known: dict[sp.Basic, int] = {}
    left, right = ([_length(entry, known) for entry in matrix.flat()] for matrix in (a, b))
    total = sum(
        left[i * a.cols + k] + right[k * b.cols + j]
        for i in range(a.rows)
        for k in range(a.cols)
        for j in range(b.cols)
        if a[i, k] != 0 and b[k, j] != 0
    )
    if total > current_budget().products:
        raise ExpressionError(
            over("products", f"a product of matrices is {total} terms and factors long when written out")
        )
    return sp.ImmutableMatrix(a * b)


def _length(value: sp.Basic, known: dict[sp.Basic, int]) -> int:
    """Numbers and symbols in a formula as it is written; parts that are the same are gone through once."""
    if value not in known:
        known[value] = sum(_length(part, known) for part in value.args) or 1
    return known[value]


def _aligned(a: Value, b: Value) -> tuple[Value, Value]:
    """Both matrices where one is: a number is that multiple of the identity."""
    if isinstance(a, sp.MatrixBase) and not isinstance(b, sp.MatrixBase):
        b = sp.eye(a.rows) * b
    elif isinstance(b, sp.MatrixBase) and not isinstance(a, sp.MatrixBase):
        a = sp.eye(b.rows) * a
    if isinstance(a, sp.MatrixBase) and a.shape != b.shape:
        raise ExpressionError(f"a {a.rows} x {a.cols} matrix and a {b.rows} x {b.cols} matrix cannot be added")
    return a, b
