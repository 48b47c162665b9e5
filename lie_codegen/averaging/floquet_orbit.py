"""lc.floquet: periodic orbits of y' = f(y, t) and y' = f(y), and of closed loops, their multipliers and their stability."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import Any, Protocol, runtime_checkable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lie_codegen.arrays import Array
from lie_codegen.averaging.loop_orbit import loop_orbit
from lie_codegen.averaging.orbit_kernels import formula_orbit_kernels, kernel_orbit_kernels
from lie_codegen.averaging.orbit_newton import Linearised, OrbitSystem, found_orbit
from lie_codegen.averaging.vector_field import read_formulas
from lie_codegen.control.loop_result import ClosedLoop
from lie_codegen.errors import InputError, NotFiniteError
from lie_codegen.groups.build import build
from lie_codegen.kernel.kernel import Kernel
from lie_codegen.kernel.saved import Saved
from lie_codegen.runtime.library import Library
from lie_codegen.runtime.ode import Motion
from lie_codegen.runtime.rows import row_by_row
from lie_codegen.shapes import shaped

#: At an equilibrium of a driven system one step may be the period, while Df goes with t.
_PANELS = 48


@dataclass(frozen=True, eq=False, repr=False)
class Orbit(Linearised, Saved):
    """A periodic orbit and its linearisation over a period.

    Attributes:
        start: (n,) a point of it, at t = t0 where the system is driven.
        period: T.
        multipliers: (n,) eigenvalues of the monodromy matrix M(T), largest modulus first; of an autonomous orbit one of them
            is 1, along the flow. Each is known to 1e-9 of itself or so, however far below the others it lies.
        exponents: (n,) log(multipliers) / T, imaginary parts in (-pi/T, pi/T]; known also where a multiplier is below 1e-308.
        monodromy: (n, n) M(T), whose entries are known to rounding of the largest.
        autonomous: whether f does not depend on t, so that T was found too.
        residual: |y(T) - y(0)|.
        liouville: |product of the multipliers - exp int tr Df| over exp int tr Df: what the integration is good for.
        mean_jacobian: (n, n) Df averaged along the orbit. Where f = eps g its eigenvalues are those of the averaged system
            to O(eps^2), beside `exponents`.
        kernels: rate, jacobian and variational, for lc.build and lc.generate.
    """

    start: Array
    period: float
    multipliers: NDArray[np.complex128]
    exponents: NDArray[np.complex128]
    monodromy: Array
    autonomous: bool
    residual: float
    liouville: float
    mean_jacobian: Array
    kernels: tuple[Kernel, ...] = field(repr=False)

    @property
    def averaged_exponents(self) -> NDArray[np.complex128]:
        """(n,) eigenvalues of the mean of Df along the orbit, largest real part first: the exponents to first order, f = eps g."""
        values = np.linalg.eigvals(self.mean_jacobian).astype(complex)
        return np.asarray(values[np.argsort(-values.real)])

    def at(self, t: ArrayLike) -> Array:
        """The orbit: (...,) times, from 0 at `start` -> (..., n)."""
        return self._motion.at(np.mod(np.asarray(t, dtype=float), self.period))

    @cached_property
    def _motion(self) -> Motion:
        return _system(self.kernels).motion(self.start, self.period)


@runtime_checkable
class AveragedFlow(Protocol):
    """An average whose slow variables have a flow of their own: of lc.phase_average, lc.time_average, lc.euler_average."""

    def slow_field(self) -> Kernel:
        """(x, eps[, order]) -> x'."""


@runtime_checkable
class AveragedMotion(Protocol):
    """An average over a free motion, whose slow variables are told by that motion: of lc.tumbling_average."""

    def slow_flow(self, X: ArrayLike, omega: ArrayLike) -> tuple[Kernel, Array, Array]:
        """The field of the slow variables, their values on the motion through (X, omega), and their units."""


@runtime_checkable
class VibratedMotion(Protocol):
    """An average of a vibrated system that knows the actual one: of lc.vibrational_average."""

    def actual_motion(self, eps: float) -> tuple[Kernel, str, float]:
        """(y, fast time, eps, ...) -> y' of the actual system, the name of the fast time, and the period in slow time."""


