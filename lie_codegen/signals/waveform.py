"""What a periodic input is inside: an exact trigonometric polynomial, or samples; one interface."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, Protocol

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.errors import InputError
from lie_codegen.on_demand import sympy as sp
from lie_codegen.signals.coefficients import CoefficientRing
from lie_codegen.signals.sampled_signal import Panels, SampledCalculus
from lie_codegen.signals.signal_values import expressions_of, integral_of, table_of
from lie_codegen.signals.trig_formula import TrigForm
from lie_codegen.signals.trig_signal import Brackets, TrigCalculus, TrigSignal
from lie_codegen.signals.trigonometric import add_scaled, clean

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
        constants = [value for row in brackets.values() for value in row.values()]
        ring = CoefficientRing.holding([*self.form.ring.generators, *constants])
        if ring.generators == self.form.ring.generators:
            return TrigCalculus(brackets, self.form.ring), self.form.signal
        return TrigCalculus(brackets, ring), moved(self.form.signal, self.form.ring, ring)

    def expressions(self, calculus: TrigCalculus, signal: TrigSignal, dim: int, time: sp.Expr) -> sp.ImmutableMatrix:
        return expressions_of(signal, dim, calculus.ring, self.omega * time, self.form.units)

    def integral(self, calculus: TrigCalculus, signal: TrigSignal, dim: int) -> sp.ImmutableMatrix:
        return integral_of(calculus.primitive(signal), dim, calculus.ring, self.form.units)

    def evaluator(self, calculus: TrigCalculus, signal: TrigSignal, dim: int) -> Callable[[Array], Array]:
        if self.parameters:
            names = ", ".join(map(str, self.parameters))
            raise InputError(f"the parameters {names} have no values; give them with .at({names}=...)")
        generators = tuple(float(g) for g in calculus.ring.generators)
        phases = tuple(float(unit) for unit in self.form.units)
        table = table_of(signal, dim, calculus.ring, generators, phases)
        omega = float(self.omega)
        return lambda t: table(omega * np.asarray(t, dtype=float))

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


def with_values(waveform: TrigWaveform, values: Mapping[sp.Symbol, sp.Expr]) -> TrigWaveform:
    """The functions with numbers in place of parameters; phases stay phases, at their values."""
    form = waveform.form

    def replaced(numerator: Any) -> sp.Expr:
        return sp.expand(form.ring.expression(numerator).subs(values))

    exact = {
        i: {p: {key: [replaced(a), replaced(b)] for key, (a, b) in wave.items()} for p, wave in component.items()}
        for i, component in form.signal.components.items()
    }
    ring = CoefficientRing.holding(v for c in exact.values() for w in c.values() for pair in w.values() for v in pair)
    signal = _collected(exact, ring, form.signal.denominator)
    units = tuple(unit.subs(values) for unit in form.units)
    return replace(waveform, form=replace(form, signal=signal, ring=ring, units=units, omega=form.omega.subs(values)))


def _collected(exact: Mapping[int, Any], ring: CoefficientRing, denominator: int) -> TrigSignal:
    """A TrigSignal from SymPy coefficients."""
    common = 1
    for component in exact.values():
        for wave in component.values():
            for pair in wave.values():
                common = math.lcm(common, *(ring.element(value)[1] for value in pair))

    def scaled(value: sp.Expr) -> Any:
        numerator, d = ring.element(value)
        return numerator * (common // d)

    components = {}
    for i, component in exact.items():
        waves = {
            p: clean({key: [scaled(a), scaled(b)] for key, (a, b) in wave.items()}) for p, wave in component.items()
        }
        if waves := {p: wave for p, wave in waves.items() if wave}:
            components[i] = waves
    return TrigSignal(components, denominator * common)


def linear_image(form: TrigForm, matrix: sp.MatrixBase) -> TrigForm:
    """The form of C u: an exact matrix times the functions."""
    entries = [sp.expand(value) for value in matrix.flat()]
    ring = CoefficientRing.holding([*form.ring.generators, *entries])
    signal = moved(form.signal, form.ring, ring)
    elements = [ring.element(value) for value in entries]
    common = int(sp.ilcm(1, *(d for _, d in elements)))
    components: dict[int, Any] = {}
    for r in range(matrix.rows):
        target: dict[int, list[Any]] = {}
        for c, component in signal.components.items():
            numerator, d = elements[r * matrix.cols + c]
            if numerator:
                add_scaled(target, component[0], numerator * (common // d), ring.multiply)
        kept = {key: entry for key, entry in target.items() if entry[0] or entry[1]}
        if kept:
            components[r] = {0: kept}
    scaled = TrigSignal(components, signal.denominator * common)
    return replace(form, signal=scaled, ring=ring, dim=matrix.rows)
