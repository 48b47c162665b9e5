"""SampledInput: values at times, held or joined by straight lines."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.errors import InputError, ShapeError
from lie_codegen.kernel.saved import Saved
from lie_codegen.runtime.formula_input import FormulaInput, lines_input
from lie_codegen.values import settle


@dataclass(frozen=True, eq=False, repr=False)
class SampledInput(Saved):
    """u(t) from values at times, as a flight computer or a log gives them.

    between="constant": u = values_k on [times_k, times_k+1), m values and m + 1 times; steps end exactly at the times.
    between="linear": straight from values_k to values_k+1, m values at m times; continuous, with corners there.
    Before the first and after the last time u keeps its value there.

    Attributes:
        times: increasing.
        values: (m, n), or (T, m, n) for T trajectories at once.
        between: "constant" or "linear".

    Raises:
        InputError: another word for `between`, or times that do not increase.
        ShapeError: numbers of times and values that do not fit.
        NotFiniteError: NaN or infinity.
    """

    times: ArrayLike
    values: ArrayLike
    between: Literal["constant", "linear"] = "constant"
    formula: FormulaInput = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        if self.between not in ("constant", "linear"):
            raise InputError(f'SampledInput: between is "constant" or "linear", given {self.between!r}')
        t, v = np.array(self.times, dtype=float), np.array(self.values, dtype=float)
        extra = 1 if self.between == "constant" else 0
        if t.ndim != 1 or v.ndim not in (2, 3) or len(t) < 2 or v.shape[-2] + extra != len(t):
            raise ShapeError(
                f"SampledInput: times {t.shape} and values {v.shape}; {self.between} pieces take "
                f"{'m + 1' if extra else 'm'} times and (m, n) or (T, m, n) values"
            )
        # A piece before and one after hold the outermost values.
        width = t[-1] - t[0]
        times = np.concatenate([[t[0] - width], t, [t[-1] + width]])
        first, last = v[..., :1, :], v[..., -1:, :]
        starts, ends = (v, v) if extra else (v[..., :-1, :], v[..., 1:, :])
        left = np.concatenate([first, starts, last], axis=-2)
        right = np.concatenate([first, ends, last], axis=-2)
        settle(self, times=t, values=v, formula=lines_input(times, left, right))

    def as_formula(self, start: float, end: float) -> FormulaInput:
        """Itself: straight pieces at all times.

        Args:
            start, end: the interval of time; the pieces serve any.
        """
        return self.formula

    @property
    def breakpoints(self) -> Array:
        """The times."""
        return np.asarray(self.times)

    def __call__(self, t: ArrayLike) -> Array:
        """u(t): scalar t -> (n,), (k,) -> (k, n); of several trajectories (T, n) and (T, k, n). At a jump, what comes after."""
        moments = np.asarray(t, dtype=float)
        flat = moments.ravel()
        found = self.formula.values(flat, np.zeros_like(flat), np.zeros(1))[..., 0, :]
        found = np.where(np.isnan(flat)[:, None], np.nan, found)  # held values depend on no time: at none there is none
        return np.asarray(found.reshape(*found.shape[:-2], *moments.shape, found.shape[-1]))
