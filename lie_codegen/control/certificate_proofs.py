"""Which constants of a certificate are proved, and the words that say how each is known."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from lie_codegen.control.certificate_constants import Metric
from lie_codegen.control.claims import is_claimed
from lie_codegen.control.critical_points import CriticalPoints
from lie_codegen.control.error_catalogue import gain
from lie_codegen.control.error_function import ErrorFunction
from lie_codegen.control.interval_proof import proved_hessian, proved_ratio, proved_transport
from lie_codegen.exact.positive_matrix import as_floats, attitude_gain

#: How far beyond the sampled value a bound is tried to be proved, in turn.
_INFLATED = (1.01, 1.05)
#: No proof of b_1, b_2, h, t.
UNPROVED = (float("nan"),) * 4


def proved_constants(
    pair: ErrorFunction,
    gains: Mapping[str, Any],
    metric: Metric,
    level: float,
    found: tuple[float, float, float, float],
) -> tuple[float, float, float, float]:
    """Bounds of b_1, b_2, h and t near the sampled ones, each proved; NaN where none is."""
    if pair.name != "so3_right" or is_claimed(pair):
        return UNPROVED
    definition = getattr(pair, "definition", None)
    given = definition["parameters"]["gains"] if definition is not None else gains
    K, I = as_floats(attitude_gain(gain(given, "K_p", "the error function so3_right"), 3, "K_p")), metric.I  # noqa: E741
    b_1, b_2, h, t = found
    claims: tuple[tuple[float, Callable[[float], bool]], ...] = (
        (b_1, lambda f: proved_ratio(K, I, level, f * b_1, upper=True)),
        (1 / b_2, lambda f: proved_ratio(K, I, level, b_2 / f, upper=False)),
        (h, lambda f: proved_hessian(K, I, metric.nabla, level, f * h)),
        (t, lambda f: proved_transport(I, metric.nabla, f * t)),
    )
    above, below, hessian, transport = (
        next((f * value for f in _INFLATED if holds(f)), float("nan")) for value, holds in claims
    )
    return above, 1 / below, hessian, transport


def status_of(pair: ErrorFunction, points: CriticalPoints, proved: tuple[float, ...], count: int) -> str:
    """How L, the constants and the rate are known, in one line."""
    if pair.uses_log:
        known = "up to the cut locus, L the least of phi there"
    elif not is_claimed(pair) and pair.constant is not None:
        known = "L known"
    else:
        known = f"L from critical points ({points.status})"
    sure = [
        f"{name} {'>=' if name == 'b_2' else '<='} {value:.6g}"
        for name, value in zip(("b_1", "b_2", "h", "t"), proved, strict=True)
        if np.isfinite(value)
    ]
    bounds = f"{', '.join(sure)} proved in interval arithmetic" if sure else "b_1, b_2, h and t sampled"
    return f"{known}; {bounds}; rate sampled ({count} places and their refinement)"
