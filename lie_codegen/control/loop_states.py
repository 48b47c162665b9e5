"""The own states of a law and an observer: how a loop begins with them, and how they are read out of its states."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.control.loop_model import Loop
from lie_codegen.control.plants import GroupPlant
from lie_codegen.errors import InputError, NotFiniteError, ShapeError
from lie_codegen.kernel.definition import doubles


def initial_own(loop: Loop, start: Array, given: Mapping[str, Any]) -> Array:
    """(N, m) states with the own states behind those of the plant.

    Raises:
        InputError: a name that is no state. ShapeError, NotFiniteError: a value of another shape, or not finite.
    """
    if not (loop.own_ports or given):
        return start
    names = [each.name for each in loop.own_ports]
    unknown = [name for name in given if name not in names]
    if unknown:
        raise InputError(
            f"closed_loop: no state {', '.join(unknown)} of the law; its own states: {', '.join(names) or 'none'}"
        )
    if not names:
        return start
    parts = [start]
    for each in loop.own_ports:
        value = given.get(each.name)
        if loop.is_element(each.port) and isinstance(loop.plant, GroupPlant):
            part, _ = loop.plant.starts(value, None)
            part = part[:, : loop.own_size(each.port)]
        else:
            part = np.zeros((1, each.port.size)) if value is None else _flat(each.name, each.port.shape, value)
        if len(part) not in (1, len(start)):
            raise ShapeError(f"closed_loop: {len(part)} starts of {each.name} for {len(start)} loops")
        parts.append(np.broadcast_to(part, (len(start), part.shape[1])))
    return np.ascontiguousarray(np.concatenate(parts, axis=1))


def _flat(name: str, shape: tuple[int, ...], value: Any) -> Array:
    array = np.asarray(doubles(value), dtype=float)
    if array.shape[array.ndim - len(shape) :] != shape or array.ndim > len(shape) + 1:
        raise ShapeError(f"closed_loop: the start of {name} has shape {array.shape}; give {shape}, or one a loop")
    if not np.all(np.isfinite(array)):
        raise NotFiniteError(f"closed_loop: the start of {name} holds NaN or infinity")
    return array.reshape(len(array) if array.ndim > len(shape) else 1, -1)


def own_states(loop: Loop, found: Array, sampled: bool) -> dict[str, Array]:
    """The own states by name, of (..., m) states; of a sampled loop as the law used them."""
    states: dict[str, Array] = {}
    if not loop.own_ports:
        return states
    place = sum(loop.plant.sizes[:2])
    if sampled:
        place += sum(loop.own_size(each.port) for each in loop.own_ports)
    for each in loop.own_ports:
        size = loop.own_size(each.port)
        flat = np.ascontiguousarray(found[..., place : place + size])
        place += size
        if loop.is_element(each.port):
            padded = np.concatenate([flat, np.zeros((*flat.shape[:-1], sum(loop.plant.sizes[:2]) - size))], axis=-1)
            states[each.name] = loop.plant.split(padded)[0]
        else:
            states[each.name] = flat.reshape(*found.shape[:-1], *each.port.shape)
    return states
