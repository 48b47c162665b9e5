"""lc.tumbling_average: environment torques on a tumbling body, averaged over nutation and precession, and directly."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.errors import InputError
from lie_codegen.kernel.kernel import Kernel
from lie_codegen.rigid_body.direct_motion import direct_motion
from lie_codegen.rigid_body.free_rotation import FreeRotation, rotation_about
from lie_codegen.rigid_body.inertia_matrix import principal_axes
from lie_codegen.rigid_body.mean_motion import Wishes, mean_motion
from lie_codegen.rigid_body.torques import Torque
from lie_codegen.rigid_body.tumbling_body import BodyAxes, TumblingBody, each_motion
from lie_codegen.rigid_body.tumbling_slow import TumblingEquilibrium, equilibrium_of, slow_kernels

#: Phases of a single rate where plates have kinks.
_PLATES_ONCE = 128


class MeanRate(NamedTuple):
    """Mean of X N (3,) [N m], inertial, and of omega.N [W]."""

    H_dot: Array
    power: Any


@dataclass(frozen=True, eq=False, repr=False)
class TumblingAverage(TumblingBody):
    """Torques on a rigid body, averaged over the torus of its free rotation.

    H' = <X N>, D' = 2 <sum (I_n - I3) w_n N_n>, D = H.H - 2 I3 T, over the phase and the precession angle, both uniform;
    T' = <omega.N>. H and D have no singularity at pure spin or at symmetric bodies. Plates have kinks where n.b = 0: at each phase the
    mean over the lit arc of precession angles is a closed form, so that smooth and kinked torques are exact alike.

    Attributes:
        J: (3, 3) inertia, in the user's axes.
        torques: of lc.torque.
    """

    def rate(self, X: ArrayLike, omega: ArrayLike, t: float = 0.0, *, nodes: int | None = None) -> MeanRate:
        """The mean of X N and of omega.N over the torus of the motion through (X, omega), the directions held at t.

        Args:
            X: (3, 3) body to inertial, or (..., 3, 3).
            omega: (3,) [rad/s] body axes, or (..., 3).
            t: [s] at which the directions are taken.
            nodes: phases; None takes 32 to k = .95, 64 to .999, 96 beyond, and 128 with plates.

        Raises:
            InputError: a motion about a fixed axis or on the separatrix, which has no torus.
        """
        free = self.torus(X, omega)
        shape = free.fixed.shape
        rows = [self._rate(each, t, nodes) for each in each_motion(free)]
        H_dot, power = np.array([row[0] for row in rows]).reshape((*shape, 3)), np.array([row[1] for row in rows])
        return MeanRate(H_dot, float(power[0]) if not shape else power.reshape(shape))

    def _rate(self, free: FreeRotation, t: float, nodes: int | None) -> tuple[Array, float]:
        axes, y = self.start(free)
        has_plates = any(each.plates is not None for each in self.torques)
        count = nodes if nodes is not None else _PLATES_ONCE if has_plates else 0
        y_dot, power = self.library["slow_rate"](
            y, float(t), axes.paper, axes.inertia, float(count), 0.0, *self.given(t)
        )
        return np.asarray(y_dot)[:3], float(power)

    def solve(
        self, X: ArrayLike, omega: ArrayLike, t: ArrayLike, *, start: str = "mean", sign: int | None = None,
        force: bool = False, nodes: int | None = None, rtol: float = 1e-9, osculating: bool = True,
    ) -> Any:  # fmt: skip
        """The averaged motion from the osculating (X, omega) at t[0].

        What was computed before an event is returned. After the separatrix the sign of H along the new axis depends on the phase,
        which averaging has lost: it is never chosen silently.

        Args:
            X, omega: as `rate`; batches give a list of runs.
            t: (n,) [s], increasing; the first is the start.
            start: "mean" subtracts the periodic part on the torus, "osculating" starts at (X, omega) itself.
            sign: 1 or -1 continues beyond the separatrix with that sign of H along the new axis.
            force: also where |N| Tn / L exceeds 0.1.
            nodes: phases of the averages; None takes 32 to 96 by k, of plates alone 8 below k = .2, 16 below .7.
            rtol: of the integration.
            osculating: also give the phases, and osculating H and energy, one series of the torus for each time.

        Raises:
            InputError: a torque too large, a motion without a torus, times that do not increase.
        """
        times = _times(t)
        if start not in ("mean", "osculating") or sign not in (None, 1, -1):
            raise InputError(f"start is 'mean' or 'osculating' and sign 1, -1 or None, given {start!r}, {sign!r}")
        free = self.torus(X, omega)
        wishes = Wishes(start, sign, force, nodes or 0, rtol, osculating)
        runs = [mean_motion(self, each, times, wishes) for each in each_motion(free)]
        return runs[0] if not free.fixed.shape else runs

    def direct(self, X: ArrayLike, omega: ArrayLike, t: ArrayLike, *, steps_per_turn: int = 150) -> Any:
        """The true system with the same torque: q' = q omega / 2, J omega' = J omega x omega + N, by steps of order 4 in C.

        Args:
            X, omega: as `rate`; batches give a list of runs.
            t: (n,) [s], increasing; the first is the start.
            steps_per_turn: steps in 2 pi / |omega|; 150 to 300.
        """
        free = rotation_about(self.principal, X, omega)
        times = _times(t)
        runs = [direct_motion(self, each, times, steps_per_turn) for each in each_motion(free)]
        return runs[0] if not free.fixed.shape else runs

    def slow_flow(self, X: ArrayLike, omega: ArrayLike) -> tuple[Kernel, Array, Array]:
        """The averaged flow of the motions about the axis that (X, omega) circles: ((H, D)[, t]) -> (H', D'), (H, D) there, their units.

        For `lc.floquet(model, guess=(X, omega))`; the averages' loops are differentiated exactly.

        Raises:
            InputError: a batch, a motion without a torus, or a direction that is a Python function.
        """
        kernel, start, scale, _ = self._slow(X, omega)
        return kernel, start, scale

    def equilibrium(self, X: ArrayLike, omega: ArrayLike, t: float = 0.0) -> TumblingEquilibrium:
        """The equilibrium of the averaged flow near the motion through (X, omega), directions held at t, with its eigenvalues.

        Raises:
            InputError: as `slow_flow`.
            ComputationError: Newton's method ends at none.
        """
        kernel, start, scale, axes = self._slow(X, omega)
        return equilibrium_of(kernel, start, scale, axes.inertia, axes.mode, float(t))

    def _slow(self, X: ArrayLike, omega: ArrayLike) -> tuple[Kernel, Array, Array, BodyAxes]:
        free = self.torus(X, omega)
        if free.fixed.shape:
            raise InputError("tumbling_average: the slow flow belongs to one motion; give X (3, 3) and omega (3,)")
        if self.functions:
            raise InputError(
                f"tumbling_average: the direction of torque.{self.functions[0].kind} is a Python function, which has no derivative; "
                "give it as formulas in t"
            )
        axes, y = self.start(free)
        kernel = slow_kernels(self.J, self.torques, axes.paper, axes.inertia, float(free.k))[0]
        L = float(np.linalg.norm(y[:3]))
        return kernel, y[:4], np.array([L, L, L, L * L]), axes


def tumbling_average(J: Any, torques: Sequence[Torque]) -> TumblingAverage:
    """A tumbling body under torques of the environment, averaged over nutation and precession.

    Args:
        J: three moments [kg m^2] or a 3 x 3 matrix, in the user's axes.
        torques: of lc.torque: gravity_gradient, solar_pressure, drag, eddy_current, residual_dipole, formula.

    Returns:
        The averaged body: `.rate(X, omega)`, the mean rates of H and D; `.solve(X, omega, t)`, the averaged run; `.direct(X, omega, t)`, the
        unaveraged one; `.equilibrium(X, omega)`, `.slow_flow(X, omega)`.

    Raises:
        InputError: an inertia of no body, something that is no torque.

    Source: Benson and Scheeres, J. Guidance Control Dynamics 44 (2021), with exact visibility of plates and slow variables H and
    D = H.H - 2 I3 T.
    """
    matrix, _, _ = principal_axes(J)
    given = [torques] if isinstance(torques, Torque) else list(torques)
    if not given:
        raise InputError("tumbling_average: no torque given")
    for each in given:
        if not isinstance(each, Torque):
            raise InputError(f"tumbling_average: {type(each).__name__} is no torque of lc.torque")
    return TumblingAverage(matrix, tuple(given))


def _times(t: ArrayLike) -> Array:
    """Increasing times, the first the start; a single one is the end of a run from 0."""
    times = np.atleast_1d(np.asarray(t, dtype=float))
    times = np.array([0.0, times[0]]) if len(times) == 1 else times
    if times.ndim != 1 or not (times[1:] > times[:-1]).all() or not np.isfinite(times).all():
        raise InputError("t: finite, increasing times; the first is the start")
    return times
