"""A planned manoeuvre as a reference: quintics of the algebra through X, xi and xi' of the plan, smooth where its controls jump."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple, Protocol

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import ArrayLike, NDArray

from lie_codegen.arrays import Array
from lie_codegen.control.reference_motion import PlanReference
from lie_codegen.control.waypoints import logarithm, quintics
from lie_codegen.errors import ComputationError, InputError, ShapeError
from lie_codegen.groups.derivation import derivation_of
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernel.definition import doubles, record_factory
from lie_codegen.on_demand import scipy

#: Degree of the polynomials that stand for the controls, and their last coefficients, relative to the largest, where they do.
_DEGREE, _RESOLVED = 16, 1e-9
#: Difference of the accelerations of two pieces, relative to the largest, that is a jump.
_JUMP = 1e-4
#: Pieces and segments at most: each segment is a row of the tables that are compiled.
_MOST = 1024
#: Half width of the smoothing, relative to the duration, where none is given.
_WIDTH = 0.01


class Planned(Protocol):
    """What a plan must have: the path X(t) and the controls u(t) on [0, duration] that make it, X' = X hat(u), or X' = X hat(xi) where it has xi(t)."""

    @property
    def duration(self) -> float:
        """[s]."""

    @property
    def u(self) -> Callable[[Any], Any]:
        """(k,) times -> (k, n)."""

    def X(self, t: Any, /) -> Array:
        """(k,) times -> (k, d, d)."""


class PlanOnGroup(Planned, Protocol):
    """A plan that names its group."""

    @property
    def group(self) -> MatrixGroup:
        """The group that the path runs on."""


@dataclass(frozen=True)
class _Piece:
    """The body velocity as a polynomial of t between first and last, where it is smooth."""

    first: float
    last: float
    velocity: chebyshev.Chebyshev | Any

    def at(self, t: float) -> tuple[Array, Array]:
        """xi and xi'."""
        x = (2 * t - self.first - self.last) / (self.last - self.first)
        slope = chebyshev.chebder(self.velocity) * 2 / (self.last - self.first)
        return chebyshev.chebval(x, self.velocity), chebyshev.chebval(x, slope)


class _Knot(NamedTuple):
    t: float
    xi: Array
    rate: Array
    #: whether the segment that begins here rounds off a jump.
    smoothed: bool


def plan_reference(group: MatrixGroup, plan: Planned, *, smoothing: float | None, tolerance: float) -> PlanReference:
    """The plan as a reference that is twice continuously differentiable.

    Between the jumps of u and u' the controls are represented by Chebyshev polynomials (to 1e-9), whose derivative is the
    acceleration; quintics of the algebra through X, xi and xi' are halved until they meet X of the plan to the tolerance. A jump at t
    is rounded off on [t - w, t + w] by one quintic, which leaves and meets the plan exactly: no error stays behind.

    Args:
        group: the group.
        plan: what `steer` returns, or anything else that has X, u and duration.
        smoothing: w [s]; a hundredth of the duration if None. Narrower between jumps that are close.
        tolerance: on the entries of X, away from the jumps.

    Raises:
        InputError: it is no plan, or one of another group; a smoothing that is not positive; controls that are nowhere smooth.
        ShapeError: u(t) does not have n components.
        ComputationError: the tolerance is not met with 1024 segments.
    """
    duration = float(plan.duration)
    theirs = getattr(plan, "group", group)
    if theirs != group:
        raise InputError(f"reference: the plan is one of {theirs.name}, not of {group.name}")
    width = _WIDTH * duration if smoothing is None else float(smoothing)
    if not (np.isfinite(width) and width > 0 and np.isfinite(tolerance) and tolerance > 0):
        raise InputError(
            f"reference: smoothing = {smoothing} and tolerance = {tolerance} must be positive; a jump of the controls "
            "cannot be tracked as it is"
        )
    pieces = _pieces(group, plan, duration, width)
    scale = max(1e-300, *(float(np.max(np.abs(p.at(t)[1]))) for p in pieces for t in (p.first, p.last)))
    speed = max(float(np.max(np.abs(p.at(t)[0]))) for p in pieces for t in (p.first, p.last))
    knots = _knots(pieces, width, _JUMP * max(scale, speed / duration))
    owner = {knot.t: knot for knot in knots}
    return _refined(group, plan, owner, pieces, tolerance)


