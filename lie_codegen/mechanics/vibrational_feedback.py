"""Amplitude feedback on the averaged system: Theorem 2 of Sanyal, Bloch and McClamroch, corrected.

u = u(tau; alpha) with amplitudes alpha about 0; z' = Z(z; alpha) = Z_1 + eps Z_2. With Z(z_e; 0) = 0,

    A = dZ/dz,  b = dZ/dalpha  at (z_e, 0),   alpha = -K (z - z_e),   A - b K stable.

The paper linearises at an equilibrium of the unvibrated system and leaves (1/eps) T^j(0) dY_j/dz out of scale; here z_e
solves the averaged equations. The amplitude is held over a period and switched at a zero of the primitive of u, where
neither the actual nor the averaged state jumps.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lie_codegen.arrays import Array
from lie_codegen.errors import InputError
from lie_codegen.kernel.parameter import refuse_input
from lie_codegen.kernel.saved import Saved
from lie_codegen.mechanics.lagrangian_average import LagrangianSeries
from lie_codegen.mechanics.relative_equilibria import newton, parameter_numbers
from lie_codegen.mechanics.vibrational_fields import VibrationalFields, fast_time
from lie_codegen.on_demand import sympy as sp

_AUTHORITY = 1e-8


@dataclass(frozen=True, eq=False, repr=False)
class VibrationalFeedback(Saved):
    """A designed amplitude feedback.

    Attributes:
        fields: the averaged system, its amplitudes still symbols.
        amplitudes: their names.
        eps: the ratio of time scales designed for.
        equilibrium: (2n,) z_e of the averaged system at alpha = 0.
        A, b: linearisation there, (2n, 2n) and (2n, na).
        K: (na, 2n) gains.
        switch_phase: fast time in [0, T) at which amplitudes switch.
        values: numbers of the other parameters.
        limit: the largest |alpha| commanded.
    """

    fields: VibrationalFields
    amplitudes: tuple[str, ...]
    eps: float
    equilibrium: Array
    A: Array
    b: Array
    K: Array
    switch_phase: float
    values: Mapping[sp.Symbol, sp.Expr]
    limit: float

    @property
    def open_loop(self) -> NDArray[np.complex128]:
        """Eigenvalues of A."""
        roots: NDArray[np.complex128] = np.linalg.eigvals(self.A).astype(np.complex128)
        return roots

    @property
    def closed_loop(self) -> NDArray[np.complex128]:
        """Eigenvalues of A - b K."""
        roots: NDArray[np.complex128] = np.linalg.eigvals(self.A - self.b @ self.K).astype(np.complex128)
        return roots


def design_feedback(
    fields: VibrationalFields | LagrangianSeries,
    *,
    amplitudes: Sequence[str],
    eps: float,
    guess: ArrayLike,
    poles: Sequence[complex] | None = None,
    weights: tuple[ArrayLike, ArrayLike] | None = None,
    parameters: Mapping[str, float] | None = None,
    limit: float = np.inf,
) -> VibrationalFeedback:
    """Amplitude feedback by pole placement or LQR on the averaged system.

    Args:
        fields: of `vibrational_fields`, for an input whose parameters include the amplitudes, as in
            PeriodicInput(["(3 + alpha)*cos(t)"], parameters=("alpha",)).
        amplitudes: names of those parameters, zero at the working point.
        eps: ratio of time scales.
        guess: (2n,) near the averaged equilibrium.
        poles: 2n eigenvalues to place; or
        weights: (Q, R) of the cost int z'Qz + alpha'R alpha dt; identity matrices if neither is given.
        parameters: numbers of the other symbols.
        limit: saturation of |alpha|.

    Raises:
        InputError: eps "input", for the gains are those of one eps; an unknown amplitude; brackets that vanish at the equilibrium (no authority); an unstable mode no
            amplitude reaches (the direction is named); a primitive without a zero common to all inputs.
        ComputationError: no averaged equilibrium near the guess.
    """
    refuse_input(eps, "design_feedback: eps", "the gains and the averaged equilibrium are those of this ratio")
    if isinstance(fields, LagrangianSeries):
        fields = fields.exact()
    names = [str(p) for p in fields.parameters]
    unknown = [name for name in amplitudes if name not in names]
    if unknown or not amplitudes:
        raise InputError(f"amplitudes {list(amplitudes)!r}: parameters of the input are {', '.join(names) or 'none'}")
    if poles is not None and weights is not None:
        raise InputError("give poles or weights, not both")
    alpha = [p for p in fields.parameters if str(p) in amplitudes]
    values = parameter_numbers([p for p in fields.parameters if p not in alpha], parameters)
    total = fields.Z[0].xreplace(values)
    if fields.order == 2:
        total = sp.ImmutableMatrix(total + sp.Float(eps) * fields.Z[1].xreplace(values))
    zero = dict.fromkeys(alpha, sp.S.Zero)
    still = total.xreplace(zero)
    z = newton(still, fields.state, guess)
    here = {**zero, **dict(zip(fields.state, map(sp.Float, z), strict=True))}

    def at(matrix: Any) -> Array:
        return np.array(matrix.xreplace(here).evalf().tolist(), dtype=np.float64)

    A, b = at(total.jacobian(sp.Matrix(list(fields.state)))), at(total.jacobian(sp.Matrix(alpha)))
    _check_authority(A, b, fields.state, amplitudes, z)
    K = _gains(A, b, poles, weights)
    return VibrationalFeedback(
        fields, tuple(str(p) for p in alpha), eps, z, A, b, K, switch_phase(fields, {**values, **zero}), values, limit
    )


def switch_phase(fields: VibrationalFields, values: Mapping[sp.Symbol, sp.Expr]) -> float:
    """A fast time in [0, T) at which every primitive U^a of the inputs vanishes.

    Raises:
        InputError: there is none; the pull-back gauge always has tau = 0.
    """
    if fields.gauge == "pull_back":
        return 0.0
    period = float(fields.period)
    waves = [u.expression(fast_time()).xreplace(dict(values)) for u in fields.primitives]
    functions = [sp.lambdify(fast_time(), wave, "numpy") for wave in waves]
    grid = np.linspace(0, period, 4001)
    size = max(float(np.abs(np.asarray(f(grid)) * np.ones_like(grid)).max()) for f in functions)
    first = np.asarray(functions[0](grid)) * np.ones_like(grid)
    exact = np.flatnonzero(np.abs(first) <= 1e-12 * size)
    candidates = [float(grid[i]) for i in exact if grid[i] < period]
    for i in np.flatnonzero(first[:-1] * first[1:] < 0):
        candidates.append(_bisect(functions[0], float(grid[i]), float(grid[i + 1])))
    for phase in sorted(candidates):
        if all(abs(float(f(phase))) <= 1e-9 * size for f in functions):
            return phase
    raise InputError("the zero-mean primitives of the inputs have no common zero to switch at; use gauge='pull_back'")


def _bisect(function: Any, low: float, high: float) -> float:
    sign = np.sign(function(low))
    for _ in range(80):
        middle = (low + high) / 2
        low, high = (middle, high) if np.sign(function(middle)) == sign else (low, middle)
    return (low + high) / 2


def _check_authority(A: Array, b: Array, state: Sequence[sp.Symbol], names: Sequence[str], z: Array) -> None:
    if np.abs(b).max() <= _AUTHORITY * max(1.0, float(np.abs(A).max())):
        raise InputError(
            f"the amplitudes {', '.join(names)} have no authority: every bracket they scale vanishes at the equilibrium "
            f"{np.round(z, 6).tolist()}, so their first-order effect is zero there; choose an equilibrium off the symmetry "
            "or a direct input"
        )
    for root in np.linalg.eigvals(A):
        if root.real < -1e-9:
            continue
        pencil = np.hstack([root * np.eye(len(A)) - A, b.astype(np.complex128)])
        left, singular, _ = np.linalg.svd(pencil)
        if singular[len(A) - 1] < _AUTHORITY * singular[0]:
            vector = np.abs(left[:, len(A) - 1])
            parts = [str(s) for s, size in zip(state, vector, strict=True) if size > 1e-6]
            raise InputError(
                f"too few directions: rank [s - A, b] is {len(A) - 1} of {len(A)} at s = {root:.6g}; no amplitude reaches "
                f"the mode in ({', '.join(parts)}), which does not decay by itself"
            )


def _gains(A: Array, b: Array, poles: Sequence[complex] | None, weights: tuple[ArrayLike, ArrayLike] | None) -> Array:
    from scipy.linalg import solve_continuous_are
    from scipy.signal import place_poles

    if poles is not None:
        if len(poles) != len(A) or max(np.real(poles)) >= 0:
            raise InputError(f"poles: {len(A)} of negative real part are needed, got {list(poles)!r}")
        gains: Array = place_poles(A, b, np.array(poles)).gain_matrix
        return gains
    Q, R = weights if weights is not None else (np.eye(len(A)), np.eye(b.shape[1]))
    cost, effort = np.asarray(Q, dtype=np.float64), np.asarray(R, dtype=np.float64)
    if cost.shape != A.shape or effort.shape != (b.shape[1], b.shape[1]):
        raise InputError(f"weights: Q is {A.shape} and R ({b.shape[1]}, {b.shape[1]})")
    solution = solve_continuous_are(A, b, cost, effort)
    result: Array = np.linalg.solve(effort, b.T @ solution)
    return result
