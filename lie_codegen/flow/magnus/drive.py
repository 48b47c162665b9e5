"""What drives a Magnus flow: u as a formula, its pieces on a grid, and its fastest rate."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import partial
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from lie_codegen.arrays import Array
from lie_codegen.flow.magnus.norms import size_of
from lie_codegen.kernel.saved import Saved
from lie_codegen.runtime.formula_input import FormulaInput
from lie_codegen.values import settle

if TYPE_CHECKING:
    from lie_codegen.signals.resolved_input import ResolvedInput


@dataclass(frozen=True, eq=False, repr=False)
class Drive(Saved):
    """factor u(t): waves and straight pieces of a FormulaInput, or the Legendre pieces of a function that was resolved.

    Attributes:
        formula: zero waves and no pieces under a function.
        rates, rates_low: (F,) of its waves, or (N, F) where each of N trajectories has its own.
        series: (m, terms, n) Legendre coefficients on the pieces, or (0, 0, n).
        times: (m + 1,) ends of the pieces, straight or Legendre; empty without.
        factor: (1,), or (N,) of N trajectories.
        many: N, or None where u and its factor are those of one trajectory.
        resolution: the longest gap between two values of u that were read; 0 for a formula, which is known everywhere.
        evaluations: how many values of u were read.
        error: the integral over time of |u - pieces|, estimated.
        corners: (j,) times at which u is not smooth.
    """

    formula: FormulaInput
    rates: Array
    rates_low: Array
    series: Array
    times: Array
    factor: Array
    many: int | None
    resolution: float
    evaluations: int
    error: float
    corners: Array

    @property
    def terms(self) -> int:
        """Number of Legendre coefficients of a piece; 0 under a formula."""
        return int(self.series.shape[1])

    @property
    def _fastest(self) -> float:
        return self.formula.fastest if self.rates.ndim == 1 else float(np.max(np.abs(self.rates), initial=0.0))

    @property
    def busiest(self) -> int:
        """The trajectory with the largest coefficients and rates: where the shortest steps are likely to be asked for."""
        formula, size = self.formula, np.zeros(1)
        for table in (formula.cosines, formula.sines, formula.left, formula.right):
            size = size + np.sum(np.abs(table), axis=(-2, -1))
        size = size * np.abs(self.factor)
        if self.rates.ndim == 2:
            size = size + np.max(np.abs(self.rates), axis=-1, initial=0.0)
        return int(np.argmax(size))

    def values(self, moments: Array, lengths: Array, at: Array) -> Array:
        """factor u at the fractions `at` of steps: (k, points, n), or (N, k, points, n).

        A step reads the piece in which its middle lies, at both its ends.
        """
        if self.terms:
            piece = self.piece_of(moments + lengths / 2)
            x = (moments - self.times[piece])[:, None] + lengths[:, None] * at
            polynomials = np.polynomial.legendre.legvander(2 * x / np.diff(self.times)[piece, None] - 1, self.terms - 1)
            total = np.einsum("kpj,kji->kpi", polynomials, self.series[piece])
        elif self.rates.ndim == 2:
            rows = [self._alone(k).values(moments, lengths, at) for k in range(len(self.rates))]
            total = np.stack(rows)
        else:
            total = self.formula.values(moments, lengths, at)
        return np.asarray(total * (self.factor[0] if self.many is None else self.factor[:, None, None, None]))

    def on_pieces(self, times: Array) -> Drive:
        """The function on other pieces: on each the Legendre series that agrees with it at Gauss's nodes.

        Its first moments, all that a Magnus step reads, are those of the function to twice the order of the nodes.
        """
        nodes, weights = np.polynomial.legendre.leggauss(self.terms)
        moments = times[:-1, None] + np.diff(times)[:, None] * (1 + nodes) / 2
        flat = moments.ravel()
        values = replace(self, factor=np.ones(1), many=None).values(flat, np.zeros_like(flat), np.zeros(1))
        powers = np.polynomial.legendre.legvander(nodes, self.terms - 1)
        to_series = (np.arange(self.terms) + 0.5)[:, None] * powers.T * weights
        series = np.einsum("kg,pgi->pki", to_series, values.reshape(*moments.shape, -1))
        return replace(self, series=np.ascontiguousarray(series), times=times)

    def _alone(self, k: int) -> FormulaInput:
        return replace(self.formula.trajectory(k), rates=self.rates[k], rates_low=self.rates_low[k])

    def piece_of(self, moments: Array) -> NDArray[np.intp]:
        """The piece in which each time lies; 0 without pieces."""
        if not len(self.times):
            return np.zeros(len(moments), dtype=np.intp)
        found = np.searchsorted(self.times, moments, side="right") - 1
        return np.ascontiguousarray(np.clip(found, 0, len(self.times) - 2), dtype=np.intp)

    def density(self, norms: Array, pieces: NDArray[np.intp]) -> Array:
        """Steps per unit of time that the fastest sine and the size of u ask for, on each of these pieces.

        One radian of the fastest sine, and |h hat(u)| <= 1: well inside the radius pi in which the Magnus series converges.
        `norms` are those of `norms_of`.
        """
        size = partial(size_of, norms)
        factor = float(np.max(np.abs(self.factor)))
        waves = np.hypot(size(self.formula.cosines), size(self.formula.sines))
        total = np.full(len(pieces), float(np.max(np.sum(waves, axis=-1), initial=0.0)))
        if self.terms:
            total = total + np.sum(size(self.series), axis=1)[pieces]
        elif len(self.times):
            ends = np.maximum(size(self.formula.left), size(self.formula.right))
            total = total + (ends if ends.ndim == 1 else np.max(ends, axis=0))[pieces]
        return np.asarray(np.maximum(factor * total, self._fastest))


def formula_drive(formula: FormulaInput, factor: Array) -> Drive:
    """A Fourier series or straight pieces, times a number or (N,) numbers; that of a number is kept beside the formula for the next run."""
    kept: Drive | None = None if factor.ndim else vars(formula).get("_drive")
    if kept is not None and kept.factor[0] == factor:
        return kept
    row, many = _row(factor)
    row.flags.writeable = False
    none = np.empty((0, 0, formula.dim))
    made = Drive(
        formula,
        formula.rates,
        formula.rates_low,
        none,
        formula.times,
        row,
        formula.trajectories or many,
        0.0,
        0,
        0.0,
        formula.times,
    )
    if many is None:
        settle(formula, _drive=made)
    return made


def resolved_drive(u: ResolvedInput, factor: Array) -> Drive:
    """The pieces of a function, times a number or (N,) numbers."""
    row, many = _row(factor)
    none, empty = np.empty((0, u.series.shape[-1])), np.empty(0)
    nothing = FormulaInput(empty, empty, none, none, empty, none, none)
    error = float(np.max(np.abs(row))) * u.error
    return Drive(nothing, empty, empty, u.series, u.times, row, many, u.resolution, u.evaluations, error, u.corners)


def _row(factor: Array) -> tuple[Array, int | None]:
    row = np.array(factor, dtype=float, ndmin=1)  # of a number a row of one
    return row, len(row) if np.ndim(factor) else None