def _velocity(group: MatrixGroup, plan: Planned, t: Array) -> Array:
    # a plan knows its own body velocity, which is not u where there is a drift, where the controls act from the left or are torques
    velocity = np.asarray(getattr(plan, "xi", plan.u)(t), dtype=float)
    if velocity.shape != (len(t), group.dim):
        raise ShapeError(f"reference: u(t) of the plan has shape {velocity.shape} for {len(t)} times on {group.name}")
    return velocity


def _pieces(group: MatrixGroup, plan: Planned, duration: float, width: float) -> list[_Piece]:
    """Intervals on which the velocity is a polynomial to rounding; what is left between them is narrower than the smoothing."""
    marks = np.asarray(getattr(plan.u, "breakpoints", ()), dtype=float).ravel()
    inner = np.unique(marks[(marks > 1e-9 * duration) & (marks < duration * (1 - 1e-9))])
    edges = np.concatenate([[0.0], inner, [duration]])
    nodes = np.cos(np.pi * (np.arange(_DEGREE + 1) + 0.5) / (_DEGREE + 1))  # inside: no value is taken at a jump
    fit = np.linalg.inv(chebyshev.chebvander(nodes, _DEGREE))
    todo = list(pairwise(edges))[::-1]
    pieces: list[_Piece] = []
    size = max(1.0 / duration, float(np.max(np.abs(_velocity(group, plan, np.linspace(0, duration, 513))))))
    while todo:
        a, b = todo.pop()
        table = fit @ _velocity(group, plan, (a + b) / 2 + (b - a) / 2 * nodes)
        if not np.all(np.isfinite(table)):
            raise InputError(f"reference: u(t) of the plan is not finite between t = {a:g} and {b:g}")
        if np.max(np.abs(table[-3:])) <= _RESOLVED * size:
            pieces.append(_Piece(float(a), float(b), table))
        elif b - a > width / 4:
            todo += [((a + b) / 2, b), (a, (a + b) / 2)]
        if len(pieces) + len(todo) > _MOST:
            raise InputError(f"reference: u(t) of the plan is not smooth in too many places, the last near t = {a:g}")
    if not pieces:
        raise InputError("reference: u(t) of the plan is nowhere smooth; a smaller smoothing= may find where it is")
    if pieces[0].first > 0 or pieces[-1].last < duration:
        end = 0.0 if pieces[0].first > 0 else duration
        raise InputError(
            f"reference: u(t) of the plan is not smooth up to its end at t = {end:g}; give a smaller smoothing="
        )
    return pieces


def _knots(pieces: list[_Piece], width: float, jump: float) -> list[_Knot]:
    """The ends of the pieces, those beside a jump moved away from it by the width, or by a quarter of the way to the next."""
    jumps = [(left.last, right.first) for left, right in pairwise(pieces) if _jumps(left, right, jump)]
    ends = [(pieces[0].first, pieces[0].first), *jumps, (pieces[-1].last, pieces[-1].last)]
    before = [b[0] - min(width, (b[0] - a[1]) / 4) for a, b in pairwise(ends)][:-1]
    behind = [a[1] + min(width, (b[0] - a[1]) / 4) for a, b in pairwise(ends)][1:]
    windows = list(zip(before, behind, strict=True))
    plain = [pieces[0].first, *(piece.last for piece in pieces)]
    plain = [t for t in plain if not any(a <= t <= b for a, b in windows)]
    smoothed = {a for a, _ in windows}
    return [
        _Knot(t, *_piece_at(pieces, t).at(t), t in smoothed)
        for t in sorted({*plain, *smoothed, *(b for _, b in windows)})
    ]


def _jumps(left: _Piece, right: _Piece, jump: float) -> bool:
    (xi, rate), (after, turn) = left.at(left.last), right.at(right.first)
    step = max(float(np.max(np.abs(after - xi))) / (right.last - left.first), float(np.max(np.abs(turn - rate))))
    return right.first > left.last or step > jump


def _piece_at(pieces: list[_Piece], t: float) -> _Piece:
    """The piece that holds t, the first of two; outside the gaps, which are narrower than what surrounds them."""
    return next(each for each in pieces if each.first <= t <= each.last)