def floquet(
    rates: Sequence[Any] | Kernel | VibratedMotion | AveragedFlow | AveragedMotion | ClosedLoop,
    variables: Sequence[str] | None = None,
    guess: ArrayLike | None = None,
    *,
    period: Any = None,
    parameters: Mapping[str, Any] | None = None,
    transient: bool = True,
    return_to: ArrayLike | None = None,
) -> Any:
    """The periodic orbit of y' = f(y, t) near a guess, and its Floquet multipliers: eigenvalues of the linearised flow over T.

    Newton's method on the flow with its variational equation, integrated in C to 1e-13: (M - 1) d = y - Phi(y); where T is
    unknown the column f is appended and d is held orthogonal to the flow.

    Args:
        rates: n formulas in the variables, t and the parameters; or a kernel whose first input is y, with an input t or
            none, and whose first output is y' (`parameters` then gives its other inputs); or a vibrational average, whose
            actual system it then is, the true loop (`parameters` gives eps; its period is known); or an average of
            lc.phase_average, lc.time_average or lc.euler_average, whose slow flow it then is, differentiated exactly
            (`parameters` gives eps, and order 1 or 2 where there is a phase); or one of lc.tumbling_average, whose guess is
            (X, omega) and whose slow variables are (H, D); or a run of lc.closed_loop
            on a matrix group, whose last state is the guess: then X' = X hat(xi), and a `LoopOrbit` is returned.
        variables: (n,) names.
        guess: (n,) a point near the orbit; of several orbits the answer is the one that belongs to the guess.
        period: T where f depends on t ("2*pi/1.4"); without it f must not.
        parameters: name -> number.
        transient: where T is unknown, follow the motion until it nearly returns before Newton starts; False takes the first
            return, for orbits that are not attracting.
        return_to: (n,) normal of the section through the guess on which `start` lies; f(guess) if None.

    Raises:
        InputError: formulas that cannot be read, a guess at rest.
        PeriodError: f depends on t and no period is given, or f has not that period.
        ComputationError: no return, an equilibrium in place of an orbit, or Newton's method does not converge.
    """
    if isinstance(rates, ClosedLoop):
        if variables is not None or guess is not None or parameters is not None or return_to is not None:
            raise InputError(
                "floquet: of a closed loop only period= and transient= are taken; its last state is the guess"
            )
        return loop_orbit(rates, period, transient)
    if isinstance(rates, VibratedMotion):
        eps = float((parameters or {}).get("eps", np.nan))
        if not eps > 0:
            raise InputError("floquet: a vibrated system needs parameters={'eps': ...}, the ratio of its time scales")
        actual, fast_time, own = rates.actual_motion(eps)
        kernels = kernel_orbit_kernels(actual, dict(parameters or {}), fast_time, 1 / eps)
        period = own if period is None else period
        driven = True
    elif isinstance(rates, AveragedMotion):
        return _orbit_of_motion(rates, guess, period, transient, return_to)
    else:
        kernels = _read(rates, variables, parameters)
        driven = _is_driven(rates, kernels)
    n = kernels[0].inputs[0].size
    section = None if return_to is None else _start(return_to, n)
    return _orbit(kernels, _start(guess, n), period, driven, section, transient)


def _orbit(
    kernels: tuple[Kernel, ...], guess: Array, period: Any, driven: bool, section: Array | None, transient: bool
) -> Orbit:
    system = _system(kernels)
    start, length, residual, monodromy, logs = found_orbit(system, guess, period, driven, section, transient)
    motion = system.motion(start, length)
    nodes, weights = _nodes(np.union1d(motion.t, np.linspace(0, length, _PANELS + 1)))
    mean = np.tensordot(weights, row_by_row(system.library.jacobian, motion.at(nodes), nodes)[0], 1) / length
    # the product of the multipliers, and exp int tr Df, may lie below every double: their ratio does not
    liouville = abs(float(np.expm1(logs.real.sum() - length * np.trace(mean))))
    return Orbit(
        start, length, np.exp(logs), logs / length, monodromy, not driven, residual, liouville, mean, kernels
    )  # fmt: skip


def _nodes(t: Array) -> tuple[Array, Array]:
    """Gauss' six nodes between any two of the times, and their weights: steps of the motion are short where Df changes fast."""
    x, w = np.polynomial.legendre.leggauss(6)
    half = np.diff(t)[:, None] / 2
    return ((t[:-1, None] + half) + half * x).ravel(), (half * w).ravel()


def _orbit_of_motion(average: AveragedMotion, guess: Any, period: Any, transient: bool, return_to: Any) -> Orbit:
    """The orbit in units of the slow variables, in which all are of size 1, told in their own."""
    if not isinstance(guess, list | tuple) or len(guess) != 2:
        raise InputError("floquet: the guess of an average over a free motion is (X, omega)")
    kernel, start, scale = average.slow_flow(*guess)
    section = None if return_to is None else _start(return_to, len(start)) * scale
    driven = len(kernel.inputs) > 1
    found = _orbit(
        kernel_orbit_kernels(kernel, {}, scale=scale.tolist()), start / scale, period, driven, section, transient
    )
    ratio = scale[:, None] / scale
    return replace(
        found, start=found.start * scale, monodromy=found.monodromy * ratio, mean_jacobian=found.mean_jacobian * ratio,
        kernels=kernel_orbit_kernels(kernel, {}),
    )  # fmt: skip


def _read(rates: Any, variables: Any, parameters: Any) -> tuple[Kernel, ...]:
    if isinstance(rates, AveragedFlow):
        field = rates.slow_field()
        order = {"order": 2} if any(port.name == "order" for port in field.inputs) else {}
        return kernel_orbit_kernels(field, {**order, **dict(parameters or {})})
    if isinstance(rates, Kernel):
        return kernel_orbit_kernels(rates, dict(parameters or {}))
    if variables is None:
        raise InputError("floquet: variables=, the names of the components, are needed with formulas")
    return formula_orbit_kernels(list(rates), list(variables), dict(parameters or {}))


@lru_cache(maxsize=64)
def _library(kernels: tuple[Kernel, ...]) -> Library:
    return build(kernels)


def _system(kernels: tuple[Kernel, ...]) -> OrbitSystem:
    return OrbitSystem(_library(kernels), "y", kernels[0].inputs[0].size)


def _is_driven(rates: Any, kernels: tuple[Kernel, ...]) -> bool:
    """Whether f depends on t."""
    if isinstance(rates, AveragedFlow):
        return False
    if isinstance(rates, Kernel):
        return any(port.name == "t" for port in rates.inputs)
    if kernels[0].definition is None:
        return True
    given = kernels[0].definition["parameters"]
    read = read_formulas(given["rates"], given["variables"], ("t",), given["numbers"], "floquet")
    return any(symbol.name == "t" for each in read for symbol in each.free_symbols)


def _start(guess: ArrayLike | None, n: int) -> Array:
    if guess is None:
        raise InputError("floquet: guess=, a point near the orbit, is needed")
    start = shaped(guess, (n,), "floquet: guess")
    if not np.all(np.isfinite(start)):
        raise NotFiniteError("floquet: the guess holds NaN or infinity")
    return start
