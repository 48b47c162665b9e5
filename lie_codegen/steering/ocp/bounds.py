"""The bounds of controls as they are given: one number, a pair, or by input."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.errors import InputError, NotFiniteError, ShapeError
from lie_codegen.steering.ocp.layout import Layout, Shape


def bounds_of(given: Any, inputs: Layout, where: str) -> tuple[tuple[float, ...], tuple[float, ...]]:
    """(lower, upper) of every control, without limit where nothing is said.

    Raises:
        InputError, ShapeError, NotFiniteError: naming the control whose bounds are crossed, no input, of another shape or NaN.
    """
    lower, upper = np.full(inputs.size, -np.inf), np.full(inputs.size, np.inf)
    if given is None:
        return tuple(lower), tuple(upper)
    by_name = given if isinstance(given, Mapping) else None
    places = inputs.slices()
    if by_name is None:
        places, by_name = {"": (slice(0, inputs.size), (inputs.size,))}, {"": given}
    for name, value in by_name.items():
        if name not in places:
            raise InputError(f"{where}: bounds of {name!r}, which is no input; inputs are {', '.join(inputs.names)}")
        place, shape = places[name]
        label = f"bounds of {name}" if name else "bounds"
        pair = value if isinstance(value, tuple | list) and len(value) == 2 else None
        if pair is None:
            high = _broadcast(value, shape, label, where)
            low = -high
        else:
            low, high = (_broadcast(each, shape, label, where) for each in pair)
        lower[place], upper[place] = low.ravel(), high.ravel()
    names = inputs.entry_names()
    for i in np.flatnonzero(~(lower <= upper)):
        raise InputError(f"{where}: bounds of {names[i]} are crossed: {lower[i]:g} > {upper[i]:g}")
    return tuple(map(float, lower)), tuple(map(float, upper))


def _broadcast(value: Any, shape: Shape, label: str, where: str) -> Array:
    try:
        array = np.broadcast_to(np.asarray(value, dtype=float), shape)
    except (TypeError, ValueError):
        raise ShapeError(f"{where}: {label}: {value!r:.60} does not fit the shape {shape}") from None
    if np.isnan(array).any():
        raise NotFiniteError(f"{where}: {label} hold NaN")
    return array
