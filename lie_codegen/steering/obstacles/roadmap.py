"""Ways around obstacles in space and among attitudes: two trees of shortest ways on a sampled roadmap, and the via points between them.

Places are what obstacles see of a state: its position where there are balls, its attitude where there are cones, with the metric
|p - q| / scale + angle. Samples that are clear, half of them drawn close to an obstacle so that gaps are met, are joined to their
neighbours by geodesics that are clear. Every sample is a via point: the way to it in the tree from the start, then on in the tree to the
goal. In the order of their lengths these ways are kept if they cannot be drawn into one that was kept before: the ways are run through
side by side, and a geodesic between them meets an obstacle somewhere.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.groups.conventions import rotation_from_quaternion
from lie_codegen.on_demand import scipy
from lie_codegen.steering.obstacles.keep_out import KeepOut

_SAMPLES, _NEIGHBOURS = 700, 12
#: Points of an edge, at least and at most (two for each half thickness of the thinnest obstacle), of a way that is compared with
#: another, and of a way that is returned.
_EDGE, _FINEST, _COMPARED, _POINTS = 16, 200, 48, 129
#: Ways longer than so many times the shortest are not looked at; via points that are tried, at most.
_LONGEST, _TRIED = 4.0, 120
_SHORTENINGS = 3
#: Part of an obstacle's size by which geodesics between two ways may cut it: ways that lie close to it are chords of it apart.
_CUT = 0.25


@dataclass(frozen=True, eq=False)
class Places:
    """Positions (k, q), of no coordinates without balls, and attitudes (k, 3, 3), all the same without cones."""

    p: Array
    R: Array

    def __len__(self) -> int:
        return len(self.p)

    def at(self, rows: Array) -> Places:
        """Some of them."""
        return Places(self.p[rows], self.R[rows])

    @staticmethod
    def joined(*parts: Places) -> Places:
        """One after the other."""
        return Places(np.concatenate([each.p for each in parts]), np.concatenate([each.R for each in parts]))


@dataclass(frozen=True, eq=False)
class Space:
    """Where ways are looked for.

    Attributes:
        keep_out: the obstacles.
        start, goal: one place each.
        margin: gap below which a place is not clear.
    """

    keep_out: KeepOut
    start: Places
    goal: Places
    margin: float

    @staticmethod
    def between(keep_out: KeepOut, start: Array, goal: Array) -> Space:
        """From one state (d, d) to another."""
        margin = 0.02 * float(np.min(keep_out.sizes))
        return Space(keep_out, seen(keep_out, start[None]), seen(keep_out, goal[None]), margin)

    @property
    def scale(self) -> float:
        """Length that counts as much as a radian."""
        return max(float(np.linalg.norm(self.goal.p - self.start.p)), 1e-9) if np.any(self.keep_out.placed) else 1.0

    def states(self, places: Places) -> Array:
        """(k, d, d) states that look so."""
        d = self.keep_out.degree
        X = np.tile(np.eye(d), (len(places), 1, 1))
        if not np.all(self.keep_out.placed):
            X[:, :3, :3] = places.R
        if places.p.shape[1]:
            X[:, :-1, -1] = places.p
        return X

    def clear(self, places: Places, cut: float = 0.0) -> Array:
        """(k,) whether each is clear of all obstacles, or cuts each by less than a part of its size."""
        least = -cut * self.keep_out.sizes if cut else np.full(len(self.keep_out.columns), self.margin)
        return np.asarray(np.all(self.keep_out.gaps(self.states(places)) > least, axis=-1))

    def distances(self, here: Places, there: Places) -> Array:
        """(a, b) between all pairs."""
        far = np.linalg.norm(here.p[:, None] - there.p, axis=2) / self.scale
        if np.all(self.keep_out.placed):
            return np.asarray(far)
        cosine = (np.einsum("aij,bij->ab", here.R, there.R) - 1) / 2
        return np.asarray(far + np.arccos(np.clip(cosine, -1, 1)))

    def steps(self, way: Places) -> Array:
        """(k - 1,) between neighbours."""
        far = np.linalg.norm(np.diff(way.p, axis=0), axis=1) / self.scale
        if np.all(self.keep_out.placed):
            return np.asarray(far)
        cosine = (np.einsum("aij,aij->a", way.R[:-1], way.R[1:]) - 1) / 2
        return np.asarray(far + np.arccos(np.clip(cosine, -1, 1)))

    def joins(self, here: Places, there: Places, cut: float = 0.0) -> Array:
        """(k,) whether the geodesic between each pair is clear, or cuts obstacles by less than that."""
        found = np.ones(len(here), bool)
        longest = float(np.max(np.linalg.norm(there.p - here.p, axis=1), initial=0.0))
        count = int(np.clip(np.ceil(2 * longest / np.min(self.keep_out.sizes)), _EDGE, _FINEST))
        for s in np.linspace(0, 1, count):
            rows = np.flatnonzero(found)
            if len(rows):
                found[rows] = self.clear(between(here.at(rows), there.at(rows), np.full(len(rows), s)), cut)
        return found


def seen(keep_out: KeepOut, X: Array) -> Places:
    """What the obstacles see of states (k, d, d)."""
    placed, d = bool(np.any(keep_out.placed)), keep_out.degree
    R = np.real(X[:, :3, :3]) if not np.all(keep_out.placed) else np.tile(np.eye(3), (len(X), 1, 1))
    return Places(np.real(X[:, :-1, -1]) if placed else np.zeros((len(X), 0)), R) if d > 1 else Places(X[:, :0, 0], R)


def between(here: Places, there: Places, s: Array) -> Places:
    """On the geodesics, at the parts s (k,) of them."""
    p = here.p + s[:, None] * (there.p - here.p)
    if here.R is there.R or np.array_equal(here.R, there.R):
        return Places(p, here.R)  # attitudes that nothing looks at
    turn = np.swapaxes(here.R, 1, 2) @ there.R
    return Places(p, here.R @ _power(turn, s))


def _power(turn: Array, s: Array) -> Array:
    """(k, 3, 3) rotations by s times the angle of each."""
    axis = np.stack(
        [turn[:, 2, 1] - turn[:, 1, 2], turn[:, 0, 2] - turn[:, 2, 0], turn[:, 1, 0] - turn[:, 0, 1]], axis=1
    )
    size = np.linalg.norm(axis, axis=1)
    angle = np.arctan2(size / 2, (np.trace(turn, axis1=1, axis2=2) - 1) / 2)
    # half a turn has no axis there: the column of R + 1 that is longest is one
    whole = turn + np.eye(3)
    column = np.argmax(np.einsum("kii->ki", whole), axis=1)
    other = whole[np.arange(len(turn)), :, column]
    flat = size < 1e-7
    axis = np.where(flat[:, None], other, axis)
    axis = axis / np.maximum(np.linalg.norm(axis, axis=1), 1e-300)[:, None]
    K = np.zeros_like(turn)
    K[:, 2, 1], K[:, 0, 2], K[:, 1, 0] = axis.T
    K = K - np.swapaxes(K, 1, 2)
    by = (s * angle)[:, None, None]
    return np.asarray(np.eye(3) + np.sin(by) * K + (1 - np.cos(by)) * K @ K)


def ways(space: Space, count: int, seed: int = 0) -> list[Places]:
    """Up to `count` ways from start to goal that cannot be drawn into each other, the shortest first; points at equal distances."""
    if not space.clear(Places.joined(space.start, space.goal)).all():
        return []
    places = Places.joined(space.start, space.goal, _sampled(space, np.random.default_rng([seed, 23])))
    graph = _roadmap(space, places)
    lengths, came = scipy.sparse.csgraph.dijkstra(graph, directed=False, indices=[0, 1], return_predecessors=True)
    total = lengths[0] + lengths[1]
    total[:2] = lengths[0, 1]
    order = [int(v) for v in np.argsort(total, kind="stable") if np.isfinite(total[v])]
    found: list[Places] = []
    looked: set[tuple[int, ...]] = set()
    for via in order:
        if len(found) >= count or len(looked) >= _TRIED or total[via] > _LONGEST * total[order[0]]:
            break
        route = (*reversed(_traced(came[0], via)), *_traced(came[1], via)[1:])
        if route in looked:
            continue
        looked.add(route)
        way = resampled(space, places.at(np.array(route)), _COMPARED)
        if any(drawn_into(space, way, other) for other in found):
            continue
        way = shortened(space, way)
        if not any(drawn_into(space, way, other) for other in found):
            found.append(way)
    return [resampled(space, way, _POINTS) for way in found]


def _sampled(space: Space, rng: np.random.Generator) -> Places:
    """Clear places: anywhere around start, goal and obstacles, and close to obstacles."""
    keep_out, q = space.keep_out, space.start.p.shape[1]
    parts = [np.concatenate([space.start.p, space.goal.p])]
    solids = keep_out.solids
    if solids is not None:
        parts += list(solids.corners())
    corners = np.concatenate(parts)
    low, high = (np.min(corners, axis=0), np.max(corners, axis=0)) if q else (np.zeros(0), np.zeros(0))
    room = 0.3 * float(np.max(high - low)) if q else 0.0
    p = rng.uniform(low - room, high + room, (4 * _SAMPLES, q))
    if solids is not None:
        which = rng.integers(0, len(solids), 2 * _SAMPLES)
        out = rng.normal(size=(2 * _SAMPLES, q))
        out /= np.linalg.norm(out, axis=1)[:, None]
        # from a point near the surface along the gradient to a part of the solid's size away from it
        at = solids.at(which)
        p[::2] = at.centers + np.einsum("oij,oj->oi", at.axes, out * at.extents)
        gap, normal = at.seen(p[::2])
        p[::2] += (at.sizes * rng.uniform(0.02, 0.6, 2 * _SAMPLES) - gap)[:, None] * normal
    w = rng.normal(size=(4 * _SAMPLES, 4))
    alike = bool(np.all(keep_out.placed))  # no attitude is looked at
    R = np.tile(np.eye(3), (len(p), 1, 1)) if alike else rotation_from_quaternion(w, order="wxyz")
    places = Places(p, R)
    return places.at(np.flatnonzero(space.clear(places))[:_SAMPLES])


def _roadmap(space: Space, places: Places) -> Any:
    """(k, k) sparse lengths of clear edges to neighbours; start and goal have more of them."""
    far = space.distances(places, places)
    np.fill_diagonal(far, np.inf)
    near = np.argsort(far, axis=1)[:, :_NEIGHBOURS]
    pairs = np.column_stack([np.repeat(np.arange(len(places)), near.shape[1]), near.ravel()])
    ends = [
        np.column_stack([np.full(4 * _NEIGHBOURS, k), np.argsort(far[k])[: 4 * _NEIGHBOURS]])
        for k in (0, 1)
        if len(places) > 4 * _NEIGHBOURS
    ]
    pairs = np.unique(np.sort(np.concatenate([pairs, *ends, [[0, 1]]]), axis=1), axis=0)
    pairs = pairs[space.joins(places.at(pairs[:, 0]), places.at(pairs[:, 1]))]
    # a length of zero would be no edge
    weights = np.maximum(far[pairs[:, 0], pairs[:, 1]], 1e-12)
    return scipy.sparse.csr_matrix((weights, (pairs[:, 0], pairs[:, 1])), shape=(len(places), len(places)))


def _traced(came: Array, vertex: int) -> list[int]:
    """From a vertex back to the root of its tree."""
    found = [vertex]
    while came[found[-1]] >= 0:
        found.append(int(came[found[-1]]))
    return found


def shortened(space: Space, way: Places) -> Places:
    """The way without corners that can be cut: from each point to the farthest that a clear geodesic leads to."""
    for _ in range(_SHORTENINGS):
        kept, here = [0], 0
        while here < len(way) - 1:
            ahead = np.arange(here + 1, len(way))
            seen_from_here = space.joins(way.at(np.full(len(ahead), here)), way.at(ahead))
            seen_from_here[0] = True
            here = int(ahead[np.flatnonzero(seen_from_here)[-1]])
            kept.append(here)
        way = resampled(space, way.at(np.array(kept)), _COMPARED)
    return way


def resampled(space: Space, way: Places, count: int) -> Places:
    """`count` points at equal distances along a way."""
    steps = space.steps(way)
    length = np.concatenate([[0.0], np.cumsum(steps)])
    s = np.linspace(0, length[-1], count)
    edge = np.clip(np.searchsorted(length, s, side="right") - 1, 0, len(steps) - 1)
    part = np.where(steps[edge] > 0, (s - length[edge]) / np.maximum(steps[edge], 1e-300), 0.0)
    return between(way.at(edge), way.at(edge + 1), np.clip(part, 0, 1))


def drawn_into(space: Space, one: Places, other: Places) -> bool:
    """Whether geodesics between ways that are run through side by side are all clear: then one can be drawn into the other."""
    here, there = (each if len(each) == _COMPARED else resampled(space, each, _COMPARED) for each in (one, other))
    return bool(np.all(space.joins(here, there, _CUT)))
