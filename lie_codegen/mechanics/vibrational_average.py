"""lc.vibrational_average: a vibrated mechanical system, averaged; exact fields with numbers on demand."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, overload

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.errors import ComputationError, InputError
from lie_codegen.groups.build import build
from lie_codegen.kernel.kernel import Kernel
from lie_codegen.kernel.saved import Saved
from lie_codegen.mechanics.bracket_series import BracketTerm, bracket_series, word_text
from lie_codegen.mechanics.lagrangian import LagrangianSystem
from lie_codegen.mechanics.lagrangian_average import LagrangianSeries, series_kernels
from lie_codegen.mechanics.mechanical_average import MechanicalAverage, mechanical_average
from lie_codegen.mechanics.mechanical_system import MechanicalSystem
from lie_codegen.mechanics.routh import RouthReduction
from lie_codegen.mechanics.vector_fields import Field
from lie_codegen.mechanics.vibrational_fields import VibrationalFields, vibrational_fields
from lie_codegen.mechanics.vibrational_kernels import term_kernels, vibrational_kernels
from lie_codegen.runtime.broadcast import broadcast_call
from lie_codegen.runtime.library import Library
from lie_codegen.signals.periodic_reader import PeriodicLike, as_periodic

NAMESPACE = "vibrational"
#: Coordinates up to which brackets are symbols: beyond, and beyond order 2, they are taken by dual numbers.
_SYMBOLIC = 2


@dataclass(frozen=True, eq=False, repr=False)
class VibrationalAverage(Saved):
    """The averaged system of y' = X(y) + (1/eps) Y_a(q) u^a(t / eps).

    Attributes:
        fields: everything exact: drift, lifts, brackets, products, P.
    """

    fields: VibrationalFields | LagrangianSeries

    @property
    def Z(self) -> list[Field]:
        """[Z_1, .., Z_order], exact: z' = Z_1 + eps Z_2. Of three coordinates and more symbols take minutes: `term` has the numbers.

        Raises:
            InputError: an order above 2, which has no symbolic form.
        """
        return self._exact.Z

    @cached_property
    def _exact(self) -> VibrationalFields:
        return self.fields if isinstance(self.fields, VibrationalFields) else self.fields.exact()

    @property
    def table(self) -> tuple[BracketTerm, ...]:
        """(order, bracket, coefficient) of every bracket in Z = sum eps^(q-1) sum coefficient * bracket."""
        given = self.fields
        inputs = given.inputs if isinstance(given, VibrationalFields) else given.series.inputs
        series = bracket_series(inputs, given.order, given.gauge)
        return tuple(
            BracketTerm(q, word_text(word, len(inputs)), value)
            for q, rate in enumerate(series.rates, start=1)
            for word, value in rate.items()
        )

    def term(self, q: int, z: ArrayLike, parameters: Mapping[str, ArrayLike] | None = None) -> Array:
        """Z_q(z), (..., 2n); q = 1 .. order.

        Raises:
            InputError: there is no such order.
        """
        if isinstance(q, bool) or not isinstance(q, int) or not 1 <= q <= self.fields.order:
            raise InputError(f"the terms of this average are those of order 1 to {self.fields.order}, got {q!r}")
        return broadcast_call(self.library[f"term_{q}"], z, *self._values(parameters))[0]

    def kernels(self, name: str = NAMESPACE) -> tuple[Kernel, ...]:
        """rate, actual, estimate, estimate_first, reconstruct and term_1 .., for lc.build and lc.generate.

        Args:
            name: C identifier that begins every symbol.
        """
        if isinstance(self.fields, LagrangianSeries):
            return series_kernels(self.fields, name)
        return (*vibrational_kernels(self.fields, name), *term_kernels(self.fields, name))

    @cached_property
    def library(self) -> Library:
        """The compiled kernels."""
        return build(self.kernels())

    def rate(self, z: ArrayLike, eps: ArrayLike, parameters: Mapping[str, ArrayLike] | None = None) -> Array:
        """Z_1(z) + eps Z_2(z), (..., 2n).

        Args:
            z: (..., 2n) averaged state (q, v).
            eps: (...) ratio of the time scales.
            parameters: a value for each name that stayed symbolic.

        Raises:
            InputError: eps not positive, or a parameter that is missing or unknown.
        """
        return self._call("rate", (z, eps), eps, parameters)

    def actual(
        self, y: ArrayLike, tau: ArrayLike, eps: ArrayLike, parameters: Mapping[str, ArrayLike] | None = None
    ) -> Array:
        """y' of the actual system at fast time tau = t / eps, (..., 2n)."""
        return self._call("actual", (y, tau, eps), eps, parameters)

    def estimate(
        self,
        y: ArrayLike,
        tau: ArrayLike,
        eps: ArrayLike,
        parameters: Mapping[str, ArrayLike] | None = None,
        *,
        floquet_map: bool = True,
    ) -> Array:
        """The averaged state of an actual one, (24): z = P(tau)^{-1} Phi(tau)^{-1} y, within O(eps^2).

        Args:
            y, tau, eps, parameters: as `actual`.
            floquet_map: False leaves P out: within O(eps) only.
        """
        return self._call("estimate" if floquet_map else "estimate_first", (y, tau, eps), eps, parameters)

    def reconstruct(
        self, z: ArrayLike, tau: ArrayLike, eps: ArrayLike, parameters: Mapping[str, ArrayLike] | None = None
    ) -> Array:
        """The actual state of an averaged one at the fast time tau = t / eps, (15): y = Phi(tau) P(tau) z."""
        return self._call("reconstruct", (z, tau, eps), eps, parameters)

    def solve(
        self,
        z0: ArrayLike,
        t: ArrayLike,
        eps: float,
        parameters: Mapping[str, float] | None = None,
        rtol: float = 1e-11,
    ) -> Array:
        """The averaged system from z0 at t[0]: (N, 2n) at times t."""
        given = self._values(parameters)
        rate = self.library["rate"]
        return integrate(lambda time, z: rate(z, eps, *given), z0, t, rtol)

    def solve_actual(
        self,
        y0: ArrayLike,
        t: ArrayLike,
        eps: float,
        parameters: Mapping[str, float] | None = None,
        rtol: float = 1e-11,
    ) -> Array:
        """The actual system from y0 at t[0], where the fast time is t[0] / eps: (N, 2n) at times t."""
        given = self._values(parameters)
        rate = self.library["actual"]
        step = eps * float(self.fields.period) / 12
        return integrate(lambda time, y: rate(y, time / eps, eps, *given), y0, t, rtol, step)

    def actual_motion(self, eps: float) -> tuple[Kernel, str, float]:
        """For lc.floquet: the kernel of the actual system, the name of its fast time, and the period of the forces in slow time."""
        actual = next(kernel for kernel in self.kernels() if kernel.name == "actual")
        return actual, "tau", eps * float(self.fields.period)

    def start(
        self, y0: ArrayLike, eps: float, parameters: Mapping[str, ArrayLike] | None = None, tau: float = 0.0
    ) -> Array:
        """The averaged state that belongs to an actual start: y0 itself at tau = 0 in the pull-back gauge."""
        return self.estimate(y0, tau, eps, parameters, floquet_map=self.fields.order >= 2)

    def _call(
        self, name: str, arguments: tuple[Any, ...], eps: ArrayLike, parameters: Mapping[str, ArrayLike] | None
    ) -> Array:
        if np.any(np.asarray(eps, dtype=np.float64) <= 0):
            raise InputError("eps must be positive")
        return broadcast_call(self.library[name], *arguments, *self._values(parameters))[0]

    def _values(self, parameters: Mapping[str, Any] | None) -> list[Any]:
        given = dict(parameters or {})
        names = [str(p) for p in self.fields.parameters]
        missing = [name for name in names if name not in given]
        if missing:
            raise InputError(
                f"parameters: {', '.join(missing)} stayed symbolic and needs a value: parameters={{{missing[0]!r}: ...}}"
            )
        unknown = sorted(set(given) - set(names))
        if unknown:
            raise InputError(f"parameters: {unknown[0]!r} is unknown; symbolic here: {', '.join(names) or 'none'}")
        return [given[name] for name in names]


