"""lc.phase_average: second-order averaging with one phase, x' = eps F(x, phi), phi' = Lambda(x) + eps G(x, phi)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.averaging.harmonics import highest_harmonic
from lie_codegen.averaging.near_identity import GOOD, to_mean
from lie_codegen.averaging.phase_kernels import phase_kernels
from lie_codegen.averaging.phase_routine import Nodes, phase_routine
from lie_codegen.averaging.vector_field import FieldBody, formula_field, read_formulas
from lie_codegen.errors import InputError, PeriodError, ShapeError
from lie_codegen.exact.numbers import exact_number
from lie_codegen.groups.build import build
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.definition import definition_of, kernel_factory
from lie_codegen.kernel.kernel import Kernel
from lie_codegen.kernel.saved import Saved
from lie_codegen.runtime.broadcast import broadcast_call
from lie_codegen.runtime.library import Library
from lie_codegen.runtime.ode import REACHED, integrate
from lie_codegen.runtime.ode_field import Field

NAMESPACE = "phase_average"
#: Phases that are tried first.
_NODES = 16


class SlowTerms(NamedTuple):
    """y' = eps F1 + eps^2 F2, each (..., n)."""

    F1: Array
    F2: Array


class PhaseTerms(NamedTuple):
    """psi' = Lambda + eps G1 + eps^2 G2, each (...)."""

    Lambda: Array
    G1: Array
    G2: Array


class NearIdentity(NamedTuple):
    """x = y + eps W, phi = psi + eps V: W (..., n), V (...)."""

    W: Array
    V: Array


@dataclass(frozen=True, eq=False, repr=False)
class PhaseSolution(Saved):
    """A solution by averaging.

    Attributes:
        t: (k,) times; fewer than were asked for where the status says why it ends.
        x: (k, n) osculating slow variables, y + eps W; error O(eps^order) over times of order 1/eps.
        phi: (k,) osculating phase; error O(eps) with order 2, of no order with order 1.
        mean, mean_phase: (k, n), (k,) y and psi.
        status: "ok", or what went wrong.
    """

    t: Array
    x: Array
    phi: Array
    mean: Array
    mean_phase: Array
    status: str


