"""lc.time_average: y' = eps f(y, t), f periodic in t, averaged to order 4."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.averaging.harmonics import highest_harmonic, is_trigonometric
from lie_codegen.averaging.near_identity import GOOD, to_mean
from lie_codegen.averaging.time_kernels import time_kernels
from lie_codegen.averaging.time_routine import time_routine
from lie_codegen.averaging.vector_field import FieldBody, formula_field, read_formulas
from lie_codegen.errors import InputError, PeriodError, ShapeError
from lie_codegen.exact.numbers import exact_number
from lie_codegen.groups.build import build
from lie_codegen.kernel.definition import definition_of, kernel_factory
from lie_codegen.kernel.kernel import Kernel
from lie_codegen.kernel.saved import Saved
from lie_codegen.on_demand import sympy as sp
from lie_codegen.runtime.broadcast import broadcast_call
from lie_codegen.runtime.library import Library
from lie_codegen.runtime.ode import REACHED, integrate
from lie_codegen.runtime.ode_field import Field

NAMESPACE = "time_average"
_MOST_ORDER, _SAMPLES = 4, 64


@dataclass(frozen=True, eq=False, repr=False)
class TimeSolution(Saved):
    """A solution by averaging.

    Attributes:
        t: (k,) times; fewer than were asked for where the status says why it ends.
        y: (k, n) z + sum_{q < order} eps^q u_q(z, t); error O(eps^order) over times of order 1/eps.
        mean: (k, n) z.
        status: "ok", or what went wrong.
    """

    t: Array
    y: Array
    mean: Array
    status: str


@dataclass(frozen=True, eq=False, repr=False)
class TimeAverage(Saved):
    """The averaged system of y' = eps f(y, t; eps) in the zero-mean gauge: z' = sum eps^q F_q(z), y = z + sum eps^q u_q(z, t).

    F_1 is unique; F_2 and above belong to the gauge <u_q> = 0, and stroboscopic averages differ from them.

    Attributes:
        rates, variables, period, order, numbers: as given.
        nodes: times at which f and its derivatives are taken.
        exact: whether f is a trigonometric polynomial in t, so that means and primitives over the nodes are exact.
    """

    rates: tuple[Any, ...]
    variables: tuple[str, ...]
    period: Any
    order: int
    numbers: Mapping[str, Any] = field(default_factory=dict)
    nodes: int = 32
    exact: bool = False

    def kernels(self, name: str = NAMESPACE) -> tuple[Kernel, ...]:
        """terms, near_identity (order > 1), mean_rate and actual_rate, for lc.build and lc.generate.

        Args:
            name: C identifier that begins every symbol.
        """
        return formula_time_kernels(
            self.rates, self.variables, self.period, self.order, dict(self.numbers), self.nodes, name
        )

    @property
    def library(self) -> Library:
        """The compiled kernels."""
        return _library(self.kernels())

    def slow_field(self) -> Kernel:
        """(z, eps) -> z' of the averaged system, for lc.floquet."""
        return next(each for each in self.kernels() if each.name == "mean_rate")

    def terms(self, y: ArrayLike) -> tuple[Array, ...]:
        """(F_1, .., F_order) at y (..., n), each (..., n)."""
        F = broadcast_call(self.library["terms"], self._point(y))[0]
        return tuple(F[..., q, :] for q in range(self.order))

    def near_identity(self, z: ArrayLike, t: ArrayLike) -> tuple[Array, ...]:
        """(u_1, .., u_{order-1}) at z (..., n) and t (...), each (..., n)."""
        if self.order == 1:
            return ()
        u = broadcast_call(self.library["near_identity"], self._point(z), t)[0]
        return tuple(u[..., q, :] for q in range(self.order - 1))

    def to_osculating(self, z: ArrayLike, t: ArrayLike, eps: float) -> Array:
        """z + sum eps^q u_q(z, t)."""
        total = self._point(z).copy()
        for q, u in enumerate(self.near_identity(z, t), 1):
            total = total + eps**q * u
        return np.asarray(total)

    def to_mean(self, y: ArrayLike, t: float, eps: float) -> tuple[Array, str]:
        """(z, status) with z + sum eps^q u_q(z, t) = y (n,)."""
        if self.order == 1:
            return self._point(y), GOOD
        function = self.library["near_identity"]

        def maps(z: Array, _: float) -> tuple[Array, Any]:
            u = np.asarray(function(z, float(t)))
            return np.asarray(eps ** np.arange(self.order - 1) @ u), 0.0

        z, _, status = to_mean(maps, self._point(y), 0.0, eps)
        return z, status

    def solve(self, y0: ArrayLike, t: ArrayLike, eps: float, *, start: str = "mean", rtol: float = 1e-12) -> Any:
        """The solution through y0 at t[0]: a TimeSolution, or a list of them for a batch of starts.

        Args:
            y0: (n,), or (B, n) for a list of solutions.
            t: (k,) increasing; the first is the start (0 where one time is given).
            eps: the small number.
            start: "mean" starts at z0 with z0 + sum eps^q u_q = y0; "osculating" at y0 itself.
            rtol: of the integration of the averaged system.
        """
        times = np.atleast_1d(np.asarray(t, dtype=float))
        if np.any(np.diff(times) <= 0) or not np.all(np.isfinite(times)):
            raise InputError("time_average: t must be finite, increasing times; the first is the start")
        if start not in ("mean", "osculating"):
            raise InputError(f"time_average: start is 'mean' or 'osculating', given {start!r}")
        times = np.array([0.0, times[0]]) if len(times) == 1 else times
        point = self._point(y0)
        if point.ndim == 2:
            return [self._one(each, times, eps, start, rtol) for each in point]
        return self._one(point, times, eps, start, rtol)

    def _one(self, y: Array, t: Array, eps: float, start: str, rtol: float) -> TimeSolution:
        z, status = self.to_mean(y, t[0], eps) if start == "mean" else (y, GOOD)
        rate = Field(self.library["mean_rate"], len(y), state="z", time=None, constants={"eps": eps})
        motion = integrate(rate, z, t[0], t[-1], rtol=rtol, atol=1e-14)
        if motion.status != REACHED:
            status = f"the averaged system has no solution beyond t = {motion.t[-1]:.9g}"
        kept = t[t <= motion.t[-1]]
        mean = motion.at(kept)
        return TimeSolution(kept, self.to_osculating(mean, kept, eps), mean, status)

    def _point(self, y: ArrayLike) -> Array:
        point = np.asarray(y, dtype=float)
        if not point.ndim or point.shape[-1] != len(self.variables):
            raise ShapeError(f"time_average: y has shape {point.shape}; the variables are {', '.join(self.variables)}")
        return point


