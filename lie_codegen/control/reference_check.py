"""References that jump are refused, with the time of the jump."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lie_codegen.control.reference_kernels import ReferenceBody
from lie_codegen.control.reference_motion import PlanReference, Reference
from lie_codegen.errors import InputError
from lie_codegen.kernel.arithmetic import FloatArithmetic
from lie_codegen.kernel.complex_scalar import Complex

#: Width, relative to the horizon, at which a change that is still there counts as a jump, and its size.
_JUMP_WIDTH, _JUMP_SIZE = 1e-9, 1e-5


#: References that were found smooth, with their times; a repeated loop does not look again.
_SMOOTH: dict[tuple[Any, float, float], None] = {}
_MOST = 256


def check_once(reference: Reference, t0: float, t1: float, evaluate: Callable[[float], Any]) -> None:
    """`check_reference`, of one that says by its definition what it is once a process.

    Raises:
        InputError: as `check_reference`.
    """
    definition = getattr(reference, "definition", None)
    key = (definition, t0, t1)
    if definition is not None and key in _SMOOTH:
        return
    check_reference(reference, t0, t1, evaluate)
    if definition is not None:
        if len(_SMOOTH) >= _MOST:
            _SMOOTH.clear()
        _SMOOTH[key] = None


def check_reference(
    reference: Reference, t0: float, t1: float, evaluate: Callable[[float], Any] | None = None, samples: int = 400
) -> None:
    """Refuses a reference that jumps, or whose velocity or acceleration does, between t0 and t1.

    Args:
        reference: what to check.
        t0: first time.
        t1: last time.
        evaluate: t -> (X_d, xi_d, xi_d_dot), as the compiled `reference_kernel` gives it; in Python floats if None.
        samples: number of intervals of the first look.

    Raises:
        InputError: it jumps or is not finite; names the time.
    """
    body = ReferenceBody(reference)
    at = evaluate or (lambda t: body(FloatArithmetic(), t))
    name = reference.group.name
    if isinstance(reference, PlanReference):
        known, slack = reference.times[[0, -1]], 1e-9 * (reference.times[-1] - reference.times[0])
        if t0 < known[0] - slack or t1 > known[1] + slack:
            raise InputError(
                f"the plan that is the reference on {name} is known on [{known[0]:g}, {known[1]:g}], not up to "
                f"t = {t0 if t0 < known[0] - slack else t1:g}"
            )

    def value(t: float) -> NDArray[Any]:
        try:
            X, xi, rate = at(t)
        except InputError:
            raise
        except (ValueError, ZeroDivisionError, OverflowError):
            raise InputError(f"the reference on {name} has no finite value at t = {t:.9g}") from None
        entries = [part for row in X for z in row for part in _parts(z)]
        result = np.array([float(x) for x in (*entries, *xi, *rate)])
        if not np.all(np.isfinite(result)):
            raise InputError(f"the reference on {name} has no finite value at t = {t:.9g}")
        return result

    grid = np.linspace(t0, t1, samples + 1)
    values = [value(float(t)) for t in grid]
    changes = [float(np.max(np.abs(b - a))) for a, b in pairwise(values)]
    # A jump keeps its size however close one looks, a steep place does not: the largest changes are bisected towards the half that changes more.
    for index in np.argsort(changes)[::-1][:8]:
        low, high, a, b = float(grid[index]), float(grid[index + 1]), values[index], values[index + 1]
        while high - low > _JUMP_WIDTH * (t1 - t0):
            middle = (low + high) / 2
            c = value(middle)
            if np.max(np.abs(c - a)) >= np.max(np.abs(b - c)):
                high, b = middle, c
            else:
                low, a = middle, c
        size = float(np.max(np.abs(b - a)))
        if size > _JUMP_SIZE * max(1.0, changes[index]):
            raise InputError(
                f"the reference on {name}, its velocity or its acceleration jumps by {size:.3g} at t = {low:.9g}; "
                "tracking needs a twice differentiable reference: smooth it, or give waypoints"
            )


def _parts(z: Any) -> tuple[float, float]:
    return (z.re, z.im) if isinstance(z, Complex) else (z.real, z.imag)
