"""lc.tumbling_average: environment torques on a tumbling body, averaged over nutation and precession, and directly."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
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
from lie_codegen.rigid_body.torus_map import TorusSeries, resonant_ratios, small_divisors, torus_series
from lie_codegen.rigid_body.tumbling_kernels import MARGIN, matrix_of, tumbling_kernels
from lie_codegen.rigid_body.tumbling_run import DirectRun, Resonance, TumblingEvent, TumblingRun
from lie_codegen.runtime.broadcast import broadcast_call
from lie_codegen.runtime.library import Library
from lie_codegen.runtime.ode import EVENT, REACHED, Field, Motion, fixed_steps, integrate

#: |N| Tn / L beyond which an average over the free motion says little.
LARGEST_TORQUE = 0.1
_LOUD, _MOST_CROSSINGS = 0.01, 8
#: Phases of a single rate where plates have kinks.
_PLATES_ONCE = 128


class MeanRate(NamedTuple):
    """Mean of X N (3,) [N m], inertial, and of omega.N [W]."""

    H_dot: Array
    power: Any


class _Body(NamedTuple):
    """The axes in which a motion is averaged."""

    paper: Array
    inertia: Array
    mode: str


@dataclass(frozen=True, eq=False, repr=False)
class TumblingAverage(Saved):
    """Torques on a rigid body, averaged over the torus of its free rotation.

    H' = <X N>, D' = 2 <sum (I_n - I3) w_n N_n>, D = H.H - 2 I3 T, over the phase and the precession angle, both uniform;
    T' = <omega.N>. H and D have no singularity at pure spin or at symmetric bodies. Plates have kinks where n.b = 0: at each phase the
    mean over the lit arc of precession angles is a closed form, so that smooth and kinked torques are exact alike.

    Attributes:
        J: (3, 3) inertia, in the user's axes.
        torques: of lc.torque.
    """

    J: Array
    torques: tuple[Torque, ...]

    def kernels(self) -> tuple[Kernel, ...]:
        """slow_rate, shape, ends, periodic, torque_at and direct_rate, for lc.build and lc.generate."""
        return tumbling_kernels(self.J, self.torques)

    @cached_property
    def library(self) -> Library:
        """The compiled kernels."""
        return build(self.kernels())

    @cached_property
    def _principal(self) -> tuple[Array, Array, Array]:
        return principal_axes(self.J)

    @property
    def _has_plates(self) -> bool:
        return any(each.plates is not None for each in self.torques)

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
        free = self._free(X, omega)
        shape = free.fixed.shape
        rows = [self._rate(each, t, nodes) for each in _each(free)]
        H_dot, power = np.array([row[0] for row in rows]).reshape((*shape, 3)), np.array([row[1] for row in rows])
        return MeanRate(H_dot, float(power[0]) if not shape else power.reshape(shape))

    def _rate(self, free: FreeRotation, t: float, nodes: int | None) -> tuple[Array, float]:
        body, y = self._start(free)
        count = nodes if nodes is not None else _PLATES_ONCE if self._has_plates else 0
        y_dot, power = self.library["slow_rate"](
            y, float(t), body.paper, body.inertia, float(count), 0.0, *self._given(t)
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
        times = np.atleast_1d(np.asarray(t, dtype=float))
        if np.any(np.diff(times) <= 0) or not np.all(np.isfinite(times)):
            raise InputError("t: finite, increasing times; the first is the start")
        times = np.array([0.0, times[0]]) if len(times) == 1 else times
        if start not in ("mean", "osculating") or sign not in (None, 1, -1):
            raise InputError(f"start is 'mean' or 'osculating' and sign 1, -1 or None, given {start!r}, {sign!r}")
        free = self._free(X, omega)
        runs = [self._run(each, times, start, sign, force, nodes, rtol, osculating) for each in _each(free)]
        return runs[0] if not free.fixed.shape else runs

    def direct(self, X: ArrayLike, omega: ArrayLike, t: ArrayLike, *, steps_per_turn: int = 150) -> Any:
        """The true system with the same torque: q' = q omega / 2, J omega' = J omega x omega + N, by steps of order 4 in C.

        Args:
            X, omega: as `rate`; batches give a list of runs.
            t: (n,) [s], increasing; the first is the start.
            steps_per_turn: steps in 2 pi / |omega|; 150 to 300.
        """
        from scipy.spatial.transform import Rotation

        free = rotation_about(self._principal, X, omega)
        times = np.atleast_1d(np.asarray(t, dtype=float))
        if len(times) < 2 or np.any(np.diff(times) <= 0) or not np.all(np.isfinite(times)):
            raise InputError("t: at least two finite, increasing times; the first is the start")
        runs = []
        for each in _each(free):
            q = Rotation.from_matrix(each.X0).as_quat()
            turn = 2 * np.pi / max(float(np.linalg.norm(each.omega0)), 1e-300)
            runs.append(self._direct(np.array([q[3], *q[:3], *each.omega0]), times, turn / steps_per_turn))
        return runs[0] if not free.fixed.shape else runs

    def _direct(self, z: Array, t: Array, step: float) -> DirectRun:
        rate = self._field("direct_rate", 7, "z", {})
        spans = np.diff(t)
        even = bool(np.allclose(spans, spans[0], rtol=1e-9, atol=0))
        steps = 0
        if even:
            parts = max(1, int(np.ceil(spans[0] / step - 1e-9)))
            states, steps = (
                fixed_steps(rate, z, t[0], (t[-1] - t[0]) / (len(spans) * parts), len(spans), parts),
                parts * len(spans),
            )
        else:
            states = np.empty((len(t), 7))
            states[0] = z
            for i, span in enumerate(spans):
                parts = max(1, int(np.ceil(span / step - 1e-9)))
                states[i + 1] = fixed_steps(rate, states[i], t[i], span / parts, 1, parts)[1]
                steps += parts
        X: Array = np.moveaxis(np.array(matrix_of(list(states[:, :4].T))), -1, 0)
        w = states[:, 4:]
        return DirectRun(
            t, X, w, np.einsum("nij,jk,nk->ni", X, self.J, w), np.einsum("ni,ij,nj->n", w, self.J, w) / 2, steps
        )

    def _field(self, name: str, size: int, state: str, constants: dict[str, Any]) -> Field:
        """A rate as C calls it; through Python where directions are functions."""
        kernel = self.library[name]
        if not any(each.is_function for each in self.torques):
            return Field(kernel, size, state=state, constants=constants)
        rest = tuple(constants.values())

        def call(t: float, y: Array) -> Array:
            result = kernel(y, t, *rest, *self._given(t))
            return np.asarray(result[0] if isinstance(result, tuple) else result)

        return Field(call, size)

    def _given(self, t: float) -> tuple[Array, ...]:
        functions = [each for each in self.torques if each.is_function]
        if not functions:
            return ()
        values = [np.asarray(each.direction(t), dtype=float) for each in functions]
        for each, value in zip(functions, values, strict=True):
            if value.shape != (3,) or not np.all(np.isfinite(value)):
                raise InputError(
                    f"torque.{each.kind}: its function gives {value!r} at t = {t:.9g}; three finite numbers are needed"
                )
        return (np.concatenate(values),)

    def _free(self, X: ArrayLike, omega: ArrayLike) -> FreeRotation:
        free = rotation_about(self._principal, X, omega)
        if np.any(free.fixed):
            raise InputError(
                "tumbling_average: a rotation about a fixed axis (a sphere, rest, spin about the middle axis) has no torus to "
                "average over; use .direct"
            )
        return free

    def _start(self, free: FreeRotation) -> tuple[_Body, Array]:
        """The axes, and (H, D, phi, alpha hat)."""
        motion = free.motion
        body = _Body(motion["paper"], motion["inertia"], str(free.mode))
        w = body.paper.T @ free.omega0
        D = float(np.sum(body.inertia * (body.inertia - body.inertia[2]) * w**2))
        return body, np.array([*free.H, D, float(motion["phi"]), float(motion["alpha"])])

    def _periodic(self, body: _Body, y: Array, t: float) -> tuple[Array, float]:
        """W (4,) with osculating = mean + W, and the largest |N| on the torus."""
        W, largest = self.library["periodic"](y, float(t), body.paper, body.inertia, *self._given(t))
        return np.asarray(W), float(largest)

    def _series(self, body: _Body, y: Array, t: float) -> TorusSeries:
        _, rate, m, b = self.library["shape"](y[:3], float(y[3]), body.inertia)
        function, given = self.library["torque_at"], self._given(t)

        def sample(phi: Array, alpha: Array) -> tuple[Array, Array]:
            rates, N, _, _ = broadcast_call(function, y[:3], y[3], phi, alpha, t, body.paper, body.inertia, *given)
            return rates, N

        return torus_series(sample, float(rate), float(m), np.asarray(b))

    def _run(
        self, free: FreeRotation, t: Array, start: str, sign: int | None, force: bool, nodes: int | None, rtol: float, osculating: bool
    ) -> TumblingRun:  # fmt: skip
        body, y = self._start(free)
        if float(free.k) >= MARGIN:
            raise InputError(
                f"tumbling_average: k = {float(free.k):.6f} is at the separatrix (margin {MARGIN}); use .direct"
            )
        W, largest = self._periodic(body, y, t[0])
        ratio = largest * float(free.nutation_period) / float(np.linalg.norm(y[:3]))
        if ratio > LARGEST_TORQUE and not force:
            raise InputError(
                f"tumbling_average: the torque turns H by {ratio:.3g} in one nutation (|N| Tn / L, at most {LARGEST_TORQUE}): an "
                "average over the free motion says little; use .direct, or force=True"
            )
        dropped: list[tuple[int, int]] = []
        remark = ""
        if start == "mean":
            dropped = small_divisors(float(free.motion["Lambda"]), float(free.motion["m"]))
            mean = np.concatenate([y[:4] - W, y[4:]])
            if float(self.library["shape"](mean[:3], float(mean[3]), body.inertia)[0]) < MARGIN:
                y = mean
            else:  # NaN or beyond: the periodic part is larger than the motion it belongs to
                remark = "; the torque is too large for the map: started at the osculating point"
        run = self._piece(body, y, t, nodes, rtol, osculating, ratio, dropped)
        run = replace(run, status=run.status + remark)
        for _ in range(_MOST_CROSSINGS if sign is not None else 0):
            if run.event is None or run.event.kind != "separatrix" or not run.status.startswith("separatrix"):
                break
            rest = t[t > run.event.t]
            if not len(rest):
                break
            X, omega = run.event.continuations[f"{sign:+d}"]
            body, y = self._start(rotation_about(self._principal, X, omega))
            more = self._piece(body, y, np.concatenate([[run.event.t], rest]), nodes, rtol, osculating, ratio, dropped)
            run = _joined(run, more)
        return run

    def _piece(
        self, body: _Body, y: Array, t: Array, nodes: int | None, rtol: float, osculating: bool, ratio: float,
        dropped: list[tuple[int, int]],
    ) -> TumblingRun:  # fmt: skip
        size, scale = len(y), float(np.linalg.norm(y[:3]))
        count = float(nodes or 0)
        rate = self._field(
            "slow_rate",
            size,
            "y",
            {"paper": body.paper, "inertia": body.inertia, "nodes": count, "carry": float(osculating)},
        )
        ends = Field(self.library["ends"], size, time=None, constants={"inertia": body.inertia, "least": 1e-9 * scale})
        # the phases drive nothing: they are carried along and never shorten a step
        atol = np.array([scale * rtol] * 3 + [scale**2 * rtol, 1e300, 1e300])
        motion = integrate(rate, y, t[0], t[-1], rtol=rtol, atol=atol, events=ends, directions=(-1, -1))
        kept = t[t <= motion.t[-1]]
        found = motion.at(kept)
        H, D = found[:, :3], found[:, 3]
        square = np.sum(H**2, axis=1)
        energy = (square - D) / (2 * body.inertia[2])
        event, status = None, "ok"
        if motion.status == EVENT:
            event = self._event(body, motion)
            status = event.kind
        elif motion.status != REACHED:
            status = f"the averaged system has no solution beyond t = {motion.t[-1]:.9g}"
        resonances = self._resonances(body, motion, rate)
        loud = [each for each in resonances if each.harmonic > _LOUD]
        if loud:
            listed = ", ".join(f"{each.n1}:{each.n2} at t = {each.t:.6g}" for each in loud[:4])
            status += f"; resonance {listed}"
        shape_k = broadcast_call(self.library["shape"], H, D, body.inertia)[0]
        wave = np.zeros((len(kept), 4))
        phi, alpha = (column if osculating else np.full(len(kept), np.nan) for column in (found[:, 4], found[:, 5]))
        if osculating:
            for i, (moment, state) in enumerate(zip(kept, found, strict=True)):
                wave[i] = self._periodic(body, state, float(moment))[0]
        full_H, full_D = H + wave[:, :3], D + wave[:, 3]
        full_energy = (np.sum(full_H**2, axis=1) - full_D) / (2 * body.inertia[2])
        return TumblingRun(
            kept, H, energy, square / (2 * energy), shape_k, phi, alpha, full_H, full_energy,
            (body.mode,) * len(kept), status, event, resonances, tuple(dropped), ratio, motion.evaluations,
        )  # fmt: skip

    def _event(self, body: _Body, motion: Motion) -> TumblingEvent:
        t, y = float(motion.t[-1]), motion.y[-1]
        other = "LAM" if body.mode == "SAM" else "SAM"
        if motion.event == 1:
            return TumblingEvent("tumbling stops", t, y[:3].copy(), body.mode, body.mode, {})
        return TumblingEvent("separatrix", t, y[:3].copy(), body.mode, other, self._beyond(body, y))

    def _beyond(self, body: _Body, y: Array) -> dict[str, tuple[Array, Array]]:
        """Mean states of the same H just beyond the separatrix, with k the margin there, by the sign of H along the new axis."""
        from lie_codegen.kernel.arithmetic import FloatArithmetic
        from lie_codegen.rigid_body.rotation_formulas import frame_of, shape_at

        _, moments, axes = self._principal
        entered = body.mode != "SAM"
        order = [0, 1, 2] if entered else [2, 1, 0]
        P, inertia = axes[:, order], moments[order]
        P = P * np.array([np.sign(np.linalg.det(P)), 1.0, 1.0])
        I1, I2, I3 = inertia
        # slightly inside the margin, or the continued run would end where it begins
        quotient = (0.9999 * MARGIN) ** 2 * I1 * (I2 - I3) / ((I1 - I2) * I3)
        first = quotient / (1 + quotient)
        L = float(np.linalg.norm(y[:3]))
        shape = shape_at(FloatArithmetic(), inertia.tolist(), L, float(first), float(1 - first))
        l = np.array([shape.r[0], 0.0, shape.r[2]])  # noqa: E741
        found = {}
        for name, sign in (("+1", 1.0), ("-1", -1.0)):
            axes_here = P * np.array([1.0, sign, sign])
            C: Array = np.array(frame_of(FloatArithmetic(), (y[:3] / L).tolist()))
            arc = np.array([[1 - l[0] ** 2 / (1 + l[2]), 0, -l[0]], [0, 1, 0], [l[0], 0, l[2]]])
            found[name] = (C @ arc @ axes_here.T, axes_here @ (L * l / inertia))
        return found

    def _resonances(self, body: _Body, motion: Motion, rate: Field) -> tuple[Resonance, ...]:
        """Where n1 2 pi Lambda + n2 m changes sign, on the cubics through the knots of the run: where, not exactly what."""
        from scipy.interpolate import CubicHermiteSpline

        if len(motion.t) < 2:
            return ()
        _, rates, m, _ = broadcast_call(self.library["shape"], motion.y[:, :3], motion.y[:, 3], body.inertia)
        quotient = 2 * np.pi * rates / m
        low, high = float(quotient.min()), float(quotient.max())
        if not any(low <= -n2 / n1 <= high for n1, n2 in resonant_ratios()):
            return ()
        slopes = np.array([rate(t, y) for t, y in zip(motion.t, motion.y, strict=True)])
        if not np.all(np.isfinite(slopes)):
            return ()
        cubic = CubicHermiteSpline(motion.t, motion.y, slopes)
        moments = np.linspace(motion.t[0], motion.t[-1], 8 * len(motion.t))
        y = cubic(moments)
        _, rates, m, _ = broadcast_call(self.library["shape"], y[:, :3], y[:, 3], body.inertia)
        quotient, found = 2 * np.pi * rates / m, []
        low, high = float(quotient.min()), float(quotient.max())
        for n1, n2 in resonant_ratios():
            if not low <= -n2 / n1 <= high:
                continue
            value = n1 * 2 * np.pi * rates + n2 * m
            for i in np.flatnonzero(value[:-1] * value[1:] < 0):
                part = value[i] / (value[i] - value[i + 1])
                when = float(moments[i] + part * (moments[i + 1] - moments[i]))
                series = self._series(body, cubic(when), when)
                found.append(Resonance(when, n1, n2, series.harmonic(n1, n2)))
        return tuple(sorted(found, key=lambda each: each.t))


def tumbling_average(J: Any, torques: Sequence[Torque]) -> TumblingAverage:
    """A tumbling body under torques of the environment, averaged over nutation and precession.

    Args:
        J: three moments [kg m^2] or a 3 x 3 matrix, in the user's axes.
        torques: of lc.torque: gravity_gradient, solar_pressure, drag, eddy_current, residual_dipole, formula.

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


def _each(free: FreeRotation) -> list[FreeRotation]:
    """The motions of a batch one by one."""
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


def _joined(a: TumblingRun, b: TumblingRun) -> TumblingRun:
    """Two pieces as one run; the second begins with the moment of the event, which is dropped."""
    names = ("t", "H", "energy", "dynamic_inertia", "k", "phi", "alpha", "osculating_H", "osculating_energy")
    columns: dict[str, Any] = {name: np.concatenate([getattr(a, name), getattr(b, name)[1:]]) for name in names}
    left = "" if a.event is None else f"; continued beyond the separatrix at t = {a.event.t:.6g}"
    return replace(
        a, **columns, mode=(*a.mode, *b.mode[1:]), status=b.status + left, event=b.event if b.event is not None else a.event,
        resonances=a.resonances + b.resonances, evaluations=a.evaluations + b.evaluations,
    )  # fmt: skip
