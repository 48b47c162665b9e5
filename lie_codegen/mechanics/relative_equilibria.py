"""Relative equilibria of (reduced) mechanical systems: stability and linear controllability.

At (q_e, 0) the linearisation is M x'' + C x' + K x = B u. An equilibrium at which the amended potential has a strict
minimum is stable (Routh); M, C, K, B are controllable if and only if rank [s^2 M + s C + K, B] = n at every root s of
det(s^2 M + s C + K) (Laub and Arnold 1984; Sanyal, Bloch and McClamroch, (33), (34)).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lie_codegen.arrays import Array
from lie_codegen.errors import ComputationError, InputError
from lie_codegen.kernel.saved import Saved
from lie_codegen.mechanics.lagrangian import LagrangianSystem
from lie_codegen.mechanics.routh import RouthReduction
from lie_codegen.on_demand import sympy as sp

#: A singular value below this, relative to the largest, counts as zero.
RANK_TOLERANCE = 1e-9
#: Two equilibria nearer to one another than this are one.
_DISTINCT = 1e-7


@dataclass(frozen=True, eq=False, repr=False)
class RelativeEquilibrium(Saved):
    """An equilibrium of a reduced system and its linearisation.

    Attributes:
        coordinates: names.
        q: (n,) the configuration.
        M, C, K, B: of M x'' + C x' + K x = B u.
        potential_hessian: second derivatives of the (amended) potential.
    """

    coordinates: tuple[str, ...]
    q: Array
    M: Array
    C: Array
    K: Array
    B: Array
    potential_hessian: Array

    @cached_property
    def eigenvalues(self) -> NDArray[np.complex128]:
        """Roots of det(s^2 M + s C + K), by growing real part."""
        roots: NDArray[np.complex128] = np.linalg.eigvals(self.matrix).astype(np.complex128)
        return roots[np.lexsort((roots.imag, roots.real))]

    @property
    def matrix(self) -> Array:
        """A of (x, x')' = A (x, x') + ..."""
        n = len(self.q)
        return np.block(
            [[np.zeros((n, n)), np.eye(n)], [-np.linalg.solve(self.M, self.K), -np.linalg.solve(self.M, self.C)]]
        )

    @property
    def verdict(self) -> str:
        """ "stable" (strict minimum of the potential), "unstable" (a root of positive real part), else "spectrally
        stable": the linearisation does not decide."""
        if np.linalg.eigvalsh(self.potential_hessian).min() > 0 and self.eigenvalues.real.max() < 1e-9:
            return "stable"
        return "unstable" if self.eigenvalues.real.max() > 1e-9 else "spectrally stable"


@dataclass(frozen=True, eq=False, repr=False)
class LinearControllability(Saved):
    """The verdict of the rank test.

    Attributes:
        controllable: whether every root passes.
        roots: the roots s tested.
        smallest: for each, the smallest singular value of [s^2 M + s C + K, B] relative to the largest.
        reason: what fails, with the direction that no input reaches.
    """

    controllable: bool
    roots: tuple[complex, ...]
    smallest: tuple[float, ...]
    reason: str


def relative_equilibrium(
    system: LagrangianSystem | RouthReduction,
    guess: ArrayLike,
    parameters: Mapping[str, float] | None = None,
) -> RelativeEquilibrium:
    """The equilibrium nearest to a guess (n,), of all that `relative_equilibria` finds around it.

    Args:
        system, guess, parameters: as there.

    Raises:
        InputError: a parameter without a value.
        ComputationError: no equilibrium is found.
    """
    return relative_equilibria(system, guess, parameters)[0]


def relative_equilibria(
    system: LagrangianSystem | RouthReduction,
    guess: ArrayLike,
    parameters: Mapping[str, float] | None = None,
    *,
    reach: float = np.pi,
    starts: int = 64,
) -> tuple[RelativeEquilibrium, ...]:
    """The equilibria around a guess (n,), nearest first, each with its stability (`.verdict`).

    Newton's method on the generalized force at rest, from the guess and from `starts` random points (seeded) of the box guess +-
    `reach`. Newton's method alone may run past the nearest root to another; that none is missed is likely, not proved.

    Args:
        system: of `lagrangian_system`, or its `routh_reduction`.
        guess: (n,) coordinates.
        parameters: name -> number, of every parameter.
        reach: half a side of the box, in the unit of the coordinates.
        starts: how many points of it.

    Raises:
        InputError: a parameter without a value, a guess of the wrong length, starts below 0.
        ComputationError: no equilibrium is found.
    """
    mechanical = system.system if isinstance(system, RouthReduction) else system
    values = parameter_numbers(mechanical.parameter_symbols, parameters)
    rest = dict.fromkeys(mechanical.v, sp.S.Zero)
    force = mechanical.generalized_force.xreplace(values)
    at_rest = force.xreplace(rest)
    centre = np.atleast_1d(np.array(guess, dtype=np.float64))
    if starts < 0:
        raise InputError(f"starts is a number of points, given {starts}")
    first = _first_guess(centre, mechanical.q)
    spread = np.random.default_rng(0).uniform(-1, 1, (starts, len(first)))
    run = NewtonMethod.of(at_rest, mechanical.q)
    ends = [run.from_guess(start) for start in (first, *(first + reach * spread))]
    found: list[Array] = []
    for q in ends:
        if q is not None and all(np.max(np.abs(q - other)) > _DISTINCT for other in found):
            found.append(q)
    if not found:
        raise ComputationError(f"no equilibrium found from the guess {guess!r}, nor from {starts} points around it")
    found.sort(key=lambda q: float(np.linalg.norm(q - first)))
    return tuple(_linearised(mechanical, force, at_rest, values, rest, q) for q in found)


def _linearised(
    mechanical: LagrangianSystem, force: Any, at_rest: Any, values: Mapping[Any, Any], rest: Mapping[Any, Any], q: Array
) -> RelativeEquilibrium:
    here = {**dict(zip(mechanical.q, map(sp.Float, q), strict=True)), **rest}
    x, v = sp.Matrix(mechanical.q), sp.Matrix(mechanical.v)

    def at(matrix: Any) -> Array:
        return np.array(matrix.xreplace(values).xreplace(here).evalf().tolist(), dtype=np.float64)

    columns = len(mechanical.inputs)
    return RelativeEquilibrium(
        mechanical.coordinates,
        q,
        at(mechanical.mass),
        -at(force.jacobian(v)),
        -at(at_rest.jacobian(x)),
        at(mechanical.input_matrix) if columns else np.zeros((len(q), 0)),
        at(sp.hessian(mechanical.potential, mechanical.q)),
    )


def linear_controllability(equilibrium: RelativeEquilibrium) -> LinearControllability:
    """The rank test (34): rank [s^2 M + s C + K, B] = n at every root s of det(s^2 M + s C + K), all (n, n), B (n, m).

    Args:
        equilibrium: one of `relative_equilibria`, with its roots.

    Returns:
        The verdict, the roots, and at each the n-th singular value relative to the first; where it is lost, the direction that no input moves.

    Raises:
        ArgumentError: equilibrium is no `RelativeEquilibrium`.
    """
    e, n = equilibrium, len(equilibrium.q)
    smallest, reason = [], "rank [s^2 M + s C + K, B] is full at every root"
    controllable = True
    for root in e.eigenvalues:
        pencil = np.hstack([root**2 * e.M + root * e.C + e.K, e.B.astype(np.complex128)])
        left, singular, _ = np.linalg.svd(pencil)
        smallest.append(float(singular[n - 1] / singular[0]))
        if smallest[-1] < RANK_TOLERANCE and controllable:
            controllable = False
            direction = _direction(left[:, n - 1].conj(), e.coordinates)
            reason = (
                f"at the root s = {root:.6g} the rank is {n - 1}, not {n}: no input moves the direction {direction}"
            )
    return LinearControllability(controllable, tuple(complex(r) for r in e.eigenvalues), tuple(smallest), reason)


@dataclass(frozen=True)
class NewtonMethod:
    """Newton's method on an exact field, compiled to numpy once.

    Attributes:
        value, slope: of the field and of its derivative, from a point.
    """

    value: Callable[[Array], Any]
    slope: Callable[[Array], Any]

    @staticmethod
    def of(field: Any, variables: Sequence[sp.Symbol]) -> NewtonMethod:
        """For a field of some variables."""
        column = sp.Matrix(list(variables))
        return NewtonMethod(
            sp.lambdify([list(variables)], list(field), "numpy", cse=True),
            sp.lambdify([list(variables)], field.jacobian(column).tolist(), "numpy", cse=True),
        )

    def from_guess(self, guess: Array) -> Array | None:
        """The zero that it ends at, to rounding; None where it ends at none."""
        x = np.array(guess, dtype=np.float64)
        with np.errstate(all="ignore"):
            for _ in range(60):
                residual = np.array(self.value(x), dtype=np.float64)
                jacobian = np.array(self.slope(x), dtype=np.float64)
                if not (np.isfinite(residual).all() and np.isfinite(jacobian).all()):
                    return None
                step = np.linalg.lstsq(jacobian, residual, rcond=1e-13)[0]
                x = x - step * min(1.0, 0.5 / max(float(np.abs(step).max()), 1e-300))
                if np.abs(step).max() < 1e-13 * max(1.0, float(np.abs(x).max())):
                    # A stationary point of |f| that is no zero also stops the steps.
                    return x if np.abs(residual).max() <= 1e-8 * max(1.0, float(np.abs(jacobian).max())) else None
        return None


def newton(field: Any, variables: Sequence[sp.Symbol], guess: ArrayLike) -> Array:
    """A zero of an exact field, found by Newton's method from a guess, to rounding.

    Raises:
        InputError: a guess of the wrong length.
        ComputationError: no convergence.
    """
    found = NewtonMethod.of(field, variables).from_guess(_first_guess(guess, variables))
    if found is None:
        raise ComputationError(f"no equilibrium found from the guess {guess!r}: Newton's method ends at none")
    return found


def _first_guess(guess: ArrayLike, variables: Sequence[sp.Symbol]) -> Array:
    x = np.atleast_1d(np.array(guess, dtype=np.float64))
    if x.shape != (len(variables),):
        raise InputError(f"the guess has shape {x.shape}; it needs {len(variables)} values, for {variables}")
    return x


def parameter_numbers(symbols: Sequence[sp.Symbol], parameters: Mapping[str, Any] | None) -> dict[sp.Symbol, sp.Expr]:
    """A number for each symbol that stayed.

    Raises:
        InputError: one without a value.
    """
    given = dict(parameters or {})
    missing = [str(s) for s in symbols if str(s) not in given]
    if missing:
        raise InputError(
            f"parameters: {', '.join(missing)} stayed symbolic and needs a value: parameters={{{missing[0]!r}: ...}}"
        )
    return {s: sp.Float(given[str(s)], 17) for s in symbols}


def _direction(vector: NDArray[np.complex128], names: Sequence[str]) -> str:
    vector = vector / vector[np.argmax(np.abs(vector))]
    parts = [
        name
        if abs(c - 1) < 1e-9
        else f"({c.real:.3g}{c.imag:+.3g}j) {name}"
        if abs(c.imag) > 1e-9
        else f"{c.real:.3g} {name}"
        for c, name in zip(vector, names, strict=True)
        if abs(c) > 1e-9
    ]
    return " + ".join(parts)