def time_average(
    rates: Sequence[Any],
    *,
    variables: Sequence[str],
    period: Any = "2*pi",
    order: int = 2,
    parameters: Mapping[str, Any] | None = None,
    nodes: int | None = None,
) -> TimeAverage:
    """Average y' = eps f(y, t), f of period T in t, to order 1, 2, 3 or 4.

    Exact (to rounding) where f is a trigonometric polynomial in t, whatever it is in y; spectral otherwise.

    Args:
        rates: (n,) formulas in the variables, t, eps and the parameters.
        variables: (n,) names.
        period: T.
        order: p; F_1 .. F_p and u_1 .. u_{p-1} then give y to O(eps^p) over times of order 1/eps.
        parameters: name -> number.
        nodes: number of times; as many as are needed if None.

    Raises:
        InputError: formulas that cannot be read, an order that is not 1 to 4.
        PeriodError: f has not that period.
        AssumptionError: Fourier coefficients that do not decay: f jumps in t.
    """
    if isinstance(order, bool) or order not in range(1, _MOST_ORDER + 1):
        raise InputError(f"time_average: order is 1 to {_MOST_ORDER}, given {order!r}")
    names, values, terms = tuple(variables), dict(parameters or {}), tuple(rates)
    if len(terms) != len(names):
        raise InputError(f"time_average: {len(terms)} formulas for the variables {', '.join(names)}")
    needed, exact = _enough_nodes(terms, names, values, _length(period), order)
    return TimeAverage(terms, names, period, order, values, needed if nodes is None else nodes, exact)


@kernel_factory()
def formula_time_kernels(
    rates: Sequence[Any], variables: Sequence[str], period: Any, order: int, numbers: Mapping[str, Any] | None = None,
    nodes: int = 32, namespace: str = NAMESPACE,
) -> tuple[Kernel, ...]:  # fmt: skip
    """terms, near_identity, mean_rate and actual_rate of formulas; see `time_kernels`."""
    field_of, length, n = _field(rates, variables, numbers), _length(period), len(variables)
    given = {"rates": list(rates), "variables": list(variables), "period": period, "order": order,
             "numbers": dict(numbers or {}), "nodes": nodes}  # fmt: skip
    key = definition_of("time", given).text
    routine = time_routine(f"{namespace}_loop", namespace, field_of, n, length, order, nodes, key)
    return time_kernels(routine, field_of, n, order, length, namespace)


def _field(rates: Sequence[Any], variables: Sequence[str], numbers: Mapping[str, Any] | None) -> FieldBody:
    return formula_field(_read(rates, variables, numbers), [*variables, "eps"], ("t",))


def _read(rates: Sequence[Any], variables: Sequence[str], numbers: Mapping[str, Any] | None) -> tuple[sp.Expr, ...]:
    return read_formulas(rates, [*variables, "eps"], ("t",), numbers, "time_average")


def _length(period: Any) -> float:
    value = float(period) if isinstance(period, float) else float(exact_number(period))
    if not (np.isfinite(value) and value > 0):
        raise PeriodError(f"time_average: the period {period!r} is not positive")
    return value


def _enough_nodes(
    rates: Sequence[Any], variables: Sequence[str], numbers: Mapping[str, Any], length: float, order: int
) -> tuple[int, bool]:
    """(nodes, exact): F_q needs more than q times the highest harmonic of f, u_q more than 2 (q - 1) times it."""
    read, t = _read(rates, variables, numbers), sp.Symbol("t", real=True)
    field_of = formula_field(read, [*variables, "eps"], ("t",))
    highest, _ = highest_harmonic(field_of, len(variables), (0.1,), length, _SAMPLES, "time_average")
    exact = all(is_trigonometric(each, t) for each in read)
    # derivatives in y of what is no polynomial have more harmonics above rounding than f has
    needed = (1 if exact else 2) * max(2 * (order - 1), order) * max(highest, 1) + 2
    return needed + needed % 2, exact


@lru_cache(maxsize=64)
def _library(kernels: tuple[Kernel, ...]) -> Library:
    return build(kernels)
