"""A periodic input, or the formulas that make one: what every average takes."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from lie_codegen.errors import InputError
from lie_codegen.signals.periodic_input import PeriodicInput

#: A `PeriodicInput`, or a list of its formulas.
PeriodicLike = PeriodicInput | Sequence[Any]


def as_periodic(u: Any, where: str) -> PeriodicInput:
    """The input itself, or that of a list of formulas of t, whose smallest common period is found.

    Raises:
        InputError: it is neither, naming `where`; formulas without a common period.
        ExpressionError: a text outside the grammar.
    """
    if isinstance(u, list | tuple):
        return PeriodicInput(list(u))
    if not isinstance(u, PeriodicInput):
        raise InputError(f"{where}: u is {type(u).__name__}; give a PeriodicInput, or a list of formulas of t")
    return u