@overload
def vibrational_average(
    system: MechanicalSystem, u: PeriodicLike, order: int = 2, gauge: str = "zero_mean", *, mean_to_drift: bool = False
) -> MechanicalAverage: ...


@overload
def vibrational_average(
    system: LagrangianSystem | RouthReduction,
    u: PeriodicLike,
    order: int = 2,
    gauge: str = "zero_mean",
    *,
    mean_to_drift: bool = False,
) -> VibrationalAverage: ...


def vibrational_average(
    system: Any,
    u: PeriodicLike,
    order: int = 2,
    gauge: str = "zero_mean",
    *,
    mean_to_drift: bool = False,
) -> Any:
    """The averaged system of a mechanical system under fast, strong, periodic inputs (1/eps) u(t / eps).

    Args:
        system: of lc.mechanical_system (on a group, any order up to 5), lc.lagrangian_system or lc.routh_reduce.
        u: lc.PeriodicInput (or its formulas) in fast time, one component an input of the system, of zero mean.
        order: 1 to 4; on a group 1 to 5.
        gauge: "zero_mean" or "pull_back" (the averaged state equals the actual one at the start of each period).
        mean_to_drift: apply the mean of u as a constant force, not divided by eps.

    Raises:
        InputError: an input of non-zero mean, or a system that is not at most quadratic in the velocities.

    Source: Sanyal, Bloch and McClamroch, (14)-(17), (22)-(24), corrected.
    """
    u = as_periodic(u, "vibrational_average")
    if isinstance(system, MechanicalSystem):
        return mechanical_average(system, u, order, gauge, mean_to_drift=mean_to_drift)
    inner = system.system if isinstance(system, RouthReduction) else system
    if isinstance(inner, LagrangianSystem) and (order > 2 or len(inner.coordinates) > _SYMBOLIC):
        return VibrationalAverage(LagrangianSeries(inner, u, order, gauge, mean_to_drift))
    return VibrationalAverage(vibrational_fields(system, u, order=order, gauge=gauge, mean_to_drift=mean_to_drift))


def integrate(rate: Any, start: ArrayLike, t: ArrayLike, rtol: float, largest_step: float = np.inf) -> Array:
    """(N, dim) at times t of y' = rate(t, y), by an explicit method of order 8.

    Raises:
        ComputationError: the integration fails.
    """
    from scipy.integrate import solve_ivp

    times = np.atleast_1d(np.asarray(t, dtype=np.float64))
    if times.ndim != 1 or len(times) < 2 or np.any(np.diff(times) <= 0):
        raise InputError("t: at least two increasing times; the first is the start")
    result = solve_ivp(
        rate, (times[0], times[-1]), np.asarray(start, dtype=np.float64), method="DOP853", t_eval=times, rtol=rtol,
        atol=rtol, max_step=largest_step,
    )  # fmt: skip
    if not result.success:
        raise ComputationError(f"the integration failed: {result.message}")
    solution: Array = result.y.T
    return solution
