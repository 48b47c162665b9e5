"""Torques that oscillate make the missing directions: virtual full actuation by symmetric products.

J xi' = ad*_xi J xi - D xi + u^a b_a, Y_a = J^-1 b_a. With xi = w + U^a Y_a, U^a oscillating and u^a = v^a + dU^a/dt, the mean motion obeys

    w' = -<w : w>/2 - J^-1 D w + v^a Y_a - sum_{a<b} lambda_ab <Y_a : Y_b> - sum_a lambda_aa <Y_a : Y_a>/2,     lambda_ab = mean U^a U^b,

so that any wanted acceleration eta = v^a Y_a + c_ab <Y_a : Y_b> is had by lambda_ab = -c_ab (off-diagonals stand twice in the double sum: no half). A pair takes
U^a += p sin(k w t), U^b += q sin(k w t), p q / 2 = -c_ab, each pair its own odd k, as two odd multiples never add to an odd one and so no mean of three U is left; what
p^2 / 2 and q^2 / 2 do on the diagonal is taken back by v. It needs rank [Y_a, <Y_a : Y_b>] = n and <Y_a : Y_a> in the span of the Y: sufficient, not necessary.
Bullo, Leonard and Lewis, IEEE TAC 45 (2000) 1437.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import combinations
from typing import Any

import numpy as np

from lie_codegen.algebra.brackets import bracket, symmetric_product
from lie_codegen.arrays import Array
from lie_codegen.errors import InputError, ShapeError, UncontrollableError
from lie_codegen.exact.positive_matrix import as_floats, positive_matrix
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.values import Value

#: Relative sizes below this are zero.
_RANK = 1e-9


@dataclass(frozen=True, eq=False, repr=False)
class VirtualActuation(Value):
    """Forces on a body, and what their symmetric products reach.

    Attributes:
        group: of the body.
        inertia: (n, n) J.
        damping: (n, n) D.
        forces: (m, n) covectors b_a.
        names: of the forces, for messages.
        mixing: (m, m) rows: these forces as combinations of those that were given.
    """

    group: MatrixGroup
    inertia: Array
    damping: Array
    forces: Array
    names: tuple[str, ...]
    mixing: Array

    @cached_property
    def inverse(self) -> Array:
        """J^-1."""
        return np.linalg.inv(self.inertia)

    @cached_property
    def lifts(self) -> Array:
        """(m, n) Y_a = J^-1 b_a."""
        return np.asarray(self.forces @ self.inverse)

    @property
    def pairs(self) -> tuple[tuple[int, int], ...]:
        """(a, b) with a < b, in the order of the odd multiples 1, 3, 5, ..."""
        return tuple(combinations(range(len(self.forces)), 2))

    def product(self, x: Array, y: Array) -> Array:
        """<x : y> = -J^-1 (ad*_x J y + ad*_y J x), (n,)."""
        return symmetric_product(self.group.algebra, self.inertia, self.inverse, x, y)

    @cached_property
    def products(self) -> Array:
        """(pairs, n) <Y_a : Y_b>."""
        found = [self.product(self.lifts[a], self.lifts[b]) for a, b in self.pairs]
        return np.array(found).reshape(len(found), self.group.dim)

    @cached_property
    def squares(self) -> Array:
        """(m, n) <Y_a : Y_a>."""
        return np.array([self.product(y, y) for y in self.lifts])

    @cached_property
    def decomposition(self) -> Array:
        """(m + pairs, n) the pseudo-inverse: eta -> (v^a, c_ab)."""
        return np.linalg.pinv(np.vstack([self.lifts, self.products]).T, rcond=_RANK)

    @cached_property
    def compensation(self) -> Array:
        """(m, m) row a: the v that stands for <Y_a : Y_a>."""
        return np.asarray(self.squares @ np.linalg.pinv(self.lifts, rcond=_RANK))

    def outside(self, vectors: Array) -> Array:
        """(k,) how far vectors (k, n) lie off the span of the Y, relative to the sizes of products of the Y."""
        inside = vectors @ np.linalg.pinv(self.lifts, rcond=_RANK) @ self.lifts
        return np.asarray(np.linalg.norm(vectors - inside, axis=1) / max(self._scale, 1e-300))

    @property
    def _scale(self) -> float:
        """What a product of the Y could be."""
        return float(np.abs(self.inverse).max() * np.abs(self.inertia).max() * np.abs(self.lifts).max() ** 2)

    @cached_property
    def _lie_rank(self) -> int:
        """Dimensions of the Lie span of the Y."""
        rows = self.lifts / np.linalg.norm(self.lifts, axis=1, keepdims=True)
        while True:
            more = np.vstack([rows, *(bracket(self.group.algebra, row, rows) for row in rows)])
            _, sizes, basis = np.linalg.svd(more)
            rank = int(np.sum(sizes > _RANK * sizes[0]))
            if rank == len(rows):
                return rank
            rows = basis[:rank]

    @cached_property
    def decoupling(self) -> tuple[int, ...]:
        """The a with <Y_a : Y_a> in the span of the Y: exp(s(t) Y_a) is followed exactly, for any time scaling."""
        return tuple(int(a) for a in np.flatnonzero(self.outside(self.squares) <= _RANK))

    @cached_property
    def kinematic(self) -> bool:
        """Whether all <Y_a : Y_b> lie in the span of the Y: every velocity plan xi = h^a(t) Y_a, at rest at its ends, is a torque plan."""
        return len(self.decoupling) == len(self.forces) and bool(np.all(self.outside(self.products) <= _RANK))

    def require(self, where: str) -> None:
        """Nothing, if products of degree two reach everything and none is bad.

        Raises:
            UncontrollableError: with the missing direction or the bad product in words.
        """
        still = "; the condition is sufficient, not necessary: products of higher degree may still do it, try method='transcription'"
        bad = [a for a in range(len(self.forces)) if a not in self.decoupling]
        if bad:
            a = bad[0]
            raise UncontrollableError(
                f"{where}: the product <{self.names[a]}:{self.names[a]}> = {self._words(self.squares[a])} is bad: it always pushes one way, and the "
                f"forces {', '.join(self.names)} cannot hold against it{still}"
            )
        rows = np.vstack([self.lifts, self.products])
        sizes = np.linalg.norm(rows, axis=1, keepdims=True)
        significant = np.concatenate([np.ones(len(self.lifts), dtype=bool), self.outside(self.products) > _RANK])
        _, singular, basis = np.linalg.svd(
            np.where(significant[:, None] & (sizes > 0), rows / np.where(sizes > 0, sizes, 1), 0)
        )
        rank = int(np.sum(singular > _RANK * singular[0]))
        if rank == self.group.dim:
            return
        gap = 1 - np.sum(basis[:rank] ** 2, axis=0)
        missing = " or ".join(label for label, share in zip(self.group.labels, gap, strict=True) if share > 1e-6)
        said = ""
        for (a, b), value, useful in zip(self.pairs, self.products, significant[len(self.lifts) :], strict=True):
            if not useful:
                zero = np.linalg.norm(value) <= _RANK * self._scale
                said += f"<{self.names[a]}:{self.names[b]}> {'= 0' if zero else 'lies in the span of the forces'}, "
        turns = all(unit.split("/")[0] == "rad" for unit in self.group.units)
        offer = (
            "; all products lie in the span of the forces, so every velocity plan along them, at rest at its ends, is a torque plan: form='primitives'"
            if self.kinematic and self._lie_rank == self.group.dim
            else still
        )
        raise UncontrollableError(
            f"{where}: forces on {', '.join(self.names)} with this inertia: {said}nothing {'turns' if turns else 'moves'} {missing}; forces and their symmetric "
            f"products span {rank} of {self.group.dim} dimensions{offer}"
        )

    def _words(self, vector: Array) -> str:
        size = np.abs(vector).max()
        parts = [
            f"{value:.4g} {label}"
            for value, label in zip(vector, self.group.labels, strict=True)
            if abs(value) > 1e-9 * size
        ]
        return " + ".join(parts).replace("+ -", "- ")


def virtual_actuation(
    group: MatrixGroup,
    inertia: Any,
    *,
    controls: Sequence[Any] | None = None,
    forces: Any = None,
    damping: Any = None,
    where: str,
) -> VirtualActuation:
    """From labels of actuated components, or from covectors.

    Raises:
        InputError, ShapeError: naming the culprit.
    """
    n = group.dim
    if inertia is None:
        raise InputError(f"{where}: give inertia=, a number, {n} numbers or a {n} x {n} matrix")
    J = as_floats(positive_matrix(inertia, n, "inertia"))
    if forces is not None:
        rows = np.asarray(forces, dtype=float)
        if rows.ndim != 2 or rows.shape[1] != n or not len(rows):
            raise ShapeError(f"{where}: forces has shape {rows.shape}; give (m, {n}), a covector a row")
        names = tuple(f"f{a + 1}" for a in range(len(rows)))
    else:
        given = [controls] if isinstance(controls, str) else list(controls or ())
        places = [group.algebra.index(c) if isinstance(c, str) else int(c) for c in given]
        if not places or len(set(places)) < len(places) or not all(0 <= p < n for p in places):
            raise InputError(f"{where}: controls {controls!r}: different labels among {', '.join(group.labels)}")
        rows, names = np.eye(n)[places], tuple(group.labels[p] for p in places)
    if not np.all(np.isfinite(rows)) or np.linalg.matrix_rank(rows) < len(rows):
        raise InputError(f"{where}: the forces must be finite and linearly independent")
    body = VirtualActuation(group, J, damping_matrix(damping, n, where), rows, names, np.eye(len(rows)))
    return body if len(body.decoupling) == len(rows) else _mixed(body)


def _mixed(body: VirtualActuation) -> VirtualActuation:
    """The same forces in combinations whose squares are good, if there are enough of them; else as they were.

    A combination a is good where all quadratic forms a' S a vanish, S_ab the part of <Y_a : Y_b> off the span of the Y: two jets beside each other push
    a craft off its line each, their sum and their difference do not.
    """
    m, n = len(body.forces), body.group.dim
    projector = np.eye(n) - np.linalg.pinv(body.lifts) @ body.lifts
    S = np.array([[body.product(x, y) @ projector for y in body.lifts] for x in body.lifts])
    rng, found = np.random.default_rng(0), np.zeros((0, m))
    for start in [
        *np.eye(m),
        *(np.eye(m)[a] + s * np.eye(m)[b] for a, b in body.pairs for s in (1, -1)),
        *rng.normal(size=(40, m)),
    ]:
        a = start / np.linalg.norm(start)
        for _ in range(40):
            value = np.einsum("i,j,ijk->k", a, a, S)
            step = np.linalg.lstsq(2 * np.einsum("j,ijk->ki", a, S), -value, rcond=1e-10)[0]
            a = (a + step) / np.linalg.norm(a + step)
        if np.linalg.norm(np.einsum("i,j,ijk->k", a, a, S)) > _RANK * body._scale:
            continue
        more = np.vstack([found, a])
        if np.linalg.svd(more, compute_uv=False)[-1] > 1e-3:
            found = more
        if len(found) == m:
            names = tuple(
                " + ".join(f"{x:.3g} {name}" for x, name in zip(row, body.names, strict=True) if abs(x) > 1e-9).replace(
                    "+ -", "- "
                )
                for row in found
            )
            return replace(body, forces=found @ body.forces, names=names, mixing=found)
    return body


def damping_matrix(value: Any, n: int, where: str) -> Array:
    """(n, n) from a number, a diagonal or a matrix; zeros for None."""
    if value is None:
        return np.zeros((n, n))
    D = np.asarray(value, dtype=float)
    if D.shape not in ((), (n,), (n, n)) or not np.all(np.isfinite(D)):
        raise ShapeError(f"{where}: damping is a number, {n} numbers or a {n} x {n} matrix")
    return D if D.ndim == 2 else np.diag(np.broadcast_to(D, (n,)))
