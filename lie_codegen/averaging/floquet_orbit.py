"""lc.floquet: periodic orbits of y' = f(y, t) and y' = f(y), their multipliers and their stability."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lie_codegen.arrays import Array
from lie_codegen.averaging.orbit_kernels import formula_orbit_kernels, kernel_orbit_kernels
from lie_codegen.averaging.vector_field import read_formulas
from lie_codegen.errors import ComputationError, InputError, NotFiniteError, PeriodError, ShapeError
from lie_codegen.exact.numbers import exact_number
from lie_codegen.groups.build import build
from lie_codegen.kernel.kernel import Kernel
from lie_codegen.kernel.saved import Saved
from lie_codegen.mechanics.vibrational_average import VibrationalAverage
from lie_codegen.runtime.library import Library
from lie_codegen.runtime.ode import EVENT, REACHED, Field, Motion, integrate

_RTOL, _ATOL = 1e-13, 1e-15
_RETURNS, _ITERATIONS = 40, 40
#: |f| of a periodic orbit, relative to size / period, below which the point found is an equilibrium.
_AT_REST = 1e-6


@dataclass(frozen=True, eq=False, repr=False)
class Orbit(Saved):
    """A periodic orbit and its linearisation over a period.

    Attributes:
        start: (n,) a point of it, at t = t0 where the system is driven.
        period: T.
        multipliers: (n,) eigenvalues of the monodromy matrix M(T), largest modulus first; of an autonomous orbit one of them
            is 1, along the flow.
        monodromy: (n, n) M(T).
        autonomous: whether f does not depend on t, so that T was found too.
        residual: |y(T) - y(0)|.
        liouville: |det M - exp int tr Df| over exp int tr Df: what the integration is good for.
        mean_jacobian: (n, n) Df averaged along the orbit. Where f = eps g its eigenvalues are those of the averaged system
            to O(eps^2), beside `exponents`.
        kernels: rate, jacobian and variational, for lc.build and lc.generate.
    """

    start: Array
    period: float
    multipliers: NDArray[np.complex128]
    monodromy: Array
    autonomous: bool
    residual: float
    liouville: float
    mean_jacobian: Array
    kernels: tuple[Kernel, ...] = field(repr=False)

    @property
    def exponents(self) -> NDArray[np.complex128]:
        """(n,) log(multipliers) / T, imaginary parts in (-pi/T, pi/T]; a real part of -infinity is a multiplier of 0."""
        with np.errstate(divide="ignore"):
            return np.asarray(np.log(self.multipliers) / self.period)

    @property
    def averaged_exponents(self) -> NDArray[np.complex128]:
        """(n,) eigenvalues of the mean of Df along the orbit, largest real part first: the exponents to first order, f = eps g."""
        values = np.linalg.eigvals(self.mean_jacobian).astype(complex)
        return np.asarray(values[np.argsort(-values.real)])

    @cached_property
    def trivial(self) -> int | None:
        """Which multiplier is the 1 of an autonomous orbit: the one nearest to 1; None where the system is driven."""
        return int(np.argmin(np.abs(self.multipliers - 1))) if self.autonomous else None

    @property
    def trivial_error(self) -> float:
        """|mu - 1| of that multiplier, a check of the whole; NaN where the system is driven."""
        return float("nan") if self.trivial is None else float(abs(self.multipliers[self.trivial] - 1))

    @property
    def stable(self) -> bool:
        """Whether every multiplier but the 1 of an autonomous orbit lies within the unit circle: exponentially stable."""
        others = self.multipliers if self.trivial is None else np.delete(self.multipliers, self.trivial)
        return bool(np.all(np.abs(others) < 1))

    def at(self, t: ArrayLike) -> Array:
        """The orbit: (...,) times, from 0 at `start` -> (..., n)."""
        return self._motion.at(np.mod(np.asarray(t, dtype=float), self.period))

    @cached_property
    def _motion(self) -> Motion:
        return integrate(
            _field(_library(self.kernels), len(self.start)), self.start, 0.0, self.period, rtol=_RTOL, atol=_ATOL
        )


def floquet(
    rates: Sequence[Any] | Kernel | VibrationalAverage,
    variables: Sequence[str] | None = None,
    guess: ArrayLike | None = None,
    *,
    period: Any = None,
    parameters: Mapping[str, Any] | None = None,
    transient: bool = True,
    return_to: ArrayLike | None = None,
) -> Orbit:
    """The periodic orbit of y' = f(y, t) near a guess, and its Floquet multipliers: eigenvalues of the linearised flow over T.

    Newton's method on the flow with its variational equation, integrated in C to 1e-13: (M - 1) d = y - Phi(y); where T is
    unknown the column f is appended and d is held orthogonal to the flow.

    Args:
        rates: n formulas in the variables, t and the parameters; or a kernel whose first input is y, with an input t or
            none, and whose first output is y' (`parameters` then gives its other inputs); or a vibrational average, whose
            actual system it then is, the true loop (`parameters` gives eps; its period is known).
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
    if isinstance(rates, VibrationalAverage):
        eps = float((parameters or {}).get("eps", np.nan))
        if not eps > 0:
            raise InputError("floquet: a vibrated system needs parameters={'eps': ...}, the ratio of its time scales")
        actual = next(kernel for kernel in rates.kernels() if kernel.name == "actual")
        kernels = kernel_orbit_kernels(actual, dict(parameters or {}), "tau", 1 / eps)
        period = eps * float(rates.fields.period) if period is None else period
        driven = True
    else:
        kernels = _read(rates, variables, parameters)
        driven = _is_driven(rates, kernels)
    n = kernels[0].inputs[0].size
    start = _start(guess, n)
    library = _library(kernels)
    if driven:
        length = _period(period)
        _check_periodic(library, start, length)
        start, residual, monodromy = _newton_driven(library, start, length)
    else:
        section = None if return_to is None else _start(return_to, n)
        start, length = _first_return(library, start, section, None if period is None else _period(period), transient)
        start, length, residual, monodromy = _newton_free(library, start, length)
    moments = np.arange(256) / 256 * length
    motion = integrate(_field(library, n), start, 0.0, length, rtol=_RTOL, atol=_ATOL)
    jacobians = np.asarray(library.jacobian.batch(motion.at(moments), moments))
    mean = jacobians.mean(axis=0)
    volume = np.exp(length * float(np.trace(mean)))
    multipliers = np.linalg.eigvals(monodromy).astype(complex)
    order = np.lexsort((-multipliers.imag, -np.abs(multipliers).round(12)))
    liouville = abs(float(np.linalg.det(monodromy)) - volume) / volume
    return Orbit(start, length, multipliers[order], monodromy, not driven, residual, liouville, mean, kernels)


