"""A function of time, resolved once into Legendre pieces, so that loops need not ask Python again."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lie_codegen.arrays import Array
from lie_codegen.errors import ComputationError, InputError, NotFiniteError
from lie_codegen.values import Value

TERMS = 9
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(TERMS)
#: Two more places at which a piece is checked: no node, and at no rational part of it.
_CHECKS = np.array([-1 / np.sqrt(2) + 0.01745, np.sqrt(5) / 2 - 0.63397])
_AT = np.concatenate([_NODES, _CHECKS])
#: From values at the nodes to coefficients, c_k = (2k + 1)/2 sum_g w_g P_k(x_g) u_g, and from those to the checks.
_TO_SERIES = ((np.arange(TERMS) + 0.5)[:, None] * np.polynomial.legendre.legvander(_NODES, TERMS - 1).T) * _WEIGHTS
_TO_CHECKS = np.polynomial.legendre.legvander(_CHECKS, TERMS - 1)
#: |P_k'| is at most k (k + 1)/2; the share of a piece beyond its outermost node.
_GROWTH = np.arange(TERMS) * (np.arange(TERMS) + 1) / 2
_MARGIN = float(1 - _NODES[-1]) / 2
#: The widest gap between the nodes, of a piece of length 1: a piece is at most this many `resolution`s long.
WIDEST_GAP = float(np.max(np.diff(_NODES))) / 2
LONGEST_PIECE = 5.88

_MOST_VALUES = 2**26
_MOST_PIECES = 2**21
_BLOCK = 2**20
#: Of the interval: pieces are this short at jumps and corners only.
_SHORT = 1e-5


@dataclass(frozen=True, eq=False, repr=False)
class ResolvedInput(Value):
    """u(t) as Legendre series of degree 8 on pieces.

    Attributes:
        times: (m + 1,) ends of the pieces.
        series: (m, 9, n) coefficients on [-1, 1] of each piece.
        resolution: the longest gap between two values of u that were read; what is shorter may have been missed.
        evaluations: how many values were read.
        error: the integral over time of the distance to u, estimated at two places of each piece that are no nodes.
        corners: (j,) where u is not smooth: named by the caller, or found, where pieces had to be very short.
    """

    times: Array
    series: Array
    resolution: float
    evaluations: int
    error: float
    corners: Array

    def __call__(self, t: Array) -> Array:
        """(k,) -> (k, n)."""
        moments = np.asarray(t, dtype=float)
        piece = np.clip(np.searchsorted(self.times, moments, side="right") - 1, 0, len(self.times) - 2)
        x = 2 * (moments - self.times[piece]) / np.diff(self.times)[piece] - 1
        return np.asarray(np.einsum("kj,kji->ki", np.polynomial.legendre.legvander(x, TERMS - 1), self.series[piece]))


def resolve_function(
    u: Callable[[Array], Array],
    start: float,
    end: float,
    *,
    tolerance: float,
    resolution: float | None = None,
    breakpoints: Array,
    where: str,
) -> ResolvedInput:
    """Pieces, halved until each agrees with u at two further places and its last coefficient is small.

    At a jump or a corner the halving goes on until what is left does not count: it is located to rounding.

    Args:
        u: (k,) -> (k, n).
        start, end: the interval.
        tolerance: of the integral of |u - pieces| over it.
        resolution: the longest gap between two values that are read; (end - start)/2000 if not given. A pulse that is
            shorter than that can lie between all values that are read, and nothing can tell.
        breakpoints: where u is known not to be smooth.
        where: for messages.

    Raises:
        InputError: a resolution that is not positive or needs more than 2^26 values, a u that changes when it is asked again.
        NotFiniteError: u is NaN or infinite; names the time.
        ComputationError: u is not resolved by two million pieces; names the time.
    """
    length = end - start
    gap = length / 2000 if resolution is None else resolution
    if not (np.isfinite(gap) and gap > 0):
        raise InputError(
            f"{where}: resolution is {resolution!r}; give the longest gap between two values of u, positive"
        )
    inside = breakpoints[(breakpoints > start) & (breakpoints < end)]
    ends = np.unique(np.concatenate([[start], inside, [end]]))
    counts = np.ceil(np.diff(ends) / (LONGEST_PIECE * gap) * (1 - 1e-12))
    if not np.sum(counts) * len(_AT) <= _MOST_VALUES:
        raise InputError(
            f"{where}: a resolution of {gap:g} over {length:g} needs {np.sum(counts) * len(_AT):.3g} values of u; at most "
            f"{_MOST_VALUES} are read: give a larger one, or u as a formula"
        )
    counts = np.maximum(counts, 1).astype(int)
    left = np.concatenate([np.linspace(a, b, c + 1)[:-1] for a, b, c in zip(ends[:-1], ends[1:], counts, strict=True)])
    right = np.append(left[1:], end)
    _check_repeatable(u, left, right, where)
    state = _Pieces(np.empty(0), np.empty(0), np.empty((0, TERMS, 0)), np.empty(0))
    evaluations, pieces = 0, len(left)
    while len(left):
        values = _read(u, left, right, where)
        evaluations += values.shape[0] * values.shape[1]
        # Legendre coefficients by quadrature at the Gauss nodes; two places that took no part in them check the sum.
        series = np.einsum("kg,pgi->pki", _TO_SERIES, values[:, :TERMS])
        missed = np.max(np.abs(_TO_CHECKS @ series - values[:, TERMS:]), axis=(1, 2))
        good = _is_resolved(series, missed, left, right, tolerance / length, tolerance)
        state = state.with_more(left[good], right[good], series[good], missed[good])
        bad_left, bad_right = left[~good], right[~good]
        # All pieces agree where u was read; what hides between the last node and an end of a piece shows as a gap between neighbours.
        if not len(bad_left):
            state, bad_left, bad_right = state.without_torn(inside, tolerance)
        middle = bad_left + (bad_right - bad_left) / 2
        pieces += len(middle)
        if pieces > _MOST_PIECES:
            raise ComputationError(
                f"{where}: u(t) is not resolved near t = {float(bad_left[0]):.9g} by {_MOST_PIECES} pieces: it is noisy there or "
                "has many corners; give it as samples (lc.SampledInput), name its corners in an attribute `breakpoints`, or "
                "loosen rtol"
            )
        left, right = np.concatenate([bad_left, middle]), np.concatenate([middle, bad_right])
    widths = state.right - state.left
    error = float(np.sum(state.missed * widths))
    corners = np.union1d(inside, state.left[widths < _SHORT * length])
    times = np.append(state.left, end)
    resolution = WIDEST_GAP * float(np.max(widths))
    return ResolvedInput(times, np.ascontiguousarray(state.series), resolution, evaluations, error, corners)


@dataclass(frozen=True, eq=False)
class _Pieces:
    """Pieces that agree with u where it was read, in the order of time."""

    left: Array
    right: Array
    series: Array
    missed: Array

    def with_more(self, left: Array, right: Array, series: Array, missed: Array) -> _Pieces:
        """These and further ones."""
        before = self.series if len(self.left) else series[:0]
        a, b = np.concatenate([self.left, left]), np.concatenate([self.right, right])
        order = np.argsort(a)
        both, misses = np.concatenate([before, series]), np.concatenate([self.missed, missed])
        return _Pieces(a[order], b[order], both[order], misses[order])

    def without_torn(self, breakpoints: Array, tolerance: float) -> tuple[_Pieces, Array, Array]:
        """Those that meet their neighbours, and the ends of those that do not: a corner lies between the last node and the end.

        The nodes leave out 1.6 % of a piece at either end. What hides there shows as a gap between neighbours, and costs at
        most the gap times that much time.
        """
        ends = np.sum(self.series[:-1], axis=1)  # P_k(1) = 1
        starts = np.einsum("k,pki->pi", (-1.0) ** np.arange(TERMS), self.series[1:])
        gap = np.max(np.abs(ends - starts), axis=1, initial=0.0)
        widths = self.right - self.left
        wide = np.maximum(widths[:-1], widths[1:])
        torn = (gap * _MARGIN * wide > 1e-2 * tolerance) & ~np.isin(self.right[:-1], breakpoints)
        # Rounding of u and t, and what the series leave out (less than their last term), are no gap.
        size = np.max(np.abs(self.series), axis=2)
        slope = 2 / widths * np.sum(size * _GROWTH, axis=1)
        noise = 4e-15 * np.sum(size, axis=1) + 1e-15 * slope * np.maximum(np.abs(self.left), np.abs(self.right))
        noise += 10 * (size[:, -1] + self.missed)
        torn &= gap > noise[:-1] + noise[1:]
        bad = np.zeros(len(widths), dtype=bool)
        bad[:-1] |= torn & (widths[:-1] >= 0.5 * wide)
        bad[1:] |= torn & (widths[1:] >= 0.5 * wide)
        bad &= widths > 8 * np.spacing(np.maximum(np.abs(self.left), np.abs(self.right)))
        kept = _Pieces(self.left[~bad], self.right[~bad], self.series[~bad], self.missed[~bad])
        return kept, self.left[bad], self.right[bad]


def _is_resolved(
    series: Array, missed: Array, left: Array, right: Array, rate: float, whole: float
) -> NDArray[np.bool_]:
    """Which pieces are good: by their values, to what rounding of u and t allows, or because they are too short to count."""
    size = np.max(np.abs(series), axis=2)
    slope = 2 / (right - left) * np.sum(size * _GROWTH, axis=1)
    scale = np.sum(size, axis=1)
    rounding = 2e-15 * scale + 4.5e-16 * slope * np.maximum(np.abs(left), np.abs(right))
    allowed = np.maximum(rate, rounding)
    smooth = (missed <= allowed) & (size[:, -1] <= 30 * allowed)
    short = (right - left) * np.maximum(missed, size[:, -1]) <= 1e-3 * whole
    return np.asarray(smooth | short | (right - left <= 8 * np.spacing(np.maximum(np.abs(left), np.abs(right)))))


def _read(u: Callable[[Array], Array], left: Array, right: Array, where: str) -> Array:
    """(pieces, 11, n) values."""
    moments = (left + right)[:, None] / 2 + (right - left)[:, None] / 2 * _AT
    flat = moments.ravel()
    values = np.concatenate([np.asarray(u(flat[k : k + _BLOCK]), dtype=float) for k in range(0, len(flat), _BLOCK)])
    if not np.all(np.isfinite(values)):
        bad = flat[np.flatnonzero(~np.all(np.isfinite(values), axis=1))[0]]
        raise NotFiniteError(f"{where}: u(t) is NaN or infinite at t = {bad:.9g}")
    return values.reshape(*moments.shape, -1)


def _check_repeatable(u: Callable[[Array], Array], left: Array, right: Array, where: str) -> None:
    first = slice(0, 4)
    if not np.array_equal(_read(u, left[first], right[first], where), _read(u, left[first], right[first], where)):
        raise InputError(
            f"{where}: u(t) changes when it is asked again at the same t; give samples of it (lc.SampledInput)"
        )
