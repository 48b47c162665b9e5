"""Controllability of left-invariant systems X' = X sum u_i A_i by the growth of the Lie span of the controls."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import accumulate

from lie_codegen.algebra.lie_algebra import LieAlgebra
from lie_codegen.algebra.lyndon import BracketWord, Word, bracket_word, lyndon_words, standard_factorization
from lie_codegen.errors import InputError, UncontrollableError
from lie_codegen.exact.numbers import Number, domain_matrix
from lie_codegen.on_demand import sympy as sp
from lie_codegen.values import Value


@dataclass(frozen=True, eq=False, repr=False)
class Controllability(Value):
    """What the brackets of the controls reach.

    Attributes:
        controls: positions of the controlled basis elements.
        growth: growth vector: dimension of the span of brackets of length 1, 2, ... until it stops growing.
        depth: number of brackets needed to fill what can be filled (0: the controls alone).
        controllable: whether the span is the whole algebra.
        missing: labels of basis elements outside the span (a complement), empty if controllable.
        reason: one sentence.
        words: for each layer the brackets that fill it: words[k] are brackets of k + 1 controls (Lyndon basis) that, with
            those before them, are independent and span all brackets of that length or less.
    """

    controls: tuple[int, ...]
    growth: tuple[int, ...]
    depth: int
    controllable: bool
    missing: tuple[str, ...]
    reason: str
    words: tuple[tuple[BracketWord, ...], ...]


def control_indices(algebra: LieAlgebra, controls: Sequence[str | int]) -> tuple[int, ...]:
    """Positions of the controlled basis elements, given by label or position.

    Raises:
        InputError: if there is none, one is unknown, or one is repeated.
    """
    if isinstance(controls, str) or not isinstance(controls, Sequence) or not controls:
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
    layers = _Layers(algebra, indices)
    while layers.grow():
        pass
    growth, span = layers.growth, layers.span
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
    return Controllability(indices, growth, len(growth) - 1, complete, missing, reason, layers.words)


def require_controllable(algebra: LieAlgebra, controls: Sequence[str | int]) -> Controllability:
    """The controllability report, or an error if the controls do not reach everything.

    Raises:
        UncontrollableError: with the growth vector and the missing directions.
    """
    report = controllability(algebra, controls)
    if not report.controllable:
        raise UncontrollableError(f"not controllable: {report.reason}; add a control in a missing direction")
    return report


class _Layers:
    """The span of brackets of the controls, grown by their length."""

    def __init__(self, algebra: LieAlgebra, indices: tuple[int, ...]) -> None:
        self.algebra = algebra
        self.labels = tuple(algebra.labels[i] for i in indices)
        self.values: dict[Word, dict[int, Number]] = {(k,): {i: sp.S.One} for k, i in enumerate(indices)}
        self.span = list(self.values.values())
        self.found: list[tuple[Word, ...]] = [tuple(self.values)]

    @property
    def growth(self) -> tuple[int, ...]:
        """Dimension of the span after each layer."""
        return tuple(accumulate(map(len, self.found)))

    @property
    def words(self) -> tuple[tuple[BracketWord, ...], ...]:
        """The brackets of each layer, as they are written."""
        return tuple(tuple(bracket_word(word, self.labels) for word in layer) for layer in self.found)

    def grow(self) -> bool:
        """Adds the next layer; False, and nothing added, when the span has stopped growing."""
        target = self._next_dimension()
        if target == len(self.span):
            return False
        new: list[Word] = []
        length = len(self.found) + 1
        for word in lyndon_words(len(self.labels), length):
            value = self._value(word)
            if value and _rank(self.algebra, [*self.span, value]) > len(self.span):
                self.span.append(value)
                new.append(word)
            if len(self.span) == target:
                break
        self.found.append(tuple(new))
        return True

    def _next_dimension(self) -> int:
        """Dimension of the span of the span and its brackets with the controls."""
        if len(self.span) == self.algebra.dim:
            return self.algebra.dim
        controls = [self.values[k,] for k in range(len(self.labels))]
        last = [self.values[word] for word in self.found[-1]]
        images = [self.algebra.bracket(control, element) for control in controls for element in last]
        return _rank(self.algebra, [*self.span, *(image for image in images if image)])

    def _value(self, word: Word) -> dict[int, Number]:
        if word not in self.values:
            left, right = (self._value(part) for part in standard_factorization(word))
            self.values[word] = self.algebra.bracket(left, right) if left and right else {}
        return self.values[word]


def _rank(algebra: LieAlgebra, vectors: list[dict[int, Number]]) -> int:
    rows = [[vector.get(k, sp.S.Zero) for k in range(algebra.dim)] for vector in vectors]
    return int(domain_matrix(rows).rank())


def _complement(algebra: LieAlgebra, span: list[dict[int, Number]]) -> tuple[str, ...]:
    rows = [[vector.get(k, sp.S.Zero) for k in range(algebra.dim)] for vector in span]
    _, pivots = domain_matrix(rows).rref()
    return tuple(label for k, label in enumerate(algebra.labels) if k not in pivots)