def _read(rates: Any, variables: Any, parameters: Any) -> tuple[Kernel, ...]:
    if isinstance(rates, Kernel):
        return kernel_orbit_kernels(rates, dict(parameters or {}))
    if variables is None:
        raise InputError("floquet: variables=, the names of the components, are needed with formulas")
    return formula_orbit_kernels(list(rates), list(variables), dict(parameters or {}))


@lru_cache(maxsize=64)
def _library(kernels: tuple[Kernel, ...]) -> Library:
    return build(kernels)


def _is_driven(rates: Any, kernels: tuple[Kernel, ...]) -> bool:
    """Whether f depends on t."""
    if isinstance(rates, Kernel):
        return any(port.name == "t" for port in rates.inputs)
    if kernels[0].definition is None:
        return True
    given = kernels[0].definition["parameters"]
    read = read_formulas(given["rates"], given["variables"], ("t",), given["numbers"], "floquet")
    return any(symbol.name == "t" for each in read for symbol in each.free_symbols)


def _period(period: Any) -> float:
    if period is None:
        raise PeriodError("floquet: f depends on t; give its period, as period='2*pi'")
    value = float(exact_number(period)) if not isinstance(period, float) else period
    if not (np.isfinite(value) and value > 0):
        raise PeriodError(f"floquet: the period {period!r} is not positive")
    return value


def _start(guess: ArrayLike | None, n: int) -> Array:
    if guess is None:
        raise InputError("floquet: guess=, a point near the orbit, is needed")
    start = np.array(guess, dtype=float)
    if start.shape != (n,):
        raise ShapeError(f"floquet: the guess has shape {start.shape}; there are {n} variables")
    if not np.all(np.isfinite(start)):
        raise NotFiniteError("floquet: the guess holds NaN or infinity")
    return start


def _field(library: Library, n: int) -> Field:
    return Field(library["rate"], n)


def _check_periodic(library: Library, start: Array, length: float) -> None:
    moments = np.linspace(0, length, 13)
    here, there = (np.asarray(library.rate.batch(start, t)) for t in (moments, moments + length))
    if not np.allclose(here, there, rtol=1e-9, atol=1e-9 * max(1e-300, float(np.abs(here).max()))):
        raise PeriodError(f"floquet: f(y, t + {length:.9g}) is not f(y, t): give the period of f, or a multiple of it")


def _flow(library: Library, start: Array, length: float) -> tuple[Array, Array]:
    """y(T) and M(T)."""
    n = len(start)
    state = np.concatenate([start, np.eye(n).ravel()])
    scale = _ATOL * max(1.0, float(np.abs(start).max()))
    motion = integrate(
        Field(library["variational"], n + n * n, state="state"), state, 0.0, length, rtol=_RTOL, atol=scale
    )
    if motion.status != REACHED:
        raise ComputationError(
            f"floquet: the motion from {start.tolist()} leaves every bound at t = {motion.t[-1]:.6g}"
        )
    return motion.y[-1, :n], motion.y[-1, n:].reshape(n, n)


def _newton_driven(library: Library, start: Array, length: float) -> tuple[Array, float, Array]:
    best = np.inf
    end, monodromy = _flow(library, start, length)
    for _ in range(_ITERATIONS):
        residual = float(np.linalg.norm(end - start))
        if residual <= 2e-13 * max(1.0, float(np.abs(start).max())) or (residual < 1e-10 and residual > 0.5 * best):
            return start, residual, monodromy
        best = min(best, residual)
        move = np.linalg.lstsq(monodromy - np.eye(len(start)), start - end, rcond=1e-12)[0]
        start, end, monodromy = _shortened(library, start, move, length, 0.0, residual)[:3]
    raise ComputationError(_unconverged(residual))


