"""Arguments of a batch of loops: with axes for the trajectories and the steps."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from lie_codegen.arrays import Array
from lie_codegen.codegen.signature import Signature
from lie_codegen.errors import InputError, ShapeError
from lie_codegen.runtime.arguments import as_array

Strides = tuple[int, int]


def loops(signature: Signature, values: Sequence[Any], steps: int) -> tuple[list[Array], list[Strides], int]:
    """Arrays, their strides in doubles (from trajectory to trajectory, from step to step), number of trajectories.

    A port of shape s takes s (the same always), (T, *s) (one a trajectory), or but for the first port
    (T, n, *s) (one a trajectory and a step), where T or n may be 1 for all.

    Raises:
        ShapeError: another shape, or two numbers of trajectories.
        InputError: no input has an axis of trajectories.
    """
    arrays: list[Array] = []
    strides: list[Strides] = []
    count: int | None = None
    first, has_axis = "", False
    for number, (port, value) in enumerate(zip(signature.inputs, values, strict=True)):
        array = as_array(signature.name, port, value, signature.real)
        lead = array.shape[: array.ndim - len(port.shape)]
        fits = array.shape[len(lead) :] == port.shape and len(lead) <= (1 if number == 0 else 2)
        if not fits or (len(lead) == 2 and lead[1] not in (1, steps)):
            inner = "".join(f", {side}" for side in port.shape)
            both = "" if number == 0 else f" or (T, {steps}{inner}) for each of {steps} steps too"
            raise ShapeError(
                f"{signature.name}.scan_batch: {port.name} has shape {port.shape}, (T{inner}{'' if inner else ','}) "
                f"for T trajectories{both}; given {array.shape}"
            )
        # An axis of length 1 stands for all trajectories, but the starts are as many as they are.
        if lead and (lead[0] != 1 or number == 0):
            if count is not None and lead[0] != count:
                raise ShapeError(
                    f"{signature.name}.scan_batch: {first} has {count} trajectories, {port.name} has {lead[0]}"
                )
            count, first = lead[0], first or port.name
        moves = lead[1] if len(lead) == 2 else 1
        # A stride of 0 reads the same entries for every trajectory, or step: nothing is copied.
        strides.append(
            (
                port.size * moves if lead and lead[0] != 1 else 0,
                port.size if moves != 1 else 0,
            )
        )
        arrays.append(array)
        has_axis = has_axis or bool(lead)
    if count is None and has_axis:
        count = 1
    if count is None:
        raise InputError(f"{signature.name}.scan_batch: no input has an axis of trajectories; use scan")
    return arrays, strides, count
