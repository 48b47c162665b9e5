"""Formulas of matrices as text: "tr(K1*(1 - Xd^-1*X))/2 + norm2(X' * b)/2".

    sum    := term (('+' | '-') term)*
    term   := factor (('*' | '/') factor)*
    factor := ('+' | '-') factor | power
    power  := postfix ('^' integer)?
    postfix:= atom "'"*                     (transpose)
    atom   := number | name | function '(' sum ')' | '(' sum ')'

tr is the trace, norm2 the sum of squares of all entries (of a number its square), skew(A) = (A - A')/2; log of a matrix is known for
the products that the caller names, and vee of such a log is its (n, 1) coordinates; a number standing where a matrix is needed is that
multiple of the identity. X^-1 and Xd^-1 are known; nothing else can be inverted. The text is data,
never evaluated.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

from lie_codegen.errors import ExpressionError
from lie_codegen.exact.expression import FORMULA_FUNCTIONS
from lie_codegen.exact.token_stream import Token, TokenStream
from lie_codegen.on_demand import sympy as sp

_MAX_EXPONENT = 16

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
    return _Parser(text, matrices, names, values, hermitian=hermitian, logs=logs).parse()


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
    value = _Parser(text, matrices, names, values, logs=logs).parse()
    if not isinstance(value, sp.MatrixBase):
        raise ExpressionError(f"{text!r} is a number, not a matrix")
    return sp.ImmutableMatrix(value)


class _Parser(TokenStream):
    """Recursive descent; one instance a text."""

    def __init__(
        self,
        text: str,
        matrices: Mapping[str, sp.ImmutableMatrix],
        names: Mapping[str, sp.Expr],
        values: Mapping[str, Any],
        *,
        hermitian: bool = False,
        logs: Sequence[MatrixLog] = (),
    ) -> None:
        super().__init__(text, "'")
        self.hermitian, self.logs = hermitian, logs
        self.matrices = matrices
        self.values = sorted(values)
        self.names: dict[str, Value] = {**names, "pi": sp.pi, **values}
        for name in ("X", "Xd"):
            if name in matrices:
                self.names[name] = matrices[name]

    def parse(self) -> Value:
        value = self.sum()
        self.end()
        return value

    def sum(self) -> Value:
        self.deeper()
        value = self.term()
        while operator := self.accept("+", "-"):
            token = self.token
            other = self.term()
            value, other = self.aligned(value, other, token)
            value = value + other if operator == "+" else value - other
        self.depth -= 1
        return value

    def aligned(self, a: Value, b: Value, token: Token) -> tuple[Value, Value]:
        if isinstance(a, sp.MatrixBase) and not isinstance(b, sp.MatrixBase):
            b = sp.eye(a.rows) * b
        elif isinstance(b, sp.MatrixBase) and not isinstance(a, sp.MatrixBase):
            a = sp.eye(b.rows) * a
        if isinstance(a, sp.MatrixBase) and a.shape != b.shape:
            raise self.error(f"a {a.rows} x {a.cols} matrix and a {b.rows} x {b.cols} matrix cannot be added", token)
        return a, b

    def term(self) -> Value:
        value = self.factor()
        while operator := self.accept("*", "/"):
            token = self.token
            other = self.factor()
            if operator == "/":
                if isinstance(other, sp.MatrixBase) or other.is_zero:
                    raise self.error("only a number other than 0 can divide", token)
                value = value / other
            elif isinstance(value, sp.MatrixBase) and isinstance(other, sp.MatrixBase):
                if value.cols != other.rows:
                    raise self.error(
                        f"{value.rows} x {value.cols} times {other.rows} x {other.cols} has no meaning", token
                    )
                value = value * other
            else:
                value = value * other
        return value

    def factor(self) -> Value:
        sign = 1
        while operator := self.accept("+", "-"):
            sign = -sign if operator == "-" else sign
        value = self.power()
        return -value if sign < 0 else value

    def power(self) -> Value:
        start = self.index
        value = self.postfix()
        if self.accept("^", "**") is None:
            return value
        sign = -1 if self.accept("-") else 1
        token = self.token
        if token.kind != "number" or not token.text.isdigit() or int(token.text) > _MAX_EXPONENT:
            raise self.error(f"an exponent must be an integer of at most {_MAX_EXPONENT}", token)
        self.index += 1
        exponent = sign * int(token.text)
        if not isinstance(value, sp.MatrixBase):
            if exponent < 0 and value.is_zero:
                raise self.error("only a number other than 0 can divide", token)
            return value**exponent
        if exponent >= 0:
            return sp.ImmutableMatrix(value**exponent)
        known = {"X": "Xi", "Xd": "Xdi"}
        name = self.tokens[start].text
        if exponent == -1 and self.index - start == 4 and name in known:
            return self.matrices[known[name]]
        raise self.error("of matrices only X^-1 and Xd^-1 are known inverses", self.tokens[start])

    def postfix(self) -> Value:
        value = self.atom()
        while self.accept("'"):
            value = value.T if isinstance(value, sp.MatrixBase) else value
        return value

    def atom(self) -> Value:
        token = self.token
        if token.kind == "number":
            self.index += 1
            return self.number(token)
        if token.kind == "name":
            self.index += 1
            return self.call(token) if self.accept("(") else self.value(token)
        if self.accept("("):
            value = self.sum()
            self.expect(")")
            return value
        raise self.error("the text ends too soon" if token.kind == "end" else f"{token.text!r} is not expected here")

    def value(self, token: Token) -> Value:
        if token.text in self.names:
            return self.names[token.text]
        known = ", ".join(["X", *(["Xd"] if "Xd" in self.names else []), *self.values, "entries as X11"])
        raise self.error(f"no name {token.text!r}; known: {known}", token)

    def square(self, entry: sp.Expr) -> sp.Expr:
        if not self.hermitian:
            return entry**2
        re, im = entry.as_real_imag()
        return re**2 + im**2

    def call(self, token: Token) -> Value:
        argument = self.sum()
        self.expect(")")
        if token.text in ("tr", "norm2", "skew"):
            if not isinstance(argument, sp.MatrixBase):
                if token.text == "norm2":
                    return self.square(argument)
                raise self.error(f"{token.text} takes a matrix", token)
            if token.text == "norm2":
                return sp.Add(*[self.square(entry) for entry in argument.flat()])
            if argument.rows != argument.cols:
                raise self.error(f"{token.text} takes a square matrix", token)
            return argument.trace() if token.text == "tr" else (argument - argument.T) / 2
        if token.text in ("log", "vee") and isinstance(argument, sp.MatrixBase):
            return self.logarithm(token, argument)
        function = FORMULA_FUNCTIONS.get(token.text)
        if function is None or token.text == "atan2":
            raise self.error(
                f"no function {token.text!r}; known: tr, norm2, skew, {', '.join(sorted(FORMULA_FUNCTIONS))}", token
            )
        if isinstance(argument, sp.MatrixBase):
            raise self.error(f"{token.text} takes a number, not a matrix", token)
        return function(argument)

    def logarithm(self, token: Token, argument: sp.MatrixBase) -> Value:
        """log of a product that the caller knows, or vee of such a log."""
        for each in self.logs:
            if token.text == "log" and argument == each.product:
                return each.matrix
            if token.text == "vee" and argument == each.matrix:
                return each.coordinates
        what = "log takes Xd^-1*X or X*Xd^-1" if token.text == "log" else "vee takes a log of these: vee(log(Xd^-1*X))"
        raise self.error(f"of matrices {what}", token)
