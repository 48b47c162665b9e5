"""Where the logarithm of an error function ends: the least value of phi on its cut."""

from __future__ import annotations

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.control.error_samples import ErrorSamples, basis_scales
from lie_codegen.flow.batched_exponential import expm


def cut_level(samples: ErrorSamples, rng: np.random.Generator, count: int = 3000) -> float:
    """The least of phi where a turn reaches 180 degrees: on rays exp(s x) just before |Im| of an eigenvalue of s hat(x) is pi.

    Infinite on groups without turns.
    """
    group = samples.group

    def level(x: Array) -> Array:
        turn = np.max(np.abs(np.linalg.eigvals(group.hat(x)).imag), axis=-1)
        ray = turn > 1e-3 * np.linalg.norm(x / basis_scales(group), axis=-1)
        s = (np.pi - 1e-9) / np.where(ray, turn, 1)
        with np.errstate(all="ignore"):
            phi, _ = samples.first(expm(group.hat(s[:, None] * x)))
        return np.where(ray & np.isfinite(phi), phi, np.inf)

    x = rng.normal(size=(count, group.dim)) * basis_scales(group)
    values = level(x)
    order = np.argsort(values)[:8]
    if not np.isfinite(values[order[0]]):
        return float("inf")
    best, least = x[order], values[order]
    spread = 0.3
    while spread > 1e-8:
        moved = best[:, None] + spread * np.linalg.norm(best, axis=1)[:, None, None] * rng.normal(
            size=(8, 40, group.dim)
        ) * basis_scales(group) / np.linalg.norm(basis_scales(group))
        tried = level(moved.reshape(-1, group.dim)).reshape(8, 40)
        first = np.argmin(tried, axis=1)
        better = tried[np.arange(8), first] < least
        best[better], least[better] = moved[np.arange(8), first][better], tried[np.arange(8), first][better]
        spread *= 0.75 if not np.any(better) else 0.97
    return float(np.min(least))
