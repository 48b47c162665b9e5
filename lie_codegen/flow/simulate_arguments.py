"""What lc.simulate is given, checked: times, tolerances, initial elements, numbers of trajectories."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from math import inf, isfinite
from operator import lt
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.errors import InputError, NotFiniteError, ShapeError
from lie_codegen.flow.events import Event, event_function
from lie_codegen.flow.events import Function as EventFunction
from lie_codegen.flow.inputs import Signal
from lie_codegen.flow.magnus.run import MOST_STEPS, ORDERS, SINGLE_GOAL
from lie_codegen.groups.matrix_group import MatrixGroup

#: The methods of fourth order of `lc.simulate`.
FOURTH_ORDER = ("rkmk4", "commutator_free")
_DEFAULT, _SMALLEST = 1e-11, 1e-14
_FEW = 8


def written(u: Any) -> Any:
    """Formulas, of which some may be numbers, as a tuple of texts; everything else, as a constant, stays."""
    entries = u.tolist() if isinstance(u, np.ndarray) and u.dtype.kind in "OU" else u
    if not isinstance(entries, list | tuple) or not any(isinstance(each, str) for each in entries):
        return u
    # a float by its shortest decimals: as it was written
    return tuple(repr(float(each)) if isinstance(each, float | np.floating) else str(each) for each in entries)


def input_of(group: MatrixGroup, u: Any) -> Any:
    """What is `written` becomes a function of time, everything else stays."""
    if not (isinstance(u, tuple) and u and isinstance(u[0], str)):
        return u
    from lie_codegen.flow.formulas import formula_input

    return formula_input(group, u)


def event_functions(
    group: MatrixGroup, events: Sequence[Event], signal: Signal, eps: Array, start: Array
) -> tuple[EventFunction, ...]:
    """The events as functions, before anything is integrated."""
    if events == ():
        return ()
    if not isinstance(events, list | tuple) or not all(isinstance(each, Event) for each in events):
        raise InputError(f"simulate({group.name}): events is a list of lc.Event, given {events!r:.80}")
    many = start.ndim == 3 or eps.ndim or (signal.formula is not None and signal.formula.trajectories is not None)
    if events and many:
        raise InputError(f"simulate({group.name}): events are of one trajectory; simulate it alone")
    return tuple(event_function(event, group.degree, group.is_complex) for event in events)


def check_precision(where: str, precision: Any) -> bool:
    """Whether it is "single".

    Raises:
        InputError: it is neither that nor "double".
    """
    if precision not in ("double", "single"):
        raise InputError(f'{where}: precision is "double" or "single", given {precision!r}')
    return bool(precision == "single")


def check_single(group: MatrixGroup, method: str, rtol: float | None, signal: Signal, eps: Array, start: Array) -> None:
    """Single precision is for N trajectories, by Magnus steps, to 1e-6 at best.

    Raises:
        InputError: something else is asked for.
    """
    where = f"simulate({group.name})"
    many = start.ndim == 3 or eps.ndim or (signal.formula is not None and signal.formula.trajectories is not None)
    if not many:
        raise InputError(f'{where}: precision="single" is for N trajectories: give eps, X0 or u of N')
    if method != "auto" and method not in ORDERS:
        raise InputError(f'{where}: precision="single" goes with the Magnus methods, not with {method}')
    if rtol is not None and rtol < SINGLE_GOAL:
        raise InputError(f'{where}: precision="single" reaches {SINGLE_GOAL:g} at best, given {rtol:g}')


def check_tolerance(where: str, rtol: float | None, atol: float, tolerance: float | None) -> float:
    """The one tolerance that was given.

    Raises:
        InputError: rtol and tolerance together, one below 1e-14 or not finite, a negative atol.
    """
    if rtol is not None and tolerance is not None:
        raise InputError(f"{where}: give rtol, or its old name tolerance, not both")
    name, value = ("tolerance", tolerance) if tolerance is not None else ("rtol", rtol)
    goal = _DEFAULT if value is None else value
    usual = type(goal) is float and 0 < goal < inf
    if not usual and not (isinstance(goal, int | float | np.floating) and np.isfinite(goal) and goal > 0):
        raise InputError(f"{where}: {name} must be positive, got {value!r}")
    if goal < _SMALLEST:
        raise InputError(f"{where}: {name} = {goal:g} is below {_SMALLEST:g}, which double precision does not reach")
    if not (type(atol) is float and 0 <= atol < inf) and not (np.isfinite(atol) and atol >= 0):
        raise InputError(f"{where}: atol must not be negative, got {atol!r}")
    return float(goal)


def step_count(group: MatrixGroup, steps: Any) -> int:
    """The number of equal steps, a whole one that can be taken."""
    if isinstance(steps, bool) or not isinstance(steps, int | np.integer) or not 1 <= steps <= MOST_STEPS:
        raise InputError(f"simulate({group.name}): steps is an integer from 1 to {MOST_STEPS}, given {steps!r}")
    return int(steps)


def factors_of(group: MatrixGroup, eps: ArrayLike) -> Array:
    """eps as a number or (N,) of them."""
    if type(eps) is float and isfinite(eps):
        return np.asarray(eps)
    try:
        factors = np.asarray(eps, dtype=float)
    except (TypeError, ValueError):
        raise NotFiniteError(f"simulate({group.name}): eps is {eps!r}; give a finite number") from None
    if not np.isfinite(factors).all():
        raise NotFiniteError(f"simulate({group.name}): eps is {eps!r}; give a finite number")
    if factors.ndim > 1 or not factors.size:
        raise ShapeError(f"simulate({group.name}): eps has shape {factors.shape}; give a number, or (N,) of them")
    return factors


def check_trajectories(group: MatrixGroup, start: Array, eps: Array, u: Signal) -> None:
    """Refuse starts, factors and inputs of different numbers of trajectories."""
    given = {
        "X0": len(start) if start.ndim == 3 else None,
        "eps": len(eps) if eps.ndim else None,
        "u": u.formula.trajectories if u.formula is not None else None,
    }
    counts = {name: count for name, count in given.items() if count is not None}
    if len(set(counts.values())) > 1:
        text = ", ".join(f"{name} has {count}" for name, count in counts.items())
        raise ShapeError(f"simulate({group.name}): give one number of trajectories; {text}")


def check_times(group: MatrixGroup, t: ArrayLike) -> Array:
    """(k,) increasing times.

    Raises:
        InputError, ShapeError, NotFiniteError: they are none.
    """
    try:
        times = np.array(t, dtype=float)  # the run keeps them
    except (TypeError, ValueError):
        raise InputError(f"simulate({group.name}): t must be an array of numbers, got {t!r}") from None
    if times.ndim != 1 or len(times) < 2:
        raise ShapeError(f"simulate({group.name}): t has shape {times.shape}; give two or more times")
    if len(times) <= _FEW:  # of two numbers numpy makes six times as much work
        values = times.tolist()
        increase = all(map(lt, values, values[1:]))
    else:
        increase = bool((times[1:] > times[:-1]).all())
    if increase and isfinite(times[0]) and isfinite(times[-1]):
        return times
    if not np.isfinite(times).all():
        raise NotFiniteError(f"simulate({group.name}): t holds NaN or infinity")
    raise InputError(f"simulate({group.name}): t must increase strictly")


@lru_cache(maxsize=64)
def _identity(group: MatrixGroup) -> Array:
    """The identity, to which nobody writes."""
    identity = np.eye(group.degree, dtype=group.basis.dtype)
    identity.flags.writeable = False
    return identity


def initial_elements(group: MatrixGroup, X0: ArrayLike | None) -> Array:
    """X0, the identity if not given, as an element of the group, or (N, d, d) of them.

    Raises:
        ShapeError, NotFiniteError, NotOnGroupError: it is none.
    """
    kind = complex if group.is_complex else float
    d = group.degree
    if X0 is None:
        return _identity(group)
    given = np.asarray(X0)
    if given.dtype.kind not in "biufc":
        raise ShapeError(f"simulate({group.name}): X0 must be a ({d}, {d}) array of numbers, got {X0!r}")
    if not group.is_complex and np.iscomplexobj(given):
        raise ShapeError(f"simulate({group.name}): X0 is complex, the group is real")
    start = np.ascontiguousarray(given, dtype=kind)
    if start.ndim not in (2, 3) or start.shape[-2:] != (d, d) or not start.size:
        raise ShapeError(
            f"simulate({group.name}): X0 has shape {start.shape}; it must be ({d}, {d}), or (N, {d}, {d}) of N trajectories"
        )
    if not np.all(np.isfinite(start)):
        raise NotFiniteError(f"simulate({group.name}): X0 holds NaN or infinity")
    from lie_codegen.groups.maps.admission import admitted, admitted_all

    where = f"simulate({group.name}): X0"
    return admitted(group, start, where).X if start.ndim == 2 else admitted_all(group, start, where)[0]
