"""Signals given by numbers: values at Chebyshev nodes of panels that cover one period.

Products are taken node by node, primitives by spectral integration on each panel. Panels are halved until every
component is resolved to rounding, so kinks and jumps at unknown times cost panels and then digits; name them as
breakpoints.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cache

import numpy as np
from numpy.typing import NDArray

from lie_codegen.arrays import Array
from lie_codegen.errors import InputError, NotFiniteError
from lie_codegen.signals.trig_signal import Brackets
from lie_codegen.values import Value

#: Nodes of a panel.
NODES = 24
_RESOLVED = 1e-14
_MOST_HALVINGS = 30
_MOST_PANELS = 4096


@cache
def _rules() -> tuple[Array, Array, Array, Array]:
    """Nodes on [-1, 1], values -> Chebyshev coefficients, values -> primitive at the nodes, weights of the integral."""
    nodes = np.cos(np.pi * (np.arange(NODES) + 0.5) / NODES)[::-1]
    analyse = np.linalg.inv(np.polynomial.chebyshev.chebvander(nodes, NODES - 1))
    integrate = np.stack([np.polynomial.chebyshev.chebint(row, lbnd=-1) for row in analyse.T], axis=-1)
    primitive = np.polynomial.chebyshev.chebvander(nodes, NODES) @ integrate
    weights = np.polynomial.chebyshev.chebvander(np.ones(1), NODES)[0] @ integrate
    return nodes, np.asarray(analyse, dtype=float), primitive, weights


@dataclass(frozen=True)
class Panels:
    """A partition of [0, T]: edges (p + 1,), increasing, from 0 to T."""

    edges: Array

    @property
    def period(self) -> float:
        """T."""
        return float(self.edges[-1])

    @property
    def nodes(self) -> Array:
        """(p, NODES) times."""
        halves = np.diff(self.edges)[:, None] / 2
        nodes: Array = self.edges[:-1, None] + halves * (_rules()[0] + 1)
        return nodes

    def primitive(self, values: Array) -> Array:
        """int_0^t at the nodes: (p, NODES, n) -> (p, NODES, n)."""
        halves = np.diff(self.edges)[:, None, None] / 2
        _, _, matrix, weights = _rules()
        totals = halves[:, 0] * np.einsum("m,pmn->pn", weights, values)
        before = np.concatenate([np.zeros((1, values.shape[2])), np.cumsum(totals, axis=0)[:-1]])
        return np.asarray(before[:, None] + halves * np.einsum("km,pmn->pkn", matrix, values))

    def integral(self, values: Array) -> Array:
        """(n,) int_0^T."""
        halves = np.diff(self.edges) / 2
        return np.asarray(np.einsum("p,m,pmn->n", halves, _rules()[3], values))

    def interpolate(self, values: Array, t: Array) -> Array:
        """Values at any times of [0, T] from those at the nodes; jumps belong to the panel that begins."""
        flat = np.asarray(t, dtype=float).ravel()
        panel = np.clip(np.searchsorted(self.edges, flat, side="right") - 1, 0, len(self.edges) - 2)
        left, right = self.edges[panel], self.edges[panel + 1]
        x = (2 * flat - left - right) / (right - left)
        coefficients = np.einsum("km,pmn->pkn", _rules()[1], values)[panel]
        basis = np.polynomial.chebyshev.chebvander(x, NODES - 1)
        return np.asarray(np.einsum("tk,tkn->tn", basis, coefficients)).reshape(*np.shape(t), values.shape[2])


@dataclass(frozen=True, eq=False, repr=False)
class Interpolated(Value):
    """The function that takes values at the nodes of panels: (k,) times of [0, T] -> (k, n)."""

    panels: Panels
    values: Array

    def __call__(self, t: Array) -> Array:
        """(k,) -> (k, n)."""
        return self.panels.interpolate(self.values, t)


def resolve(function: Callable[[Array], Array], period: float, breakpoints: Sequence[float]) -> tuple[Panels, Array]:
    """Panels on which the function is resolved, and its values at their nodes (p, NODES, n).

    Raises:
        NotFiniteError: if the function is NaN or infinite somewhere.
        InputError: if it has a pole, or varies too fast.
    """
    inside = [b for b in breakpoints if 0 < b < period]
    edges = np.unique(np.concatenate([[0.0, period], inside, np.linspace(0, period, 5)]))
    smallest = period * 0.5**_MOST_HALVINGS
    analyse = _rules()[1]
    while True:
        panels = Panels(edges)
        nodes = panels.nodes
        values = np.asarray(function(nodes.ravel()), dtype=float).reshape(*nodes.shape, -1)
        if not np.all(np.isfinite(values)):
            raise NotFiniteError("the periodic input is NaN or infinite at some time")
        tails = np.max(np.abs(np.einsum("km,pmn->pkn", analyse, values)[:, NODES // 2 :]), axis=(1, 2))
        scale = max(float(np.max(np.abs(values))), 1e-300)
        rough = (tails > _RESOLVED * scale * np.sqrt(NODES)) & (np.diff(edges) > smallest)
        if not rough.any() or len(edges) > _MOST_PANELS:
            _check_integrable(panels, values, tails > _RESOLVED * scale * np.sqrt(NODES))
            return panels, values
        middles = (edges[:-1] + edges[1:])[rough] / 2
        edges = np.sort(np.concatenate([edges, middles]))


def _check_integrable(panels: Panels, values: Array, rough: NDArray[np.bool_]) -> None:
    """Panels that stay rough must weigh nothing: a kink or a jump does, a pole does not."""
    weights = np.diff(panels.edges) * np.max(np.abs(values), axis=(1, 2))
    if float(np.sum(weights[rough])) > 1e-6 * float(np.sum(weights)):
        worst = int(np.argmax(np.where(rough, weights, 0.0)))
        raise InputError(
            f"the periodic input is not resolved near t = {panels.edges[worst]:.6g}: it has a singularity there, or varies too "
            f"fast for {_MOST_PANELS} panels of {NODES} nodes; name the times of its jumps as breakpoints"
        )


@dataclass(frozen=True)
class SampledCalculus:
    """The operations of an averaging recursion on arrays (p, NODES, n)."""

    brackets: Brackets
    panels: Panels
    dim: int

    def bracket(self, x: Array, y: Array, *, mean_only: bool = False) -> Array:
        """[x, y]."""
        total = np.zeros((*x.shape[:2], self.dim))
        for (i, j), row in self.brackets.items():
            wedge = _column(x, i) * _column(y, j) - _column(x, j) * _column(y, i)
            for k, value in row.items():
                total[..., k] += float(value) * wedge
        return self.mean(total) if mean_only else total

    def combine(self, terms: Iterable[tuple[Fraction | int, Array]]) -> Array:
        """sum of factor * signal."""
        total = np.zeros((*self.panels.nodes.shape, self.dim))
        for factor, signal in terms:
            total = total + float(factor) * signal
        return total

    def mean(self, x: Array) -> Array:
        """The mean over the period at every node."""
        return np.broadcast_to(self.panels.integral(x) / self.panels.period, x.shape)

    def primitive(self, x: Array) -> Array:
        """int_0^t x."""
        return self.panels.primitive(x)


def _column(x: Array, i: int) -> Array | float:
    """A component; those beyond the last are zero."""
    return x[..., i] if i < x.shape[-1] else 0.0
