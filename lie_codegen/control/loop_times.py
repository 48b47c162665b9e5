"""When things happen in a loop: the times of the output, the calls of the law, steps, delays and tolerances."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.control.loop_ports import LoopLaw
from lie_codegen.errors import InputError, NotFiniteError, ShapeError
from lie_codegen.identifiers import shown

_RTOL, _SMALLEST = 1e-10, 1e-14
#: Relative distance from a whole number of samples or steps that is rounding.
_WHOLE = 1e-6


def read_times(t: ArrayLike) -> Array:
    """(k,) equally spaced times.

    Raises:
        InputError, ShapeError: they are not.
    """
    try:
        times = np.asarray(t, dtype=float)
    except (TypeError, ValueError):
        raise InputError(f"closed_loop: t must be an array of numbers, got {shown(t)}") from None
    if times.ndim != 1 or len(times) < 2 or not np.all(np.isfinite(times)):
        raise ShapeError(f"closed_loop: t has shape {times.shape}; give at least two finite times")
    gaps = np.diff(times)
    if gaps[0] <= 0 or np.max(np.abs(gaps - gaps[0])) > 1e-9 * abs(gaps[0]) * len(times):
        raise InputError("closed_loop: t must increase in equal steps, as numpy.linspace gives them")
    return times


def is_number(value: Any) -> bool:
    """A real number of Python or numpy."""
    return isinstance(value, int | float | np.number) and not isinstance(value, bool)


def sampling(
    times: Array,
    step: float | None,
    sample: float | None,
    delay: float | None,
    noise: Sequence[str],
    observer: LoopLaw | None,
) -> tuple[float | None, int]:
    """Seconds between two calls of the law, None for a continuous one, and the delay in samples.

    Raises:
        InputError: no positive numbers, or none that fit each other.
    """
    for name, value in (("step", step), ("sample", sample)):
        if value is not None and not (is_number(value) and np.isfinite(value) and value > 0):
            raise InputError(f"closed_loop: {name} is a positive number of seconds, got {shown(value)}")
    asked = [f"noise on {', '.join(noise)}"] if noise else []
    asked += ["a delay"] if delay else []
    asked += ["an observer"] if observer is not None else []
    if sample is None:
        if not asked:
            return None, 0
        if step is None:
            raise InputError(
                f"closed_loop: {' and '.join(asked)} needs sample=, the seconds from one call of the law to the next"
            )
        sample = step
    gap = float(times[1] - times[0])
    count = round(gap / sample)
    if count < 1 or abs(gap / sample - count) > _WHOLE * count:
        raise InputError(
            f"closed_loop: the times t are {gap:g} s apart, which is no multiple of sample = {sample:g}; choose t so that it is"
        )
    # Exactly a part of the gap, so that the times t fall on calls to the last bit however 0.1 was rounded.
    sample = gap / count
    if delay is None:
        return sample, 0
    if not is_number(delay) or not np.isfinite(delay) or delay < 0:
        raise InputError(
            f"closed_loop: delay is a number of samples (an int) or of seconds (a float), got {shown(delay)}"
        )
    if isinstance(delay, int | np.integer):
        return sample, int(delay)
    late = round(float(delay) / sample)
    if abs(float(delay) / sample - late) > _WHOLE * max(1, late):
        raise InputError(f"closed_loop: delay = {delay:g} s is no multiple of sample = {sample:g} s")
    return sample, late


def error_goal(rtol: float | None, tolerance: float | None, step: float | None) -> float:
    """The one tolerance that was given, or the default.

    Raises:
        InputError, NotFiniteError: two of them, one beside a step, or no number of at least 1e-14.
    """
    if rtol is not None and tolerance is not None:
        raise InputError("closed_loop: give rtol, or its old name tolerance, not both")
    name, value = ("rtol", rtol) if rtol is not None else ("tolerance", tolerance)
    if value is not None and step is not None:
        raise InputError(f"closed_loop: step = {step:g} and {name}: give the step or the tolerance, not both")
    if value is None:
        return _RTOL
    if not is_number(value):
        raise InputError(f"closed_loop: {name} is a positive number, got {shown(value)}")
    if not np.isfinite(value):
        raise NotFiniteError(f"closed_loop: {name} is {value}; give a positive number")
    if value <= 0:
        raise InputError(f"closed_loop: {name} must be positive, got {shown(value)}")
    if value < _SMALLEST:
        raise InputError(
            f"closed_loop: {name} = {value:g} is below {_SMALLEST:g}, which double precision does not reach"
        )
    return float(value)