@dataclass(frozen=True, eq=False, repr=False)
class PhaseAverage(Saved):
    """The averaged system of x' = eps F(x, phi), phi' = Lambda(x) + eps G(x, phi), in the zero-mean gauge.

    x = y + eps W(y, psi), phi = psi + eps V(y, psi), <W> = <V> = 0 (F2 and G2 belong to this gauge), with P f the zero-mean
    primitive of f - <f>:

        F1 = <F>,  W = P F / Lambda,  F2 = <F_x W + F_phi V>,
        G1 = <G>,  V = P (G + Lambda_x W) / Lambda,  G2 = <G_x W + G_phi V + Lambda_xx [W, W] / 2>,
        y' = eps F1 + eps^2 F2,  psi' = Lambda + eps G1 + eps^2 G2.

    Attributes:
        F, G, rate, variables, phase, period, order, numbers: as given.
        nodes: phases at which the functions are taken.
    """

    F: tuple[Any, ...]
    G: Any
    rate: Any
    variables: tuple[str, ...]
    phase: str
    period: Any
    order: int
    numbers: Mapping[str, Any] = field(default_factory=dict)
    nodes: int = 32

    def kernels(self, name: str = NAMESPACE) -> tuple[Kernel, ...]:
        """terms, near_identity, mean_rate, actual_rate and slow_field, for lc.build and lc.generate.

        Args:
            name: C identifier that begins every symbol.
        """
        return formula_phase_kernels(
            self.F, self.G, self.rate, self.variables, self.phase, self.period, dict(self.numbers), self.nodes, name
        )

    @property
    def library(self) -> Library:
        """The compiled kernels."""
        return _library(self.kernels())

    def slow_field(self) -> Kernel:
        """(x, eps, order) -> x' of the averaged system, which the phase does not enter, for lc.floquet."""
        return next(each for each in self.kernels() if each.name == "slow_field")

    def terms(self, x: ArrayLike) -> SlowTerms:
        """(F1, F2) at x (..., n)."""
        F1, F2, *_ = broadcast_call(self.library["terms"], self._point(x))
        return SlowTerms(F1, F2)

    def phase_terms(self, x: ArrayLike) -> PhaseTerms:
        """(Lambda, G1, G2) at x (..., n)."""
        return PhaseTerms(*broadcast_call(self.library["terms"], self._point(x))[2:])

    def near_identity(self, x: ArrayLike, phi: ArrayLike) -> NearIdentity:
        """(W, V) at x (..., n) and phi (...)."""
        return NearIdentity(*broadcast_call(self.library["near_identity"], self._point(x), phi))

    def to_mean(self, x: ArrayLike, phi: float, eps: float) -> tuple[Array, float, str]:
        """(y, psi, status) of osculating x (n,), phi."""
        return to_mean(self._map, self._point(x), float(phi), eps)

    def to_osculating(self, y: ArrayLike, psi: ArrayLike, eps: float) -> tuple[Array, Array]:
        """(x, phi) = (y + eps W, psi + eps V); arguments broadcast."""
        W, V = self.near_identity(y, psi)
        return np.asarray(y, dtype=float) + eps * W, np.asarray(psi, dtype=float) + eps * V

    def solve(
        self, x0: ArrayLike, phi0: float, t: ArrayLike, eps: float, *, order: int | None = None, start: str = "mean",
        rtol: float = 1e-12,
    ) -> Any:  # fmt: skip
        """The solution through the osculating (x0, phi0) at t[0]: a PhaseSolution, or a list of them for a batch of starts.

        Args:
            x0: (n,), or (B, n) for a list of solutions.
            phi0: phase at t[0]; a number, or (B,).
            t: times, increasing; the first is the start.
            eps: the small number.
            order: 1 or 2; that of the average if None.
            start: "mean" starts at the mean point y0 with y0 + eps W = x0; "osculating" at x0 itself, which costs a factor of
                15 to 18 in the slow variables and every order of the phase.
            rtol: of the integration of the averaged system.
        """
        order = self.order if order is None else order
        if order not in (1, 2) or start not in ("mean", "osculating"):
            raise InputError(
                f"phase_average: order is 1 or 2 and start 'mean' or 'osculating', given {order!r}, {start!r}"
            )
        point = self._point(x0)
        if point.ndim == 2:
            phases = np.broadcast_to(np.asarray(phi0, dtype=float), len(point))
            pairs = zip(point, phases, strict=True)
            return [self._one(x, float(phi), _times(t), eps, order, start, rtol) for x, phi in pairs]
        return self._one(point, float(phi0), _times(t), eps, order, start, rtol)

    def _one(self, x: Array, phi: float, t: Array, eps: float, order: int, start: str, rtol: float) -> PhaseSolution:
        y, psi, status = self.to_mean(x, phi, eps) if start == "mean" else (x, phi, GOOD)
        n = len(self.variables)
        rate = Field(self.library["mean_rate"], n + 1, time=None, constants={"eps": eps, "order": order})
        motion = integrate(rate, np.append(y, psi), t[0], t[-1], rtol=rtol, atol=1e-13)
        if motion.status != REACHED:
            status = f"the averaged system has no solution beyond t = {motion.t[-1]:.9g}"
        kept = t[t <= motion.t[-1]]
        found = motion.at(kept)
        mean, mean_phase = found[:, :n], found[:, n]
        osculating, phases = self.to_osculating(mean, mean_phase, eps)
        return PhaseSolution(kept, osculating, phases, mean, mean_phase, status)

    def _map(self, y: Array, psi: float) -> tuple[Array, Any]:
        W, V = self.library["near_identity"](y, psi)
        return np.asarray(W), V

    def _point(self, x: ArrayLike) -> Array:
        point = np.asarray(x, dtype=float)
        if not point.ndim or point.shape[-1] != len(self.variables):
            raise ShapeError(f"phase_average: x has shape {point.shape}; the variables are {', '.join(self.variables)}")
        return point


