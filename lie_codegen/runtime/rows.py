"""A kernel at a few samples, each as a call: what runs once need not wait for the compilation of lanes."""

from __future__ import annotations

from typing import Any

from lie_codegen.arrays import Array
from lie_codegen.errors import ShapeError
from lie_codegen.runtime.arguments import bind, outputs_for, sequences
from lie_codegen.runtime.call import Compiled

#: Samples up to which the scalar function is asked: at a microsecond or less each, milliseconds where compiling the lanes takes a second.
FEW = 2**14


def row_by_row(function: Compiled[Any], *args: Any, **named: Any) -> tuple[Array, ...]:
    """The outputs as `function.batch` gives them, as arrays in their order.

    Up to `FEW` samples each is, to the last bit, what a call gives, and no lanes are compiled for them; beyond, they are those of the batch.

    Raises:
        ShapeError: as `batch`.
    """
    values = bind(function.signature, args, named)
    arrays, strides, count = sequences(function.signature, values, "samples", function.inputs)
    if count is None:
        raise ShapeError(f"{function.name}: no input has a leading axis of samples")
    if count > FEW:
        made = function.batch(*values)
        return (made,) if function.result_type is None else tuple(made)
    outputs = outputs_for(function.signature, None, (count,))
    function.backend.calls(count, arrays, strides, outputs)
    return tuple(outputs)
