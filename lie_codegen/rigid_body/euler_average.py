"""lc.euler_average: perturbed Euler's equations, averaged over the torque-free motion."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.averaging.near_identity import to_mean
from lie_codegen.errors import InputError
from lie_codegen.groups.build import build
from lie_codegen.kernel.kernel import Kernel
from lie_codegen.kernel.saved import Saved
from lie_codegen.rigid_body import euler_kernels
from lie_codegen.rigid_body.euler_motion import averaged_motion
from lie_codegen.rigid_body.euler_second_order import (
    EulerSolution,
    NearIdentity,
    SecondOrder,
    inside,
    second_order_kernels,
)
from lie_codegen.rigid_body.euler_variational import EulerPerturbation, euler_perturbation
from lie_codegen.rigid_body.free_rigid_body import FreeRigidBody, SlowState, check_slow
from lie_codegen.rigid_body.phase_as_time import cycle_growth, phase_time_kernels
from lie_codegen.rigid_body.phase_quadrature import nodes_for, phase_means
from lie_codegen.runtime.broadcast import broadcast_call
from lie_codegen.runtime.library import Library

NAMESPACE = "euler_average"


class Variational(NamedTuple):
    """Table 2: Omega' = eps F_Omega, k' = eps F_k, phi' = Lambda + eps G."""

    F_Omega: Array
    F_k: Array
    G: Array
    Lambda: Array


class Averaged(NamedTuple):
    """The means over phi of F_Omega [rad/s^2], F_k [1/s] and G [1/s]."""

    F_Omega: Array
    F_k: Array
    G: Array