def phase_average(
    F: Sequence[Any],
    *,
    rate: Any,
    G: Any = 0,
    variables: Sequence[str],
    phase: str = "phi",
    period: Any = 1,
    order: int = 2,
    parameters: Mapping[str, Any] | None = None,
    nodes: int | None = None,
) -> PhaseAverage:
    """Average x' = eps F(x, phi), phi' = Lambda(x) + eps G(x, phi) over the phase, to second order.

    Args:
        F: (n,) formulas in the variables, the phase and the parameters.
        rate: Lambda, a formula in the variables.
        G: a formula as F; 0 if not given.
        variables: (n,) names of the slow variables.
        phase: name of the phase.
        period: of F and G in the phase ("2*pi").
        order: 1 or 2, what `solve` takes.
        parameters: name -> number.
        nodes: number of phases; as many as make the last quarter of the Fourier coefficients rounding if None.

    Raises:
        InputError: formulas that cannot be read, another order.
        PeriodError: F or G is not periodic.
        AssumptionError: Fourier coefficients that do not decay: F jumps in the phase.

    Source: Coppola, The method of averaging for Euler's equations of rigid body motion, (19)-(22), with the term Lambda_x W
    in V and the start at the mean point, which the paper leaves out.
    """
    if order not in (1, 2):
        raise InputError(f"phase_average: order is 1 or 2, given {order!r}")
    names, values = tuple(variables), dict(parameters or {})
    terms = tuple(F)
    if len(terms) != len(names):
        raise InputError(f"phase_average: {len(terms)} formulas for the variables {', '.join(names)}")
    field_of, _ = _system(terms, G, rate, names, phase, values)
    length = _length(period)
    if nodes is None:  # twice the phases at which F and G are resolved: products of two of them then are
        nodes = 2 * highest_harmonic(field_of, len(names), (), length, _NODES, "phase_average")[1]
    return PhaseAverage(terms, G, rate, names, phase, period, order, values, nodes)


@kernel_factory()
def formula_phase_kernels(
    F: Sequence[Any], G: Any, rate: Any, variables: Sequence[str], phase: str, period: Any,
    numbers: Mapping[str, Any] | None = None, nodes: int = 32, namespace: str = NAMESPACE,
) -> tuple[Kernel, ...]:  # fmt: skip
    """terms, near_identity, mean_rate and actual_rate of formulas; see `phase_kernels`."""
    both, speed = _system(F, G, rate, variables, phase, numbers)
    length, n = _length(period), len(variables)

    def node(ops: Arithmetic, x: Sequence[Scalar], phi: Scalar) -> tuple[list[Scalar], Scalar]:
        values = both(ops, x, [length * phi])
        return values[:n], values[n] / length

    def clock(ops: Arithmetic, x: Sequence[Scalar]) -> Scalar:
        return speed(ops, x, [])[0] / length

    given = {"F": list(F), "G": G, "rate": rate, "variables": list(variables), "phase": phase, "period": period,
             "numbers": dict(numbers or {}), "nodes": nodes}  # fmt: skip
    key = definition_of("phase", given).text
    routine = phase_routine(f"{namespace}_loop", namespace, node, clock, n, Nodes(((np.inf, nodes),)), key)
    return phase_kernels(routine, node, clock, n, namespace, length)


def _system(
    F: Sequence[Any], G: Any, rate: Any, variables: Sequence[str], phase: str, numbers: Mapping[str, Any] | None
) -> tuple[FieldBody, FieldBody]:
    """(F, G) together, of the variables and the phase, and Lambda of the variables alone."""
    both = read_formulas([*F, G], variables, (phase,), numbers, "phase_average")
    speed = read_formulas([rate], variables, (), numbers, "phase_average: rate")
    return formula_field(both, variables, (phase,)), formula_field(speed, variables, ())


def _length(period: Any) -> float:
    value = float(period) if isinstance(period, float) else float(exact_number(period))
    if not (np.isfinite(value) and value > 0):
        raise PeriodError(f"phase_average: the period {period!r} is not positive")
    return value


@lru_cache(maxsize=64)
def _library(kernels: tuple[Kernel, ...]) -> Library:
    return build(kernels)


def _times(t: ArrayLike) -> Array:
    times = np.atleast_1d(np.asarray(t, dtype=float))
    if times.ndim != 1 or np.any(np.diff(times) <= 0) or not np.all(np.isfinite(times)):
        raise InputError("t: finite, increasing times; the first is the start")
    return np.concatenate([[0.0], times]) if len(times) == 1 and times[0] > 0 else times
