"""The closed grammar in which users write numbers and formulas.

    expression := term (('+' | '-') term)*
    term       := factor (('*' | '/') factor)*
    factor     := ('+' | '-') factor | power
    power      := atom (('^' | '**') factor)?
    atom       := number | name | name ('[' integer ']')+ | function '(' expression (',' expression)* ')' | '(' expression ')'

Numbers are integers and decimals, taken exactly ("0.1" is 1/10). Names and functions are those the caller
allows, nothing else: a text is data and is never evaluated as Python nor given to SymPy's parser.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
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
    return _Parser(text, names, functions, arrays or {}).parse()


class _Parser(TokenStream):
    """Recursive descent; one instance a text."""

    def __init__(
        self,
        text: str,
        names: Mapping[str, sp.Expr],
        functions: Mapping[str, Function],
        arrays: Mapping[str, Mapping[tuple[int, ...], sp.Expr]],
    ) -> None:
        super().__init__(text, ",[]" if arrays else ",")
        self.names = names
        self.functions = functions
        self.arrays = arrays

    def parse(self) -> sp.Expr:
        if self.token.kind == "end":
            raise ExpressionError("column 1: the text is empty")
        value = self.expression()
        self.end()
        return value

    def expression(self) -> sp.Expr:
        self.deeper()
        token = self.token
        value = self.term()
        while operator := self.accept("+", "-"):
            value = value + self.term() if operator == "+" else value - self.term()
            value = self.bounded(value, token)
        self.depth -= 1
        return value

    def term(self) -> sp.Expr:
        value = self.factor()
        while operator := self.accept("*", "/"):
            token = self.token
            other = self.factor()
            if operator == "/" and other.is_zero:
                raise self.error("division by zero", token)
            value = self.bounded(value * other if operator == "*" else value / other, token)
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
        self.deeper()
        exponent = self.factor()
        self.depth -= 1
        if not (exponent.is_Integer and abs(exponent) <= _MAX_EXPONENT):
            raise self.error(f"an exponent must be an integer between -{_MAX_EXPONENT} and {_MAX_EXPONENT}", token)
        if exponent < 0 and base.is_zero:
            raise self.error("division by zero", token)
        if base not in (0, 1, -1) and (digits(base) - 1) * abs(int(exponent)) > current_budget().digits:
            raise self.error(over("digits", "the power has too many digits"), token)
        return self.bounded(base**exponent, token)

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

    def name(self, token: Token) -> sp.Expr:
        if self.accept("("):
            function = self.functions.get(token.text)
            if function is None:
                known = ", ".join(sorted(self.functions)) or "none"
                raise self.error(f"no function {token.text!r}; known: {known}", token)
            return self.call(token, function)
        if token.text in self.names:
            return self.names[token.text]
        if token.text in self.arrays:
            return self.entry(token)
        known = ", ".join(sorted([*self.names, *self.arrays])) or "none"
        raise self.error(f"no name {token.text!r}; known: {known}", token)

    def entry(self, token: Token) -> sp.Expr:
        """An entry of an array: integers in brackets, as many as it has axes, counted from 0."""
        entries, place = self.arrays[token.text], []
        while self.accept("["):
            number = self.token
            if number.kind != "number" or not number.text.isdigit():
                raise self.error("an index is an integer", number)
            self.index += 1
            place.append(int(number.text))
            self.expect("]")
        if tuple(place) not in entries:
            last = "".join(f"[{index}]" for index in max(entries))
            raise self.error(
                f"no entry {token.text}{''.join(f'[{k}]' for k in place)}; the last is {token.text}{last}", token
            )
        return entries[tuple(place)]

    def call(self, token: Token, function: Function) -> sp.Expr:
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
        return self.bounded(value, token)
