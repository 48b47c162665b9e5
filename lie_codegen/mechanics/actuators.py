"""Internal actuators of a rigid body with zero angular momentum: momentum wheels and a point-mass oscillator.

Both turn shape velocities into body angular velocity, X' = X hat(Omega). TR 93-59, section 6.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.errors import InputError, NotFiniteError, ShapeError
from lie_codegen.exact.numbers import exact_number
from lie_codegen.kernel.saved import Saved
from lie_codegen.on_demand import sympy as sp
from lie_codegen.shapes import shaped
from lie_codegen.values import settle


@dataclass(frozen=True, eq=False, repr=False)
class MomentumWheels(Saved):
    """p wheels fixed in a rigid body, any axes; Omega = C theta', (68).

    Attributes:
        inertia: (3, 3) J*, the body without wheels, in body axes. [kg m^2]
        axes: (p, 3) directions b_i; made unit vectors, exactly.
        axial: (p,) j_i, the moment of inertia of wheel i about b_i. [kg m^2]
        transverse: (p,) k_i, about any axis orthogonal to b_i. [kg m^2]

    Raises:
        ShapeError: if the numbers of axes and of moments differ, or the inertia is not 3 x 3.
        InputError: an inertia that is not symmetric positive definite, a zero axis, a negative moment.
    """

    inertia: Any
    axes: Any
    axial: Any
    transverse: Any

    def __post_init__(self) -> None:
        inertia = positive_inertia(self.inertia, "MomentumWheels: inertia")
        axes = _matrix(self.axes, "MomentumWheels: axes")
        if axes.cols != 3:
            raise ShapeError(f"MomentumWheels: axes has {axes.cols} columns; each axis has 3 components")
        units = []
        for i in range(axes.rows):
            length = sp.sqrt(sp.expand(sum(value**2 for value in axes.row(i))))
            if length == 0:
                raise InputError(f"MomentumWheels: axis {i + 1} is zero")
            units.append([sp.radsimp(value / length) for value in axes.row(i)])
        moments = {}
        for name in ("axial", "transverse"):
            values = tuple(_exact(value) for value in getattr(self, name))
            if len(values) != axes.rows:
                raise ShapeError(f"MomentumWheels: {name} has {len(values)} entries for {axes.rows} wheels")
            if any(value < 0 for value in values):
                raise InputError(f"MomentumWheels: {name} holds a negative moment of inertia")
            moments[name] = values
        settle(self, inertia=inertia, axes=sp.ImmutableMatrix(units), **moments)

    @property
    def count(self) -> int:
        """p."""
        return int(self.axes.rows)

    @cached_property
    def locked_inertia(self) -> sp.ImmutableMatrix:
        """J = J* + sum_i k_i I + (j_i - k_i) b_i b_i^T."""
        total = sp.Matrix(self.inertia)
        for i, (j, k) in enumerate(zip(self.axial, self.transverse, strict=True)):
            b = self.axes.row(i).T
            total += k * sp.eye(3) + (j - k) * b * b.T
        return sp.ImmutableMatrix(total.applyfunc(sp.expand))

    @cached_property
    def exact_C(self) -> sp.ImmutableMatrix:
        """(3, p) C = -J^{-1} [j_1 b_1, .., j_p b_p], (68)."""
        momenta = sp.Matrix.hstack(*(j * self.axes.row(i).T for i, j in enumerate(self.axial)))
        return sp.ImmutableMatrix((-self.locked_inertia.inv() * momenta).applyfunc(sp.radsimp))

    @property
    def C(self) -> Array:
        """(3, p) in doubles."""
        return np.array(self.exact_C.tolist(), dtype=float)

    def body_rate(self, wheel_rates: ArrayLike) -> Array:
        """Omega = C theta', TR 93-59, (69).

        Args:
            wheel_rates: (..., p) theta'. [rad/s]

        Returns:
            (..., 3). [rad/s]

        Raises:
            ShapeError: the last axis is not p.
        """
        rates = shaped(wheel_rates, (..., self.count), "MomentumWheels.body_rate: wheel_rates")
        return np.asarray(rates @ self.C.T)

    def body_areas(self, wheel_areas: ArrayLike) -> Array:
        """Areas of the integrals of Omega: C area C^T, TR 93-59, section 6.1.

        For three wheels this is (Area_23, Area_31, Area_12) = cof(C) (area_23, area_31, area_12).

        Args:
            wheel_areas: (p, p) antisymmetric areas of the wheel angles. [rad^2]

        Returns:
            (3, 3). [rad^2]

        Raises:
            ShapeError: the areas are not (p, p).
        """
        areas = shaped(wheel_areas, (self.count, self.count), "MomentumWheels.body_areas: wheel_areas")
        return np.asarray(self.C @ areas @ self.C.T)

    @property
    def area_transform(self) -> Array:
        """(3, 3) cof(C) = det(C) C^{-T}, for three wheels.

        Raises:
            InputError: for another number of wheels; use `body_areas`.
        """
        if self.count != 3:
            raise InputError(
                f"area_transform: {self.count} wheels; the cofactor matrix is that of three: use body_areas"
            )
        return np.array(self.exact_C.cofactor_matrix().tolist(), dtype=float)


@dataclass(frozen=True, eq=False, repr=False)
class PointMassOscillator(Saved):
    """A point mass moved along y(t) in body axes, starting at the centre of mass; section 6.2.

    Attributes:
        body_mass, point_mass: m_0, m_1. [kg]
        inertia: (3, 3) I_0 of the body alone. [kg m^2]

    Raises:
        InputError: a mass that is not positive, an inertia that is not symmetric positive definite.
    """

    body_mass: Any
    point_mass: Any
    inertia: Any

    def __post_init__(self) -> None:
        masses = {"body_mass": _exact(self.body_mass), "point_mass": _exact(self.point_mass)}
        for name, value in masses.items():
            if not value > 0:
                raise InputError(f"PointMassOscillator: {name} must be positive, got {value}")
        settle(self, inertia=positive_inertia(self.inertia, "PointMassOscillator: inertia"), **masses)

    @property
    def reduced_mass(self) -> sp.Expr:
        """alpha_m = m_0 m_1 / (m_0 + m_1). [kg]"""
        return self.body_mass * self.point_mass / (self.body_mass + self.point_mass)

    def locked_inertia(self, y: ArrayLike) -> Array:
        """I_lock(y) = I_0 + alpha_m (|y|^2 I - y y^T). [kg m^2]

        Args:
            y: (..., 3) position of the point mass in body axes. [m]

        Returns:
            (..., 3, 3).

        Raises:
            ShapeError: the last axis is not 3.
        """
        position = shaped(y, (..., 3), "PointMassOscillator.locked_inertia: y")
        square = np.sum(position**2, axis=-1)[..., None, None] * np.eye(3)
        outer = position[..., :, None] * position[..., None, :]
        return np.asarray(np.array(self.inertia.tolist(), dtype=float) + float(self.reduced_mass) * (square - outer))

    def body_rate(self, y: ArrayLike, y_dot: ArrayLike) -> Array:
        """Omega = -alpha_m I_lock(y)^{-1} (y x y'), TR 93-59, (70).

        Args:
            y: (..., 3) position of the point mass in body axes. [m]
            y_dot: (..., 3) its rate. [m/s]

        Returns:
            (..., 3). [rad/s]

        Raises:
            ShapeError: a last axis that is not 3.
        """
        momentum = float(self.reduced_mass) * np.cross(
            shaped(y, (..., 3), "PointMassOscillator.body_rate: y"),
            shaped(y_dot, (..., 3), "PointMassOscillator.body_rate: y_dot"),
        )
        return -np.asarray(np.linalg.solve(self.locked_inertia(y), momentum[..., None])[..., 0])


def positive_inertia(value: Any, where: str) -> sp.ImmutableMatrix:
    """An exact symmetric positive definite (3, 3) matrix; three numbers are its diagonal.

    Raises:
        ShapeError, InputError: naming `where`.
    """
    if np.ndim(value) == 0 and not isinstance(value, sp.MatrixBase):
        raise ShapeError(f"{where} is {value!r:.60}; give (3, 3), or three principal moments")
    rows = value.tolist() if isinstance(value, np.ndarray | sp.MatrixBase) else list(value)
    if len(rows) == 3 and not any(isinstance(row, Sequence) and not isinstance(row, str) for row in rows):
        matrix = sp.diag(*(_exact(entry) for entry in rows))
    else:
        matrix = _matrix(rows, where)
    if matrix.shape != (3, 3):
        raise ShapeError(f"{where} has shape {matrix.shape}; give (3, 3), or three principal moments")
    if matrix != matrix.T:
        raise InputError(f"{where} is not symmetric")
    if not all(matrix[:k, :k].det() > 0 for k in (1, 2, 3)):
        raise InputError(f"{where} is not positive definite")
    return sp.ImmutableMatrix(matrix)


def _matrix(value: Any, where: str) -> sp.Matrix:
    rows = value.tolist() if isinstance(value, np.ndarray | sp.MatrixBase) else value
    if (
        not isinstance(rows, Sequence)
        or not rows
        or any(isinstance(row, str) or not isinstance(row, Sequence) for row in rows)
    ):
        raise ShapeError(f"{where} must be a list of rows, given {value!r:.60}")
    if len({len(row) for row in rows}) != 1:
        raise ShapeError(f"{where} must be a list of rows of one length")
    return sp.Matrix([[_exact(entry) for entry in row] for row in rows])


def _exact(value: Any) -> sp.Expr:
    """A number exactly; a float at its exact binary value."""
    if isinstance(value, float | np.floating):
        if not np.isfinite(value):
            raise NotFiniteError(f"{value} is not finite")
        return sp.Rational(*float(value).as_integer_ratio())
    return exact_number(value)
