"""Controllability of left-invariant systems X' = X sum u_i A_i by the growth of the Lie span of the controls."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import sympy as sp

from lie_codegen.algebra.exact import Number, domain_matrix
from lie_codegen.algebra.lie_algebra import LieAlgebra
from lie_codegen.errors import InputError, UncontrollableError


@dataclass(frozen=True)
class Controllability:
    """What the brackets of the controls reach.

    Attributes:
        controls: positions of the controlled basis elements.
        growth: growth vector: dimension of the span of brackets of length 1, 2, ... until it stops growing.
        depth: number of brackets needed to fill what can be filled (0: the controls alone).
        controllable: whether the span is the whole algebra.
        missing: labels of basis elements outside the span (a complement), empty if controllable.
        reason: one sentence.
    """

    controls: tuple[int, ...]
    growth: tuple[int, ...]
    depth: int
    controllable: bool
    missing: tuple[str, ...]
    reason: str


def control_indices(algebra: LieAlgebra, controls: Sequence[str | int]) -> tuple[int, ...]:
    """Positions of the controlled basis elements, given by label or position.

    Raises:
        InputError: if there is none, one is unknown, or one is repeated.
    """
    if isinstance(controls, str) or not len(controls):
        raise InputError(f"{algebra.name}: controls must be a non-empty sequence of labels, got {controls!r}")
    indices = tuple(algebra.index(control) for control in controls)
    if len(set(indices)) < len(indices):
        raise InputError(f"{algebra.name}: a control is repeated in {tuple(controls)}")
    return indices


def controllability(algebra: LieAlgebra, controls: Sequence[str | int]) -> Controllability:
    """The growth vector of the controls, exact.

    A driftless left-invariant system on a connected group is controllable if and only if the Lie span of its
    controls is the algebra (Chow; Jurdjevic and Sussmann); Leonard and Krishnaprasad, TR 93-59, section 2.
    """
    indices = control_indices(algebra, controls)
    generators: list[dict[int, Number]] = [{i: sp.S.One} for i in indices]
    span = list(generators)
    layer = list(generators)
    growth = [len(span)]
    while len(span) < algebra.dim:
        layer, span = _next_layer(algebra, generators, layer, span)
        if len(span) == growth[-1]:
            break
        growth.append(len(span))
    missing = _complement(algebra, span)
    complete = not missing
    names = ", ".join(algebra.labels[i] for i in indices)
    vector = "(" + ", ".join(map(str, growth)) + ")"
    reason = (
        f"the brackets of {names} fill all {algebra.dim} dimensions of {algebra.name}: growth vector {vector}"
        if complete
        else f"the brackets of {names} fill only {growth[-1]} of {algebra.dim} dimensions of {algebra.name}: growth "
        f"vector {vector}; out of reach: {', '.join(missing)}"
    )
    return Controllability(indices, tuple(growth), len(growth) - 1, complete, missing, reason)


def require_controllable(algebra: LieAlgebra, controls: Sequence[str | int]) -> Controllability:
    """The controllability report, or an error if the controls do not reach everything.

    Raises:
        UncontrollableError: with the growth vector and the missing directions.
    """
    report = controllability(algebra, controls)
    if not report.controllable:
        raise UncontrollableError(f"not controllable: {report.reason}; add a control in a missing direction")
    return report


def _next_layer(
    algebra: LieAlgebra,
    generators: list[dict[int, Number]],
    layer: list[dict[int, Number]],
    span: list[dict[int, Number]],
) -> tuple[list[dict[int, Number]], list[dict[int, Number]]]:
    """Brackets of the generators with the last layer that enlarge the span."""
    new: list[dict[int, Number]] = []
    for generator in generators:
        for element in layer:
            candidate = algebra.bracket(generator, element)
            if candidate and _rank(algebra, [*span, *new, candidate]) > len(span) + len(new):
                new.append(candidate)
    return new, [*span, *new]


def _rank(algebra: LieAlgebra, vectors: list[dict[int, Number]]) -> int:
    rows = [[vector.get(k, sp.S.Zero) for k in range(algebra.dim)] for vector in vectors]
    return int(domain_matrix(rows).rank())


def _complement(algebra: LieAlgebra, span: list[dict[int, Number]]) -> tuple[str, ...]:
    rows = [[vector.get(k, sp.S.Zero) for k in range(algebra.dim)] for vector in span]
    _, pivots = domain_matrix(rows).rref()
    return tuple(label for k, label in enumerate(algebra.labels) if k not in pivots)
