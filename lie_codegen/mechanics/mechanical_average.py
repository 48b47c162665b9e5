"""The average of a mechanical system on a group under fast, strong inputs, as lc.vibrational_average gives it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.errors import InputError, ShapeError
from lie_codegen.groups.build import build
from lie_codegen.kernel.kernel import Kernel
from lie_codegen.kernel.renaming import in_namespace
from lie_codegen.kernel.saved import Saved
from lie_codegen.mechanics.averaging_map import AveragingMap
from lie_codegen.mechanics.effective_potential import EffectivePotential, effective_potential
from lie_codegen.mechanics.mechanical_fields import GAUGES, MOST, MechanicalFields, fourier_of
from lie_codegen.mechanics.mechanical_kernels import (
    actual_kernel,
    actual_step,
    average_step,
    loop_kernel,
    rate_kernel,
    reconstruct_kernel,
)
from lie_codegen.mechanics.mechanical_run import GroupRun, run, states_of
from lie_codegen.mechanics.mechanical_system import MechanicalSystem
from lie_codegen.on_demand import sympy as sp
from lie_codegen.runtime.library import Library
from lie_codegen.signals.periodic_input import PeriodicInput


class GroupState(NamedTuple):
    """A configuration and a body velocity, or arrays of them."""

    X: Array
    xi: Array


@dataclass(frozen=True, eq=False, repr=False)
class VibrationalOrderCheck(Saved):
    """Errors of the orders 1 .. p at the end of a run of fixed length, always at one fast phase.

    Attributes:
        eps: (k,) decreasing.
        errors: (p, k) largest difference of any entry of X, xi to the actual state.
        slopes: (p, k - 1) between neighbours.
        t: the length of the run.
    """

    eps: Array
    errors: Array
    slopes: Array
    t: float


@dataclass(frozen=True, eq=False, repr=False)
class MechanicalAverage(Saved):
    """The averaged system of J xi' = ad*_xi J xi + f - D xi + (1/eps) b_a u^a(t / eps), X' = X hat(xi), to any order.

    The averaged state z = (X, xi) moves by X' = X hat(alpha), xi' = beta with (alpha, beta) = sum_q eps^(q-1) F_q: from order 2
    on alpha is not xi, and the averaged system is no mechanical system. A run starts at `estimate` of the actual start, which
    is the start itself for gauge="pull_back" and t = 0 alone.

    Attributes:
        system, u, order, gauge: what was averaged and how.
        constant: (m,) mean of u that acts as a constant force.
    """

    system: MechanicalSystem
    u: PeriodicInput
    order: int
    gauge: str
    constant: Array

    @cached_property
    def fields(self) -> MechanicalFields:
        """F_q and Lambda_q as polynomials."""
        return MechanicalFields(self.system, fourier_of(self.u)[0], self.order, self.gauge, self.constant)

    @cached_property
    def _map(self) -> AveragingMap:
        return AveragingMap(self.fields)

    @property
    def symmetric(self) -> tuple[int, ...]:
        """Orders that vanish by symmetry: the even ones, where all primitives are even about one instant."""
        return self.fields.symmetric

    def term(self, q: int, xi: ArrayLike, X: ArrayLike | None = None, **advected: ArrayLike) -> Array:
        """F_q at a state: (..., 2, n), alpha in the first row and beta in the second.

        Args:
            q: 1 .. order.
            xi: (..., n).
            X: (..., d, d) configuration, in place of advected vectors.
            **advected: the vectors by name, G=(0, 0, 1).
        """
        self._check_order(q)
        return self._map.value(self.fields.solution[0][q - 1], self._map.state(xi, X, advected))

    def correction(
        self, q: int, tau: ArrayLike, xi: ArrayLike, X: ArrayLike | None = None, **advected: ArrayLike
    ) -> Array:
        """Lambda_q at fast time tau, (..., 2, n); q = 1 .. order - 1."""
        self._check_order(q, self.order - 1)
        state = self._map.state(xi, X, advected)
        when = np.broadcast_to(np.asarray(tau, dtype=float), state.shape[:-1])
        field = self.fields.solution[1][q - 1]
        return self._map.value(field, state, self._map.at(field, when))

    def rate(self, xi: ArrayLike, eps: ArrayLike, X: ArrayLike | None = None, **advected: ArrayLike) -> Array:
        """sum_q eps^(q-1) F_q, (..., 2, n): X' = X hat(alpha), xi' = beta."""
        state = self._map.state(xi, X, advected)
        power = np.asarray(eps, dtype=float)[..., None, None]
        terms = [power**q * self._map.value(f, state) for q, f in enumerate(self.fields.solution[0])]
        return np.asarray(sum(terms[1:], terms[0]))

    def estimate(self, X: ArrayLike, xi: ArrayLike, tau: ArrayLike, eps: ArrayLike) -> GroupState:
        """The averaged state of an actual one at fast time tau: z = flow_1(-Lambda(tau)) o shift(tau)^-1 (y).

        Args:
            X: (..., d, d); xi: (..., n).
            tau: (...) t / eps.
            eps: (...) positive.
        """
        return GroupState(*self._map.estimated(X, xi, tau, eps, self.order))

    def reconstruct(self, X: ArrayLike, xi: ArrayLike, tau: ArrayLike, eps: ArrayLike) -> GroupState:
        """The actual state of an averaged one: y = shift(tau) o flow_1(Lambda(tau)) (z)."""
        return GroupState(*self._map.reconstructed(X, xi, tau, eps, self.order))

    def solve(self, X0: ArrayLike, xi0: ArrayLike, t: ArrayLike, eps: float, *, tolerance: float = 1e-11) -> GroupRun:
        """The averaged system from the averaged state (X0, xi0) at t[0], compiled.

        Args:
            X0: (d, d); xi0: (n,): z(t[0]), the `estimate` of an actual start.
            t: (k,) increasing times; or the end of a run from 0.
            eps: positive.
            tolerance: on all entries, by halving the step.

        Raises:
            NotOnGroupError: X0 is off the group; ComputationError: the tolerance is not met.
        """
        return self._solved("average_step", X0, xi0, t, eps, tolerance)

    def solve_actual(
        self, X0: ArrayLike, xi0: ArrayLike, t: ArrayLike, eps: float, *, tolerance: float = 1e-11
    ) -> GroupRun:
        """The actual system from (X0, xi0) at t[0], where the fast time is t[0] / eps."""
        return self._solved("actual_step", X0, xi0, t, eps, tolerance)

    def predict(self, X0: ArrayLike, xi0: ArrayLike, t: ArrayLike, eps: float, *, tolerance: float = 1e-11) -> GroupRun:
        """The actual states by the average: estimate the start, solve, reconstruct at every time; error O(eps^order)."""
        return self._predicted(X0, xi0, states_of(t), eps, tolerance, self.order)

    def order_check(
        self,
        X0: ArrayLike,
        xi0: ArrayLike,
        t: float = 1.0,
        *,
        cycles: tuple[int, ...] = (4, 8, 16, 32),
        phase: float = 1.3,
    ) -> VibrationalOrderCheck:
        """Errors of all orders up to this one at time t for eps = t / (N T + phase), N in `cycles`.

        The fast phase at the end is the same for every eps: with a free one the leading coefficient of the error would differ from run
        to run, and slopes would scatter. The series is asymptotic: look here before believing a high order.
        """
        period = self.fields.forcing.period
        eps = np.array([t / (N * period + phase) for N in cycles])
        errors = np.zeros((self.order, len(eps)))
        for k, small in enumerate(eps):
            actual = self.solve_actual(X0, xi0, [0.0, t], float(small), tolerance=1e-12)
            for q in range(self.order):
                found = self._predicted(X0, xi0, np.array([0.0, t]), float(small), 1e-12, q + 1)
                errors[q, k] = max(np.abs(found.X[-1] - actual.X[-1]).max(), np.abs(found.xi[-1] - actual.xi[-1]).max())
        slopes = np.diff(np.log(errors), axis=1) / np.diff(np.log(eps))
        return VibrationalOrderCheck(eps, errors, slopes, t)

    @cached_property
    def _potential(self) -> EffectivePotential:
        return effective_potential(self.system, self.u)

    @property
    def effective_potential(self) -> sp.Expr | None:
        """V + lambda_ab dphi_a J^-1 dphi_b / 2 in the advected names, lambda_ab = mean U^a U^b; None: see `no_potential`."""
        return self._potential.value

    @property
    def no_potential(self) -> str | None:
        """Why there is no effective potential."""
        return self._potential.reason

    def kernels(self, name: str | None = None) -> tuple[Kernel, ...]:
        """rate, actual, estimate, reconstruct, for lc.build and lc.generate.

        Args:
            name: C identifier that begins every symbol; vibration if None.
        """
        kernels = (
            rate_kernel(self.fields),
            actual_kernel(self.fields),
            reconstruct_kernel(self.fields, back=True),
            reconstruct_kernel(self.fields, back=False),
        )
        return in_namespace(kernels, name)

    def loop(self, eps: float) -> Kernel:
        """The actual system as (y, t) -> y', y = (xi, advected vectors), of period `period(eps)`: for lc.floquet."""
        if not eps > 0:
            raise InputError(f"eps must be positive, got {eps!r}")
        return loop_kernel(self.fields, float(eps))

    def period(self, eps: float) -> float:
        """Of the actual forces, in slow time."""
        return float(eps) * self.fields.forcing.period

    @cached_property
    def library(self) -> Library:
        """The compiled kernels."""
        return build(self.kernels())

    @cached_property
    def _steps(self) -> dict[str, Any]:
        return {}

    def _predicted(
        self, X0: ArrayLike, xi0: ArrayLike, times: Array, eps: float, tolerance: float, order: int
    ) -> GroupRun:
        """By F_1 .. F_order and Lambda_1 .. Lambda_{order - 1} alone."""
        z = self._map.estimated(X0, xi0, times[0] / eps, eps, order)
        averaged = self._solved("average_step", *z, times, eps, tolerance, order)
        X, xi = self._map.reconstructed(averaged.X, averaged.xi, times / eps, eps, order)
        return replace(averaged, X=X, xi=xi)

    def _solved(
        self, name: str, X0: ArrayLike, xi0: ArrayLike, t: ArrayLike, eps: float, tolerance: float, order: int = MOST
    ) -> GroupRun:
        small = float(eps)
        if not small > 0:
            raise InputError(f"eps must be positive, got {eps!r}")
        if name not in self._steps:
            make: Callable[[MechanicalFields], Kernel] = average_step if name == "average_step" else actual_step
            self._steps[name] = build([make(self.fields)])[name]
        if name == "actual_step":
            # a step sees a part of the period alone, before halving begins
            numbers: dict[str, Any] = {"eps": small}
            longest = self.fields.forcing.period * small / 16
        else:
            powers = [small**q if q < order else 0.0 for q in range(self.order)]
            numbers, longest = {"weights": np.array(powers)}, np.inf
        return run(self.system, self._steps[name], X0, xi0, states_of(t), numbers, small, tolerance, longest)

    def _check_order(self, q: int, most: int | None = None) -> None:
        most = self.order if most is None else most
        if isinstance(q, bool) or not isinstance(q, int | np.integer) or not 1 <= q <= most:
            raise InputError(f"the terms of this average are those of order 1 to {most}, got {q!r}")


