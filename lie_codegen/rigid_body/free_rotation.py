"""lc.free_rotation: attitude and angular velocity of a torque-free body at any time, in closed form."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lie_codegen.arrays import Array
from lie_codegen.door import warn_caller
from lie_codegen.errors import AssumptionWarning, InputError, NotFiniteError, NotOnGroupError, ShapeError
from lie_codegen.groups.build import build
from lie_codegen.kernel.kernel import Kernel
from lie_codegen.kernel.saved import Saved
from lie_codegen.rigid_body.inertia_matrix import SPHERE, principal_axes
from lie_codegen.rigid_body.rotation_kernels import MOTION, NAMESPACE, free_rotation_kernels
from lie_codegen.runtime.broadcast import broadcast_call
from lie_codegen.runtime.library import Library
from lie_codegen.shapes import shaped

_SEPARATRIX, _PURE, _ROTATION = 1e-9, 1e-8, 1e-5


@dataclass(frozen=True, eq=False, repr=False)
class FreeRotation(Saved):
    """The torque-free rotation through (X0, omega0) at t = 0; with a batch of starts every fact is an array over it.

    Attributes:
        J: (3, 3) inertia, in the user's axes.
        X0, omega0: (..., 3, 3) body to inertial, (..., 3) [rad/s] body axes.
        motion: what `prepare` gives, by name.
        fixed: (...) where the motion is a rotation about a fixed axis that the formulas do not take: a sphere, pure spin about
            the middle axis, rest.
    """

    J: Array
    X0: Array
    omega0: Array
    motion: dict[str, Array] = field(repr=False)
    fixed: NDArray[np.bool_] = field(repr=False)

    def kernels(self, name: str = NAMESPACE) -> tuple[Kernel, ...]:
        """prepare and at, of any body, for lc.build and lc.generate.

        Args:
            name: C identifier that begins every symbol.
        """
        return free_rotation_kernels(name)

    @property
    def H(self) -> Array:
        """(..., 3) angular momentum, inertial [N m s]."""
        return np.asarray(np.einsum("...ij,jk,...k->...i", self.X0, self.J, self.omega0))

    @property
    def energy(self) -> Array:
        """(...) T [J]."""
        energy: Array = np.asarray(np.einsum("...i,ij,...j->...", self.omega0, self.J, self.omega0) / 2)[()]
        return energy

    @property
    def dynamic_inertia(self) -> Array:
        """(...) I_d = L^2 / 2T [kg m^2], between the smallest and the largest moment."""
        with np.errstate(invalid="ignore"):
            return np.asarray(np.sum(self.H**2, axis=-1) / (2 * self.energy))[()]

    @property
    def mode(self) -> Any:
        """ "SAM" where the motion circles the axis of the largest moment, "LAM" where that of the smallest; an array of them."""
        names = np.where(self.fixed, "fixed axis", np.where(self.motion["mode"] > 0.5, "SAM", "LAM"))
        return str(names) if names.ndim == 0 else names

    @property
    def k(self) -> Array:
        """(...) modulus; 0 at pure spin and of symmetric bodies."""
        return self.motion["k"] + 0.0  # the root of a negative zero is one

    @property
    def nutation_period(self) -> Array:
        """(...) Tn = 1 / |Lambda| [s], after which omega repeats; infinite about a fixed axis."""
        with np.errstate(divide="ignore"):
            return np.asarray(1 / np.abs(self.motion["Lambda"]))[()]

    @property
    def precession_rate(self) -> Array:
        """(...) m [rad/s]: X(t + Tn) = exp(hat(H/L) m Tn) X(t)."""
        return self.motion["m"]

    @property
    def geometric_phase(self) -> Array:
        """(...) m Tn - 2 T Tn / L [rad] = -(solid angle of J omega / L about its axis over one nutation, signed along the motion)."""
        length = np.linalg.norm(self.H, axis=-1)
        with np.errstate(invalid="ignore"):
            dynamic = 2 * self.energy / length
            return np.asarray((self.precession_rate - dynamic) * self.nutation_period)[()]

    def X(self, t: ArrayLike) -> Array:
        """Body to inertial at times t (...): (..., 3, 3); a batch of starts stands before the times."""
        return self._at(t)[0]

    def omega(self, t: ArrayLike) -> Array:
        """Angular velocity [rad/s] in body axes at times t (...): (..., 3)."""
        return self._at(t)[1]

    def _at(self, t: ArrayLike) -> tuple[Array, Array]:
        times = np.asarray(t, dtype=float)
        if not np.all(np.isfinite(times)):
            raise NotFiniteError("free_rotation: t holds NaN or infinity")
        lead, extra = self.fixed.shape, (1,) * times.ndim
        arguments = []
        for port in MOTION[:-1]:
            value = self.motion[port.name]
            arguments.append(np.reshape(value, (*lead, *extra, *port.shape)))
        X, omega = broadcast_call(_library()["at"], *arguments, times)
        if np.any(self.fixed):
            turned, steady = self._steady(times)
            mask = np.reshape(self.fixed, (*lead, *extra))
            X, omega = np.where(mask[..., None, None], turned, X), np.where(mask[..., None], steady, omega)
        return X, omega

    def _steady(self, times: Array) -> tuple[Array, Array]:
        """X0 exp(hat(omega0) t), by Rodrigues' formula."""
        extra = (1,) * times.ndim
        lead = self.fixed.shape
        w = np.reshape(self.omega0, (*lead, *extra, 3))
        speed = np.linalg.norm(w, axis=-1, keepdims=True)
        n = np.divide(w, speed, out=np.zeros_like(w), where=speed > 0)
        angle = (speed[..., 0] * times)[..., None, None]
        zero = np.zeros_like(n[..., 0])
        N = np.stack([zero, -n[..., 2], n[..., 1], n[..., 2], zero, -n[..., 0], -n[..., 1], n[..., 0], zero], axis=-1)
        N = N.reshape((*N.shape[:-1], 3, 3))
        R = np.eye(3) + np.sin(angle) * N + 2 * np.sin(angle / 2) ** 2 * (N @ N)
        start = np.reshape(self.X0, (*lead, *extra, 3, 3))
        return start @ R, np.broadcast_to(w, R.shape[:-1])


