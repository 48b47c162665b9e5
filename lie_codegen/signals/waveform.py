"""What a periodic input is inside: an exact trigonometric polynomial, or samples; one interface."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.errors import InputError
from lie_codegen.on_demand import sympy as sp
from lie_codegen.signals.coefficients import CoefficientRing
from lie_codegen.signals.sampled_signal import Panels, SampledCalculus
from lie_codegen.signals.signal_values import SeriesValues, expressions_of, integral_of, table_of
from lie_codegen.signals.trig_formula import TrigForm
from lie_codegen.signals.trig_signal import Brackets, TrigCalculus, TrigSignal

Signal = Any
Calculus = Any


class Waveform(Protocol):
    """n periodic functions of t with the operations that averaging needs; the inner time is tau = omega t."""

    @property
    def dim(self) -> int: ...

    @property
    def exact(self) -> bool: ...

    @property
    def has_formula(self) -> bool: ...

    @property
    def omega(self) -> sp.Expr: ...

    @property
    def period(self) -> sp.Expr: ...

    @property
    def parameters(self) -> tuple[sp.Symbol, ...]: ...

    def calculus(self, brackets: Brackets, dim: int) -> tuple[Calculus, Signal]:
        """The operations with these structure constants, and the input as a signal of theirs."""

    def expressions(self, calculus: Calculus, signal: Signal, dim: int, time: sp.Expr) -> sp.ImmutableMatrix:
        """(dim, 1) a signal as expressions in t; a constant where the waveform is sampled."""

    def integral(self, calculus: Calculus, signal: Signal, dim: int) -> sp.ImmutableMatrix:
        """(dim, 1) int_0^{2 pi / omega} of a signal, in the inner time."""

    def evaluator(self, calculus: Calculus, signal: Signal, dim: int) -> Callable[[Array], Array]:
        """A signal as a function of t: (...,) -> (..., dim)."""

    def vanishes(self, calculus: Calculus, signal: Signal) -> bool:
        """Whether a signal is identically zero (to rounding, where the waveform is sampled)."""


@dataclass(frozen=True)
class TrigWaveform:
    """Exact trigonometric polynomials, see `TrigForm`.

    Attributes:
        form: the polynomials in tau.
        order: the parameters, in the order in which the user gave them.
    """

    form: TrigForm
    order: tuple[sp.Symbol, ...] = ()

    @property
    def dim(self) -> int:
        """n."""
        return self.form.dim

    @property
    def exact(self) -> bool:
        """True."""
        return True

    @property
    def has_formula(self) -> bool:
        """True: signals are expressions in t."""
        return True

    @property
    def omega(self) -> sp.Expr:
        """2 pi / T."""
        return self.form.omega

    @cached_property
    def period(self) -> sp.Expr:
        """T."""
        return sp.cancel(2 * sp.pi / self.form.omega)

    @cached_property
    def parameters(self) -> tuple[sp.Symbol, ...]:
        """The parameters that occur."""
        used = set().union(*(e.free_symbols for e in (*self.form.ring.generators, *self.form.units, self.omega)))
        return tuple(s for s in self.order if s in used)

    def calculus(self, brackets: Brackets, dim: int) -> tuple[TrigCalculus, TrigSignal]:
        """The ring grows by the irrational structure constants."""
        # sqrt(3) as a structure constant is a generator that no amplitude need have; with none the coefficients stay plain integers.
        constants = [value for row in brackets.values() for value in row.values()]
        ring = CoefficientRing.holding([*self.form.ring.generators, *constants])
        if ring.generators == self.form.ring.generators:
            return TrigCalculus(brackets, self.form.ring), self.form.signal
        return TrigCalculus(brackets, ring), moved(self.form.signal, self.form.ring, ring)

    def expressions(self, calculus: TrigCalculus, signal: TrigSignal, dim: int, time: sp.Expr) -> sp.ImmutableMatrix:
        return expressions_of(signal, dim, calculus.ring, self.omega * time, self.form.units)

    def integral(self, calculus: TrigCalculus, signal: TrigSignal, dim: int) -> sp.ImmutableMatrix:
        return integral_of(calculus.primitive(signal), dim, calculus.ring, self.form.units)

    def evaluator(self, calculus: TrigCalculus, signal: TrigSignal, dim: int) -> SeriesValues:
        if self.parameters:
            names = ", ".join(map(str, self.parameters))
            raise InputError(f"the parameters {names} have no values; give them with .at({names}=...)")
        generators = tuple(float(g) for g in calculus.ring.generators)
        phases = tuple(float(unit) for unit in self.form.units)
        table = table_of(signal, dim, calculus.ring, generators, phases)
        return SeriesValues(float(self.omega), table)

    def vanishes(self, calculus: TrigCalculus, signal: TrigSignal) -> bool:
        return signal.is_zero


def moved(signal: TrigSignal, old: CoefficientRing, new: CoefficientRing) -> TrigSignal:
    """A signal with its coefficients in a larger ring."""
    place = [new.generators.index(g) for g in old.generators]

    def move(value: Any) -> Any:
        if isinstance(value, int):
            return value
        terms = {}
        for monom, coefficient in value.terms():
            key = [0] * len(new.generators)
            for position, exponent in zip(place, monom, strict=True):
                key[position] = exponent
            terms[tuple(key)] = coefficient
        return new.polynomials.from_dict(terms)

    components = {
        i: {p: {key: [move(a), move(b)] for key, (a, b) in wave.items()} for p, wave in component.items()}
        for i, component in signal.components.items()
    }
    return TrigSignal(components, signal.denominator)


@dataclass(frozen=True)
class SampledWaveform:
    """Periodic functions known by their values.

    Attributes:
        panels, values: the nodes and (p, NODES, n) what the functions are there.
        function: the functions themselves on [0, T), vectorised.
        period: T, exact where it was given so.
    """

    panels: Panels
    values: Array
    function: Callable[[Array], Array]
    period: sp.Expr

    @property
    def dim(self) -> int:
        """n."""
        return int(self.values.shape[2])

    @property
    def exact(self) -> bool:
        """False."""
        return False

    @property
    def has_formula(self) -> bool:
        """False."""
        return False

    @property
    def omega(self) -> sp.Expr:
        """1: the inner time is t."""
        return sp.S.One

    @property
    def parameters(self) -> tuple[sp.Symbol, ...]:
        """None."""
        return ()

    def calculus(self, brackets: Brackets, dim: int) -> tuple[SampledCalculus, Array]:
        return SampledCalculus(brackets, self.panels, dim), self.values

    def expressions(self, calculus: SampledCalculus, signal: Array, dim: int, time: sp.Expr) -> sp.ImmutableMatrix:
        # A mean is such a signal: its values are one number up to the rounding of the quadrature.
        first = signal[0, 0]
        if np.max(np.abs(signal - first)) > 1e-12 * max(1.0, float(np.max(np.abs(signal)))):
            raise InputError("a sampled input has no exact expression in t; evaluate it instead")
        return sp.ImmutableMatrix([sp.Float(float(value)) for value in first])

    def integral(self, calculus: SampledCalculus, signal: Array, dim: int) -> sp.ImmutableMatrix:
        return sp.ImmutableMatrix([sp.Float(float(value)) for value in self.panels.integral(signal)])

    def evaluator(self, calculus: SampledCalculus, signal: Array, dim: int) -> Callable[[Array], Array]:
        period = self.panels.period
        return lambda t: self.panels.interpolate(signal, np.mod(np.asarray(t, dtype=float), period))

    def vanishes(self, calculus: SampledCalculus, signal: Array) -> bool:
        return float(np.max(np.abs(signal), initial=0.0)) <= 1e-11 * max(1.0, float(np.max(np.abs(self.values))))
