"""The averaged fields of a mechanical system under (1/eps) u(t / eps), any order.

With tau = t / eps, U^a a primitive of u^a and xi = w + U^a Y_a(Gamma) (exact: lifts that are free of xi commute), dw/dtau = eps G with

    G = X + U^a [Y_a, X] - U^a U^b <Y_a : Y_b> / 2,     <Y_a : Y_b> = [Y_a, [X, Y_b]],

without remainder, since X is at most quadratic in xi. Flows as pull-back operators obey Phi*' = Phi* (eps G), which is X' = eps X U with
the bracket of fields in place of the algebra's: the Floquet-Magnus recursion runs unchanged and gives F_q and Lambda_q. As maps the order is reversed,

    y(t) = shift(tau) o flow_1(sum eps^q Lambda_q(tau)) o flow_t(sum eps^(q-1) F_q) (z_0).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.errors import InputError
from lie_codegen.kernel.saved import Saved
from lie_codegen.mechanics.mechanical_system import MechanicalSystem
from lie_codegen.mechanics.polynomial_fields import Field, FieldSpace, PullBackSpace, gathered
from lie_codegen.signals.floquet_magnus import floquet_magnus
from lie_codegen.signals.periodic_input import PeriodicInput

GAUGES = ("zero_mean", "pull_back")
MOST = 5
#: Coefficients of a field below this part of the drift's are zero by symmetry.
_ZERO = 1e-12
_SAMPLES = 1024


@dataclass(frozen=True, eq=False)
class Fourier:
    """Real periodic signals of zero mean, sum_{0 < n <= H} 2 Re(c_an e^{i n w tau}).

    Attributes:
        coefficients: (m, H + 1) complex c_an, those of n = 0 zero.
        period: T.
    """

    coefficients: Array
    period: float

    @property
    def highest(self) -> int:
        """H."""
        return int(self.coefficients.shape[1]) - 1

    def values(self, tau: Array) -> Array:
        """(..., m) at times (...)."""
        n = np.arange(self.coefficients.shape[1])
        waves = np.exp(2j * np.pi / self.period * np.asarray(tau, dtype=float)[..., None] * n)
        return np.asarray(2 * (waves @ self.coefficients.T).real)

    def primitive(self) -> Fourier:
        """The primitives of zero mean."""
        n = np.arange(self.coefficients.shape[1])
        factor = np.zeros(len(n), dtype=complex)
        factor[1:] = self.period / (2j * np.pi * n[1:])
        return Fourier(self.coefficients * factor, self.period)

    def centre(self) -> float | None:
        """An instant about which every signal is even; None where there is none."""
        size = np.abs(self.coefficients).max(initial=0.0)
        rows, waves = np.nonzero(np.abs(self.coefficients) > 1e-12 * size)
        if not len(rows):
            return 0.0
        c, n, w = self.coefficients[rows, waves], waves, 2 * np.pi / self.period
        # c e^{i n w s} must be real for all of them; the first one leaves 2 n candidates
        for k in range(2 * int(n[0])):
            instant = (-np.angle(c[0]) + k * np.pi) / (n[0] * w)
            if np.all(np.abs((c * np.exp(1j * n * w * instant)).imag) <= 1e-10 * np.abs(c)):
                return float(instant % self.period)
        return None


def fourier_of(u: PeriodicInput) -> tuple[Fourier, Array]:
    """The oscillating part of an input and its mean (m,).

    Raises:
        InputError: an input that is no trigonometric polynomial, or has parameters without values.
    """
    if u.symbols:
        raise InputError(
            f"vibrational_average: the parameters {', '.join(map(str, u.symbols))} of u have no values; use u.at(...)"
        )
    if not u.exact:
        raise InputError(
            "vibrational averages take sums of sines and cosines; approximate the input first, as with "
            "PeriodicInput.from_fourier(cosines, sines, period=...)"
        )
    period = float(u.period)
    waves = np.fft.rfft(u(np.arange(_SAMPLES) * period / _SAMPLES).T, axis=1) / _SAMPLES
    size = np.abs(waves).max(initial=0.0)
    waves[np.abs(waves) <= 1e-14 * size] = 0
    harmonics = np.flatnonzero(np.abs(waves).max(axis=0) > 0)
    highest = int(harmonics[-1]) if len(harmonics) else 0
    if highest > _SAMPLES // 4:
        raise InputError(
            f"u has harmonics up to the {highest}th: it is no short sum of sines and cosines; truncate its series first"
        )
    mean = waves[:, 0].real.copy()
    waves[:, 0] = 0
    return Fourier(waves[:, : highest + 1], period), mean


@dataclass(frozen=True, eq=False, repr=False)
class MechanicalFields(Saved):
    """The fields of an average, with doubles for coefficients.

    Attributes:
        system: what is averaged.
        forcing: u.
        order: p.
        gauge: "zero_mean" or "pull_back".
        constant: (m,) a constant force b_a constant^a besides, as the mean of u.
    """

    system: MechanicalSystem
    forcing: Fourier
    order: int
    gauge: str
    constant: Array

    @cached_property
    def nodes(self) -> int:
        """Nodes of the period: no harmonic of G_q, of degree 2 q H, falls on another that is kept, nor on the mean."""
        p, H = self.order, max(1, self.forcing.highest)
        return max(2 * p * H, 4 * (p - 1) * H) + 1

    @cached_property
    def times(self) -> Array:
        """(M,) the nodes."""
        return np.arange(self.nodes) * self.forcing.period / self.nodes

    @cached_property
    def space(self) -> FieldSpace:
        """Where the brackets are taken."""
        rho, r = self.system.advection
        kind = FieldSpace if self.gauge == "zero_mean" else PullBackSpace
        degree = max(sum(e) for terms in self.system.acceleration for e, _ in terms)
        degree = max(degree, 2, *(sum(e) + 1 for lift in self.system.lifts for terms in lift for e, _ in terms))
        # G holds products of two lifts with the drift; a bracket raises the degree by at most one beside the sum
        most = self.order * (2 * degree + 2)
        return kind(self.system.group.algebra.structure_constants, rho, r, most, self.forcing.period)

    @cached_property
    def lifts(self) -> tuple[Field, ...]:
        """Y_a."""
        n = self.system.dim
        return tuple(
            self.space.field((n + a, e, v) for a, terms in enumerate(lift) for e, v in terms)
            for lift in self.system.lifts
        )

    @cached_property
    def drift(self) -> Field:
        """X, with the constant forces."""
        n, space = self.system.dim, self.space
        one = np.eye(space.variables, dtype=int)
        own = space.field(
            [(i, one[i], 1.0) for i in range(n)]
            + [(n + a, e, v) for a, terms in enumerate(self.system.acceleration) for e, v in terms]
        )
        return space.combine([(1, own), *((float(c), lift) for c, lift in zip(self.constant, self.lifts, strict=True))])

    @cached_property
    def primitive(self) -> Array:
        """(m, M) U^a at the nodes, in the gauge."""
        values = self.forcing.primitive().values(self.times).T
        return values if self.gauge == "zero_mean" else values - values[:, :1]

    def shift(self, tau: Array) -> Array:
        """(..., m) U^a at any fast time."""
        U = self.forcing.primitive()
        values = U.values(tau)
        return values if self.gauge == "zero_mean" else values - U.values(np.zeros(()))

    @cached_property
    def brackets(self) -> tuple[Field, ...]:
        """[Y_a, X]."""
        return tuple(self.space.bracket(lift, self.drift) for lift in self.lifts)

    def product(self, a: int, b: int) -> Field:
        """<Y_a : Y_b> = [Y_a, [X, Y_b]]."""
        return self.space.combine([(-1, self.space.bracket(self.lifts[a], self.brackets[b]))])

    @cached_property
    def pulled_back(self) -> Field:
        """G at the nodes."""
        U, m = self.primitive, len(self.lifts)
        parts = [(self.drift.codes, self.drift.values)]
        parts += [(b.codes, b.values * U[a]) for a, b in enumerate(self.brackets)]
        for a in range(m):
            for b in range(a, m):
                product = self.product(a, b)
                # the pair (a, b) stands twice in the double sum unless a = b
                parts.append((product.codes, product.values * (U[a] * U[b] * (-0.5 if a == b else -1.0))))
        return gathered(parts)

    @cached_property
    def solution(self) -> tuple[list[Field], list[Field]]:
        """([F_1 .. F_p], [Lambda_1 .. Lambda_{p-1}]); F_q whose vanishing follows from symmetry are empty."""
        rates, logarithms = floquet_magnus(self.space, self.pulled_back, self.order)
        size = np.abs(self.drift.values).max()
        rates = [
            gathered([]) if q in self.symmetric or np.abs(f.values).max(initial=0.0) <= _ZERO * size else f
            for q, f in enumerate(rates, start=1)
        ]
        return rates, logarithms

    @cached_property
    def symmetric(self) -> tuple[int, ...]:
        """Orders that vanish because all U^a are even about one instant: reversal of time takes z to itself there."""
        if self.gauge != "zero_mean" or self.forcing.primitive().centre() is None:
            return ()
        return tuple(range(2, self.order + 1, 2))
