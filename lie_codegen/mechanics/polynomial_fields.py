"""Polynomial vector fields on a group and its velocities, with coefficients that are periodic in time.

The state is s = (xi, Gamma) beside X: X' = X hat(alpha), xi' = beta, and advected vectors Gamma' = -(rho(alpha) Gamma + r(alpha)), as directions
and points of space seen from the body. A field V = (alpha(s), beta(s)) has 2n polynomials in s for components; such fields are closed under

    [V, W] = DW.V - DV.W + ([alpha_V, alpha_W], 0),     D.V the derivative along (beta_V, -rho(alpha_V) Gamma - r(alpha_V)),

and nothing of the attitude but Gamma ever appears. A `Field` keeps its nonzero coefficients alone, by an integer that says component and exponents,
each as values at equally spaced nodes of a period: products of signals are products of values, exact as long as no harmonic is aliased.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.errors import InputError

#: A coefficient below this part of the largest one of its field is rounding.
NEGLIGIBLE = 1e-14
_LARGEST_CODE = 2**62


@dataclass(frozen=True, eq=False)
class Field:
    """Coefficients of 2n polynomials.

    Attributes:
        codes: (K,) increasing; code = (sum_v e_v base^v) 2n + component, of the space it belongs to.
        values: (K, M) at M nodes of the period, or (K, 1) constants.
    """

    codes: Array
    values: Array


@dataclass(frozen=True, eq=False)
class FieldSpace:
    """What a bracket of fields needs: the algebra and how vectors are advected.

    Attributes:
        structure: (n, n, n) c_ijk of [A_i, A_j] = c_ijk A_k.
        advection: (n, k, k) rho(A_i).
        offset: (n, k) r(A_i).
        degree: the largest exponent that will be met.
        period: T of the signals.
    """

    structure: Array
    advection: Array
    offset: Array
    degree: int
    period: float

    def __post_init__(self) -> None:
        if self.base**self.variables * 2 * self.dim > _LARGEST_CODE:
            raise InputError(
                f"{self.variables} variables of degree up to {self.degree} are too many for this average: lower the order, or advect fewer vectors"
            )

    @property
    def dim(self) -> int:
        """n."""
        return int(self.structure.shape[0])

    @property
    def variables(self) -> int:
        """n + k, those of s."""
        return self.dim + int(self.advection.shape[1])

    @property
    def base(self) -> int:
        """Of the code of exponents."""
        return self.degree + 1

    @cached_property
    def places(self) -> Array:
        """(n + k,) what one exponent more of each variable adds to the code."""
        return 2 * self.dim * self.base ** np.arange(self.variables, dtype=np.int64)

    def exponents(self, codes: Array) -> Array:
        """(K, n + k)."""
        powers: Array = (codes[:, None] // self.places) % self.base
        return powers

    def components(self, codes: Array) -> Array:
        """(K,) 0 .. n-1 of alpha, n .. 2n-1 of beta."""
        return codes % (2 * self.dim)

    def field(self, entries: Iterable[tuple[int, Sequence[int], float]]) -> Field:
        """The constant field of (component, exponents, coefficient) triples."""
        rows = list(entries)
        codes = np.array([c + int(np.dot(self.places, e)) for c, e, _ in rows], dtype=np.int64)
        return gathered([(codes, np.array([[v] for *_, v in rows], dtype=float).reshape(-1, 1))])

    def rates(self, field: Field) -> list[Field]:
        """For each variable of s its rate of change along the field, as scalar polynomials (codes of component 0)."""
        n, component = self.dim, self.components(field.codes)
        result = []
        for i in range(n):
            mine = component == n + i
            result.append(Field(field.codes[mine] - n - i, field.values[mine]))
        angles = [Field(field.codes[component == i] - i, field.values[component == i]) for i in range(n)]
        for a in range(self.variables - n):
            parts = [
                (angle.codes + self.places[n + b], -self.advection[i, a, b] * angle.values)
                for i, angle in enumerate(angles)
                for b in range(self.variables - n)
                if self.advection[i, a, b] != 0
            ]
            parts += [
                (angle.codes, -self.offset[i, a] * angle.values)
                for i, angle in enumerate(angles)
                if self.offset[i, a] != 0
            ]
            result.append(gathered(parts))
        return result

    def bracket(self, V: Field, W: Field, *, mean_only: bool = False) -> Field:
        """[V, W], or its mean over the period."""
        pairs: list[tuple[Field, Field]] = []
        for moved, along, sign in ((W, V, 1.0), (V, W, -1.0)):
            exponents = self.exponents(moved.codes)
            for v, rate in enumerate(self.rates(along)):
                has = exponents[:, v] > 0
                if len(rate.codes) and np.any(has):
                    slope = sign * exponents[has, v, None] * moved.values[has]
                    pairs.append((Field(moved.codes[has] - self.places[v], slope), rate))
        return _sum_of_products([*pairs, *self._turned(V, W)], mean_only=mean_only)

    def _turned(self, V: Field, W: Field) -> list[tuple[Field, Field]]:
        """[alpha_V, alpha_W]: for each j the field with components sum_i c_ijk alpha_V^i, and the scalar alpha_W^j."""
        n, pairs = self.dim, []
        component_V, component_W = self.components(V.codes), self.components(W.codes)
        for j in range(n):
            scalar = component_W == j
            if not np.any(scalar):
                continue
            parts = [
                (V.codes[component_V == i] - i + k, self.structure[i, j, k] * V.values[component_V == i])
                for i, k in np.argwhere(self.structure[:, j, :])
            ]
            turned = gathered(parts)
            if len(turned.codes):
                pairs.append((turned, Field(W.codes[scalar] - j, W.values[scalar])))
        return pairs

    def combine(self, terms: Iterable[tuple[Fraction | int | float, Field]]) -> Field:
        """sum of factor * field."""
        return gathered([(f.codes, float(factor) * f.values) for factor, f in terms])

    def mean(self, x: Field) -> Field:
        """The mean over a period, as a constant field."""
        return pruned(Field(x.codes, x.values.mean(axis=1, keepdims=True)))

    def primitive(self, x: Field) -> Field:
        """The integral of zero mean, of a field of zero mean."""
        return pruned(Field(x.codes, integrated(x.values, self.period)))


class PullBackSpace(FieldSpace):
    """The same with primitives that vanish at time 0: averaged and actual states are equal at whole periods."""

    def primitive(self, x: Field) -> Field:
        """int_0^t of a field of zero mean."""
        values = integrated(x.values, self.period)
        return pruned(Field(x.codes, values - values[:, :1]))


def integrated(values: Array, period: float) -> Array:
    """The zero-mean primitive of a periodic signal of zero mean, from its values at equally spaced nodes."""
    waves = np.fft.rfft(values, axis=-1)
    factors = np.zeros(waves.shape[-1], dtype=complex)
    factors[1:] = period / (2j * np.pi * np.arange(1, waves.shape[-1]))
    return np.asarray(np.fft.irfft(waves * factors, n=values.shape[-1], axis=-1))


def gathered(parts: Sequence[tuple[Array, Array]]) -> Field:
    """One field of lists of codes and values, equal codes added."""
    parts = [part for part in parts if len(part[0])]
    if not parts:
        return Field(np.zeros(0, dtype=np.int64), np.zeros((0, 1)))
    codes, inverse = np.unique(np.concatenate([codes for codes, _ in parts]), return_inverse=True)
    values = np.zeros((len(codes), max(v.shape[1] for _, v in parts)))
    first = 0
    for own, v in parts:
        # within one part no code stands twice, so that an indexed sum is safe
        values[inverse[first : first + len(own)]] += v
        first += len(own)
    return pruned(Field(codes, values))


def pruned(field: Field) -> Field:
    """Without the coefficients that are rounding."""
    if not len(field.codes):
        return field
    size = np.abs(field.values).max(axis=1)
    kept = size > NEGLIGIBLE * size.max()
    return field if kept.all() else Field(field.codes[kept], field.values[kept])


def _sum_of_products(pairs: Sequence[tuple[Field, Field]], *, mean_only: bool) -> Field:
    """sum of field * scalar."""
    sums = [field.codes[:, None] + scalar.codes[None, :] for field, scalar in pairs]
    if not sums:
        return gathered([])
    codes, flat = np.unique(np.concatenate([each.ravel() for each in sums]), return_inverse=True)
    nodes = 1 if mean_only else max(max(p.values.shape[1], s.values.shape[1]) for p, s in pairs)
    values, first = np.zeros((len(codes), nodes)), 0
    for (field, scalar), each in zip(pairs, sums, strict=True):
        at = flat[first : first + each.size].reshape(each.shape)
        first += each.size
        if mean_only:
            np.add.at(values[:, 0], at, _mean_products(field.values, scalar.values))
            continue
        # codes within one row or column of `each` differ: loop over the shorter side, add whole vectors of signals
        if each.shape[0] <= each.shape[1]:
            for row, signal in zip(at, field.values, strict=True):
                values[row] += signal * scalar.values
        else:
            for column, signal in zip(at.T, scalar.values, strict=True):
                values[column] += signal * field.values
    return pruned(Field(codes, values))


def _mean_products(a: Array, b: Array) -> Array:
    """(K, L) means of all products of K signals with L."""
    if a.shape[1] == 1 or b.shape[1] == 1:
        return np.asarray(a.mean(axis=1)[:, None] * b.mean(axis=1)[None, :])
    return np.asarray(a @ b.T / a.shape[1])