def _refined(
    group: MatrixGroup, plan: Planned, knots: dict[float, _Knot], pieces: list[_Piece], tolerance: float
) -> PlanReference:
    """Segments are halved until they meet the plan; those that round off a jump stay as they are."""
    derivation = derivation_of(group)
    inside = np.array([0.25, 0.5, 0.75])
    # Kept by the ends of a segment: of the next round only the halves are new.
    rows: dict[tuple[float, float], NDArray[Any] | None] = {}
    while True:
        t = np.array(sorted(knots))
        spans = np.diff(t)
        asked = np.concatenate([t, (t[:-1, None] + spans[:, None] * inside).ravel()])
        order = np.argsort(asked)
        path = np.empty((len(asked), group.degree, group.degree), dtype=complex if group.is_complex else float)
        path[order] = plan.X(asked[order])
        X, between = path[: len(t)], path[len(t) :].reshape(len(spans), 3, group.degree, group.degree)
        error = np.full(len(spans), np.inf)
        ends = [(float(a), float(b)) for a, b in pairwise(t)]
        new = [i for i, key in enumerate(ends) if key not in rows]
        moves = {i: logarithm(derivation, np.linalg.solve(X[i], X[i + 1])) for i in new}
        joined = {i: move for i, move in moves.items() if move is not None}
        rows |= {ends[i]: None for i in new}
        if joined:
            first, last = ([knots[ends[i][side]] for i in joined] for side in (0, 1))
            made = quintics(
                derivation,
                np.array(list(joined.values())),
                np.array([knot.xi for knot in first]),
                np.array([knot.xi for knot in last]),
                spans[list(joined)],
                (np.array([knot.rate for knot in first]), np.array([knot.rate for knot in last])),
            )
            rows |= {ends[i]: row for i, row in zip(joined, made, strict=True)}
        for i, key in enumerate(ends):
            row = rows[key]
            if row is not None:
                passed = X[i] @ scipy.linalg.expm(np.array([group.hat(s ** np.arange(6) @ row) for s in inside]))
                error[i] = float(np.max(np.abs(passed - between[i])))
        smoothed = np.array([knots[float(each)].smoothed for each in t[:-1]])
        lost = np.flatnonzero(smoothed & ~np.isfinite(error))
        if len(lost):
            raise InputError(
                f"reference: the jump of the controls near t = {t[lost[0]] + spans[lost[0]] / 2:g} cannot be rounded off over "
                f"{spans[lost[0]]:g} s, in which the plan turns too far; give a smaller smoothing="
            )
        coarse = np.flatnonzero(~smoothed & (error > tolerance))
        if not len(coarse):
            break
        if len(t) + len(coarse) > _MOST:
            raise ComputationError(
                f"reference: {_MOST} segments do not meet the plan to {tolerance:g}, the worst near t = "
                f"{t[coarse[np.argmax(error[coarse])]]:g} by {np.max(error[coarse]):.3g}; allow a larger tolerance="
            )
        for each in coarse:
            middle = float(t[each] + spans[each] / 2)
            knots[middle] = _Knot(middle, *_piece_at(pieces, middle).at(middle), False)
    table = np.array([rows[float(a), float(b)] for a, b in pairwise(t)])
    return quintic_reference(
        group, t, X, table, np.stack([t[:-1], t[1:]], axis=1)[smoothed],
        float(np.max(error[~smoothed], initial=0.0)), float(np.max(error[smoothed], initial=0.0)),
    )  # fmt: skip


@record_factory(
    times=doubles, elements=doubles, coefficients=doubles, smoothed=doubles, error=doubles, smoothing_error=doubles
)
def quintic_reference(
    group: MatrixGroup,
    times: ArrayLike,
    elements: ArrayLike,
    coefficients: ArrayLike,
    smoothed: ArrayLike,
    error: float,
    smoothing_error: float,
) -> PlanReference:
    """The record, from its numbers."""
    return PlanReference(
        group,
        np.asarray(times, dtype=float),
        np.asarray(elements),
        np.asarray(coefficients, dtype=float),
        np.asarray(smoothed, dtype=float).reshape(-1, 2),
        float(error),
        float(smoothing_error),
    )
