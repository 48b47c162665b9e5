"""Inputs that compiled loops evaluate themselves: Fourier series and straight lines between times."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Protocol, TypeGuard

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.errors import InputError, NotFiniteError, ShapeError
from lie_codegen.kernel.saved import Saved

_NONE = np.empty(0)


@dataclass(frozen=True, eq=False, repr=False)
class FormulaInput(Saved):
    """u(t) = sum_f cosines_f cos(w_f t) + sines_f sin(w_f t), plus on each piece a straight line.

    Attributes:
        rates: (F,) w_f, to twice the precision with `rates_low`.
        cosines, sines: (F, n), or (T, F, n) for T trajectories.
        times: (m + 1,) ends of the pieces, increasing; before the first and after the last the lines go on.
        left, right: (m, n) or (T, m, n): at the start and the end of each piece.
    """

    rates: Array
    rates_low: Array
    cosines: Array
    sines: Array
    times: Array
    left: Array
    right: Array

    @property
    def dim(self) -> int:
        """n."""
        return int(self.cosines.shape[-1])

    @property
    def trajectories(self) -> int | None:
        """T, or None where all share one input."""
        counts = [len(table) for table in (self.cosines, self.left) if table.ndim == 3]
        return counts[0] if counts else None

    @cached_property
    def addresses(self) -> tuple[int, int, int, int, int, int]:
        """Of rates, rates_low, cosines, sines, left and right, for compiled loops."""
        tables = self.rates, self.rates_low, self.cosines, self.sines, self.left, self.right
        return tuple(each.ctypes.data for each in tables)  # type: ignore[return-value]

    @property
    def breakpoints(self) -> Array:
        """Where a piece begins or ends."""
        return self.times

    @property
    def fastest(self) -> float:
        """The largest |w_f| whose coefficients are not all zero."""
        used = np.any((self.cosines != 0) | (self.sines != 0), axis=-1)
        used = used.any(axis=0) if used.ndim == 2 else used
        return float(np.max(np.abs(self.rates), initial=0.0, where=used))

    def scaled(self, factor: ArrayLike) -> FormulaInput:
        """factor u; (T,) factors make T trajectories."""
        f = np.asarray(factor, dtype=float)
        f = f[:, None, None] if f.ndim else f
        tables = {name: _table(f * getattr(self, name)) for name in ("cosines", "sines", "left", "right")}
        return replace(self, **tables)

    def trajectory(self, number: int) -> FormulaInput:
        """The input of one trajectory."""
        tables = {name: getattr(self, name) for name in ("cosines", "sines", "left", "right")}
        return replace(self, **{name: each[number] if each.ndim == 3 else each for name, each in tables.items()})

    def values(self, moments: Array, lengths: Array, at: Array) -> Array:
        """u at the fractions `at` of steps that begin at `moments`: (k, points, n), or (T, k, points, n).

        Each step reads the piece in which its middle lies, at both its ends.
        """
        t = moments[:, None] + lengths[:, None] * at
        angles = t[..., None] * self.rates
        low = t[..., None] * self.rates_low
        c, s = np.cos(angles) - low * np.sin(angles), np.sin(angles) + low * np.cos(angles)
        total = np.einsum("kpf,...fn->...kpn", c, self.cosines) + np.einsum("kpf,...fn->...kpn", s, self.sines)
        if not len(self.times):
            return np.asarray(total)
        piece = np.searchsorted(self.times, moments + lengths / 2, side="right") - 1
        piece = np.clip(piece, 0, len(self.times) - 2)
        x = ((t - self.times[piece][:, None]) / np.diff(self.times)[piece][:, None])[..., None]
        left, right = self.left[..., piece, None, :], self.right[..., piece, None, :]
        return np.asarray(total + np.where(left == right, left, left + x * (right - left)))


class HasFormula(Protocol):
    """An input that can say itself as a formula: periodic, sampled, in pieces."""

    def as_formula(self, start: float, end: float) -> FormulaInput | None:
        """u on [start, end]; None where it is no such formula."""


def has_formula(u: Any) -> TypeGuard[HasFormula]:
    """By the method alone: to ask the protocol takes ten microseconds of a call of a hundred."""
    return hasattr(u, "as_formula")


def fourier_input(
    rates: ArrayLike, cosines: ArrayLike, sines: ArrayLike, *, rates_low: ArrayLike | None = None
) -> FormulaInput:
    """u(t) = sum_f cosines_f cos(rates_f t) + sines_f sin(rates_f t), from (F,), (F, n) and (F, n) or (T, F, n) each.

    Raises:
        ShapeError: the tables do not fit.
        NotFiniteError: NaN or infinity.
    """
    w, c, s = (np.asarray(each, dtype=float) for each in (rates, cosines, sines))
    if w.ndim != 1 or c.shape != s.shape or c.ndim not in (2, 3) or c.shape[-2] != len(w):
        raise ShapeError(
            f"a Fourier input takes rates (F,), cosines and sines (F, n) or (T, F, n); given {w.shape}, {c.shape}, {s.shape}"
        )
    if not all(np.all(np.isfinite(each)) for each in (w, c, s)):
        raise NotFiniteError("a Fourier input holds NaN or infinity")
    low = np.zeros_like(w) if rates_low is None else np.asarray(rates_low, dtype=float)
    none = np.empty((0, c.shape[-1]))
    return FormulaInput(_table(w), _table(low), _table(c), _table(s), _NONE, none, none)


def lines_input(times: ArrayLike, left: ArrayLike, right: ArrayLike) -> FormulaInput:
    """Straight from left_k at times_k to right_k at times_k+1; from (m + 1,) and (m, n) or (T, m, n) each.

    Raises:
        ShapeError, InputError, NotFiniteError: about what is wrong.
    """
    t, a, b = (np.asarray(each, dtype=float) for each in (times, left, right))
    if t.ndim != 1 or a.shape != b.shape or a.ndim not in (2, 3) or a.shape[-2] != len(t) - 1 or len(t) < 2:
        raise ShapeError(
            f"pieces take times (m + 1,) and values (m, n) or (T, m, n); given {t.shape}, {a.shape}, {b.shape}"
        )
    if not all(np.all(np.isfinite(each)) for each in (t, a, b)):
        raise NotFiniteError("an input in pieces holds NaN or infinity")
    if np.any(np.diff(t) <= 0):
        raise InputError("the times of an input in pieces must increase")
    none = np.empty((0, a.shape[-1]))
    return FormulaInput(_NONE, _NONE, none, none, _table(t), _table(a), _table(b))


def formula_input(u: Any, start: float, end: float) -> FormulaInput | None:
    """What u is on [start, end] as a formula; None where it is none.

    Args:
        u: an input that says so itself, by a method as_formula(start, end).
    """
    if isinstance(u, FormulaInput):
        return u
    return u.as_formula(start, end) if has_formula(u) else None


def _table(values: Any) -> Array:
    return np.ascontiguousarray(values, dtype=float)
