"""What is steered: directions of the controls, drift, which side the velocity acts on; constants, texts or functions of time."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.errors import NotFiniteError, ShapeError, SteeringInputError
from lie_codegen.exact.expression import FORMULA_FUNCTIONS, parse_expression
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.values import Value


@dataclass(frozen=True, eq=False, repr=False)
class Velocity(Value):
    """An algebra element that may depend on time: a constant, formulas of t, or a function of t.

    Attributes:
        dim: n.
        constant: (n,), or None.
        texts: n formulas of t, or none.
        function: t -> (n,), or None.
    """

    dim: int
    constant: Array | None = None
    texts: tuple[str, ...] = ()
    function: Callable[[float], Any] | None = field(default=None, repr=False)

    def at(self, t: Array) -> Array:
        """(k,) times -> (k, n)."""
        if self.constant is not None:
            return np.broadcast_to(self.constant, (len(t), self.dim))
        if self.function is not None:
            rows = [np.asarray(self.function(float(s)), dtype=float) for s in t]
            return np.array(rows).reshape(len(t), self.dim)
        return np.column_stack(
            [np.broadcast_to(np.asarray(entry(t), dtype=float), t.shape) for entry in self._formulas]
        )

    @cached_property
    def _formulas(self) -> list[Callable[[Array], Any]]:
        import sympy as sp

        t = sp.Symbol("t", real=True)
        names = {"t": t, "pi": sp.pi}
        return [sp.lambdify([t], parse_expression(text, names, FORMULA_FUNCTIONS), "numpy") for text in self.texts]

    def __getstate__(self) -> dict[str, Any]:
        return {name: getattr(self, name) for name in ("dim", "constant", "texts", "function")}


def velocity(group: MatrixGroup, value: Any, where: str) -> Velocity:
    """A Velocity from (n,) numbers, n texts in t (numbers among them), a function of t, or {label: number or text}.

    Raises:
        ShapeError, NotFiniteError, ExpressionError, SteeringInputError: naming `where`.
    """
    n = group.dim
    if callable(value):
        try:
            first = np.asarray(value(0.0), dtype=float)
        except (TypeError, ValueError) as error:
            raise SteeringInputError(
                f"{where}: a function of t must return {n} numbers; at t = 0 it fails: {error}"
            ) from error
        if first.shape != (n,):
            raise ShapeError(f"{where}: the function of t returns shape {first.shape}; it must be ({n},)")
        return Velocity(n, function=value)
    entries = _by_label(group, value, where) if isinstance(value, dict) else value
    if isinstance(entries, str) or not np.iterable(entries):
        raise ShapeError(f"{where}: give ({n},) numbers, {n} formulas of t, or a function of t, got {value!r:.60}")
    given = list(entries)
    if len(given) != n:
        raise ShapeError(f"{where}: {len(given)} entries; give {n}, one for each of {', '.join(group.labels)}")
    if any(isinstance(each, str) for each in given):
        formulas = Velocity(n, texts=tuple(str(each) for each in given))
        formulas.at(np.zeros(1))
        return formulas
    try:
        constant = np.array(given, dtype=float)
    except (TypeError, ValueError):
        raise ShapeError(f"{where}: give ({n},) real numbers, got {value!r:.60}") from None
    if constant.shape != (n,):
        raise ShapeError(f"{where} has shape {constant.shape}; give ({n},)")
    if not np.all(np.isfinite(constant)):
        raise NotFiniteError(f"{where} holds NaN or infinity")
    return Velocity(n, constant=constant)


def _by_label(group: MatrixGroup, value: dict[Any, Any], where: str) -> list[Any]:
    unknown = [label for label in value if label not in group.labels]
    if unknown:
        raise SteeringInputError(f"{where}: no component {unknown[0]!r}; there are {', '.join(group.labels)}")
    return [value.get(label, 0.0) for label in group.labels]


@dataclass(frozen=True, eq=False, repr=False)
class System(Value):
    """X' = X hat(drift + sum_i u_i b_i), or X' = hat(drift + sum_i u_i b_i) X, from `start`.

    Attributes:
        group: the group.
        labels: (m,) names of the controls.
        directions: (m,) b_i.
        drift: the velocity that is there without controls.
        start: (d, d) X(0).
        right: whether the velocity acts from the left of X (a right-invariant system, as Schroedinger's equation).
    """

    group: MatrixGroup = field(repr=False)
    labels: tuple[str, ...]
    directions: tuple[Velocity, ...] = field(repr=False)
    drift: Velocity = field(repr=False)
    start: Array = field(repr=False)
    right: bool = False

    @property
    def steady(self) -> bool:
        """Whether nothing depends on time."""
        return all(each.constant is not None for each in (*self.directions, self.drift))

    def directions_at(self, t: Array) -> Array:
        """(k,) times -> (k, m, n)."""
        constants = [each.constant for each in self.directions]
        if all(each is not None for each in constants):
            return np.broadcast_to(np.array(constants), (len(t), len(constants), self.group.dim))
        return np.stack([each.at(t) for each in self.directions], axis=1)

    def velocity(self, t: Array, inputs: Array) -> Array:
        """(k,) times, (k, m) inputs -> (k, n) drift and controls together."""
        return np.asarray(self.drift.at(t) + np.einsum("km,kmn->kn", inputs, self.directions_at(t)))


def controls_of(
    group: MatrixGroup, controls: Sequence[Any], where: str
) -> tuple[tuple[str, ...], tuple[Velocity, ...]]:
    """Labels and directions of controls: labels or positions of the basis, (n,) vectors, n texts, or functions of t.

    Raises:
        SteeringInputError, ShapeError, NotFiniteError: naming the control.
    """
    if isinstance(controls, str):
        controls = (controls,)
    labels: list[str] = []
    directions = []
    for number, each in enumerate(controls, start=1):
        if isinstance(each, str):
            if each not in group.labels:
                raise SteeringInputError(f"{where}: no control {each!r}; {group.name} has {', '.join(group.labels)}")
            position = group.labels.index(each)
        elif isinstance(each, int | np.integer):
            if not -group.dim <= each < group.dim:
                raise SteeringInputError(f"{where}: no control number {each}; {group.name} has {group.dim}")
            position = int(each) % group.dim
        else:
            labels.append(f"u{number}")
            directions.append(velocity(group, each, f"{where}: control {number}"))
            continue
        labels.append(group.labels[position])
        directions.append(Velocity(group.dim, constant=np.eye(group.dim)[position]))
    if not labels:
        raise SteeringInputError(f"{where}: no controls; {group.name} has {', '.join(group.labels)}")
    if len(set(labels)) < len(labels):
        raise SteeringInputError(f"{where}: a control is given twice: {', '.join(labels)}")
    return tuple(labels), tuple(directions)
