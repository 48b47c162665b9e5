"""A chain of elementary manoeuvres: a straight part, loops, figures of eight, one after the other, as often as it takes."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import combinations
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.steering.closed_form.endpoint import flow_end, retune
from lie_codegen.steering.closed_form.segments import FigureEight, Loop, Segment, Straight
from lie_codegen.steering.plan import Controls
from lie_codegen.values import Value

_NEGLIGIBLE = 1e-9
_STEPS = 32


@dataclass(frozen=True, eq=False, repr=False)
class ChainVelocity(Value):
    """u(t) of segments driven in turn, over and over, between the edges."""

    n: int
    controls: tuple[int, ...]
    parts: tuple[tuple[Segment, Array], ...]
    edges: Array

    def __call__(self, t: Array) -> Array:
        """(k,) times -> (k, n)."""
        u = np.zeros((len(t), self.n))
        count = len(self.edges) - 1
        place = np.clip(np.searchsorted(self.edges, t, side="right") - 1, 0, max(count - 1, 0))
        for number in range(count):
            now = np.flatnonzero(place == number)
            if len(now):
                segment, x = self.parts[number % len(self.parts)]
                span = self.edges[number + 1] - self.edges[number]
                values = segment.velocity(x, (t[now] - self.edges[number]) / span) / span
                u[now[:, None], np.array(self.controls)] = values
        return u


@dataclass(frozen=True)
class Chain:
    """Segments with their parameters: X(1) = exp(straight) prod exp(area [A_i, A_j] + ...) prod exp(moment [a, [a, b]] + ...).

    Attributes:
        group, controls: the system; controls are positions.
        segments: in order; the first is straight.
        sizes: (p,) their parameters: (m,) displacement, then signed areas, then signed moments.
        repeats: how often the whole is driven.
    """

    group: MatrixGroup
    controls: tuple[int, ...]
    segments: tuple[Segment, ...]
    sizes: Array
    repeats: int = 1

    @staticmethod
    def towards(group: MatrixGroup, controls: tuple[int, ...], x: Array) -> Chain:
        """The chain whose segments add up to x: to lowest order of each, and up to the order of the factors, exp(hat(x)).

        What neither controls nor single brackets reach falls to the figures of eight, what the controls do not reach of
        the rest to the loops: as few as span it, the best conditioned first.
        """
        m = len(controls)
        loops = [Loop(m, pair) for pair in combinations(range(m), 2)]
        straight = Straight(m)
        direct = straight.limit(group.algebra, controls)
        chosen_loops = _independent(group, controls, direct, loops)
        single = np.hstack([direct, *(loop.limit(group.algebra, controls) for loop in chosen_loops)])
        eights = _independent(group, controls, single, _eights(m)) if single.shape[1] < group.dim else []
        segments = (straight, *chosen_loops, *eights)
        columns = np.hstack([segment.limit(group.algebra, controls) for segment in segments])
        return Chain(group, controls, segments, np.linalg.lstsq(columns, x, rcond=None)[0])

    def repeated(self, rounds: int) -> Chain:
        """The chain, driven so often."""
        return replace(self, repeats=rounds)

    @property
    def energy(self) -> float:
        """int |u|^2 over unit time: the square of the length of the curve of the integrated controls."""
        return float(self.repeats * sum(np.sqrt(segment.energy(x)) for segment, x in self.parts())) ** 2

    def parts(self) -> Iterator[tuple[Segment, Array]]:
        """Each segment and its parameters."""
        place = 0
        for segment in self.segments:
            yield segment, self.sizes[place : place + segment.count]
            place += segment.count

    def controls_over(self, duration: float) -> Controls:
        """u(t): each segment takes time in proportion to the root of its energy in unit time, which costs least."""
        driven = [(segment, x, float(np.sqrt(segment.energy(x)))) for segment, x in self.parts()]
        driven = [part for part in driven if part[2] > 0]
        lengths = np.array([length for _, _, length in driven] * self.repeats)
        edges = duration * np.concatenate([[0.0], np.cumsum(lengths)]) / max(float(np.sum(lengths)), 1e-300)

        parts = tuple((segment, x) for segment, x, _ in driven)
        return Controls(ChainVelocity(self.group.dim, self.controls, parts, edges), edges[1:-1])

    def retuned(self, target: Array) -> tuple[Chain, float]:
        """The chain, its sizes changed, that ends at the target exactly; and max |target^-1 X(1) - I| that is left."""
        sizes, off = retune(self.group, target, self.sizes, self._end)
        return replace(self, sizes=sizes), off

    def _end(self, sizes: Array, refine: int) -> tuple[Array, Array]:
        """X of one round, and vee(X^-1 dX / d sizes), segment by segment."""
        group = self.group
        after = np.eye(group.degree, dtype=complex if group.is_complex else float)
        columns: list[Array] = []
        for segment, x in reversed(list(replace(self, sizes=sizes).parts())):
            X, slope = _segment_end(group, self.controls, segment, x, refine)
            columns.insert(0, group.project(np.linalg.solve(after, group.hat(slope.T) @ after)).T)
            after = X @ after
        return after, np.hstack(columns)


def _segment_end(
    group: MatrixGroup, controls: tuple[int, ...], segment: Segment, x: Array, refine: int
) -> tuple[Array, Array]:
    size = np.sqrt(segment.energy(x))
    steps = _STEPS * segment.harmonics * int(np.clip(size / 8, 1, 64))
    X, s, carried = flow_end(group, controls, lambda s: segment.velocity(x, s), steps, refine)
    slopes = segment.slopes(x, s)
    if slopes is None:
        return X, segment.limit(group.algebra, controls)
    return X, np.einsum("kin,kip->np", carried, slopes)


def _eights(m: int) -> list[FigureEight]:
    """Figures of eight along controls and bisectors of two controls."""
    axes = np.eye(m)
    firsts = [
        *axes,
        *((axes[i] + sign * axes[j]) / np.sqrt(2) for i, j in combinations(range(m), 2) for sign in (1, -1)),
    ]
    return [
        FigureEight(tuple(map(float, a)), tuple(map(float, b)))
        for a in firsts
        for b in axes
        if abs(a @ b) < _NEGLIGIBLE
    ]


def _independent(group: MatrixGroup, controls: tuple[int, ...], span: Array, candidates: list[Any]) -> list[Any]:
    """Candidates that extend the span as far as they can, each time the one that adds the longest new direction."""
    chosen: list[Any] = []
    q = np.linalg.qr(span)[0]
    left = [(each, each.limit(group.algebra, controls)[:, 0]) for each in candidates]
    while left:
        rest = [vector - q @ (q.T @ vector) for _, vector in left]
        best = int(np.argmax([round(float(np.linalg.norm(r)), 9) for r in rest]))
        if np.linalg.norm(rest[best]) < _NEGLIGIBLE:
            break
        chosen.append(left[best][0])
        q = np.column_stack([q, rest[best] / np.linalg.norm(rest[best])])
        left.pop(best)
    return chosen