def mechanical_average(
    system: MechanicalSystem, u: PeriodicInput, order: int, gauge: str, *, mean_to_drift: bool
) -> MechanicalAverage:
    """The average of a system on a group; see `vibrational_average`.

    Raises:
        InputError: an order above 5, an input of non-zero mean or of another number of components, an unknown gauge.
    """
    if isinstance(order, bool) or not isinstance(order, int) or order < 1:
        raise InputError(f"vibrational_average: order must be a positive integer, got {order!r}")
    if order > MOST:
        raise InputError(
            f"vibrational_average: order {order} is refused: beyond order {MOST} the fields have too many terms, and the series is asymptotic; "
            "make eps smaller instead"
        )
    if gauge not in GAUGES:
        raise InputError(f"vibrational_average: no gauge {gauge!r}; choose one of {', '.join(map(repr, GAUGES))}")
    if u.dim != len(system.inputs):
        raise ShapeError(f"vibrational_average: u has {u.dim} components, the system has {len(system.inputs)} inputs")
    _, mean = fourier_of(u)
    if np.any(np.abs(mean) > 1e-14) and not mean_to_drift:
        raise InputError(
            f"vibrational_average: u has the mean {mean.tolist()}, which over eps is a force that grows without bound; subtract it, or pass "
            "mean_to_drift=True to apply it as a constant force, not divided by eps"
        )
    average = MechanicalAverage(system, u, order, gauge, mean if mean_to_drift else np.zeros(len(mean)))
    return average