def free_rotation(J: Any, X: ArrayLike, omega: ArrayLike) -> FreeRotation:
    """The whole torque-free rotation of any rigid body, at any time at the same cost.

    X(t) = C(H/L) Rz(alpha(t)) A(l(t)), with elliptic functions in l and a sine series in alpha: long-axis and short-axis modes,
    symmetric and nearly symmetric bodies, pure spin.

    Args:
        J: three moments [kg m^2], or a 3 x 3 matrix in the user's axes.
        X: (3, 3) body to inertial at t = 0, or (..., 3, 3).
        omega: (3,) [rad/s] in body axes, or (..., 3); batches broadcast.

    Returns:
        The motion: `.X(t)` and `.omega(t)` at any times, `.k`, `.mode`, `.energy`, `.dynamic_inertia`, `.nutation_period`, `.precession_rate`,
        `.geometric_phase`, `.kernels()` for C. A body whose moments differ by less than 1e-9 of themselves turns as a sphere: an error that grows with t.

    Raises:
        InputError: an inertia of no body; a motion exactly on the separatrix, whose period is infinite.
        NotOnGroupError: X is no rotation (to 1e-5; within that the nearest one is taken).

    Source: Benson and Scheeres, JGCD 44 (2021), for the torus; the section is the shortest arc, which is never singular here.
    """
    return rotation_about(principal_axes(J), X, omega)


