"""Formulas on successive intervals as one exact periodic waveform."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np

from lie_codegen.errors import InputError
from lie_codegen.on_demand import sympy as sp
from lie_codegen.signals.coefficients import CoefficientRing
from lie_codegen.signals.piecewise_signal import Pieces, PiecewiseCalculus, ring_values
from lie_codegen.signals.signal_values import PiecewiseValues, expressions_of, table_of
from lie_codegen.signals.trig_formula import Census, NotTrigonometricError, Reader, base_rate
from lie_codegen.signals.trig_signal import Brackets, TrigCalculus, TrigSignal
from lie_codegen.signals.waveform import moved


@dataclass(frozen=True)
class PiecewiseWaveform:
    """n periodic functions, each a polynomial with sines and cosines on every piece; exact.

    Attributes:
        pieces: the functions in tau = omega (t - start of the piece).
        ring: of their coefficients.
        units: the phases of the keys.
        omega: the base rate of the sines and cosines, 1 if there are none.
        ends: (m,) ends of the pieces, in t.
        dim: n.
        order: the parameters as the user gave them.
    """

    pieces: Pieces
    ring: CoefficientRing
    units: tuple[sp.Expr, ...]
    omega: sp.Expr
    ends: tuple[sp.Expr, ...]
    dim: int
    order: tuple[sp.Symbol, ...] = ()

    @property
    def exact(self) -> bool:
        """True."""
        return True

    @property
    def has_formula(self) -> bool:
        """False: there is no one formula in t."""
        return False

    @property
    def period(self) -> sp.Expr:
        """T."""
        return self.ends[-1]

    @cached_property
    def parameters(self) -> tuple[sp.Symbol, ...]:
        """The parameters that occur."""
        used = set().union(*(e.free_symbols for e in (*self.ring.generators, *self.units, self.omega)))
        return tuple(s for s in self.order if s in used)

    @property
    def lengths(self) -> tuple[sp.Expr, ...]:
        """Of the pieces, in tau."""
        starts = (sp.S.Zero, *self.ends[:-1])
        return tuple(sp.expand(self.omega * (b - a)) for a, b in zip(starts, self.ends, strict=True))

    def calculus(self, brackets: Brackets, dim: int) -> tuple[PiecewiseCalculus, Pieces]:
        """The operations with these structure constants, and the functions as signals of theirs."""
        constants = [value for row in brackets.values() for value in row.values()]
        ring = CoefficientRing.holding([*self.ring.generators, *constants])
        pieces = tuple(moved(piece, self.ring, ring) for piece in self.pieces)
        return PiecewiseCalculus(brackets, ring, self.lengths), pieces

    def expressions(self, calculus: PiecewiseCalculus, signal: Pieces, dim: int, time: sp.Expr) -> sp.ImmutableMatrix:
        """(dim, 1) a constant signal, exactly."""
        first = expressions_of(signal[0], dim, calculus.ring, sp.S.Zero, self.units)
        varying = [c for piece in signal for c in piece.components.values() if set(c) != {0}]
        if varying or any(piece.components != signal[0].components for piece in signal):
            raise InputError("an input in pieces has no one formula in t; evaluate it instead")
        return first

    def integral(self, calculus: PiecewiseCalculus, signal: Pieces, dim: int) -> sp.ImmutableMatrix:
        """(dim, 1) the integral over one period, in tau."""
        total = calculus.integral(signal)
        return expressions_of(total, dim, calculus.ring, sp.S.Zero, self.units).applyfunc(sp.expand)

    def evaluator(self, calculus: PiecewiseCalculus, signal: Pieces, dim: int) -> PiecewiseValues:
        """A signal as a function of t; at a joint, the piece that begins."""
        if self.parameters:
            names = ", ".join(map(str, self.parameters))
            raise InputError(f"the parameters {names} have no values")
        generators = tuple(float(g) for g in calculus.ring.generators)
        phases = tuple(float(unit) for unit in self.units)
        tables = tuple(table_of(piece, dim, calculus.ring, generators, phases) for piece in signal)
        return PiecewiseValues(float(self.omega), np.array([float(end) for end in self.ends]), tables)

    def vanishes(self, calculus: PiecewiseCalculus, signal: Pieces) -> bool:
        """Whether a signal is identically zero."""
        return all(piece.is_zero for piece in signal)


def piecewise_waveform(
    ends: Sequence[sp.Expr], formulas: Sequence[Sequence[sp.Expr]], time: sp.Symbol, order: Sequence[sp.Symbol]
) -> PiecewiseWaveform:
    """The waveform of formulas in t on [0, ends[0]), [ends[0], ends[1]), ...

    Raises:
        NotTrigonometricError: if a formula is no polynomial in t with sines and cosines of commensurate rates.
    """
    starts = [sp.S.Zero, *ends[:-1]]
    split = [
        [_by_powers(formula.subs(time, start + _local())) for formula in row]
        for start, row in zip(starts, formulas, strict=True)
    ]
    census = Census(_local())
    for row in split:
        for parts in row:
            for part in parts.values():
                census.visit(part)
    omega = base_rate(list(census.rates), None, "PeriodicInput.from_pieces") if census.rates else sp.S.One
    lengths = [sp.expand(omega * (b - a)) for a, b in zip(starts, ends, strict=True)]
    held = [*census.coefficients, 1 / omega, *ring_values(lengths)]
    ring = CoefficientRing.holding(sp.expand(value) for value in held)
    units = tuple(sp.Mul(sp.Rational(1, q), unit) for unit, q in census.units.items())
    reader = Reader(_local(), ring, dict(zip(census.units, range(len(units)), strict=True)), census.units, omega)
    pieces = tuple(_piece(row, reader, ring, omega) for row in split)
    return PiecewiseWaveform(pieces, ring, units, omega, tuple(ends), len(split[0]), tuple(order))


@cache
def _local() -> sp.Symbol:
    """Time within a piece."""
    return sp.Symbol("s", real=True)


def _by_powers(formula: sp.Expr) -> dict[int, sp.Expr]:
    """power of s -> coefficient, which holds s in sines and cosines alone."""
    collected = sp.collect(sp.expand(formula), _local(), evaluate=False)
    parts: dict[int, sp.Expr] = {}
    for monomial, coefficient in collected.items():
        power = sp.degree(monomial, _local()) if monomial.has(_local()) else 0
        if monomial != _local() ** power:
            raise NotTrigonometricError(str(formula))
        parts[int(power)] = coefficient
    return parts


def _piece(row: Sequence[dict[int, sp.Expr]], reader: Reader, ring: CoefficientRing, omega: sp.Expr) -> TrigSignal:
    calculus = TrigCalculus({}, ring)
    terms = []
    for i, parts in enumerate(row):
        for power, part in parts.items():
            wave, denominator = reader.read(part)
            scale, scale_den = ring.element(sp.expand(omega**-power))
            scaled = {
                key: [ring.multiply(scale, a) if a else 0, ring.multiply(scale, b) if b else 0]
                for key, (a, b) in wave.items()
            }
            terms.append((1, TrigSignal({i: {power: scaled}}, denominator * scale_den)))
    return calculus.combine(
        [(f, t) for f, t in terms if any(t.components[i][p] for i, c in t.components.items() for p in c)]
    )
