"""Between actual and averaged states: y = shift(tau) o flow_1(Lambda(tau)) (z), batched, in numpy."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.algebra.brackets import dexp_inverse
from lie_codegen.arrays import Array
from lie_codegen.errors import InputError, ShapeError
from lie_codegen.flow.batched_exponential import expm
from lie_codegen.kernel.runge_kutta import CLASSICAL, TUPLES, increment
from lie_codegen.mechanics.mechanical_fields import MechanicalFields
from lie_codegen.mechanics.polynomial_fields import Field
from lie_codegen.mechanics.polynomial_kernels import evaluate
from lie_codegen.shapes import shaped

#: Steps of the unit-time flow of the frozen correction, a motion of size eps: its error is far below that of any order.
_FLOW_STEPS = 8


@dataclass(frozen=True, eq=False)
class AveragingMap:
    """The map of the averaged state to the actual one at a fast time, by the fields of an average.

    Attributes:
        fields: F_q, Lambda_q and the shift.
    """

    fields: MechanicalFields

    def estimated(self, X: ArrayLike, xi: ArrayLike, tau: ArrayLike, eps: ArrayLike, order: int) -> tuple[Array, Array]:
        """(X, xi) averaged, of actual ones at fast time tau, by Lambda_1 .. Lambda_{order - 1}."""
        Y, eta, when, small = self._points(X, xi, tau, eps)
        # The shift moves xi by a field of X alone, and X not at all: it is undone by its negative, at the same X. The unit-time flow of a
        # field that is frozen in tau is undone by that of its negative, exactly.
        return self._flow(Y, eta - self._shift(Y, when), when, -small, small, order)

    def reconstructed(
        self, X: ArrayLike, xi: ArrayLike, tau: ArrayLike, eps: ArrayLike, order: int
    ) -> tuple[Array, Array]:
        """(X, xi) actual, of averaged ones; see `estimated`."""
        Y, eta, when, small = self._points(X, xi, tau, eps)
        moved_X, moved_xi = self._flow(Y, eta, when, small, small, order)
        return moved_X, moved_xi + self._shift(moved_X, when)

    def state(self, xi: ArrayLike, X: ArrayLike | None, advected: dict[str, ArrayLike]) -> Array:
        """(..., n + m) velocity and advected vectors, those of X where it is given.

        Raises:
            InputError, ShapeError: naming what does not fit.
        """
        velocity = shaped(xi, (..., self.fields.system.dim), "xi")
        if X is not None:
            if advected:
                raise InputError("give X or the advected vectors, not both")
            parts = [velocity, self.fields.system.seen(np.asarray(X))]
        else:
            names = [a.name for a in self.fields.system.advected]
            wrong = [
                *(name for name in names if name not in advected),
                *(name for name in advected if name not in names),
            ]
            if wrong:
                raise InputError(
                    f"advected vectors: {', '.join(names) or 'none'} needed, got {', '.join(advected) or 'none'}"
                )
            parts = [velocity, *(np.asarray(advected[name], dtype=float) for name in names)]
        for vector, part in zip(self.fields.system.advected, parts[1:] if X is None else (), strict=False):
            if part.shape[-1:] != (vector.size,):
                raise ShapeError(f"{vector.name} has shape {part.shape}; its last axis must be {vector.size}")
        shape = np.broadcast_shapes(*(part.shape[:-1] for part in parts))
        return np.concatenate([np.broadcast_to(part, (*shape, part.shape[-1])) for part in parts], axis=-1)

    def _points(self, X: ArrayLike, xi: ArrayLike, tau: ArrayLike, eps: ArrayLike) -> tuple[Array, Array, Array, Array]:
        group = self.fields.system.group
        Y = np.asarray(X, dtype=complex if group.is_complex else float)
        eta, when, small = (np.asarray(each, dtype=float) for each in (xi, tau, eps))
        d, n = group.degree, group.dim
        if Y.shape[-2:] != (d, d) or eta.shape[-1:] != (n,):
            raise ShapeError(
                f"X has shape {Y.shape} and xi {eta.shape}; {group.name} needs (..., {d}, {d}) and (..., {n})"
            )
        if np.any(small <= 0):
            raise InputError("eps must be positive")
        shape = np.broadcast_shapes(Y.shape[:-2], eta.shape[:-1], when.shape, small.shape)
        return (
            np.broadcast_to(Y, (*shape, d, d)), np.broadcast_to(eta, (*shape, n)),
            np.broadcast_to(when, shape), np.broadcast_to(small, shape),
        )  # fmt: skip

    def at(self, field: Field, when: Array) -> Array:
        """(..., K) coefficients at fast times, by trigonometric interpolation, which is exact."""
        M, values = self.fields.nodes, field.values
        spectrum = np.fft.rfft(np.broadcast_to(values, (len(values), M)), axis=1) / M
        spectrum[:, 1:] *= 2
        waves = np.exp(2j * np.pi / self.fields.forcing.period * when[..., None] * np.arange(spectrum.shape[1]))
        return np.asarray((waves @ spectrum.T).real)

    def value(self, field: Field, state: Array, values: Array | None = None) -> Array:
        """(..., 2, n) a field at states: alpha, beta."""
        flat = evaluate(self.fields.space, field, state, values)
        return np.asarray(flat.reshape(*flat.shape[:-1], 2, self.fields.system.dim))

    def _shift(self, X: Array, when: Array) -> Array:
        """U^a(tau) Y_a(Gamma), (..., n)."""
        state = self.state(np.zeros((*X.shape[:-2], self.fields.system.dim)), X, {})
        U = self.fields.shift(when)
        parts = [U[..., a, None] * self.value(lift, state)[..., 1, :] for a, lift in enumerate(self.fields.lifts)]
        return np.asarray(sum(parts[1:], parts[0]))

    def _flow(self, X: Array, xi: Array, when: Array, first: Array, eps: Array, order: int) -> tuple[Array, Array]:
        """Unit-time flow of first * sum eps^(q-1) Lambda_q(tau): fourth order on the group, batched."""
        logarithms = self.fields.solution[1][: order - 1]
        if not logarithms:
            return X, xi
        frozen = [(f, first[..., None] * eps[..., None] ** q * self.at(f, when)) for q, f in enumerate(logarithms)]
        group, h = self.fields.system.group, 1 / _FLOW_STEPS

        def slope(_: float, moved: tuple[Array, Array]) -> tuple[Array, Array]:
            theta, change = moved
            state = self.state(xi + change, X @ expm(group.hat(theta)), {})
            parts = [self.value(f, state, values) for f, values in frozen]
            total = sum(parts[1:], parts[0])
            alpha, beta = total[..., 0, :], total[..., 1, :]
            return dexp_inverse(group.algebra, theta, alpha), beta

        for _ in range(_FLOW_STEPS):
            theta, change = increment(TUPLES, CLASSICAL, slope, (np.zeros_like(xi), np.zeros_like(xi)), h)
            X, xi = X @ expm(group.hat(theta)), xi + change
        return X, xi
