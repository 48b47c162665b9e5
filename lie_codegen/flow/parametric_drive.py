"""A ParametricInput at given parameters as a Magnus flow reads it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.flow.magnus.drive import Drive, resolved_drive
from lie_codegen.runtime.formula_input import FormulaInput
from lie_codegen.signals.parametric_input import ParametricInput, Waves
from lie_codegen.signals.resolved_input import resolve_function

_EMPTY = np.empty(0)


def parametric_drive(
    u: ParametricInput, values: Sequence[float], length: float, rtol: float, resolution: float | None, where: str
) -> Drive:
    """u(.; p) on [0, length]: waves where it is a sum of sines and cosines, else resolved once."""
    if u.waves is not None and not u.breakpoints:
        return _of_waves(u.waves, u.dim, values, None)
    named = dict(zip(u.parameters, values, strict=True))
    found = resolve_function(
        lambda t: u(t, **named), 0.0, length, tolerance=0.2 * rtol, resolution=resolution,
        breakpoints=np.array(u.breakpoints), where=where,
    )  # fmt: skip
    return resolved_drive(found, np.array(1.0))


def parametric_batch(
    u: ParametricInput,
    values: Sequence[Any],
    count: int,
    length: float,
    rtol: float,
    resolution: float | None,
    where: str,
) -> list[Drive]:
    """One drive of N trajectories for waves, N drives of one else."""
    if u.waves is not None and not u.breakpoints:
        return [_of_waves(u.waves, u.dim, values, count)]
    rows = zip(*(np.broadcast_to(value, count) for value in values), strict=True)
    return [parametric_drive(u, [float(x) for x in row], length, rtol, resolution, where) for row in rows]


def wave_numbers(waves: Waves, values: Sequence[float]) -> Array:
    """Rates, cosines, sines, one after the other; not finite where a formula has no value there."""
    try:
        return np.array(waves.evaluate_one(*values), dtype=float)
    except (ValueError, ZeroDivisionError, OverflowError, TypeError):
        # `math` raises where numpy gives NaN or infinity, which the flow refuses by name.
        with np.errstate(all="ignore"):
            return np.array(waves.evaluate(*(np.float64(value) for value in values)), dtype=float)


def _of_waves(waves: Waves, n: int, values: Sequence[Any], count: int | None) -> Drive:
    F = waves.count
    shape = () if count is None else (count,)
    if count is None:
        flat = wave_numbers(waves, values)
    else:
        entries = waves.evaluate(*values)
        flat = np.stack([np.broadcast_to(np.asarray(each, dtype=float), shape) for each in entries], axis=-1)
    rates = np.ascontiguousarray(flat[..., :F])
    cosines, sines = (
        np.ascontiguousarray(flat[..., F + k * F * n : F + (k + 1) * F * n]).reshape(*shape, F, n) for k in (0, 1)
    )
    none = np.empty((0, n))
    formula = FormulaInput(rates if count is None else rates[0], np.zeros(F), cosines, sines, _EMPTY, none, none)
    shared = count is None or bool(np.all(rates == rates[0]))
    own = formula.rates if shared else rates
    return Drive(formula, own, np.zeros_like(own), np.empty((0, 0, n)), _EMPTY, np.ones(1), count, 0.0, 0, 0.0, _EMPTY)
