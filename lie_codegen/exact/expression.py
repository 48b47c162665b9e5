"""The closed grammar in which users write numbers and formulas, of numbers and of matrices.

    expression := term (('+' | '-') term)*
    term       := factor (('*' | '/') factor)*
    factor     := ('+' | '-') factor | power
    power      := atom "'"* (('^' | '**') factor)?
    atom       := number | name | name ('[' integer ']')+ | function '(' expression (',' expression)* ')' | '(' expression ')'

Numbers are integers and decimals, taken exactly ("0.1" is 1/10). What names, operations and functions mean is said by a visitor:
here by `Numbers`, whose values are SymPy expressions; by `kernel.matrix_formula.Matrices`, which knows matrices and "'", the transpose.
Names and functions are those the caller allows, nothing else: a text is data and is never evaluated as Python nor given to
SymPy's parser.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any, TypeAlias

from lie_codegen.errors import ExpressionError
from lie_codegen.exact.budget import current_budget, digits, over
from lie_codegen.exact.token_stream import Token, TokenStream
from lie_codegen.on_demand import sympy as sp

_MAX_EXPONENT = 64

Function: TypeAlias = "Callable[..., sp.Expr]"


class _OfSympy(Mapping[str, Any]):
    """Name in the grammar -> what SymPy has by another name, or by the same; looked up when asked for."""

    def __init__(self, *same: str, **others: str) -> None:
        self._names = {**dict(zip(same, same, strict=True)), **others}

    def __getitem__(self, name: str) -> Any:
        return getattr(sp, self._names[name])

    def __iter__(self) -> Iterator[str]:
        return iter(self._names)

    def __len__(self) -> int:
        return len(self._names)


#: What an entry of a matrix or a structure constant may hold beside numbers.
NUMBER_NAMES: Mapping[str, sp.Expr] = _OfSympy("pi", "I", i="I")
NUMBER_FUNCTIONS: Mapping[str, Function] = _OfSympy("sqrt")
#: What a formula of an input, a Lagrangian or a perturbation may call.
FORMULA_FUNCTIONS: Mapping[str, Function] = _OfSympy(
    "sqrt", "sin", "cos", "tan", "exp", "log", "asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh", abs="Abs"
)


@cache
def time_symbol() -> sp.Symbol:
    """t, the time in formulas; real."""
    return sp.Symbol("t", real=True)


def parse_number(text: str) -> sp.Expr:
    """The exact number a text denotes: rationals, decimals, sqrt, pi, and I (or i) for the imaginary unit.

    Raises:
        ExpressionError: for anything else, with the column (counted from 1).
    """
    value = parse_expression(text, NUMBER_NAMES, NUMBER_FUNCTIONS)
    return sp.expand(value)


def parse_expression(
    text: str,
    names: Mapping[str, sp.Expr],
    functions: Mapping[str, Function],
    arrays: Mapping[str, Mapping[tuple[int, ...], sp.Expr]] | None = None,
) -> sp.Expr:
    """The SymPy expression a text denotes, built from the given names, functions and entries of arrays (X[0][1]) only.

    Raises:
        ExpressionError: for a text outside the grammar, with the column (counted from 1).
    """
    return Parser(text, Numbers(names, functions, arrays or {})).parse()


@dataclass(frozen=True)
class Numbers:
    """What the parts of a text mean as SymPy expressions; an ExpressionError of it gets the column from the parser.

    Attributes:
        names, functions: those that a text may use.
        arrays: name -> entries, by their places.
        operators: words beside + - * / ^ ** ( ).
    """

    names: Mapping[str, sp.Expr]
    functions: Mapping[str, Function]
    arrays: Mapping[str, Mapping[tuple[int, ...], sp.Expr]]

    @property
    def operators(self) -> str:
        return ",[]" if self.arrays else ","

    def add(self, a: Any, b: Any) -> Any:
        return a + b

    def subtract(self, a: Any, b: Any) -> Any:
        return a - b

    def multiply(self, a: Any, b: Any) -> Any:
        return a * b

    def divide(self, a: Any, b: Any) -> Any:
        if b.is_zero:
            raise ExpressionError("division by zero")
        return a / b

    def power(self, base: Any, exponent: Any) -> Any:
        """base^exponent; its size is known before it is computed."""
        if not (exponent.is_Integer and abs(exponent) <= _MAX_EXPONENT):
            raise ExpressionError(f"an exponent must be an integer between -{_MAX_EXPONENT} and {_MAX_EXPONENT}")
        if exponent < 0 and base.is_zero:
            raise ExpressionError("division by zero")
        if base not in (0, 1, -1) and (digits(base) - 1) * abs(int(exponent)) > current_budget().digits:
            raise ExpressionError(over("digits", "the power has too many digits"))
        return base**exponent

    def name(self, text: str) -> Any:
        if text not in self.names:
            known = ", ".join(sorted([*self.names, *self.arrays])) or "none"
            raise ExpressionError(f"no name {text!r}; known: {known}")
        return self.names[text]

    def entry(self, text: str, place: tuple[int, ...]) -> sp.Expr:
        """An entry of an array, by as many integers as it has axes, counted from 0."""
        entries = self.arrays[text]
        if place not in entries:
            asked, last = ("".join(f"[{index}]" for index in each) for each in (place, max(entries)))
            raise ExpressionError(f"no entry {text}{asked}; the last is {text}{last}")
        return entries[place]

    def call(self, text: str, arguments: Sequence[Any]) -> Any:
        function = self.functions.get(text)
        if function is None:
            known = ", ".join(sorted(self.functions)) or "none"
            raise ExpressionError(f"no function {text!r}; known: {known}")
        expected = 2 if text == "atan2" else 1
        if len(arguments) != expected:
            raise ExpressionError(f"{text} takes {expected} argument(s), {len(arguments)} given")
        value = function(*arguments)
        if value.has(sp.zoo, sp.nan, sp.oo, -sp.oo):
            raise ExpressionError(f"{text} has no finite value there")
        return value


class Parser(TokenStream):
    """Recursive descent; one instance a text, whose parts mean what the visitor says, within the budget."""

    def __init__(self, text: str, meaning: Numbers) -> None:
        super().__init__(text, meaning.operators)
        self.meaning = meaning

    def parse(self) -> Any:
        if self.token.kind == "end":
            raise ExpressionError("column 1: the text is empty")
        value = self.expression()
        self.end()
        return value

    def made(self, token: Token, operation: Callable[..., Any], *operands: Any) -> Any:
        """What an operation of the visitor gives; what it refuses, it refuses at this word."""
        try:
            value = operation(*operands)
        except ExpressionError as error:
            raise self.error(str(error), token) from None
        return self.bounded(value, token)

    def expression(self) -> Any:
        self.deeper()
        value = self.term()
        while operator := self.accept("+", "-"):
            operation = self.meaning.add if operator == "+" else self.meaning.subtract
            value = self.made(self.token, operation, value, self.term())
        self.depth -= 1
        return value

    def term(self) -> Any:
        value = self.factor()
        while operator := self.accept("*", "/"):
            operation = self.meaning.multiply if operator == "*" else self.meaning.divide
            value = self.made(self.token, operation, value, self.factor())
        return value

    def factor(self) -> Any:
        sign = 1
        while operator := self.accept("+", "-"):
            sign = -sign if operator == "-" else sign
        value = self.power()
        return value if sign > 0 else -value

    def power(self) -> Any:
        base = self.atom()
        while self.accept("'"):
            base = base.T if isinstance(base, sp.MatrixBase) else base
        if self.accept("^", "**") is None:
            return base
        token = self.token
        self.deeper()
        exponent = self.factor()
        self.depth -= 1
        return self.made(token, self.meaning.power, base, exponent)

    def atom(self) -> Any:
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

    def name(self, token: Token) -> Any:
        if self.accept("("):
            arguments = [self.expression()]
            while self.accept(","):
                arguments.append(self.expression())
            self.expect(")")
            return self.made(token, self.meaning.call, token.text, arguments)
        if token.text in self.meaning.arrays:
            return self.made(token, self.meaning.entry, token.text, self.place())
        return self.made(token, self.meaning.name, token.text)

    def place(self) -> tuple[int, ...]:
        """Integers in brackets."""
        place = []
        while self.accept("["):
            number = self.token
            if number.kind != "number" or not number.text.isdigit():
                raise self.error("an index is an integer", number)
            self.index += 1
            place.append(int(number.text))
            self.expect("]")
        return tuple(place)
