"""The coefficients of a series in eps, kept as signals in phase, as expressions and as functions of t."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lie_codegen.exact.expression import time_symbol
from lie_codegen.on_demand import sympy as sp
from lie_codegen.signals.periodic_input import PeriodicInput


def expressions_of(u: PeriodicInput, calculus: Any, signals: Sequence[Any]) -> tuple[sp.ImmutableMatrix, ...]:
    """Each (n, 1), in t; the q-th signal counts omega^-q, one integration for each order.

    Raises:
        InputError: for a sampled input.
    """
    waveform = u.waveform
    return tuple(
        waveform.expressions(calculus, signal, u.dim, time_symbol()) / waveform.omega**q
        for q, signal in enumerate(signals, start=1)
    )


def functions_of(
    u: PeriodicInput, calculus: Any, signals: Sequence[Any]
) -> list[Callable[[ArrayLike], NDArray[np.float64]]]:
    """Each a function of t, (...,) -> (..., n)."""
    waveform = u.waveform
    omega = float(waveform.omega) if not waveform.omega.free_symbols else 1.0
    evaluators = [waveform.evaluator(calculus, signal, u.dim) for signal in signals]
    return [
        lambda t, f=evaluate, s=omega**-q: s * f(np.asarray(t, dtype=float))  # type: ignore[misc]
        for q, evaluate in enumerate(evaluators, start=1)
    ]
