"""Polynomial fields as kernel bodies: each monomial once, from one of lower degree; then a sum a component, Horner's rule in eps."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.structural_zeros import add, product
from lie_codegen.mechanics.polynomial_fields import Field, FieldSpace

Exponents = tuple[int, ...]
#: exponents -> component -> coefficient.
Table = dict[Exponents, dict[int, float]]


def table_of(space: FieldSpace, field: Field, values: Any = None) -> Table:
    """The coefficients of a constant field, or of a field with the given values (K,), by monomials."""
    numbers = field.values[:, 0] if values is None else values
    table: Table = {}
    for e, c, v in zip(
        space.exponents(field.codes).tolist(), space.components(field.codes).tolist(), numbers, strict=True
    ):
        table.setdefault(tuple(e), {})[c] = float(v)
    return table


class Monomials:
    """Values of monomials at one state: built on demand, each by one product."""

    def __init__(self, state: Sequence[Scalar]) -> None:
        self.state = list(state)
        self.known: dict[Exponents, Scalar] = {(0,) * len(self.state): 1}

    def __call__(self, exponents: Exponents) -> Scalar:
        """prod_v s_v^{e_v}."""
        if exponents not in self.known:
            last = max(v for v, e in enumerate(exponents) if e)
            lower = (*exponents[:last], exponents[last] - 1, *exponents[last + 1 :])
            self.known[exponents] = product(self(lower), self.state[last])
        return self.known[exponents]


def evaluated(ops: Arithmetic, monomials: Monomials, table: Table, size: int) -> list[Scalar]:
    """(size) components of a field at a state."""
    result: list[Scalar] = [0] * size
    for exponents, row in table.items():
        value = monomials(exponents)
        for component, number in row.items():
            result[component] = add(result[component], product(ops.constant(number), value))
    return result


def series(ops: Arithmetic, monomials: Monomials, tables: Sequence[Table], eps: Scalar, size: int) -> list[Scalar]:
    """sum_q eps^(q-1) F_q, (size)."""
    total: list[Scalar] = [0] * size
    for table in reversed(tables):
        here = evaluated(ops, monomials, table, size)
        total = [add(product(t, eps), x) for t, x in zip(total, here, strict=True)]
    return total


def evaluate(space: FieldSpace, field: Field, state: Any, values: Any = None) -> Any:
    """(..., 2n) components at states (..., n + k); `values` (..., K) in place of constant coefficients."""
    s = np.asarray(state, dtype=float)
    exponents = space.exponents(field.codes)
    # powers of all variables once, then each monomial by look-up
    powers = s[..., None] ** np.arange(int(exponents.max(initial=0)) + 1)
    monomials = np.ones((*s.shape[:-1], len(field.codes)))
    for v in range(space.variables):
        monomials = monomials * powers[..., v, :][..., exponents[:, v]]
    numbers = field.values[:, 0] if values is None else values
    choose = np.zeros((len(field.codes), 2 * space.dim))
    choose[np.arange(len(field.codes)), space.components(field.codes)] = 1
    return (monomials * numbers) @ choose
