"""A body under torques with its compiled kernels: what averaged and direct motions have in common."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.errors import InputError, ShapeError
from lie_codegen.groups.build import build
from lie_codegen.kernel.kernel import Kernel
from lie_codegen.kernel.saved import Saved
from lie_codegen.rigid_body.free_rotation import FreeRotation, rotation_about
from lie_codegen.rigid_body.inertia_matrix import principal_axes
from lie_codegen.rigid_body.torques import Torque
from lie_codegen.rigid_body.tumbling_kernels import NAMESPACE, tumbling_kernels
from lie_codegen.runtime.library import Library
from lie_codegen.runtime.ode_field import Field


class BodyAxes(NamedTuple):
    """The axes in which a motion is averaged: the second moment is the middle one, the third axis is the one circled."""

    paper: Array
    inertia: Array
    mode: str


@dataclass(frozen=True, eq=False, repr=False)
class TumblingBody(Saved):
    """A rigid body under torques.

    Attributes:
        J: (3, 3) inertia, in the user's axes.
        torques: of lc.torque.
    """

    J: Array
    torques: tuple[Torque, ...]

    def kernels(self, name: str = NAMESPACE) -> tuple[Kernel, ...]:
        """slow_rate, shape, ends, periodic, torque_at and direct_rate, for lc.build and lc.generate.

        Args:
            name: C identifier that begins every symbol.
        """
        return tumbling_kernels(self.J, self.torques, name)

    @cached_property
    def library(self) -> Library:
        """The compiled kernels."""
        return build(self.kernels())

    @cached_property
    def principal(self) -> tuple[Array, Array, Array]:
        """What `principal_axes` finds of J."""
        return principal_axes(self.J)

    @cached_property
    def functions(self) -> tuple[Torque, ...]:
        """The torques whose directions are Python functions of t."""
        return tuple(each for each in self.torques if each.is_function)

    def given(self, t: float) -> tuple[Array, ...]:
        """What the kernels take beside t: the directions that are functions, at t.

        Raises:
            InputError: a function gives something else than three finite numbers.
        """
        if not self.functions:
            return ()
        values = [np.asarray(each.direction(t), dtype=float) for each in self.functions]
        for each, value in zip(self.functions, values, strict=True):
            if value.shape != (3,) or not np.all(np.isfinite(value)):
                raise InputError(
                    f"torque.{each.kind}: its function gives {value!r} at t = {t:.9g}; three finite numbers are needed"
                )
        return (np.concatenate(values),)

    def field(self, name: str, size: int, state: str, constants: dict[str, Any]) -> Field:
        """A rate as C calls it; through Python where directions are functions."""
        kernel = self.library[name]
        if not self.functions:
            return Field(kernel, size, state=state, constants=constants)
        rest = tuple(constants.values())

        def call(t: float, y: Array) -> Array:
            result = kernel(y, t, *rest, *self.given(t))
            return np.asarray(result[0] if isinstance(result, tuple) else result)

        return Field(call, size)

    def torus(self, X: ArrayLike, omega: ArrayLike) -> FreeRotation:
        """The free motion through (X, omega).

        Raises:
            InputError: it has no torus.
        """
        free = rotation_about(self.principal, X, omega)
        if free.fixed.any():
            raise InputError(
                "tumbling_average: a rotation about a fixed axis (a sphere, rest, spin about the middle axis) has no torus to "
                "average over; use .direct"
            )
        return free

    def start(self, free: FreeRotation) -> tuple[BodyAxes, Array]:
        """The axes, and (H, D, phi, alpha hat), of a single motion."""
        motion = free.motion
        axes = BodyAxes(motion["paper"], motion["inertia"], "SAM" if motion["mode"] > 0.5 else "LAM")
        w = axes.paper.T @ free.omega0
        y = np.empty(6)
        y[:3] = free.X0 @ (self.J @ free.omega0)
        y[3] = np.sum(axes.inertia * (axes.inertia - axes.inertia[2]) * w**2)
        y[4:] = motion["phi"], motion["alpha"]
        return axes, y

    def state_at(self, axes: BodyAxes, y: Array, t: float) -> tuple[Array, Array]:
        """(X, omega) of the free motion through (H, D, phi, alpha hat)."""
        _, _, _, b = self.library["shape"](y[:3], float(y[3]), axes.inertia)
        alpha = float(y[5] + np.sin(4 * np.pi * y[4] * np.arange(1, len(b) + 1)) @ b)
        found = self.library["torque_at"](
            y[:3], float(y[3]), float(y[4]), alpha, t, axes.paper, axes.inertia, *self.given(t)
        )
        return np.asarray(found[2]), np.asarray(found[3])

    def periodic(self, axes: BodyAxes, y: Array, t: float) -> tuple[Array, float]:
        """W (4,) with osculating (H, D) = mean + W, and the largest |N| on the torus."""
        W, largest = self.library["periodic"](y, float(t), axes.paper, axes.inertia, *self.given(t))
        return np.asarray(W), float(largest)


def each_motion(free: FreeRotation) -> list[FreeRotation]:
    """The motions of a batch one by one.

    Raises:
        ShapeError: X and omega are batches of other shapes.
    """
    lead = free.fixed.shape
    if not lead:
        return [free]
    if free.X0.shape[:-2] != lead:
        raise ShapeError("tumbling_average: batches of X and omega differ")
    return [
        FreeRotation(
            free.J, free.X0[i], free.omega0[i], {n: np.asarray(v)[i] for n, v in free.motion.items()}, free.fixed[i]
        )
        for i in np.ndindex(*lead)
    ]
