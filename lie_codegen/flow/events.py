"""Events: times at which a formula of t and X changes sign along a trajectory."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lie_codegen.arrays import Array
from lie_codegen.errors import InputError
from lie_codegen.flow.chandrupatla import roots
from lie_codegen.kernel.saved import Saved

#: Where g is looked at within a step, beside its ends: at no rational part of it.
INNER = np.array([0.3090169943749474, 0.7071067811865476])


@dataclass(frozen=True, eq=False, repr=False)
class Event(Saved):
    """A formula g in t, X[i][j] and, along mechanical motions, xi[i] (counted from 0), that is to vanish.

    Of complex matrices it reads re(X[i][j]), im(X[i][j]) and abs(X[i][j]). The text is data, never evaluated.

    Attributes:
        formula: g in the closed grammar of formulas (sin, cos, sqrt, exp, log, ...).
        direction: 1 for passages from negative to positive, -1 for the others, 0 for both.
        grazing: also report where |g| has a minimum without a change of sign.

    Raises:
        InputError: another direction.
    """

    formula: str
    direction: int = 0
    grazing: bool = False

    def __post_init__(self) -> None:
        if not isinstance(self.formula, str):
            raise InputError(f"Event: the formula is a text such as 'X[2][2] - 3/10', given {self.formula!r}")
        if self.direction not in (-1, 0, 1):
            raise InputError(f"Event({self.formula!r}): direction is -1, 0 or 1, given {self.direction!r}")


@dataclass(frozen=True, eq=False, repr=False)
class EventHits(Saved):
    """What was found of one event.

    Attributes:
        event: the event.
        t: (m,) times at which g changes sign, increasing.
        X: (m, d, d) there.
        xi: (m, n) there, along mechanical motions; else None.
        grazing: (q,) times of a minimum of |g| without a change of sign, where they were asked for.
    """

    event: Event
    t: Array
    X: Array
    xi: Array | None
    grazing: Array

    def __repr__(self) -> str:
        return f"EventHits({self.event.formula!r}, {len(self.t)} found)"


#: (k,) times, (k, d, d), (k, n) or None -> (k,) values.
Function = Callable[[Array, Array, Array | None], Array]
#: (k,) steps, (k,) fractions of them -> X and xi there.
Inside = Callable[[NDArray[np.intp], Array], tuple[Array, Array | None]]


def event_function(event: Event, degree: int, is_complex: bool, velocities: int = 0) -> Function:
    """g as a function of arrays.

    Raises:
        ExpressionError: a text outside the grammar, with the column; an entry that there is not.
        InputError: a complex value.
    """
    import sympy as sp

    from lie_codegen.exact.expression import FORMULA_FUNCTIONS, parse_expression
    from lie_codegen.kernel.expressions import ExpressionEvaluator
    from lie_codegen.kernel.numpy_arithmetic import NumpyArithmetic

    t = sp.Symbol("t", real=True)
    places: list[tuple[int, ...]] = [(i, j) for i in range(degree) for j in range(degree)]
    real: dict[tuple[int, ...], Any] = {place: sp.Symbol("X_{}_{}".format(*place), real=True) for place in places}
    imaginary: dict[tuple[int, ...], Any] = {place: sp.Symbol("Y_{}_{}".format(*place), real=True) for place in places}
    speeds: dict[tuple[int, ...], Any] = {(i,): sp.Symbol(f"xi_{i}", real=True) for i in range(velocities)}
    entries = {place: real[place] + sp.I * imaginary[place] for place in places} if is_complex else real
    arrays = {"X": entries, **({"xi": speeds} if velocities else {})}
    functions = dict(FORMULA_FUNCTIONS)
    if is_complex:
        functions |= {"re": _part(sp.re), "im": _part(sp.im), "abs": _modulus}
    g = parse_expression(event.formula, {"t": t, "pi": sp.pi}, functions, arrays)
    if g.has(sp.I):
        raise InputError(f"Event({event.formula!r}) is complex: take re(X[i][j]), im(X[i][j]) or abs(X[i][j])")

    def function(times: Array, X: Array, xi: Array | None) -> Array:
        values: dict[Any, Any] = {t: times}
        for place in places:
            entry = X[:, place[0], place[1]]
            values[real[place]], values[imaginary[place]] = entry.real, entry.imag
        if xi is not None:
            values |= {symbol: xi[:, place[0]] for place, symbol in speeds.items()}
        with np.errstate(all="ignore"):
            found = ExpressionEvaluator(NumpyArithmetic(), values)(g)
        return np.broadcast_to(np.asarray(found, dtype=float), times.shape)

    return function


def _part(which: Any) -> Callable[..., Any]:
    return lambda z: which(z.expand(complex=True))


def _modulus(z: Any) -> Any:
    import sympy as sp

    re, im = z.as_real_imag()
    return sp.sqrt(sp.expand(re) ** 2 + sp.expand(im) ** 2)


def find_events(
    events: Sequence[Event],
    functions: Sequence[Function],
    starts: Array,
    lengths: Array,
    states: tuple[Array, Array | None],
    inside: Inside,
    where: str,
) -> tuple[EventHits, ...]:
    """The sign changes of every event along a run.

    g is looked at where each step begins, at two places within and where it ends; a change of sign is brought down to
    rounding by Chandrupatla's method on fresh partial steps.

    Args:
        events: what to find.
        functions: of `event_function`.
        starts, lengths: (k,) the steps.
        states: X (3 k + 1, d, d) and xi (3 k + 1, n) or None, at the start and the inner places of each step, and at the end.
        inside: the state within a step.
        where: for messages.

    Raises:
        InputError: g is zero at the start, or NaN on the way.
    """
    parts = np.concatenate([[0.0], INNER])
    moments = np.append((starts[:, None] + lengths[:, None] * parts).ravel(), starts[-1] + lengths[-1])
    hits = []
    for event, g in zip(events, functions, strict=True):
        values = g(moments, *states)
        if not np.all(np.isfinite(values)):
            bad = moments[np.flatnonzero(~np.isfinite(values))[0]]
            raise InputError(f"{where}: the event {event.formula!r} has no finite value at t = {bad:.9g}")
        if values[0] == 0:
            raise InputError(
                f"{where}: the event {event.formula!r} is zero at the start, t = {moments[0]:.9g}, so it cannot change sign "
                "there; start a little later, or shift the formula"
            )
        # A value that is exactly zero counts as the sign it comes from: the next interval finds the passage.
        sign = np.sign(values)
        sign = sign[np.maximum.accumulate(np.where(sign != 0, np.arange(len(sign)), 0))]
        change = np.flatnonzero(sign[1:] != sign[:-1])
        if event.direction:
            change = change[sign[change + 1] == event.direction]
        t, X, xi = _roots(g, moments, change, starts, lengths, inside)
        grazing = _grazing(g, values, sign, moments, starts, lengths, inside) if event.grazing else np.empty(0)
        hits.append(EventHits(event, t, X, xi, grazing))
    return tuple(hits)


def _roots(
    g: Function, moments: Array, change: NDArray[np.intp], starts: Array, lengths: Array, inside: Inside
) -> tuple[Array, Array, Array | None]:
    step = change // 3

    def at(t: Array, which: NDArray[np.intp]) -> tuple[Array, Array | None]:
        chosen = step[which]
        return inside(chosen, (t - starts[chosen]) / lengths[chosen])

    def value(t: Array, which: NDArray[np.intp]) -> Array:
        return g(t, *at(t, which))

    t = roots(value, moments[change], moments[change + 1])
    X, xi = at(t, np.arange(len(t)))
    return t, X, xi


def _grazing(
    g: Function, values: Array, sign: Array, moments: Array, starts: Array, lengths: Array, inside: Inside
) -> Array:
    """Minima of |g| between neighbours of one sign, by golden sections."""
    size = np.abs(values)
    low = np.flatnonzero((size[1:-1] <= size[:-2]) & (size[1:-1] <= size[2:])) + 1
    low = low[(sign[low - 1] == sign[low]) & (sign[low] == sign[low + 1])]
    a, b = moments[low - 1], moments[low + 1]
    ratio = (np.sqrt(5) - 1) / 2

    def height(t: Array) -> Array:
        step = np.clip(np.searchsorted(starts, t, side="right") - 1, 0, len(starts) - 1)
        return np.abs(g(t, *inside(step, (t - starts[step]) / lengths[step])))

    for _ in range(40):  # the square root of rounding is all that a minimum can be located to
        c, d = b - ratio * (b - a), a + ratio * (b - a)
        left = height(c) < height(d)
        a, b = np.where(left, a, c), np.where(left, d, b)
    return np.asarray((a + b) / 2)
