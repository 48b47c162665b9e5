"""Batches of the entries that vary: the rest of a result is the same for all samples, and need not be written again and again."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lie_codegen.arrays import Array
from lie_codegen.errors import ShapeError
from lie_codegen.kernel.kernel import Port

#: As numpy.nonzero gives them: X[(..., *index)] are the entries.
Index = tuple[NDArray[np.intp], ...]


@dataclass(frozen=True, eq=False)
class Varying:
    """A compiled kernel that gives these entries alone.

    Attributes:
        function: it.
        index: of each output.
        ports: the outputs.
        constant: of each output, an element with the entries that never vary, and zeros.
    """

    function: Any
    index: tuple[Index, ...]
    ports: tuple[Port, ...]
    constant: tuple[Array, ...]

    def whole(self, values: Sequence[Any]) -> list[Array]:
        """(..., m) of each output -> (..., *shape).

        Raises:
            ShapeError: an array whose last axis is not m.
        """
        found = []
        for port, index, constant, given in zip(self.ports, self.index, self.constant, values, strict=True):
            array = np.asarray(given)
            count = len(index[0]) if index else 1
            if not index or count == constant.size:
                found.append(array)
                continue
            if array.ndim < 1 or array.shape[-1] != count:
                raise ShapeError(
                    f"whole: {port.name} has shape {array.shape}; the last axis holds the {count} entries that vary"
                )
            lead = array.shape[:-1]
            result = np.broadcast_to(constant.ravel(), (*lead, constant.size)).copy()
            result[..., np.ravel_multi_index(index, constant.shape)] = array
            found.append(result.reshape(*lead, *constant.shape))
        return found
