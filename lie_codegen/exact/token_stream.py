"""The words of a formula, with their columns: what the parsers of texts share."""

from __future__ import annotations

import re
from dataclasses import dataclass

from lie_codegen.errors import ExpressionError
from lie_codegen.exact.budget import complaint, current_budget, over
from lie_codegen.on_demand import sympy as sp

_MAX_LENGTH = 4000
_WORDS = r"\s*(?:(?P<number>(?:\d+(?:\.\d*)?|\.\d+)(?:[eE][+-]?\d+)?)|(?P<name>[A-Za-z_]\w*)|(?P<op>\*\*|[-+*/^()%s]))"


@dataclass(frozen=True)
class Token:
    """kind: number, name, op or end; columns count from 1."""

    kind: str
    text: str
    column: int


class TokenStream:
    """A text read word by word; `more` are operators beside + - * / ^ ** ( )."""

    def __init__(self, text: str, more: str) -> None:
        if not isinstance(text, str):
            raise ExpressionError(f"expected a text, got {type(text).__name__}")
        if len(text) > _MAX_LENGTH:
            raise ExpressionError(f"the text has {len(text)} characters; at most {_MAX_LENGTH} are read")
        self.text = text
        self.tokens = _tokens(text, re.compile(_WORDS % re.escape(more), re.ASCII))
        self.index = 0
        self.depth = 0

    @property
    def token(self) -> Token:
        return self.tokens[self.index]

    def error(self, what: str, token: Token | None = None) -> ExpressionError:
        return ExpressionError(f"column {(token or self.token).column}: {what}, in {self.text!r}")

    def accept(self, *operators: str) -> str | None:
        """The next word if it is one of these operators, which is then read."""
        if self.token.kind == "op" and self.token.text in operators:
            self.index += 1
            return self.tokens[self.index - 1].text
        return None

    def expect(self, operator: str) -> None:
        if self.accept(operator) is None:
            found = repr(self.token.text) if self.token.kind != "end" else "the end"
            raise self.error(f"expected {operator!r}, found {found}")

    def number(self, token: Token) -> sp.Rational:
        """The exact value of a number: "0.1" is 1/10."""
        mantissa, _, exponent = token.text.lower().partition("e")
        most = current_budget().digits
        if len(mantissa) > most + 1 or (exponent and (len(exponent) > 9 or abs(int(exponent)) > most)):
            raise self.error(over("digits", f"a number of more than {most} digits"), token)
        return self.bounded(sp.Rational(token.text), token)

    def bounded(self, value: sp.Expr, token: Token) -> sp.Expr:
        """The value, when it is within the budget."""
        if why := complaint(value):
            raise self.error(why, token)
        return value

    def end(self) -> None:
        """Nothing may be left."""
        if self.token.kind != "end":
            raise self.error(f"{self.token.text!r} is not expected here")

    def deeper(self) -> None:
        """One more level of nesting; the caller takes it back."""
        self.depth += 1
        most = current_budget().nesting
        if self.depth > most:
            raise self.error(over("nesting", f"nested more than {most} deep"))


def _tokens(text: str, pattern: re.Pattern[str]) -> list[Token]:
    tokens = []
    position = 0
    while text[position:].strip():
        match = pattern.match(text, position)
        if match is None:
            column = position + len(text[position:]) - len(text[position:].lstrip())
            numpy = "; NumPy prints a number so by repr: write float(x)" if "np.float64(" in text else ""
            raise ExpressionError(f"column {column + 1}: {text[column]!r} is not understood in {text!r}{numpy}")
        kind = str(match.lastgroup)
        tokens.append(Token(kind, match.group(kind), match.start(kind) + 1))
        position = match.end()
    return [*tokens, Token("end", "", len(text) + 1)]
