"""Attitude manoeuvres in wheel speeds."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.polynomial import chebyshev
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.codegen.parts import PackageParts
from lie_codegen.errors import InputError
from lie_codegen.flow.trajectory import Trajectory
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernel.saved import Saved
from lie_codegen.steering.plan import Plan, Status
from lie_codegen.steering.plan_path import Replay, replay_times, replay_tolerance, simulated, starts_of
from lie_codegen.steering.plan_table import PlanTable, plan_table
from lie_codegen.steering.wheels.body import WheeledBody
from lie_codegen.steering.wheels.motion import WheelRun, under_torques
from lie_codegen.steering.wheels.package import system_parts
from lie_codegen.values import Value

_POINTS = 401


@dataclass(frozen=True, eq=False, repr=False)
class WheelPlan(Saved):
    """A manoeuvre in wheel speeds.

    Attributes:
        system: body and wheels.
        target: element of the group.
        duration: [s].
        method: of `lc.steer`, or "torques" for the problem with speeds as states.
        start: attitude at t = 0.
        plan: what `lc.steer` returned, or the knots (t, speeds) of the problem with torques.
        status: see `Status`.
    """

    system: WheeledBody
    target: Array
    duration: float
    method: str
    start: Array
    plan: Plan | _Knots
    status: Status
    scale: Array = field(repr=False)

    @staticmethod
    def of_torques(
        system: WheeledBody,
        target: Array,
        duration: float,
        start: Array,
        t: Array,
        torques: Array,
        speeds: Array,
        status: Status,
    ) -> WheelPlan:
        """The plan of motor torques (N, p) that are held between (N + 1,) times, from (p,) speeds at t = 0."""
        knots = _Knots(t, torques, speeds)
        return WheelPlan(system, target, duration, "torques", start, knots, status, np.ones(system.count))

    def speeds(self, t: ArrayLike) -> Array:
        """(p,) at a time, (k, p) at (k,) times. [rad/s]"""
        if isinstance(self.plan, Plan):
            return np.asarray(self.plan.inputs(t) / self.scale)
        return self._flown(t).speeds if np.ndim(t) else self._flown(np.reshape(t, 1)).speeds[0]

    def torques(self, t: ArrayLike) -> Array:
        """(p,) at a time, (k, p) at (k,) times: j_i (O_i' + b_i . w'). Where speeds jump, motors would need an impulse, which is not in here. [N m]"""
        times = np.atleast_1d(np.asarray(t, dtype=float))
        if isinstance(self.plan, Plan):
            rates = self._rates(times)
            axial = np.array([float(j) for j in self.system.wheels.axial])
            found = axial * (rates + rates @ self.system.C.T @ self.system.axes.T)
        else:
            found = self.plan.torque_at(times)
        return np.asarray(found[0] if np.ndim(t) == 0 else found)

    def X(self, t: ArrayLike) -> Array:
        """(d, d) at a time, (k, d, d) at (k,) times: where the true body is."""
        if isinstance(self.plan, Plan):
            return self.plan.X(t)
        return self._flown(t).X if np.ndim(t) else self._flown(np.reshape(t, 1)).X[0]

    def __simulate__(
        self,
        group: MatrixGroup | None,
        *,
        t: ArrayLike | None = None,
        eps: ArrayLike = 1.0,
        X0: ArrayLike | None = None,
        **options: Any,
    ) -> Trajectory:
        """`lc.simulate` of this plan: of wheel speeds the body velocity that they make, of motor torques the body with its wheels."""
        own = self.system.group
        times = replay_times(self, own, group, t, eps)
        if isinstance(self.plan, Plan):  # on the same matrices, in the basis of the wheels
            return simulated(self.plan, t=times, X0=X0, **options)
        rtol = replay_tolerance(f"simulate({own.name})", options, "torques")
        starts, joined = starts_of(own, X0)
        # turning the start is no symmetry: the momentum that is stored in space stays where it is
        runs = [self._flown(times, start, rtol) for start in starts]
        xi = joined([run.omega @ np.linalg.inv(self.system.frame).T for run in runs])
        error, steps = max(run.error_estimate for run in runs), max(run.steps for run in runs)
        return Replay(
            own, times, joined([run.X for run in runs]), steps, error, "rkmk4", 0, 0.0, (), None, rtol, 0, plan=self, xi=xi,  # type: ignore[arg-type]
        )  # fmt: skip

    @cached_property
    def X_final(self) -> Array:
        """(d, d) where the true body ends."""
        return self.plan.X_final if isinstance(self.plan, Plan) else self.X(self.duration)

    @property
    def error(self) -> float:
        """The angle between the attitude reached and the target, in rad, whatever the basis."""
        return float(self.system.attitude_error(self.X_final, self.target))

    @cached_property
    def cost(self) -> float:
        """int |O|^2 dt. [rad^2/s]"""
        edges = self._table.edges if isinstance(self.plan, Plan) else self.plan.t
        nodes, weights = np.polynomial.legendre.leggauss(16)
        middle, half = (edges[1:] + edges[:-1]) / 2, np.diff(edges) / 2
        t = middle[:, None] + half[:, None] * nodes
        squares = np.sum(self.speeds(t.ravel()) ** 2, axis=1).reshape(t.shape)
        return float(np.sum(half[:, None] * weights * squares))

    @cached_property
    def violation(self) -> Mapping[str, float]:
        """{"end": rad, "speeds": rad/s, "torques": N m}: what is missed, and by how much limits are exceeded at 401 times."""
        t = np.linspace(0, self.duration, _POINTS)
        found = {"end": self.error}
        limits = self.system.speed_limits, self.system.torque_limits
        for name, limit, values in zip(("speeds", "torques"), limits, (self.speeds, self.torques), strict=True):
            if limit is not None:
                found[name] = float(max(0.0, np.max(np.abs(values(t)) - limit)))
        return found

    def package_parts(self, name: str | None = None, real: str = "double", form: str | None = None) -> PackageParts:
        """The wheels as C; a plan of `lc.steer` also as speeds of time, in the units of its `scale`.

        Raises:
            InputError: form for a plan with torques, whose speeds are linear between knots.
        """
        own = system_parts(self.system, name)
        if not isinstance(self.plan, Plan):
            raise InputError("generate: a wheel plan with torques is kept as knots: plan.plan.t and plan.plan.torques")
        inner = self.plan.package_parts(own.namespace, real, form)
        return PackageParts(own.namespace, (*own.kernels, *inner.kernels), inner.files, has_forms=True)

    @cached_property
    def _table(self) -> PlanTable:
        if not isinstance(self.plan, Plan):
            raise InputError("a wheel plan with torques is kept as knots: plan.plan.t and plan.plan.torques")
        return plan_table(self.plan, "table")

    def _rates(self, times: Array) -> Array:
        """(k, p) O', at a jump that of the later piece."""
        table = self._table
        edges = table.edges
        piece = np.clip(np.searchsorted(edges, times, side="right") - 1, 0, len(edges) - 2)
        length = np.diff(edges)[piece]
        s = (2 * times - edges[piece] - edges[piece + 1]) / length
        slopes = np.empty((len(times), len(table.places)))
        for number in np.unique(piece):
            here = piece == number
            derivative = chebyshev.chebder(table.coefficients[number].T)
            slopes[here] = chebyshev.chebval(s[here], derivative).T * (2 / length[here])[:, None]
        full = np.zeros((len(times), len(self.system.group.labels)))
        full[:, list(table.places)] = slopes
        return self._speeds_of(full)

    def _speeds_of(self, u: Array) -> Array:
        """(k, p) wheel speeds (or their rates) of velocities (or theirs)."""
        p = self.system.count
        if p == self.system.rank and p <= 3:
            return np.asarray(u[:, :p] / self.scale)
        rate = u @ self.system.frame.T
        return np.asarray(-(rate @ self.system.inertia.T) @ np.linalg.pinv(self.system.momenta).T)

    def _flown(self, t: ArrayLike, X0: Array | None = None, tolerance: float = 1e-9) -> WheelRun:
        """The true body under the torques of the knots, at the times; from X0 at the first of them, with the speeds that the plan has there."""
        knots = self.plan
        if isinstance(knots, Plan):
            raise InputError("a plan of lc.steer has speeds, no knots")
        times = np.asarray(t, dtype=float)
        if np.any(times < 0) or np.any(times > self.duration * (1 + 1e-9)):
            raise InputError(f"the plan is known on [0, {self.duration:g}]")
        begin, start, first = 0.0, self.start, knots.first
        if X0 is not None:
            begin, start = float(times[0]), X0
            first = knots.first if begin == 0 else self._flown(times[:1]).speeds[0]
        every, place = np.unique(
            np.append(np.minimum(times, knots.t[-1]), knots.t[knots.t >= begin]), return_inverse=True
        )
        run = under_torques(self.system, knots.torque_at, every, start, first, tolerance, held=True)
        asked = place[: times.size]
        return replace(
            run,
            t=times,
            X=run.X[asked],
            omega=run.omega[asked],
            speeds=run.speeds[asked],
            momentum=run.momentum[asked],
            torques=None,
        )


@dataclass(frozen=True, eq=False, repr=False)
class _Knots(Value):
    """Motor torques that are held between knots.

    Attributes:
        t: (N + 1,) times. torques: (N, p). [N m]
        first: (p,) speeds at t = 0. [rad/s]
    """

    t: Array
    torques: Array
    first: Array

    def torque_at(self, times: Array) -> Array:
        """(k, p), at a knot that of the later interval."""
        place = np.clip(np.searchsorted(self.t, times, side="right") - 1, 0, len(self.torques) - 1)
        return np.asarray(self.torques[place])
