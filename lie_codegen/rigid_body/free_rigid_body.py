"""lc.free_rigid_body: the torque-free motion of an asymmetric body in the coordinates (Omega, k, phi)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.errors import InputError
from lie_codegen.groups.build import build
from lie_codegen.kernel.elliptic import LARGEST_MODULUS
from lie_codegen.kernel.kernel import Kernel
from lie_codegen.kernel.saved import Saved
from lie_codegen.rigid_body import euler_kernels
from lie_codegen.rigid_body.principal_body import TAU, PrincipalBody, principal_body
from lie_codegen.runtime.broadcast import broadcast_call
from lie_codegen.runtime.library import Library

NAMESPACE = "rigid_body"
#: Of a matrix of inertia, relative to its largest entry.
_SYMMETRIC = 1e-12


class SlowState(NamedTuple):
    """Coordinates of a torque-free motion.

    Attributes:
        Omega: the largest rate about the third axis [rad/s], positive.
        k: the modulus, 0 (steady spin) to 1 (separatrix).
        phi: u / (4 K(k)), of period 1.
    """

    Omega: Array
    k: Array
    phi: Array


@dataclass(frozen=True, eq=False, repr=False)
class FreeRigidBody(Saved):
    """A rigid body in the coordinates (Omega, k, phi) of its torque-free motions.

        omega = (s1 G13 k Omega cn, s2 G23 k Omega sn, s3 Omega dn) at u = 4 K(k) phi            (9), (10)

    along the paper's axes (`model.axes`); the functions below take and give the user's axes. Functions of a body
    whose inertia depends on the slow time take `tau`.

    Attributes:
        model: the exact body: moments, axes, signs, J, Gamma; in principal axes.
        columns: the principal axes in the user's axes, row by row, of an inertia given as a matrix; None for principal ones.
    """

    model: PrincipalBody
    columns: tuple[tuple[float, ...], ...] | None = None

    @property
    def rotation(self) -> Array:
        """(3, 3) R with the principal axes as columns, right-handed: inertia = R diag(moments) R^T, omega = R omega_principal."""
        return np.eye(3) if self.columns is None else np.array(self.columns)

    def kernels(self, name: str = NAMESPACE) -> tuple[Kernel, ...]:
        """to_slow, from_slow, frequency and constants_of_motion, for lc.build and lc.generate.

        Args:
            name: C identifier that begins every symbol.
        """
        return _kernels(self.model, name)

    @property
    def library(self) -> Library:
        """The compiled kernels."""
        return _library(self.model)

    def to_slow(self, omega: ArrayLike, tau: ArrayLike = 0.0) -> SlowState:
        """(Omega, k, phi) of angular velocities.

        Args:
            omega: (..., 3) [rad/s] in the user's axes.
            tau: slow time, used where the inertia depends on it.

        Returns:
            Omega [rad/s], k, and phi in (-1/2, 1/2], each (...).

        Raises:
            InputError: a motion at rest, on the separatrix, about another axis, or of the other sense of spin than
                this body was made for; the message says which body to make instead.
        """
        omega = self._principal(omega)
        spin, k, phi = self._call("to_slow", (omega,), tau)
        third, sign = self.model.axes[2]
        along = np.broadcast_to(sign * omega[..., third], np.shape(k))
        if np.any(spin == 0):
            raise InputError("omega = 0: a body at rest has no phase")
        if np.any(k > 1):
            raise InputError(self._other_axis(omega))
        if np.any(k > LARGEST_MODULUS):
            raise InputError(
                f"k = {float(np.max(k))!r} is at the separatrix (L^2 / 2T equals the middle moment of inertia): the "
                "period is infinite there and the coordinates, and averaging, do not apply"
            )
        if np.any(along * self.model.signs[2] < 0):
            flipped = tuple(int(-s) if n != 1 else int(s) for n, s in enumerate(self.model.signs))
            raise InputError(
                f"the body spins about its third axis (user axis {third + 1}) in the other sense than "
                f"s3 = {self.model.signs[2]}: make it with signs={flipped}, or use body.adapted_to(omega)"
            )
        return SlowState(spin, k, phi)

    def from_slow(self, Omega: ArrayLike, k: ArrayLike, phi: ArrayLike, tau: ArrayLike = 0.0) -> Array:
        """omega (..., 3) [rad/s] in the user's axes, (9).

        Raises:
            InputError: Omega < 0, or k outside [0, 0.999999].
        """
        check_slow(Omega, k)
        omega = self._call("from_slow", (Omega, k, phi), tau)[0]
        return omega if self.columns is None else np.asarray(omega @ self.rotation.T)

    def frequency(self, Omega: ArrayLike, k: ArrayLike, tau: ArrayLike = 0.0) -> Array:
        """Lambda = phi' [1/s] of the torque-free motion: negative where the third axis has the largest inertia."""
        check_slow(Omega, k)
        return self._call("frequency", (Omega, k), tau)[0]

    def motion(self, omega0: ArrayLike, t: ArrayLike) -> Array:
        """The torque-free solution through omega0 (3,) at times t (...): (..., 3) [rad/s]."""
        spin, k, phi = self.to_slow(omega0)
        return self.from_slow(spin, k, phi + self.frequency(spin, k) * np.asarray(t, dtype=np.float64))

    def energy_and_momentum(self, omega: ArrayLike, tau: ArrayLike = 0.0) -> tuple[Array, Array]:
        """T [J] and |L| [N m s], (5)."""
        energy, momentum = self._call("constants_of_motion", (self._principal(omega),), tau)
        return energy, momentum

    def adapted_to(self, omega: ArrayLike) -> FreeRigidBody:
        """The body with the axes and signs (s1 = 1) that Table 1 asks for at omega (3,).

        Raises:
            InputError: omega is on the separatrix.
        """
        vector = self._principal(omega)
        moments = np.array([float(value.subs(TAU, 0)) for value in self.model.inertia])
        energy, momentum = float(moments @ vector**2), float(moments**2 @ vector**2)
        middle = float(np.sort(moments)[1])
        if momentum == energy * middle:
            raise InputError("omega is on the separatrix (L^2 / 2T equals the middle moment of inertia)")
        axis = "max" if momentum > energy * middle else "min"
        if self.model.axes[2][0] == int(np.argmax(moments) if axis == "max" else np.argmin(moments)):
            axes = self.model.axes
        else:
            axes = principal_body(self.model.inertia, axis=axis).axes
        third, sign = axes[2]
        spin = 1 if sign * vector[third] >= 0 else -1
        return FreeRigidBody(PrincipalBody(self.model.inertia, axes, (1, -spin, spin)), self.columns)

    def _principal(self, omega: ArrayLike) -> Array:
        """(..., 3) along the principal axes."""
        vector = np.asarray(omega, dtype=np.float64)
        return vector if self.columns is None else np.asarray(vector @ self.rotation)

    def _other_axis(self, omega: Array) -> str:
        third = self.model.axes[2][0] + 1
        moments = [float(value.subs(TAU, 0)) for value in self.model.inertia]
        here = "max" if moments[third - 1] == max(moments) else "min"
        other = "min" if here == "max" else "max"
        return (
            f"the motion does not circle user axis {third} ({here}imum inertia): L^2 / 2T is on the other side of the "
            f"middle moment of inertia; make the body with axis={other!r}, or use body.adapted_to(omega)"
        )

    def _call(self, name: str, arguments: tuple[Any, ...], tau: ArrayLike) -> tuple[Array, ...]:
        return broadcast_call(self.library[name], *(arguments if self.model.is_constant else (*arguments, tau)))


