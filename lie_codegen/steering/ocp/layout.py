"""Names with shapes, laid out one behind the other in a vector: inputs, states, parameters."""

from __future__ import annotations

import operator
from collections.abc import Mapping
from dataclasses import dataclass
from math import prod
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.errors import InputError, NotFiniteError, ShapeError
from lie_codegen.identifiers import check_identifier

#: (), (k,), (r, c); or (d, d, 2) for a complex matrix of a complex group, as (re, im).
Shape = tuple[int, ...]

#: What formulas call by these names is always the same thing, or an option of `solve`, `reset` or `step`.
RESERVED = (
    *("X", "X0", "t", "pi", "plan", "starts", "guess", "seed", "threads", "tolerance", "allowed", "iterations"),
    *("curvature", "self"),
)


@dataclass(frozen=True)
class Layout:
    """Named arrays in one vector, in C order each.

    Attributes:
        what: "input", "state" or "parameter", for messages.
        shapes: name -> shape, in order.
    """

    what: str
    shapes: tuple[tuple[str, Shape], ...]

    @property
    def size(self) -> int:
        """Numbers in all."""
        return sum(prod(shape) for _, shape in self.shapes)

    @property
    def names(self) -> tuple[str, ...]:
        """In order."""
        return tuple(name for name, _ in self.shapes)

    def slices(self) -> dict[str, tuple[slice, Shape]]:
        """name -> (its place in the vector, its shape)."""
        places, start = {}, 0
        for name, shape in self.shapes:
            places[name] = (slice(start, start + prod(shape)), shape)
            start += prod(shape)
        return places

    def entry_names(self) -> tuple[str, ...]:
        """A name for each number: v1, v2 of a vector v; M11, M12 of a matrix; the name itself of a number."""
        return tuple(entry for name, shape in self.shapes for entry in entry_names(name, shape))

    def split(self, vector: Array) -> dict[str, Array]:
        """The named arrays in vectors (..., size)."""
        parts = {}
        for name, (place, shape) in self.slices().items():
            part = vector[..., place].reshape((*vector.shape[:-1], *shape))
            parts[name] = part[..., 0] + 1j * part[..., 1] if len(shape) == 3 else part
        return parts

    def rows(self, values: Mapping[str, ArrayLike], stages: int, where: str) -> Array:
        """(stages, size) or (1, size): one row where nothing changes from stage to stage.

        A value has the shape of its name, or that with a leading axis of `stages` (the last may be missing, and is
        then repeated).

        Raises:
            InputError: a name that is missing or unknown.
            ShapeError, NotFiniteError: naming the culprit.
        """
        missing = [name for name in self.names if name not in values]
        unknown = [name for name in values if name not in self.names]
        if missing or unknown:
            known = ", ".join(self.names) or "none"
            said = f"no value for {', '.join(missing)}" if missing else f"no {self.what} {', '.join(unknown)}"
            raise InputError(f"{where}: {said}; the {self.what}s are {known}")
        parts = {name: _checked(self.what, name, shape, values[name], stages, where) for name, shape in self.shapes}
        count = max([len(part) for part in parts.values()], default=1)
        result = np.empty((count, self.size))
        for name, (place, _) in self.slices().items():
            result[:, place] = parts[name]
        return result


def entry_names(name: str, shape: Shape) -> tuple[str, ...]:
    """A name for each number of a named array."""
    if len(shape) == 0 or shape == (1,):
        return (name,)
    if len(shape) == 1:
        return tuple(f"{name}{i + 1}" for i in range(shape[0]))
    parts = ("",) if len(shape) == 2 else ("_re", "_im")
    return tuple(f"{name}{i + 1}{j + 1}{part}" for i in range(shape[0]) for j in range(shape[1]) for part in parts)


def _checked(what: str, name: str, shape: Shape, value: ArrayLike, stages: int, where: str) -> Array:
    try:
        array = np.asarray(value, dtype=complex if len(shape) == 3 else float)
    except (TypeError, ValueError):
        raise ShapeError(f"{where}: {what} {name} is no array of real numbers: {value!r:.60}") from None
    if not np.isfinite(array).all():
        raise NotFiniteError(f"{where}: {what} {name} holds NaN or infinity")
    if len(shape) == 3:
        array = np.stack([array.real, array.imag], axis=-1)
    if array.shape == shape or (shape == (1,) and array.shape == ()):
        return array.reshape(1, -1)
    if stages > 1 and array.shape[1:] == shape and array.shape[0] in (stages - 1, stages):
        flat = array.reshape(len(array), -1)
        return flat if len(flat) == stages else np.vstack([flat, flat[-1:]])
    more = f", or a row an interval, ({stages - 1}, ...)" if stages > 1 else ""
    raise ShapeError(f"{where}: {what} {name} has shape {array.shape}; it is {shape}{more}")


def layout(what: str, given: Mapping[str, Any], element: Shape = ()) -> Layout:
    """The layout of {name: shape}; a shape may be a number of components, or "X" for an element of the group.

    Raises:
        InputError, IdentifierError: a name that is no identifier or is reserved.
        ShapeError: a shape that is none.
    """
    if not isinstance(given, Mapping):
        raise InputError(f"ocp: {what}s are a mapping of names to shapes, got {given!r:.60}")
    shapes = []
    for name, shape in given.items():
        check_identifier(name, f"{what} name")
        if name in RESERVED:
            raise InputError(f"ocp: the {what} {name!r} has a name that means something else; choose another")
        shapes.append((name, element if shape == "X" and element else _shape(what, name, shape)))
    return Layout(what, tuple(shapes))


def _shape(what: str, name: str, shape: Any) -> Shape:
    try:
        sides = (operator.index(shape),) if not isinstance(shape, tuple | list) else tuple(map(operator.index, shape))
    except TypeError:
        sides = (0,)
    if len(sides) > 2 or any(side < 1 for side in sides):
        raise ShapeError(f"ocp: {what} {name!r}: {shape!r} is no shape; give (), k, (k,) or (rows, columns)")
    return sides


def check_distinct(layouts: tuple[Layout, ...], matrix_entries: tuple[str, ...]) -> None:
    """No two numbers have one name.

    Raises:
        InputError: naming it.
    """
    seen: dict[str, str] = dict.fromkeys(matrix_entries, "an entry of X")
    for each in layouts:
        for name, shape in each.shapes:
            for entry in {name, *entry_names(name, shape)}:
                if entry in seen:
                    raise InputError(f"ocp: {entry!r} names {seen[entry]} and the {each.what} {name}; rename one")
                seen[entry] = f"the {each.what} {name}"
