"""The exact average of small gaits: X' = X hat(-A(r) r'), r = r_0 + eps s(t), to any order in eps.

U = sum_k eps^k U_k with U_k = -(1/(k-1)!) D^(k-1) A(r_0)[s, .., s] s'. The Floquet-Magnus recursion takes such series, and as Lambda vanishes at whole
periods, log X(T) = T sum_q eps^q F_q with error O(eps^(p+1)) a period. U_1 is a derivative, so F_1 = 0; F_2 is the curvature at r_0 times the area.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from fractions import Fraction
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.algebra.brackets import bracket, dexp_inverse
from lie_codegen.algebra.lie_algebra import LieAlgebra
from lie_codegen.arrays import Array
from lie_codegen.averaging.gait_path import gait_path
from lie_codegen.averaging.shape_form import ShapeForm
from lie_codegen.errors import InputError
from lie_codegen.flow.batched_exponential import expm
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernel.runge_kutta import ARRAYS, CLASSICAL, increment
from lie_codegen.kernel.saved import Saved
from lie_codegen.mechanics.advected import Advected
from lie_codegen.mechanics.polynomial_fields import Field, PullBackSpace, gathered, integrated
from lie_codegen.mechanics.polynomial_kernels import evaluate
from lie_codegen.shapes import shaped
from lie_codegen.signals.floquet_magnus import Calculus, floquet_magnus

_MOST = 10
#: Points of the circle in the plane of eps from which Taylor coefficients are read, and its radius in units of the gait.
_CIRCLE, _RADIUS = 32, 0.3
_AGREE = 1e-8
_FLOW_STEPS = 32


@dataclass(frozen=True, eq=False, repr=False)
class GaitAverage(Saved):
    """The average of a gait.

    Attributes:
        group: of the body.
        F: (order, n), log X(T) = T sum_q eps^q F_q; with a stored momentum, F_q at mu_b = the spatial momentum, where a run begins.
        T: the period.
        momentum: (n,) mu_1 of mu = eps mu_1, or None.
        fields: with a stored momentum, F_q as fields of mu_b = Ad*_X mu_1.
    """

    group: MatrixGroup
    F: Array
    T: float
    momentum: Array | None = None
    fields: tuple[tuple[Array, Array], ...] = ()

    @property
    def order(self) -> int:
        """p."""
        return len(self.F)

    def log(self, eps: float) -> Array:
        """T sum_q eps^q F_q, (n,): log X(T) of a gait of amplitude eps, without stored momentum.

        Raises:
            InputError: with a stored momentum the averaged motion is no one-parameter group; see `displacement`.
        """
        if self.momentum is not None:
            raise InputError("with a stored momentum the mean velocity changes with the attitude; see displacement")
        return np.asarray(
            self.T * np.polynomial.polynomial.polyval(float(eps), np.vstack([np.zeros(self.group.dim), self.F]))
        )

    def displacement(self, eps: float, periods: int = 1) -> Array:
        """X after whole periods, (d, d)."""
        if self.momentum is None:
            return np.asarray(expm(self.group.hat(periods * self.log(eps))))
        space, terms = _space(self.group, self.order, self.T), [Field(codes, values) for codes, values in self.fields]
        carried = Advected(self.group, "mu", "momentum", self.momentum)
        X = np.eye(self.group.degree, dtype=self.group.basis.dtype)
        n, h = self.group.dim, periods * self.T / (_FLOW_STEPS * periods)

        def velocity(Y: Array) -> Array:
            state = np.concatenate([np.zeros(n), carried.seen(Y)])
            return np.asarray(sum(eps**q * evaluate(space, f, state)[:n] for q, f in enumerate(terms, 1)))

        def slope(X: Array, _: float, theta: Array) -> Array:
            """Theta' of X exp(Theta): Munthe-Kaas's step of fourth order."""
            return dexp_inverse(self.group.algebra, theta, velocity(X @ expm(self.group.hat(theta))))

        for _ in range(_FLOW_STEPS * periods):
            X = X @ expm(self.group.hat(increment(ARRAYS, CLASSICAL, partial(slope, X), np.zeros(n), h)))
        return np.asarray(X)


@dataclass(frozen=True)
class _Sampled:
    """Signals with values in the algebra at equally spaced nodes of a period, (M, n): a Calculus of the recursion."""

    algebra: LieAlgebra
    period: float

    def bracket(self, x: Array, y: Array, *, mean_only: bool = False) -> Array:
        """[x, y] at the nodes."""
        return bracket(self.algebra, x, y)

    def combine(self, terms: Iterable[tuple[Fraction | int, Array]]) -> Array:
        """sum of factor * signal."""
        parts = [float(factor) * signal for factor, signal in terms]
        return np.asarray(sum(parts[1:], parts[0]))

    def mean(self, x: Array) -> Array:
        """The mean, at every node."""
        return np.broadcast_to(x.mean(axis=0), x.shape)

    def primitive(self, x: Array) -> Array:
        """int_0^t."""
        values = integrated(x.T, self.period).T
        return np.asarray(values - values[0])


def gait_average(
    connection: ShapeForm, gait: Any, order: int, centre: ArrayLike | None, momentum: ArrayLike | None
) -> GaitAverage:
    """See `ShapeForm.average`."""
    if isinstance(order, bool) or not isinstance(order, int) or not 1 <= order <= _MOST:
        raise InputError(f"average: order must be an integer from 1 to {_MOST}, got {order!r}")
    path = gait_path(gait, connection.size)
    if path.fourier is None:
        raise InputError(
            "average: the gait has corners; the average takes smooth ones, sums of sines and cosines: see displacement for this one"
        )
    group, middle = connection.group, np.zeros(connection.size) if centre is None else np.asarray(centre, dtype=float)
    highest = max(1, path.fourier.shape[1] - 1)
    M = 4 * order * highest + 1
    times = np.arange(M) * path.T / M
    s, rate = path.at(times)
    terms = _taylor(connection, middle, s, order)  # (order, M, n, k) of A(r_0 + eps s)
    U = [-np.einsum("tnk,tk->tn", a, rate) for a in terms]
    if momentum is not None:
        return _with_momentum(connection, middle, s, U, path.T, order, momentum)
    calculus: Calculus[Array] = _Sampled(group.algebra, path.T)
    series: Any = U
    rates, _ = floquet_magnus(calculus, series, order)
    F = np.array([f[0] for f in rates])
    return GaitAverage(group, F, path.T)


def _taylor(connection: ShapeForm, middle: Array, s: Array, order: int) -> Array:
    return series_on_circle(connection.A, middle, s, order, connection.shape)


def series_on_circle(function: Any, middle: Array, s: Array, order: int, names: tuple[str, ...]) -> Array:
    """(order, M, ...) coefficients of eps^0 .. of function(r_0 + eps s), from values on a circle of complex eps.

    Raises:
        InputError: two circles disagree: the function is singular nearby.
    """
    size = max(float(np.linalg.norm(s, axis=1).max()), 1e-12)
    turn = np.exp(2j * np.pi * np.arange(_CIRCLE) / _CIRCLE)
    found, scale = [], 0.0
    for radius in (_RADIUS / size, 0.6 * _RADIUS / size):
        values = function(middle + (radius * turn)[:, None, None] * s)
        scale = max(scale, float(np.abs(values).max(initial=0.0)))
        coefficients = np.fft.fft(values, axis=0)[:order] / _CIRCLE
        powers = radius ** -np.arange(order, dtype=float)
        found.append((coefficients * powers.reshape(-1, *[1] * (coefficients.ndim - 1))).real)
    first, second = found
    # a coefficient of eps^k counts by what it does at the radius of the circle
    weights = (_RADIUS / size) ** np.arange(order, dtype=float).reshape(-1, *[1] * (first.ndim - 1))
    if np.abs((first - second) * weights).max() > _AGREE * scale:
        raise InputError(
            f"average: the formulas are singular within {_RADIUS:g} of {', '.join(names)} = {np.round(middle, 6).tolist()}: no Taylor series to average"
        )
    return np.asarray(first)


def _space(group: MatrixGroup, order: int, period: float) -> PullBackSpace:
    carried = Advected(group, "mu", "momentum", np.zeros(group.dim))
    rho, r = carried.matrices
    return PullBackSpace(group.algebra.structure_constants, rho, r, order + 1, period)


def _with_momentum(
    connection: ShapeForm, middle: Array, s: Array, U: list[Array], T: float, order: int, momentum: ArrayLike
) -> GaitAverage:
    """xi = -A r' + M_11^-1 mu_b, mu_b = Ad*_X mu: fields whose alpha is affine in the advected momentum."""
    group, n = connection.group, connection.group.dim
    if connection.frame is not None:
        raise InputError(
            "average: a stored momentum is seen from the body's own frame; average the connection as it was given"
        )
    mu = shaped(momentum, (n,), "momentum")
    space = _space(group, order, T)
    inverse = series_on_circle(connection.locked_inverse, middle, s, order, connection.shape)
    own = np.arange(n, dtype=np.int64)
    linear = (own[:, None] + space.places[n:][None, :]).ravel()
    inputs = [
        gathered([(own, U[q].T), (linear, np.moveaxis(inverse[q], 0, -1).reshape(n * n, -1))]) for q in range(order)
    ]
    rates, _ = floquet_magnus(space, inputs, order)
    state = np.concatenate([np.zeros(n), mu])
    F = np.array([evaluate(space, f, state)[:n] for f in rates])
    return GaitAverage(group, F, T, mu, tuple((f.codes, f.values) for f in rates))
