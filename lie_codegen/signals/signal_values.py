"""TrigSignals as numbers and as SymPy expressions."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lie_codegen.arrays import Array
from lie_codegen.on_demand import sympy as sp
from lie_codegen.signals import trigonometric as trig
from lie_codegen.signals.coefficients import CoefficientRing
from lie_codegen.signals.trig_signal import TrigSignal


@dataclass(frozen=True)
class SignalTable:
    """A TrigSignal in doubles: sum_r tau^power_r (cosine_r cos(frequency_r tau) + sine_r sin(frequency_r tau)).

    Attributes:
        powers, frequencies: (r,) integers.
        cosines, sines: (r, n).
    """

    powers: NDArray[np.int64]
    frequencies: NDArray[np.int64]
    cosines: Array
    sines: Array

    def __call__(self, tau: Array) -> Array:
        """(...,) -> (..., n); equal times give equal bits whatever the shape."""
        times = np.asarray(tau, dtype=float)[..., None]
        total = np.zeros((*times.shape[:-1], self.cosines.shape[1]))
        for power, frequency, cosine, sine in zip(self.powers, self.frequencies, self.cosines, self.sines, strict=True):
            wave = cosine * np.cos(frequency * times) + sine * np.sin(frequency * times) if frequency else cosine
            total += times ** int(power) * wave if power else wave
        return total


@dataclass(frozen=True)
class SeriesValues:
    """t -> a trigonometric polynomial in omega t, called with (...,) times: (..., n)."""

    omega: float
    table: SignalTable

    def __call__(self, t: Array) -> Array:
        return self.table(self.omega * np.asarray(t, dtype=float))


@dataclass(frozen=True)
class PiecewiseValues:
    """t -> the piece in which t falls, each a table in omega (t - its start), repeated; at a joint, the piece that begins.

    Attributes:
        omega: the rate of the pieces' own time.
        ends: (m,) of the pieces; the last is the period.
        tables: (m).
    """

    omega: float
    ends: Array
    tables: tuple[SignalTable, ...]

    def __call__(self, t: Array) -> Array:
        times = np.asarray(t, dtype=float)
        inner = np.mod(times, self.ends[-1]).ravel()
        index = np.minimum(np.searchsorted(self.ends, inner, side="right"), len(self.ends) - 1)
        starts = np.concatenate([[0.0], self.ends[:-1]])
        result = np.empty((inner.size, self.tables[0].cosines.shape[1]))
        for m, table in enumerate(self.tables):
            here = index == m
            result[here] = table(self.omega * (inner[here] - starts[m]))
        return result.reshape(*times.shape, result.shape[1])


def table_of(
    signal: TrigSignal, dim: int, ring: CoefficientRing, generators: Sequence[Any] = (), phases: Sequence[float] = ()
) -> SignalTable:
    """The signal at numeric values of the generators and of the phases."""
    rows: dict[tuple[int, int], Array] = {}
    values = tuple(generators)
    for i, component in signal.components.items():
        for power, wave in component.items():
            for key, (cosine, sine) in wave.items():
                frequency, *multiples = trig.unpack(key, len(phases))
                a = ring.number(cosine, signal.denominator, values)
                b = ring.number(sine, signal.denominator, values)
                shift = sum(m * phase for m, phase in zip(multiples, phases, strict=True))
                c, s = (
                    (a * np.cos(shift) + b * np.sin(shift), b * np.cos(shift) - a * np.sin(shift)) if shift else (a, b)
                )
                row = rows.setdefault((power, abs(frequency)), np.zeros((2, dim)))
                row[0, i] += c
                row[1, i] += s if frequency >= 0 else -s
    keys = sorted(rows)
    stacked = np.array([rows[key] for key in keys]).reshape(len(keys), 2, dim)
    return SignalTable(
        np.array([p for p, _ in keys], dtype=np.int64),
        np.array([f for _, f in keys], dtype=np.int64),
        stacked[:, 0],
        stacked[:, 1],
    )


def expressions_of(
    signal: TrigSignal, dim: int, ring: CoefficientRing, tau: sp.Expr, phases: Sequence[sp.Expr] = ()
) -> sp.ImmutableMatrix:
    """(n, 1) the signal as exact expressions in tau, the generators and the phases."""
    entries = []
    for i in range(dim):
        terms = []
        for power, wave in signal.components.get(i, {}).items():
            for key, (cosine, sine) in sorted(wave.items()):
                frequency, *multiples = trig.unpack(key, len(phases))
                angle = frequency * tau + sp.Add(*(m * phase for m, phase in zip(multiples, phases, strict=True)))
                a = ring.expression(cosine, signal.denominator)
                b = ring.expression(sine, signal.denominator)
                terms.append(tau**power * (a * sp.cos(angle) + b * sp.sin(angle)))
        entries.append(sp.Add(*terms))
    return sp.ImmutableMatrix(entries)


def integral_of(
    signal: TrigSignal, dim: int, ring: CoefficientRing, phases: Sequence[sp.Expr] = ()
) -> sp.ImmutableMatrix:
    """(n, 1) the value at tau = 2 pi less that at tau = 0: for a primitive, the integral over one period."""
    entries = []
    for i in range(dim):
        terms = []
        for power, wave in signal.components.get(i, {}).items():
            if power == 0:
                continue
            for key, (cosine, sine) in wave.items():
                _, *multiples = trig.unpack(key, len(phases))
                angle = sp.Add(*(m * phase for m, phase in zip(multiples, phases, strict=True)))
                a = ring.expression(cosine, signal.denominator)
                b = ring.expression(sine, signal.denominator)
                terms.append((2 * sp.pi) ** power * (a * sp.cos(angle) + b * sp.sin(angle)))
        entries.append(sp.expand(sp.Add(*terms)))
    return sp.ImmutableMatrix(entries)
