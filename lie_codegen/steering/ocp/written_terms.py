"""What a user writes as costs and conditions, sorted: scalars and residuals; g <= 0 and e = 0, and where a text compares, what it means."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from itertools import islice
from typing import Any

from lie_codegen.errors import ExpressionError, InputError, ShapeError
from lie_codegen.exact.budget import current_budget, over
from lie_codegen.kernel.kernel import Kernel
from lie_codegen.steering.ocp.problem_data import Condition, Cost
from lie_codegen.steering.ocp.terms import Term

Terms = Term | Sequence[Term]

_COMPARISON = re.compile(r"<=|>=|==|!=|<|>|=")


def sequence_of(terms: Any) -> tuple[Any, ...]:
    """Terms as a tuple; numbers are texts too.

    Raises:
        InputError: something that is neither a text, a number nor a Kernel; more terms than the budget has.
    """
    if isinstance(terms, str | Kernel):
        return (terms,)
    if not isinstance(terms, Iterable) or isinstance(terms, Mapping):
        raise InputError(f"ocp: expected a text, a Kernel or a sequence of them, got {terms!r:.60}")
    most = current_budget().terms
    listed = tuple(repr(float(term)) if isinstance(term, int | float) else term for term in islice(terms, most + 1))
    if len(listed) > most:
        raise InputError(over("terms", f"ocp: more than {most} terms in one cost or set of conditions"))
    for term in listed:
        if not isinstance(term, str | Kernel):
            raise InputError(f"ocp: expected a text or a Kernel, got {term!r:.60}")
    return listed


def costs_of(terms: Terms | None, what: str, where: str) -> tuple[Cost, ...]:
    """Parts of a cost: one text is a scalar, a sequence of texts a residual, a Kernel what its output is called."""
    if terms is None:
        return ()
    alone = isinstance(terms, str | Kernel)
    parts = []
    for term in sequence_of(terms):
        if isinstance(term, Kernel):
            output = term.outputs[0]
            if output.name not in ("residual", "cost"):
                raise InputError(
                    f"{where}: {what}: {term.name} gives {output.name!r}; name its output residual or cost"
                )
            if output.name == "cost" and output.shape not in ((), (1,)):
                raise ShapeError(f"{where}: {what}: the cost of {term.name} has shape {output.shape}; it is a number")
            parts.append(Cost(term, output.name == "residual"))
        else:
            parts.append(Cost(term, not alone))
    return tuple(parts)


def conditions_of(terms: Terms, sense: str, where: str) -> tuple[Condition, ...]:
    """g <= 0 (sense "g") or e = 0 (sense "e"); in g a text may compare: "a <= b", "a >= b", "a <= b <= c".

    Raises:
        InputError, ExpressionError: naming the culprit.
    """
    return tuple(each for term in sequence_of(terms) for each in _conditions(term, sense, where))


def _conditions(term: Term, sense: str, where: str) -> list[Condition]:
    what = "constraints" if sense == "g" else "terminal"
    if isinstance(term, Kernel):
        if term.outputs[0].name != sense:
            zero = "<= 0" if sense == "g" else "= 0"
            raise InputError(
                f"{where}: {what}: {term.name} gives {term.outputs[0].name!r}; name its output {sense} ({sense} {zero})"
            )
        return [Condition(term.name, term, sense)]
    signs = _COMPARISON.findall(term)
    if not signs:
        return [Condition(term, term, sense)]
    if sense == "e":
        raise ExpressionError(
            f"{where}: terminal: {term!r} compares; a condition at the end is an expression that is zero there, "
            f"a - b for a = b (constraints= takes inequalities)"
        )
    if any(sign not in ("<=", ">=") for sign in signs) or len(signs) > 2 or len(set(signs)) > 1:
        raise ExpressionError(
            f"{where}: constraints: {term!r}: write an expression that is at most zero, or a <= b, a >= b, a <= b <= c"
        )
    parts = _COMPARISON.split(term)
    found = []
    for sign, left, right in zip(signs, parts[:-1], parts[1:], strict=True):
        name = term if len(signs) == 1 else f"{left.strip()} {sign} {right.strip()}"
        text = f"({left}) - ({right})" if sign == "<=" else f"({right}) - ({left})"
        found.append(Condition(name, text, sense))
    return found
