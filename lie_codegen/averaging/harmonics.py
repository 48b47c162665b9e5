"""How many equally spaced nodes resolve a periodic function: its highest harmonic, found without being taken in by aliases."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.averaging.vector_field import FieldBody
from lie_codegen.errors import AssumptionError, InputError, PeriodError
from lie_codegen.kernel.numpy_arithmetic import NumpyArithmetic
from lie_codegen.on_demand import sympy as sp

#: The most nodes that are tried for a function that is no trigonometric polynomial.
MOST_NODES = 1024
#: A last quarter of Fourier coefficients above it, with the most nodes, is that of a jump.
_SMOOTH, _ROUNDING, _PRESENT = 1e-9, 1e-14, 1e-13
#: Boxes in which points are drawn, until the function is finite at some of them.
_BOXES = ((0.2, 0.8), (1.0, 2.0), (-0.8, -0.2), (2.0, 8.0))
#: Parts of a period that are nodes of no grid.
_BETWEEN = np.array([0.0618, 0.1854, 0.3091, 0.4327, 0.5563, 0.6799, 0.8035, 0.9271]) / math.sqrt(1.0001)


def tail(values: Array) -> float:
    """The last quarter of the Fourier coefficients of samples (..., M) over the largest: what a jump leaves there."""
    waves = np.abs(np.fft.rfft(values, axis=-1))
    largest = float(waves.max())
    if largest == 0 or not math.isfinite(largest):
        return 0.0
    return float(waves[..., 3 * waves.shape[-1] // 4 :].max()) / largest


def highest_harmonic(
    field: FieldBody, n: int, others: Sequence[float], length: float, nodes: int, where: str
) -> tuple[int, int]:
    """(harmonic, nodes): the highest harmonic above rounding of f at some points, and nodes that resolve it.

    Coefficients that decay prove nothing by themselves: 64 nodes see cos(64 t) as a constant. The interpolant must also meet f
    between the nodes.

    Args:
        field: f of (variables, others) and of the time or the phase.
        n: number of variables.
        others: values of what follows the variables.
        length: the period.
        nodes: to begin with.
        where: for messages.

    Raises:
        InputError: f is finite at none of the points tried.
        PeriodError: f has not the period.
        AssumptionError: Fourier coefficients that do not decay: f has a jump or a corner.
    """
    sample = _sampler(field, n, others, where)
    with np.errstate(all="ignore"):
        moments = np.array([0.1, 0.37, 0.73]) * length
        if not np.allclose(sample(moments), sample(moments + length), rtol=1e-9, atol=1e-9):
            raise PeriodError(f"{where}: f has not the period {length:.9g}; give period=")
        between, count = sample(_BETWEEN * length), nodes
        while True:
            values = sample(np.arange(count) / count * length)
            waves = np.fft.rfft(values, axis=-1) / count
            left, size = tail(values), max(float(np.abs(values).max()), 1e-300)
            missed = float(np.abs(_interpolant(waves) - between).max()) / size
            if left < _ROUNDING and missed < 1e3 * _ROUNDING:
                break
            if count >= MOST_NODES:
                if left < _SMOOTH and missed < 1e3 * _SMOOTH:
                    break
                raise AssumptionError(
                    f"{where}: the Fourier coefficients of f do not decay (the last quarter of {count} is {left:.1e} of the "
                    "largest): a jump or a corner, for which averages beyond the first order do not hold"
                )
            count *= 2
    heights = np.abs(waves).max(axis=(0, 1))
    present = np.flatnonzero(heights > _PRESENT * max(float(heights.max()), 1e-300))
    return (int(present[-1]) if len(present) else 0), count


def is_trigonometric(expression: sp.Expr, t: sp.Symbol) -> bool:
    """Whether t stands in it only as a polynomial of sin(c t + d) and cos(c t + d)."""
    waves = [w for w in expression.atoms(sp.sin, sp.cos) if w.has(t)]
    if any(sp.diff(w.args[0], t).has(t) for w in waves):
        return False
    symbols = [sp.Dummy() for _ in waves]
    plain = expression.xreplace(dict(zip(waves, symbols, strict=True)))
    return not plain.has(t) and bool(plain.is_polynomial(*symbols) if symbols else True)


def _sampler(field: FieldBody, n: int, others: Sequence[float], where: str) -> Callable[[Array], Array]:
    """times (k,) -> (n_f, points, k), at points where f is finite."""
    rng = np.random.default_rng(0)
    for box in _BOXES:
        points = rng.uniform(*box, (n, 6))

        def sample(times: Array, points: Array = points) -> Array:
            values = field(NumpyArithmetic(), [*(p[:, None] for p in points), *others], [times])
            return np.stack(
                [np.broadcast_to(np.asarray(v, dtype=float), (points.shape[1], len(times))) for v in values]
            )

        with np.errstate(all="ignore"):
            finite = np.all(np.isfinite(sample(np.linspace(0, 1, 7))), axis=(0, 2))
        if np.any(finite):
            kept = points[:, finite]
            return lambda times, kept=kept: sample(times, kept)  # type: ignore[misc]
    raise InputError(
        f"{where}: f has no finite value at any of the points tried, in boxes from -0.8 to 8; shift the variables, or give nodes="
    )


def _interpolant(waves: Array) -> Array:
    """The real trigonometric interpolant of coefficients (..., M/2 + 1) at `_BETWEEN`."""
    phases = np.exp(2j * np.pi * np.outer(np.arange(waves.shape[-1]), _BETWEEN))
    twice = np.full(waves.shape[-1], 2.0)
    twice[0] = 1.0
    return np.asarray(((waves * twice) @ phases).real)