def free_rigid_body(
    inertia: Any,
    *,
    axis: str | None = None,
    signs: Sequence[int] = (1, -1, 1),
    rates: Sequence[Any] | None = None,
) -> FreeRigidBody:
    """The torque-free asymmetric rigid body in elliptic coordinates.

    Args:
        inertia: (I1, I2, I3) [kg m^2], numbers or formulas in tau such as "10 + 0.04*tau^2"; or a symmetric (3, 3) matrix of
            numbers, which is diagonalised: `body.rotation` keeps the principal axes, the moments ascend, and angular velocities
            stay those of the user's axes.
        axis: "max" or "min", the axis of inertia the motion circles (Table 1); None: the third as given where the
            second moment is the middle one, else "max".
        signs: (s1, s2, s3), product -1; s3 is the sense of spin about the third axis.
        rates: dI/dtau, for moments given as numbers.

    Raises:
        InputError: moments that no asymmetric body has, signs of product +1, an unknown axis.

    Source: Coppola, The method of averaging for Euler's equations of rigid body motion, (9)-(15), Table 1.
    """
    moments, columns = _diagonalised(inertia)
    if columns is not None and rates is not None:
        raise InputError("free_rigid_body: rates are of principal moments; give these, not a matrix")
    return FreeRigidBody(principal_body(moments, axis=axis, signs=signs, rates=rates), columns)


