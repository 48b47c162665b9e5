"""Controls that are constant on each interval: an array, and a function of time."""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array


class StageControls(np.ndarray[Any, Any]):
    """(N, m) controls, constant on each of N equally long intervals.

    Attributes:
        duration: of all intervals together [s].
    """

    #: What `lie_codegen.kernel.saved` keeps of it.
    SAVED: ClassVar[tuple[str, ...]] = ("values", "duration")

    duration: float

    def __new__(cls, values: ArrayLike, duration: float) -> StageControls:
        """A copy of the values."""
        array = np.array(values, dtype=float).view(cls)
        array.duration = duration
        return array

    def __array_finalize__(self, other: Any) -> None:
        """A view or a result of arithmetic keeps the duration of what it came from."""
        self.duration = getattr(other, "duration", 1.0)

    @property
    def values(self) -> Array:
        """(N, m) as a plain array."""
        return np.asarray(self)

    def __call__(self, t: ArrayLike) -> Array:
        """u at t: (m,) for a number, (k, m) for (k,) times; the first and the last value before and after."""
        times = np.asarray(t, dtype=float)
        k = np.clip(np.floor(times / self.duration * len(self) + 1e-9), 0, len(self) - 1).astype(int)
        return np.asarray(np.asarray(self)[k])

    def __reduce__(self) -> Any:
        """Values and duration."""
        return StageControls, (self.values, self.duration)