@dataclass(frozen=True, eq=False, repr=False)
class EulerAverage(Saved):
    """The variational equations of a perturbed free rigid body, and their averages, per unit eps.

    Attributes:
        body: the body.
        perturbation: the exact g_n.
        tolerance: of the trapezoid rule, relative to the size of the averaged functions.
    """

    body: FreeRigidBody
    perturbation: EulerPerturbation
    tolerance: float = 1e-12

    def kernels(self, *, largest_k: float = 0.9, name: str = NAMESPACE) -> tuple[Kernel, ...]:
        """variational, rate and averaged, and terms, near_identity, mean_rate and actual_rate of the second order.

        Args:
            largest_k: where g is not affine, the averages in C take as many fixed phases as rounding accuracy needs up
                to this modulus, by the nome.
            name: C identifier that begins every symbol.
        """
        basic, averages = self._basic(name), self.averaged_kernel(largest_k, name)
        return (*basic, averages, *second_order_kernels(self.perturbation, name))

    def averaged_kernel(self, largest_k: float = 0.9, name: str = NAMESPACE) -> Kernel:
        """(Omega, k) -> averages: Table 3 for affine g, else the trapezoid rule with `nodes_for(largest_k)` phases."""
        return euler_kernels.averaged(self.perturbation, name, nodes_for(largest_k))

    def _basic(self, name: str = NAMESPACE) -> tuple[Kernel, ...]:
        make, g = euler_kernels, self.perturbation
        return make.variational(g, name), make.rate(g, name)

    @cached_property
    def library(self) -> Library:
        """Compiled: variational, rate and, where Table 3 applies, averaged and averaged_rate."""
        rate = euler_kernels.averaged_rate(self.perturbation, NAMESPACE)
        closed = () if rate is None else (self.averaged_kernel(), rate)
        return build((*self._basic(), *closed))

    @cached_property
    def second_order_library(self) -> Library:
        """Compiled: terms, near_identity, mean_rate and actual_rate, loops over phases."""
        return build(second_order_kernels(self.perturbation, NAMESPACE))

    @cached_property
    def third_order_library(self) -> Library:
        """Compiled: terms, near_identity, mean_rate and actual_rate of (Omega, k, s) with the phase as time, to order 3."""
        return build(phase_time_kernels(self.perturbation, NAMESPACE))

    def slow_field(self) -> Kernel:
        """(x, eps, order) -> x' of the averaged (Omega, k), or (Omega, k, tau), which the phase does not enter, for lc.floquet."""
        return next(each for each in second_order_kernels(self.perturbation, NAMESPACE) if each.name == "slow_field")

    def cycle_growth(self, k: float) -> tuple[float, float]:
        """(c3, dk) of a limit cycle k of linear g: Omega' = c3 eps^3 / Omega [rad/s], the cycle moving by dk eps^2 / Omega^2.

        The reversing symmetry leaves no term of order eps^2; forgetting that the cycle itself moves gives another c3.
        """
        return cycle_growth(self.third_order_library, k)

    def second_order(self, Omega: ArrayLike, k: ArrayLike, tau: ArrayLike = 0.0) -> SecondOrder:
        """(F2_Omega, F2_k, G2): mean Omega' = eps F1 + eps^2 F2, phi' = Lambda + eps G1 + eps^2 G2; arguments broadcast.

        Raises:
            InputError: as `variational`.
        """
        self._check(Omega, k)
        _, F2, _, _, G2 = broadcast_call(self.second_order_library["terms"], self.stacked(Omega, k, tau))
        return SecondOrder(F2[..., 0][()], F2[..., 1][()], G2)

    def near_identity(self, Omega: ArrayLike, k: ArrayLike, phi: ArrayLike, tau: ArrayLike = 0.0) -> NearIdentity:
        """(W_Omega, W_k, V): osculating variables are mean ones plus eps times these; arguments broadcast.

        Raises:
            InputError: as `variational`.
        """
        self._check(Omega, k)
        W, V = broadcast_call(self.second_order_library["near_identity"], self.stacked(Omega, k, tau), phi)
        return NearIdentity(W[..., 0][()], W[..., 1][()], V)

    def to_mean(self, Omega: float, k: float, phi: float, eps: float, tau: float = 0.0) -> SlowState:
        """Mean (Omega, k, phi) of osculating ones, by half steps of the fixed point; where eps is too large, at first order.

        Raises:
            InputError: as `variational`.
        """
        self._check(Omega, k)
        return self.mean_point(Omega, k, phi, eps, tau)[0]

    def to_osculating(
        self, Omega: ArrayLike, k: ArrayLike, phi: ArrayLike, eps: float, tau: ArrayLike = 0.0
    ) -> SlowState:
        """Osculating (Omega, k, phi) of mean ones; arguments broadcast."""
        W = self.near_identity(Omega, k, phi, tau)
        values = zip((Omega, k, phi), W, strict=True)
        return SlowState(*(np.asarray(mean, dtype=float) + eps * w for mean, w in values))

    def stacked(self, *columns: ArrayLike) -> Array:
        """(..., 2 or 3) slow variables (Omega, k, tau) as one array, tau only where g depends on it."""
        kept = columns[:2] if self.perturbation.is_autonomous else columns
        return np.stack(np.broadcast_arrays(*(np.asarray(each, dtype=float) for each in kept)), axis=-1)

    def mean_point(self, Omega: float, k: float, phi: float, eps: float, tau: float) -> tuple[SlowState, str]:
        """Mean (Omega, k, phi) of osculating ones, and the status of the map."""
        function = self.second_order_library["near_identity"]

        def maps(y: Array, psi: float) -> tuple[Array, Any]:
            W, V = function(y, psi)
            return np.asarray(W), V

        y, psi, status = to_mean(maps, inside(self.stacked(Omega, k, tau)), float(phi), eps, inside)
        return SlowState(y[0], y[1], np.asarray(psi)[()]), status

    def solve(
        self, omega0: ArrayLike, t: ArrayLike, eps: float, *, order: int = 2, start: str = "mean", rtol: float = 1e-12
    ) -> Any:
        """The motion from omega0 at t[0] by averaging, mean and osculating; what was computed before an event is returned.

        An EulerSolution, or a list of them for a batch of starts.

        Over times of order 1/eps: Omega and k to O(eps^2) with order 2, to O(eps) with order 1; phi to O(eps) with order 2,
        to no order with order 1 (F3 would be needed for more, as phi integrates Lambda along the slow error).

        Args:
            omega0: (3,) [rad/s], or (B, 3) for a list of solutions; a motion about another axis than the body's takes the
                axes and signs that it needs.
            t: (N,) [s], increasing; the first is the start.
            eps: the small number.
            order: 1, 2, or 3 (the phase as time: slow variables to O(eps^3), t and phi one order lower).
            start: "mean" starts at the mean point that belongs to omega0; "osculating" at omega0 itself, as the paper does.
            rtol: of the integration of the averaged system.

        Raises:
            InputError: another order or start; omega0 at rest or on the separatrix.
        """
        if order not in (1, 2, 3) or start not in ("mean", "osculating"):
            raise InputError(f"order is 1, 2 or 3 and start 'mean' or 'osculating', given {order!r}, {start!r}")
        vector, times = np.asarray(omega0, dtype=float), np.atleast_1d(np.asarray(t, dtype=float))
        if vector.ndim == 2:
            return [self._solve(each, times, eps, order, start, rtol) for each in vector]
        return self._solve(vector, times, eps, order, start, rtol)

    def _solve(self, omega0: Array, t: Array, eps: float, order: int, start: str, rtol: float) -> EulerSolution:
        body = self.body.adapted_to(omega0)
        if body == self.body:
            return averaged_motion(self, omega0, t, eps, order, start, rtol)
        other = EulerAverage(body, EulerPerturbation(body.model, self.perturbation.terms), self.tolerance)
        return averaged_motion(other, omega0, t, eps, order, start, rtol)

    @property
    def is_closed(self) -> bool:
        """Whether g is affine in omega, so that Table 3 gives the averages."""
        return self.perturbation.averaged is not None

    def variational(self, Omega: ArrayLike, k: ArrayLike, phi: ArrayLike, tau: ArrayLike = 0.0) -> Variational:
        """(F_Omega, F_k, G, Lambda) at a phase, Table 2; arguments broadcast.

        G has the pole 1/k of polar coordinates at k = 0.

        Raises:
            InputError: Omega not positive, k outside (0, 0.999999].
        """
        self._check(Omega, k)
        return Variational(*broadcast_call(self.library.variational, *self._with_tau((Omega, k, phi), tau)))

    def averaged(self, Omega: ArrayLike, k: ArrayLike, tau: ArrayLike = 0.0) -> Averaged:
        """(F_Omega, F_k, G), averaged over phi: Table 3 where g is affine, else quadrature.

        Raises:
            InputError: as `variational` (k = 0 is allowed where Table 3 applies).
            ComputationError: the quadrature does not converge, for a g with corners.
        """
        if self.is_closed:
            self._check(Omega, k, at_zero=True)
            return Averaged(*broadcast_call(self.library.averaged, *self._with_tau((Omega, k), tau)))
        return self.quadrature(Omega, k, tau)

    def quadrature(self, Omega: ArrayLike, k: ArrayLike, tau: ArrayLike = 0.0, nodes: int | None = None) -> Averaged:
        """The averages by the trapezoid rule in phi, which converges geometrically for smooth g.

        Args:
            Omega, k, tau: as `averaged`.
            nodes: number of phases; None starts from the nome of the largest k and doubles until half of the phases
                give the same means to `tolerance`.
        """
        self._check(Omega, k)

        def functions(phi: Array) -> Array:
            spin, modulus, slow = (np.asarray(x, dtype=np.float64)[..., None] for x in (Omega, k, tau))
            return np.stack(self.variational(spin, modulus, phi, slow)[:3])

        return Averaged(*phase_means(functions, np.asarray(Omega, dtype=np.float64), k, self.tolerance, nodes))

    def rate(self, omega: ArrayLike, eps: ArrayLike, tau: ArrayLike = 0.0) -> Array:
        """omega' (..., 3) of the full equations (3) in the user's axes."""
        return broadcast_call(self.library.rate, *self._with_tau((omega, eps), tau))[0]

    def _with_tau(self, arguments: tuple[Any, ...], tau: ArrayLike) -> tuple[Any, ...]:
        return arguments if self.perturbation.is_autonomous else (*arguments, tau)

    def _check(self, Omega: ArrayLike, k: ArrayLike, *, at_zero: bool = False) -> None:
        check_slow(Omega, k)
        if np.any(np.asarray(Omega, dtype=np.float64) == 0):
            raise InputError("Omega = 0: there is no torque-free motion to average over")
        if not at_zero and np.any(np.asarray(k, dtype=np.float64) == 0):
            raise InputError("k = 0 is the steady spin, the origin of the polar coordinates (k, phi): G has a pole")


def euler_average(
    body: FreeRigidBody,
    terms: Sequence[Any],
    parameters: Mapping[str, Any] | None = None,
    *,
    tolerance: float = 1e-12,
) -> EulerAverage:
    """Perturbed Euler's equations in (Omega, k, phi), and averaged.

    Args:
        body: of lc.free_rigid_body.
        terms: (g_1, g_2, g_3), the perturbing angular accelerations per unit eps [rad/s^2] in the body's axes: texts
            (or SymPy) in w1 w2 w3 [rad/s], dw1 dw2 dw3 [rad/s^2], tau = eps t, and the parameters.
        parameters: name -> number.
        tolerance: of the quadrature, relative.

    Raises:
        InputError: not three terms; a parameter without a value or hiding a variable.
        ExpressionError: a text outside the grammar, with its column.

    Source: Coppola, (24), Tables 2 and 3.
    """
    if not isinstance(body, FreeRigidBody):
        raise InputError(f"expected a body of free_rigid_body, got {type(body).__name__}")
    return EulerAverage(body, euler_perturbation(body.model, terms, parameters), tolerance)