def _diagonalised(inertia: Any) -> tuple[Any, tuple[tuple[float, ...], ...] | None]:
    """Principal moments, and the axes of a matrix; None where the user's axes are principal."""
    rows = inertia.tolist() if hasattr(inertia, "tolist") else inertia
    if (
        isinstance(rows, str)
        or not isinstance(rows, Sequence)
        or not all(isinstance(row, list | tuple) for row in rows)
    ):
        return rows, None
    try:
        matrix = np.array(rows, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError(
            "free_rigid_body: a matrix of inertia holds numbers; formulas are for principal moments"
        ) from None
    if matrix.shape != (3, 3) or not np.all(np.isfinite(matrix)):
        raise InputError(f"free_rigid_body: inertia {matrix.shape} is no finite (3, 3) matrix and no three moments")
    if np.max(np.abs(matrix - matrix.T)) > _SYMMETRIC * np.max(np.abs(matrix)):
        raise InputError("free_rigid_body: the matrix of inertia is not symmetric")
    if not np.any(matrix - np.diag(np.diag(matrix))):
        return np.diag(matrix).tolist(), None
    moments, axes = np.linalg.eigh((matrix + matrix.T) / 2)
    axes[:, 0] *= np.sign(np.linalg.det(axes))  # right-handed
    return moments.tolist(), tuple(tuple(row) for row in axes.tolist())


def _kernels(model: PrincipalBody, namespace: str = NAMESPACE) -> tuple[Kernel, ...]:
    make = euler_kernels
    return (
        make.to_slow(model, namespace),
        make.from_slow(model, namespace),
        make.frequency(model, namespace),
        make.constants_of_motion(model, namespace),
    )


@lru_cache(maxsize=64)
def _library(model: PrincipalBody) -> Library:
    return build(_kernels(model))


def check_slow(Omega: ArrayLike, k: ArrayLike) -> None:
    """Refuse coordinates of no motion.

    Raises:
        InputError: Omega < 0 or k outside [0, 0.999999], with the reason.
    """
    if np.any(np.asarray(Omega, dtype=np.float64) < 0):
        raise InputError("Omega < 0: it is an amplitude; the sense of spin is the body's sign s3")
    modulus = np.asarray(k, dtype=np.float64)
    if np.any(modulus < 0):
        raise InputError(f"k = {float(np.min(modulus))!r} is negative; the modulus k is in [0, 1)")
    if np.any(modulus > LARGEST_MODULUS):
        raise InputError(
            f"k = {float(np.max(modulus))!r} is beyond {LARGEST_MODULUS}: at the separatrix (k = 1) the period is "
            "infinite, the slow variables are no longer slow against the phase, and averaging does not apply"
        )
