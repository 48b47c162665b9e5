"""Waveforms of inputs as functions of arrays of times: their values and their integrals."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.signals.input_formulas import period_of
from lie_codegen.signals.sampled_signal import Interpolated, Panels
from lie_codegen.signals.waveform import SampledWaveform, Waveform


def table_waveform(table: tuple[Array, ...], period: Any, function: Any) -> SampledWaveform:
    """The waveform of a function by its values at the Chebyshev nodes of panels; without the function they stand for it."""
    panels, values = Panels(table[0]), table[1]
    return SampledWaveform(panels, values, function or Interpolated(panels, values), period_of(period, {}))


def values_of(waveform: Waveform, dim: int) -> Callable[[Array], Array]:
    """u(t): (...,) -> (..., dim)."""
    if isinstance(waveform, SampledWaveform):
        length = waveform.panels.period
        return lambda t: waveform.function(np.mod(t, length).ravel()).reshape(*t.shape, dim)
    calculus, u = waveform.calculus({}, dim)
    return waveform.evaluator(calculus, u, dim)


def integral_of(waveform: Waveform, dim: int, mean: Array) -> Callable[[Array], Array]:
    """int_0^t u: (...,) -> (..., dim), the primitive of what is left without the mean, and the mean's own growth."""
    calculus, u = waveform.calculus({}, dim)
    wave = calculus.primitive(calculus.combine([(1, u), (-1, calculus.mean(u))]))
    periodic = waveform.evaluator(calculus, wave, dim)
    omega = float(waveform.omega)
    return lambda t: periodic(t) / omega + t[..., None] * mean
