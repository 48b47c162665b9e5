"""How much work a text or a number may ask for: hostile or mistaken input is refused before it costs anything."""

from __future__ import annotations

import math
from contextvars import ContextVar, Token
from dataclasses import dataclass, fields
from types import TracebackType

from lie_codegen.errors import InputError
from lie_codegen.on_demand import sympy as sp


@dataclass(frozen=True)
class Budget:
    """Limits of the grammar, of group files and of exact results; raise one with `with lc.Budget(digits=2000): ...`.

    Attributes:
        digits: decimal digits of numerator and denominator of a number; the default keeps numbers within a double.
        terms: terms that a number may have once multiplied out.
        degree: degree over Q of the field that the roots in the entries span, at most (pi is not counted).
        dimension: labels of a group, and rows of a matrix.
        size: bytes of a group file.
        nesting: brackets within brackets in a formula, parts of a dotted key.
        products: products of two terms that one exact result may take; in a number field of degree d each counts d^2.

    Raises:
        InputError: a limit that is not a positive integer.
    """

    digits: int = 300
    terms: int = 1000
    degree: int = 16
    dimension: int = 128
    size: int = 1_000_000
    nesting: int = 60
    products: int = 500_000

    def __post_init__(self) -> None:
        for field in fields(self):
            limit = getattr(self, field.name)
            if isinstance(limit, bool) or not isinstance(limit, int) or limit < 1:
                raise InputError(f"Budget: {field.name} must be a positive integer")

    def __enter__(self) -> Budget:
        _entered.set((*_entered.get(), _current.set(self)))
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        *outer, token = _entered.get()
        _entered.set(tuple(outer))
        _current.reset(token)


_current: ContextVar[Budget] = ContextVar("lie_codegen_budget", default=Budget())  # noqa: B039  (frozen)
_entered: ContextVar[tuple[Token[Budget], ...]] = ContextVar("lie_codegen_budgets", default=())


def current_budget() -> Budget:
    """The budget in force: that of the innermost `with Budget(...)`, or the default."""
    return _current.get()


def over(limit: str, what: str) -> str:
    """What to say when a limit of the budget is passed: which, and how to raise it."""
    value = getattr(current_budget(), limit)
    return (
        f"{what}; the limit of {limit} is {value}; from Python it is raised by "
        f"`with lie_codegen.Budget({limit}=...):` around the call"
    )


@dataclass
class Meter:
    """Counts the products of terms that one exact result takes.

    Attributes:
        what: the result, for the message.
        spent: products so far.
    """

    what: str
    spent: int = 0

    def spend(self, products: int) -> None:
        """Count products that are about to be made.

        Raises:
            InputError: with them the result is over the budget.
        """
        self.spent += products
        if self.spent > _current.get().products:
            raise InputError(over("products", f"{self.what} takes too many products of terms"))


def complaint(value: sp.Expr) -> str | None:
    """Why a number, or an entry of a matrix, is over the budget, or None; a formula of symbols is bounded in its digits alone."""
    if isinstance(value, sp.MatrixBase):
        return next(filter(None, map(complaint, value.flat())), None)
    if digits(value) > current_budget().digits:
        return over("digits", "a number has too many digits")
    if value.is_Rational or value.free_symbols:
        return None
    if field_degree([value]) > current_budget().degree:
        return over("degree", "the roots span a field of too high a degree")
    if expanded_terms(value) > current_budget().terms:
        return over("terms", "the number has too many terms when multiplied out")
    return None


def require_within(value: sp.Expr) -> sp.Expr:
    """The number itself.

    Raises:
        InputError: it is over the budget; names the limit.
    """
    if why := complaint(value):
        raise InputError(why)
    return value


def integer_digits(value: int) -> int:
    """Decimal digits of an integer, found from its bits: writing it out may be refused by Python itself."""
    return max(1, math.ceil(abs(value).bit_length() * math.log10(2) - 1e-9))


def digits(value: sp.Expr) -> int:
    """Most digits of a numerator or denominator in an expression."""
    if value.is_Rational:
        return max(integer_digits(int(value.p)), integer_digits(int(value.q)))
    return max((digits(part) for part in value.atoms(sp.Rational)), default=1)


def expanded_terms(value: sp.Expr) -> int:
    """A bound on the terms of the expanded number: sums add, products multiply, (k terms)^n has C(k + n - 1, n)."""
    if isinstance(value, sp.Add):
        return sum(expanded_terms(part) for part in value.args)
    if isinstance(value, sp.Mul):
        return math.prod(expanded_terms(part) for part in value.args)
    if isinstance(value, sp.Pow):
        inner, n = expanded_terms(value.base), value.exp
        return math.comb(inner + abs(int(n)) - 1, abs(int(n))) if n.is_Integer else inner
    return 1


def field_degree(values: list[sp.Expr]) -> int:
    """A bound on [Q(roots) : Q], exact for square roots of integers: 2 to the number of independent ones."""
    powers: set[sp.Expr] = set().union(*(value.atoms(sp.Pow) for value in values)) if values else set()
    radicands: set[int] = {-1} if any(value.has(sp.I) for value in values) else set()
    degree = 1
    for base, q in sorted({(p.base, int(p.exp.q)) for p in powers if p.exp.is_Rational}, key=str):
        if q == 2 and base.is_Integer:
            radicands.add(int(base))
        elif q > 1:
            degree *= q
    # Products of independent radicands modulo squares; a radicand whose class is among them brings no new root.
    classes = [1]
    for radicand in sorted(radicands):
        if not any(_is_square(radicand * other) for other in classes):
            classes += [radicand * other for other in classes]
        if degree * len(classes) > current_budget().degree:
            break
    return degree * len(classes)


def _is_square(value: int) -> bool:
    return value >= 0 and math.isqrt(value) ** 2 == value
