"""The closed grammar in which users write numbers and formulas.

    expression := term (('+' | '-') term)*
    term       := factor (('*' | '/') factor)*
    factor     := ('+' | '-') factor | power
    power      := atom (('^' | '**') factor)?
    atom       := number | name | function '(' expression (',' expression)* ')' | '(' expression ')'

Numbers are integers and decimals, taken exactly ("0.1" is 1/10). Names and functions are those the caller
allows, nothing else: a text is data and is never evaluated as Python nor given to SymPy's parser.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import sympy as sp

from lie_codegen.errors import ExpressionError

_TOKEN = re.compile(
    r"\s*(?:(?P<number>(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d+)?)|(?P<name>[A-Za-z_]\w*)|(?P<op>\*\*|[-+*/^(),]))",
    re.ASCII,
)
_MAX_LENGTH = 4000
_MAX_DEPTH = 60
_MAX_EXPONENT = 64
_MAX_DIGITS = 400

Function = Callable[..., sp.Expr]

#: What an entry of a matrix or a structure constant may hold beside numbers.
NUMBER_NAMES: Mapping[str, sp.Expr] = {"pi": sp.pi, "I": sp.I, "i": sp.I}
NUMBER_FUNCTIONS: Mapping[str, Function] = {"sqrt": sp.sqrt}
#: What a formula of an input, a Lagrangian or a perturbation may call.
FORMULA_FUNCTIONS: Mapping[str, Function] = {
    "sqrt": sp.sqrt, "sin": sp.sin, "cos": sp.cos, "tan": sp.tan, "exp": sp.exp, "log": sp.log, "asin": sp.asin,
    "acos": sp.acos, "atan": sp.atan, "atan2": sp.atan2, "sinh": sp.sinh, "cosh": sp.cosh, "tanh": sp.tanh,
    "abs": sp.Abs,
}  # fmt: skip


@dataclass(frozen=True)
class _Token:
    kind: str
    text: str
    column: int


def parse_number(text: str) -> sp.Expr:
    """The exact number a text denotes: rationals, decimals, sqrt, pi, and I (or i) for the imaginary unit.

    Raises:
        ExpressionError: for anything else, with the column (counted from 1).
    """
    value = parse_expression(text, NUMBER_NAMES, NUMBER_FUNCTIONS)
    return sp.expand(value)


def parse_expression(text: str, names: Mapping[str, sp.Expr], functions: Mapping[str, Function]) -> sp.Expr:
    """The SymPy expression a text denotes, built from the given names and functions only.

    Raises:
        ExpressionError: for a text outside the grammar, with the column (counted from 1).
    """
    if not isinstance(text, str):
        raise ExpressionError(f"expected a text, got {type(text).__name__}")
    if len(text) > _MAX_LENGTH:
        raise ExpressionError(f"the text has {len(text)} characters; at most {_MAX_LENGTH} are read")
    return _Parser(text, names, functions).parse()


def _tokens(text: str) -> list[_Token]:
    tokens = []
    position = 0
    while text[position:].strip():
        match = _TOKEN.match(text, position)
        if match is None:
            column = position + len(text[position:]) - len(text[position:].lstrip())
            raise ExpressionError(f"column {column + 1}: {text[column]!r} is not understood in {text!r}")
        kind = str(match.lastgroup)
        tokens.append(_Token(kind, match.group(kind), match.start(kind) + 1))
        position = match.end()
    return [*tokens, _Token("end", "", len(text) + 1)]


class _Parser:
    """Recursive descent; one instance a text."""

    def __init__(self, text: str, names: Mapping[str, sp.Expr], functions: Mapping[str, Function]) -> None:
        self.text = text
        self.names = names
        self.functions = functions
        self.tokens = _tokens(text)
        self.index = 0
        self.depth = 0

    @property
    def token(self) -> _Token:
        return self.tokens[self.index]

    def parse(self) -> sp.Expr:
        if self.token.kind == "end":
            raise ExpressionError("column 1: the text is empty")
        value = self.expression()
        if self.token.kind != "end":
            raise self.error(f"{self.token.text!r} is not expected here")
        return value

    def error(self, what: str, token: _Token | None = None) -> ExpressionError:
        return ExpressionError(f"column {(token or self.token).column}: {what}, in {self.text!r}")

    def accept(self, *operators: str) -> str | None:
        if self.token.kind == "op" and self.token.text in operators:
            self.index += 1
            return self.tokens[self.index - 1].text
        return None

    def expect(self, operator: str) -> None:
        if self.accept(operator) is None:
            found = repr(self.token.text) if self.token.kind != "end" else "the end"
            raise self.error(f"expected {operator!r}, found {found}")

    def expression(self) -> sp.Expr:
        self.depth += 1
        if self.depth > _MAX_DEPTH:
            raise self.error(f"nested more than {_MAX_DEPTH} deep")
        value = self.term()
        while operator := self.accept("+", "-"):
            value = value + self.term() if operator == "+" else value - self.term()
        self.depth -= 1
        return value

    def term(self) -> sp.Expr:
        value = self.factor()
        while operator := self.accept("*", "/"):
            token = self.token
            other = self.factor()
            if operator == "/" and other.is_zero:
                raise self.error("division by zero", token)
            value = value * other if operator == "*" else value / other
        return value

    def factor(self) -> sp.Expr:
        sign = 1
        while operator := self.accept("+", "-"):
            sign = -sign if operator == "-" else sign
        return sign * self.power()

    def power(self) -> sp.Expr:
        base = self.atom()
        if self.accept("^", "**") is None:
            return base
        token = self.token
        self.depth += 1
        if self.depth > _MAX_DEPTH:
            raise self.error(f"nested more than {_MAX_DEPTH} deep")
        exponent = self.factor()
        self.depth -= 1
        if not (exponent.is_Integer and abs(exponent) <= _MAX_EXPONENT):
            raise self.error(f"an exponent must be an integer between -{_MAX_EXPONENT} and {_MAX_EXPONENT}", token)
        if exponent < 0 and base.is_zero:
            raise self.error("division by zero", token)
        return base**exponent

    def atom(self) -> sp.Expr:
        token = self.token
        if token.kind == "number":
            self.index += 1
            return self.number(token)
        if token.kind == "name":
            self.index += 1
            return self.name(token)
        if self.accept("("):
            value = self.expression()
            self.expect(")")
            return value
        raise self.error("the text ends too soon" if token.kind == "end" else f"{token.text!r} is not expected here")

    def number(self, token: _Token) -> sp.Expr:
        mantissa, _, exponent = token.text.lower().partition("e")
        if len(mantissa) > _MAX_DIGITS or (exponent and (len(exponent) > 5 or abs(int(exponent)) > _MAX_DIGITS)):
            raise self.error(f"a number of more than {_MAX_DIGITS} digits", token)
        return sp.Rational(token.text)

    def name(self, token: _Token) -> sp.Expr:
        if self.accept("("):
            function = self.functions.get(token.text)
            if function is None:
                known = ", ".join(sorted(self.functions)) or "none"
                raise self.error(f"no function {token.text!r}; known: {known}", token)
            return self.call(token, function)
        if token.text in self.names:
            return self.names[token.text]
        known = ", ".join(sorted(self.names)) or "none"
        raise self.error(f"no name {token.text!r}; known: {known}", token)

    def call(self, token: _Token, function: Function) -> sp.Expr:
        arguments = [self.expression()]
        while self.accept(","):
            arguments.append(self.expression())
        self.expect(")")
        expected = 2 if token.text == "atan2" else 1
        if len(arguments) != expected:
            raise self.error(f"{token.text} takes {expected} argument(s), {len(arguments)} given", token)
        value = function(*arguments)
        if value.has(sp.zoo, sp.nan, sp.oo, -sp.oo):
            raise self.error(f"{token.text} has no finite value there", token)
        return value
