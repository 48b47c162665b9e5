"""A body with wheels: its numbers, rates, speeds and momentum, TR 93-59, section 6.1."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.errors import InputError
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernel.saved import Saved
from lie_codegen.mechanics.actuators import MomentumWheels
from lie_codegen.mechanics.body_frame import body_frame
from lie_codegen.on_demand import sympy as sp


@dataclass(frozen=True, eq=False, repr=False)
class WheeledBody(Saved):
    """A body with momentum wheels on a group of rotations.

    Attributes:
        group: rotations of space as 3 x 3 matrices in any basis, or SU(2).
        wheels: body and wheels; `wheels.locked_inertia` is J.
        directions: (p, 3) the axes as given, exact; those of `wheels` have unit length.
        stored: (3,) H, the total angular momentum in space. [N m s]
        speed_limits, torque_limits: (p,) of each wheel [rad/s], [N m], or None.
    """

    group: MatrixGroup
    wheels: MomentumWheels
    directions: Any = field(repr=False)
    stored: Array
    speed_limits: Array | None
    torque_limits: Array | None

    @property
    def count(self) -> int:
        """p."""
        return self.wheels.count

    @cached_property
    def C(self) -> Array:
        """(3, p) w = C O where nothing is stored, (68)."""
        return self.wheels.C

    @cached_property
    def inertia(self) -> Array:
        """(3, 3) J, wheels locked. [kg m^2]"""
        return np.array(self.wheels.locked_inertia.tolist(), dtype=float)

    @cached_property
    def momenta(self) -> Array:
        """(3, p) j_i b_i: the momentum of the wheels is this times their speeds."""
        return np.array([[float(j * b) for b in self.wheels.axes.row(i)] for i, j in enumerate(self.wheels.axial)]).T

    @cached_property
    def axes(self) -> Array:
        """(p, 3) unit axes b_i."""
        return np.array(self.wheels.axes.tolist(), dtype=float)

    @cached_property
    def rank(self) -> int:
        """How many directions the wheels span."""
        return int(sp.Matrix(self.directions).rank())

    @cached_property
    def frame(self) -> Array:
        """(3, 3) the basis of the group in body axes, a column each."""
        return np.array(body_frame(self.group, "momentum_wheels").tolist(), dtype=float)

    def rotation(self, X: ArrayLike) -> Array:
        """(..., 3, 3) the rotation of elements of the group: Ad_X in body axes."""
        elements = np.asarray(X)
        moved = elements[..., None, :, :] @ self.group.basis @ np.linalg.inv(elements)[..., None, :, :]
        adjoint = np.swapaxes(self.group.project(moved), -1, -2)
        return np.asarray(self.frame @ adjoint @ np.linalg.inv(self.frame))

    def attitude_error(self, X: ArrayLike, X_d: ArrayLike) -> Array:
        """(...,) the angle between two attitudes, in rad, whatever the basis: 2 arcsin(|R_d^T R - 1|_F / sqrt 8)."""
        relative = np.swapaxes(self.rotation(X_d), -1, -2) @ self.rotation(X)
        chord = np.linalg.norm(relative - np.eye(3), axis=(-2, -1)) / np.sqrt(8)
        return np.asarray(2 * np.arcsin(np.minimum(chord, 1.0)))

    def body_rate(self, speeds: ArrayLike, X: ArrayLike | None = None) -> Array:
        """w = C O + J^{-1} R^T H: (..., p) -> (..., 3). [rad/s]

        Raises:
            InputError: momentum is stored and no attitude is given.
        """
        rate = np.asarray(speeds, dtype=float) @ self.C.T
        return np.asarray(rate + self._carried(X) @ np.linalg.inv(self.inertia).T)

    def wheel_speeds(self, body_rate: ArrayLike, X: ArrayLike | None = None) -> Array:
        """The speeds of least |O| that give the body a rate: (..., 3) -> (..., p). [rad/s]

        Raises:
            InputError: the wheels cannot give that rate (two wheels span a plane); or as `body_rate`.
        """
        wanted = self._carried(X) - np.asarray(body_rate, dtype=float) @ self.inertia.T
        speeds = wanted @ np.linalg.pinv(self.momenta).T
        missed = float(np.max(np.abs(speeds @ self.momenta.T - wanted), initial=0.0))
        if missed > 1e-9 * max(1.0, float(np.max(np.abs(wanted), initial=0.0))):
            raise InputError(
                f"momentum_wheels: {self.count} wheels that span {self.rank} directions do not give this rate"
            )
        return np.asarray(speeds)

    def momentum(self, X: ArrayLike, body_rate: ArrayLike, speeds: ArrayLike) -> Array:
        """R (J w + sum j_i b_i O_i): (..., 3), the same at all times. [N m s]"""
        inside = np.asarray(body_rate) @ self.inertia.T + np.asarray(speeds) @ self.momenta.T
        return np.asarray((self.rotation(X) @ inside[..., None])[..., 0])

    def rest_speeds(self, X: ArrayLike | None = None) -> Array:
        """(p,) the least speeds with which the body is at rest: they hold the stored momentum.

        Raises:
            InputError: the wheels cannot hold it.
        """
        return self.wheel_speeds(np.zeros(3), np.eye(self.group.degree) if X is None else X)

    def _carried(self, X: ArrayLike | None) -> Array:
        """(..., 3) R^T H."""
        if not np.any(self.stored):
            return np.zeros(3)
        if X is None:
            raise InputError("momentum_wheels: with stored momentum the rate depends on the attitude; give X")
        return np.asarray(np.swapaxes(self.rotation(X), -1, -2) @ self.stored)