def _newton_free(library: Library, start: Array, length: float) -> tuple[Array, float, float, Array]:
    best, n = np.inf, len(start)
    end, monodromy = _flow(library, start, length)
    for _ in range(_ITERATIONS):
        residual = float(np.linalg.norm(end - start))
        size = max(1.0, float(np.abs(start).max()))
        if residual <= 2e-13 * size or (residual < 1e-10 * size and residual > 0.5 * best):
            _check_moving(library, start, length)
            return start, length, residual, monodromy
        best = min(best, residual)
        slope, here = (np.asarray(library.rate(y, 0.0)) for y in (end, start))
        # the last row holds the point on the plane across the flow, or it could slide along the orbit
        matrix = np.block([[monodromy - np.eye(n), slope[:, None]], [here[None, :], np.zeros((1, 1))]])
        solution = np.linalg.lstsq(matrix, np.append(start - end, 0.0), rcond=1e-13)[0]
        move, longer = solution[:n], float(solution[n])
        if abs(longer) > 0.3 * length:  # a period that collapses is the way to the equilibrium
            move, longer = move * (0.3 * length / abs(longer)), np.sign(longer) * 0.3 * length
        start, end, monodromy, length = _shortened(library, start, move, length, longer, residual)
        _check_moving(library, start, length)
    raise ComputationError(_unconverged(residual))


def _shortened(
    library: Library, start: Array, move: Array, length: float, longer: float, residual: float
) -> tuple[Array, Array, Array, float]:
    """The step, halved until it does not increase the distance by which the motion misses its start."""
    part = 1.0
    while True:
        trial, duration = start + part * move, length + part * longer
        try:
            end, monodromy = _flow(library, trial, duration)
        except ComputationError:
            end = np.full_like(start, np.inf)
        if np.linalg.norm(end - trial) <= max(2 * residual, 1e-9) or part < 1e-3:
            if not np.all(np.isfinite(end)):
                raise ComputationError(
                    "floquet: Newton's method leaves the region in which the motion exists; give a nearer guess"
                )
            return trial, end, monodromy, duration
        part /= 2


def _check_moving(library: Library, start: Array, length: float) -> None:
    speed = float(np.linalg.norm(np.asarray(library.rate(start, 0.0))))
    if speed * length < _AT_REST * max(1e-3, float(np.linalg.norm(start))):
        raise ComputationError(
            f"floquet: Newton's method fell onto the equilibrium {np.round(start, 9).tolist()}, which is no orbit; "
            "give a guess nearer to the orbit"
        )


def _first_return(
    library: Library, guess: Array, section: Array | None, period: float | None, transient: bool, *, again: bool = True
) -> tuple[Array, float]:
    """A point on the section through the guess to which the motion nearly returns, and after what time."""
    n, here = len(guess), np.asarray(library.rate(guess, 0.0))
    speed, size = float(np.linalg.norm(here)), max(float(np.linalg.norm(guess)), 1e-6)
    if speed < 1e-9 * size:
        raise InputError(f"floquet: the guess {guess.tolist()} is an equilibrium: f = {here.tolist()}")
    normal = here if section is None else section * np.copysign(1.0, float(section @ here))
    normal = normal / np.linalg.norm(normal)
    if period is not None:
        return guess, period
    events = Field(lambda t, y: np.array([normal @ (y - guess)]), n)
    longest, now = 1e4 * size / speed, guess
    best: tuple[float, Array, float] | None = None
    for _ in range(_RETURNS if transient else 1):
        motion = integrate(_field(library, n), now, 0.0, longest, rtol=1e-10, atol=1e-12, events=events, directions=[1])
        if motion.status != EVENT:
            break
        end, length = motion.y[-1], float(motion.t[-1])
        gap = float(np.linalg.norm(end - now)) / max(float(np.abs(motion.y - end).max()), 1e-300)
        if best is None or gap < best[0]:
            best = gap, end, length
        now = end
        if gap < 1e-4:
            break
    if best is None:
        last = motion.y[-1]
        at_rest = float(np.linalg.norm(np.asarray(library.rate(last, 0.0)))) < 1e-6 * speed
        if again and transient and not at_rest and np.all(np.isfinite(last)) and motion.status == REACHED:
            # the guess lies off the orbit's reach: what the motion has come to is a better one
            return _first_return(library, last, section, None, transient, again=False)
        where = np.round(last, 6).tolist()
        fate = f"settles on the equilibrium {where}" if at_rest else f"is at {where} at t = {motion.t[-1]:.4g}"
        raise ComputationError(
            f"floquet: the motion from the guess does not return to the section through it: it {fate}; give another guess"
        )
    return best[1], best[2]


def _unconverged(residual: float) -> str:
    return f"floquet: Newton's method did not converge (the motion misses its start by {residual:.1e}); give a nearer guess"
