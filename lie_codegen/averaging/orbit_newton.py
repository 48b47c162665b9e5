"""Newton's method for periodic orbits: the flow with its linearisation, on vectors and on groups alike.

    driven:      (M - L) d = y - Phi(y),  M = D Phi L
    autonomous:  the column f(Phi(y)) of the period is appended, and d is held orthogonal to the flow

L holds the tangent directions at y by columns: the identity for vectors, X hat(A_a) on a group, where y moves to X exp(d).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lie_codegen.arrays import Array
from lie_codegen.averaging.graded_product import log_eigenvalues
from lie_codegen.errors import ComputationError, InputError, PeriodError
from lie_codegen.exact.numbers import exact_number
from lie_codegen.runtime.library import Library
from lie_codegen.runtime.ode import EVENT, REACHED, Motion, integrate
from lie_codegen.runtime.ode_field import Field

_RTOL, _ATOL = 1e-13, 1e-15
_RETURNS, _ITERATIONS = 40, 40
#: |f| of a periodic orbit, relative to size / period, below which the point found is an equilibrium.
_AT_REST = 1e-6
#: A component that goes less far than this part of the largest need not return by itself.
_SMALL = 1e-6
#: A monodromy matrix is taken in pieces where its least direction is below this part of 1, the start, or of its largest: the flow
#: knows 1e-15 of these, 1e-11 of that direction.
_GRADED, _HALVINGS = 1e-4, 24
#: Growth in a period from which the last bit of a start misses the return by more than Newton's method ends with, 1e-10.
_HOPELESS = 1e6


@dataclass(frozen=True)
class OrbitSystem:
    """y' = f(y, t) with its variational equation, compiled.

    Attributes:
        library: rate (y, t) and variational (y and its derivative by rows, t), each with the constants behind.
        state: name of the input of `rate` that is y.
        size: entries of y.
        constants: other inputs, by name.
        begin: t at which a period begins.
        tangent: y -> (size, k) directions in which y may move.
        moved: (y, d) -> y moved by d (k,) along them.
    """

    library: Library
    state: str
    size: int
    constants: Mapping[str, ArrayLike] = field(default_factory=dict)
    begin: float = 0.0
    tangent: Callable[[Array], Array] = lambda y: np.eye(len(y))
    moved: Callable[[Array, Array], Array] = lambda y, d: y + d

    @property
    def field(self) -> Field:
        """f as C calls it, its time beginning with the period."""
        return Field(self.library["rate"], self.size, state=self.state, constants=self.constants)

    def rate(self, y: Array, t: float) -> Array:
        """f at a time after the beginning."""
        return self.field(self.begin + t, y)

    def motion(self, y: Array, length: float) -> Motion:
        """From y at the beginning on."""
        return integrate(self.field, y, self.begin, self.begin + length, rtol=_RTOL, atol=_ATOL)

    def flow(self, y: Array, length: float) -> tuple[Array, Array]:
        """Phi(y) and D Phi L, (size, k)."""
        directions = self.tangent(y)
        state = np.concatenate([y, directions.ravel()])
        scale = _ATOL * max(1.0, float(np.abs(y).max()))
        whole = Field(self.library["variational"], len(state), state="state", constants=self.constants)
        motion = integrate(whole, state, self.begin, self.begin + length, rtol=_RTOL, atol=scale)
        if motion.status != REACHED:
            raise ComputationError(
                f"floquet: the motion from {y.tolist()} leaves every bound at t = {motion.t[-1]:.6g}"
            )
        return motion.y[-1, : self.size], motion.y[-1, self.size :].reshape(directions.shape)

    def monodromy(self, y: Array, columns: Array) -> Array:
        """(k, k): the columns at the end of a period in the directions there, which are those of the start."""
        return np.asarray(np.linalg.lstsq(self.tangent(y), columns, rcond=None)[0])

    def factors(self, start: Array, length: float, monodromy: Array, halvings: int = _HALVINGS) -> list[Array]:
        """The linearised flow over parts of the period, each well conditioned; their product is the monodromy matrix.

        The tangent directions at the end of each part are those in which the next begins.
        """
        sizes = np.linalg.svd(monodromy, compute_uv=False)
        if not halvings or sizes[-1] >= _GRADED * max(1.0, sizes[0]):
            return [monodromy]
        here, found = start, []
        for k in (0, 1):
            part = replace(self, begin=self.begin + k * length / 2)
            end, columns = part.flow(here, length / 2)
            found += part.factors(here, length / 2, self.monodromy(end, columns), halvings - 1)
            here = end
        return found


class Linearised:
    """What the linearisation of a periodic orbit over a period says; `Orbit` and `LoopOrbit` have it."""

    period: float
    multipliers: NDArray[np.complex128]
    exponents: NDArray[np.complex128]
    autonomous: bool

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


def found_orbit(
    system: OrbitSystem, start: Array, period: Any, driven: bool, section: Array | None, transient: bool
) -> tuple[Array, float, float, Array, NDArray[np.complex128]]:
    """(start, T, residual, monodromy, logarithms of the multipliers) of the orbit near a start.

    Raises:
        PeriodError: a driven system without a period, or with one that is not its own.
        InputError: the start is an equilibrium.
        ComputationError: no return, an equilibrium in place of an orbit, or Newton's method does not converge.
    """
    if driven:
        length = _period(period)
        _check_periodic(system, start, length)
        start, residual, columns = _newton_driven(system, start, length)
    else:
        start, length = _first_return(system, start, section, None if period is None else _period(period), transient)
        start, length, residual, columns = _newton_free(system, start, length)
    monodromy = system.monodromy(start, columns)
    return start, length, residual, monodromy, log_eigenvalues(system.factors(start, length, monodromy))


def _period(period: Any) -> float:
    if period is None:
        raise PeriodError("floquet: f depends on t; give its period, as period='2*pi'")
    value = float(exact_number(period)) if not isinstance(period, float) else period
    if not (np.isfinite(value) and value > 0):
        raise PeriodError(f"floquet: the period {period!r} is not positive")
    return value


def _check_periodic(system: OrbitSystem, start: Array, length: float) -> None:
    """Refuse f(y, t) that has not the period."""
    moments = np.linspace(0, length, 13)
    here, there = (np.array([system.rate(start, s) for s in t]) for t in (moments, moments + length))
    if not np.allclose(here, there, rtol=1e-9, atol=1e-9 * max(1e-300, float(np.abs(here).max()))):
        raise PeriodError(f"floquet: f(y, t + {length:.9g}) is not f(y, t): give the period of f, or a multiple of it")


def _newton_driven(system: OrbitSystem, start: Array, length: float) -> tuple[Array, float, Array]:
    best = np.inf
    end, columns = system.flow(start, length)
    for _ in range(_ITERATIONS):
        residual = float(np.linalg.norm(end - start))
        if residual <= 2e-13 * max(1.0, float(np.abs(start).max())) or (residual < 1e-10 and residual > 0.5 * best):
            return start, residual, columns
        best = min(best, residual)
        move = np.linalg.lstsq(columns - system.tangent(start), start - end, rcond=1e-12)[0]
        start, end, columns = _shortened(system, start, move, length, 0.0, residual)[:3]
    raise ComputationError(_unconverged(residual, columns))


def _newton_free(system: OrbitSystem, start: Array, length: float) -> tuple[Array, float, float, Array]:
    best = np.inf
    end, columns = system.flow(start, length)
    for _ in range(_ITERATIONS):
        residual = float(np.linalg.norm(end - start))
        size = max(1.0, float(np.abs(start).max()))
        if residual <= 2e-13 * size or (residual < 1e-10 * size and residual > 0.5 * best):
            _check_moving(system, start, length)
            return start, length, residual, columns
        best = min(best, residual)
        slope, here = (system.rate(y, 0.0) for y in (end, start))
        # the last row holds the point on the plane across the flow, or it could slide along the orbit
        L = system.tangent(start)
        matrix = np.block([[columns - L, slope[:, None]], [here[None, :] @ L, np.zeros((1, 1))]])
        solution = np.linalg.lstsq(matrix, np.append(start - end, 0.0), rcond=1e-13)[0]
        move, longer = solution[:-1], float(solution[-1])
        if abs(longer) > 0.3 * length:  # a period that collapses is the way to the equilibrium
            move, longer = move * (0.3 * length / abs(longer)), np.sign(longer) * 0.3 * length
        start, end, columns, length = _shortened(system, start, move, length, longer, residual)
        _check_moving(system, start, length)
    raise ComputationError(_unconverged(residual, columns))


def _shortened(
    system: OrbitSystem, start: Array, move: Array, length: float, longer: float, residual: float
) -> tuple[Array, Array, Array, float]:
    """The step, halved until it does not increase the distance by which the motion misses its start."""
    part = 1.0
    while True:
        trial, duration = system.moved(start, part * move), length + part * longer
        try:
            end, columns = system.flow(trial, duration)
        except ComputationError:
            end = np.full_like(start, np.inf)
        if np.linalg.norm(end - trial) <= max(2 * residual, 1e-9) or part < 1e-3:
            if not np.all(np.isfinite(end)):
                raise ComputationError(
                    "floquet: Newton's method leaves the region in which the motion exists; give a nearer guess"
                )
            return trial, end, columns, duration
        part /= 2


def _check_moving(system: OrbitSystem, start: Array, length: float) -> None:
    speed = float(np.linalg.norm(system.rate(start, 0.0)))
    if speed * length < _AT_REST * max(1e-3, float(np.linalg.norm(start))):
        raise ComputationError(
            f"floquet: Newton's method fell onto the equilibrium {np.round(start, 9).tolist()}, which is no orbit; "
            "give a guess nearer to the orbit"
        )


def _first_return(
    system: OrbitSystem,
    guess: Array,
    section: Array | None,
    period: float | None,
    transient: bool,
    *,
    again: bool = True,
) -> tuple[Array, float]:
    """A point on the section through the guess to which the motion nearly returns, and after what time."""
    n, here = len(guess), system.rate(guess, 0.0)
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
        motion = integrate(system.field, now, 0.0, longest, rtol=1e-10, atol=1e-12, events=events, directions=[1])
        if motion.status != EVENT:
            break
        end, length = motion.y[-1], float(motion.t[-1])
        # each component by how far it goes: of a relaxation oscillation the velocity would hide what x still misses
        reach = np.abs(motion.y - end).max(axis=0)
        gap = float(np.max(np.abs(end - now) / np.maximum(reach, max(_SMALL * float(reach.max()), 1e-300))))
        if best is None or gap < best[0]:
            best = gap, end, length
        now = end
        if gap < 1e-4:
            break
    if best is None:
        last = motion.y[-1]
        at_rest = float(np.abs(system.rate(last, 0.0)).max()) < 1e-6 * speed
        if again and transient and not at_rest and np.all(np.isfinite(last)) and motion.status == REACHED:
            # the guess lies off the orbit's reach: what the motion has come to is a better one
            return _first_return(system, last, section, None, transient, again=False)
        where = np.round(last, 6).tolist()
        fate = f"settles on the equilibrium {where}" if at_rest else f"is at {where} at t = {motion.t[-1]:.4g}"
        raise ComputationError(
            f"floquet: the motion from the guess does not return to the section through it: it {fate}; give another guess"
        )
    return best[1], best[2]


def _unconverged(residual: float, columns: Array) -> str:
    missed = f"floquet: Newton's method did not converge (the motion misses its start by {residual:.1e}"
    growth = float(np.linalg.norm(columns, 2)) if np.all(np.isfinite(columns)) else np.inf
    if growth > _HOPELESS:
        return (
            f"{missed}, where errors grow {growth:.1e} times in a period): give a nearer guess; if the orbit itself is so unstable, doubles hold no "
            "start that returns: look for the orbit of the motion backward in time"
        )
    return f"{missed}); give a nearer guess"