def rotation_about(principal: tuple[Array, Array, Array], X: ArrayLike, omega: ArrayLike) -> FreeRotation:
    """`free_rotation` of what `principal_axes` found."""
    matrix, moments, axes = principal
    start, rate = _rotation(X), np.asarray(omega, dtype=float)
    if rate.ndim < 1 or rate.shape[-1] != 3:
        raise ShapeError(f"free_rotation: omega has shape {rate.shape}, expected (..., 3)")
    if not np.isfinite(rate).all():
        raise NotFiniteError("free_rotation: omega holds NaN or infinity")
    if start.ndim == 2 and rate.ndim == 1:
        start, rate = start.copy(), rate.copy()
    else:
        lead = np.broadcast_shapes(start.shape[:-2], rate.shape[:-1])
        start, rate = np.broadcast_to(start, (*lead, 3, 3)).copy(), np.broadcast_to(rate, (*lead, 3)).copy()
    fixed = _fixed_axis(matrix, moments, rate)
    if not fixed.any():
        values = broadcast_call(_library()["prepare"], moments, axes, start, rate)
        return FreeRotation(matrix, start, rate, _named(values), fixed)
    # where the formulas do not apply, a harmless motion stands in: pure spin about the largest moment of another body
    harmless = np.where(fixed[..., None], axes[:, 2], rate)
    stand_in = moments if moments[2] - moments[0] > SPHERE * moments[2] else np.array([1.0, 1.2, 1.4])
    motion = _named(broadcast_call(_library()["prepare"], stand_in, axes, start, harmless))
    speed = np.linalg.norm(rate, axis=-1)
    for name, value in (("k", 0.0), ("Lambda", 0.0), ("m", speed)):
        motion[name] = np.where(fixed, value, motion[name])[()]
    return FreeRotation(matrix, start, rate, motion, fixed)


def _named(values: tuple[Array, ...]) -> dict[str, Array]:
    return {port.name: np.asarray(value) for port, value in zip(MOTION, values, strict=True)}


def _fixed_axis(J: Array, moments: Array, omega: Array) -> NDArray[np.bool_]:
    """Where the motion is a rotation about a fixed axis outside of the formulas; refuses what has no period."""
    low, middle, high = moments.tolist()
    if high - low <= SPHERE * high:
        return np.ones(omega.shape[:-1], dtype=bool)
    # a single motion is judged in Python's numbers, a batch in arrays: the formulas are the same
    a, b, c = omega.tolist() if omega.ndim == 1 else np.moveaxis(omega, -1, 0)
    p, q, r = (row[0] * a + row[1] * b + row[2] * c for row in J.tolist())
    speed, square, twice = a * a + b * b + c * c, p * p + q * q + r * r, a * p + b * q + c * r
    size = np.sqrt(speed) * np.sqrt(square)
    across = np.sqrt((b * r - c * q) ** 2 + (c * p - a * r) ** 2 + (a * q - b * p) ** 2)
    rest = size == 0
    near = ~rest & (np.abs(square - middle * twice) < _SEPARATRIX * middle * twice)
    pure = near & (across < _PURE * size)
    if np.any(near & ~pure):
        raise InputError(
            "free_rotation: the motion is on the separatrix (L^2 / 2T is the middle moment of inertia to 1e-9): its period is "
            "infinite; change omega a little"
        )
    if np.any(pure) and middle - low > SPHERE * high and high - middle > SPHERE * high:
        warn_caller(
            "free_rotation: pure spin about the middle axis is unstable; the steady rotation is returned, which no real body keeps",
            AssumptionWarning,
        )
    return np.asarray(rest | pure)


def _rotation(X: ArrayLike) -> Array:
    start = shaped(X, (..., 3, 3), "X")
    finite = np.isfinite(start).all()
    defect = np.abs(np.swapaxes(start, -1, -2) @ start - np.eye(3)).max() if finite else np.inf
    if not defect <= _ROTATION or np.any(_determinant(start) < 0):
        raise NotOnGroupError(f"X is no rotation: X^T X differs from 1 by {defect:.3g}, or det X < 0")
    if defect < 1e-13:
        return start
    u, _, v = np.linalg.svd(start)
    return np.asarray(u @ v)


def _determinant(X: Array) -> Any:
    """(...) by the rule of Sarrus."""
    (a, b, c), (d, e, f), (g, h, i) = X.tolist() if X.ndim == 2 else np.moveaxis(X, (-2, -1), (0, 1))
    return a * (e * i - f * h) + b * (f * g - d * i) + c * (d * h - e * g)


@lru_cache(maxsize=1)
def _library() -> Library:
    return build(free_rotation_kernels())
