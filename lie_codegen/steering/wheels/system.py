"""lc.momentum_wheels: a body that wheels turn, in wheel speeds and torques; TR 93-59, section 6.1, with stored momentum.

With J the inertia of the body and its wheels locked, b_i the axes and j_i the axial inertias of the wheels, O_i their speeds relative to
the body, R the attitude and H the total angular momentum in space, which nothing inside changes,

    J w + sum_i j_i b_i O_i = R^T H,      so      w = C O + J^{-1} R^T H,      C = -J^{-1} [j_1 b_1, .., j_p b_p],     (68)
    torque of motor i = j_i (O_i' + b_i . w').

H = 0 is the paper's case. Vectors of the body are in its own axes hat(e_1), hat(e_2), hat(e_3), whatever basis the group has.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.averaging.actuated_inputs import wheel_input
from lie_codegen.averaging.averaged import average
from lie_codegen.codegen.parts import PackageParts
from lie_codegen.control.reference_motion import Reference
from lie_codegen.errors import InputError, NotFiniteError, ShapeError
from lie_codegen.groups.catalogue_load import GroupLike, as_group
from lie_codegen.kernel.kernel import Kernel
from lie_codegen.mechanics.actuators import MomentumWheels
from lie_codegen.mechanics.body_frame import body_frame
from lie_codegen.signals.periodic_input import PeriodicInput
from lie_codegen.steering.wheels.body import WheeledBody
from lie_codegen.steering.wheels.closed_loop import closed_loop_of
from lie_codegen.steering.wheels.motion import WheelRun, simulated
from lie_codegen.steering.wheels.package import system_parts
from lie_codegen.steering.wheels.plan import WheelPlan
from lie_codegen.steering.wheels.read import read_directions, read_each, read_limits
from lie_codegen.steering.wheels.steer import planned


class WheelSystem(WheeledBody):
    """A body with momentum wheels on a group of rotations: what moves it, and what it is (`WheeledBody`)."""

    def steer(
        self,
        target: Any,
        duration: float,
        method: str = "auto",
        *,
        start: ArrayLike | None = None,
        rest: bool | None = None,
        **options: Any,
    ) -> WheelPlan:
        """Wheel speeds that turn the body to an attitude.

        Without limits, or with limits of the speeds alone, `lc.steer` in the wheels' own basis, of least int |O|^2 dt: speeds may
        jump at the ends. With limits of the torques, with stored momentum or with `rest`, an optimal control problem with the
        speeds as states and their rates as controls: the body is at rest at both ends, unless rest=False.

        Args:
            target: element of the group, (3, 3) rotation, or coordinates of the second kind.
            duration: [s].
            method: of `lc.steer`; "auto" as there.
            start: attitude at the start; the identity if not given.
            rest: whether the body is at rest at both ends.
            options: of `lc.steer`, or `intervals` (40) and `starts` (8) of the problem with torques.

        Raises:
            InputError: the wheels cannot reach it (one wheel), cannot hold what is stored, or the target is no attitude.
            InfeasibleError, SteeringError: as `lc.steer`.
        """
        return planned(self, target, float(duration), method, start, rest, options)

    def simulate(
        self,
        speeds: Any = None,
        *,
        torques: Any = None,
        t: ArrayLike,
        X0: ArrayLike | None = None,
        speeds0: ArrayLike | None = None,
        tolerance: float = 1e-9,
    ) -> WheelRun:
        """The motion under given wheel speeds, or under given motor torques. Exactly one of the two.

        Args:
            speeds: (p,) constant, (k, p) values at the times t (linear between), a function of t, a PeriodicInput, or p formulas of t. [rad/s]
            torques: of the motors, likewise; limits are not applied, `run.violation` says by how much they are exceeded. [N m]
            t: (k,) increasing times.
            X0: attitude at t[0]; the identity if not given.
            speeds0: speeds at t[0], for torques; those that hold the body at rest if not given.
            tolerance: on the entries of X; steps are halved until two runs agree.

        Raises:
            InputError, ShapeError: both or none given; wrong shapes.
            ComputationError: the tolerance is not met.
        """
        return simulated(self, speeds, torques, t, X0, speeds0, tolerance)

    def average(self, speeds: PeriodicInput, order: int = 2, form: str = "single") -> Any:
        """`lc.average` of X' = eps X hat(C O(t)) in the group's own basis: the drift that zero-mean wheel speeds cause, (69).

        Raises:
            InputError: momentum is stored: the body rate then depends on the attitude and is no input of time; take `simulate`.
            ShapeError: not p components.
        """
        if np.any(self.stored):
            raise InputError(
                "momentum_wheels: average is for zero stored momentum, where the rate is a function of time; simulate instead"
            )
        rate = wheel_input(self.wheels, speeds)
        return average(self.group, rate.linear(body_frame(self.group, "momentum_wheels").inv()), order, form)

    def closed_loop(
        self,
        law: Kernel | None = None,
        *,
        t: ArrayLike,
        X0: ArrayLike | None = None,
        speeds0: ArrayLike | None = None,
        target: Any = None,
        reference: Reference | None = None,
        bandwidth: float = 0.5,
        sample: float | None = None,
        substeps: int = 2,
        noise: Any = None,
        seed: int = 0,
        runs: int | None = None,
        threads: int = 1,
    ) -> WheelRun:
        """Feedback through the wheels, sampled and held: law -> body torque -> motors, with their limits, compiled.

        Args:
            law: an attitude law of torques ("pd") or a tracking law on the group; None for "pd" with J and the bandwidth.
            t: (k,) equally spaced times.
            X0: (d, d) or (N, d, d) attitudes at the start.
            speeds0: (p,) or (N, p); those that hold the body at rest if not given.
            target: attitude to hold, for attitude laws; the identity if not given.
            reference: of a tracking law.
            bandwidth: [rad/s] of the law that is made for law=None: k_p = J bandwidth^2 and k_d = 2 J bandwidth with the largest moment J.
            sample: [s] between two evaluations; the step of t if not given.
            substeps: integration steps a sample.
            noise: standard deviations of what is measured: {"X": rad, "xi": rad/s}.
            seed: of the noise; run k has the numbers of (seed, k), however many runs there are.
            runs: N runs from one start.
            threads: over which the runs are shared out.

        Raises:
            InputError: wheels that span less than three directions give no torque about every axis; a law of other inputs;
                times that are not equally spaced, or no multiple of the sample.
        """
        return closed_loop_of(
            self, law, t, X0, speeds0, target, reference, bandwidth, sample, substeps, noise, seed, runs, threads
        )

    def package_parts(self, name: str | None = None, real: str = "double", form: str | None = None) -> PackageParts:
        """Rates, speeds and torques as C: what `lc.generate(system, folder)` writes."""
        return system_parts(self, name)


def momentum_wheels(
    group: GroupLike = "so3",
    *,
    axes: Any,
    inertia: Any,
    wheel_inertia: Any = 1,
    transverse: Any = 0,
    stored: ArrayLike | None = None,
    speed_limits: Any = None,
    torque_limits: Any = None,
) -> WheelSystem:
    """A body with p momentum wheels: steering, simulation, averages and closed loops in wheel speeds and torques.

    Args:
        group: rotations of space as 3 x 3 matrices, in any basis, or SU(2).
        axes: (p, 3) directions of the wheels in body axes, of any length and skew; or labels of basis elements.
        inertia: (3, 3) or (3,) of the body without wheels. [kg m^2]
        wheel_inertia: j_i about the axis of each wheel, a number or (p,). [kg m^2]
        transverse: k_i about the other axes, through the wheel's centre, a number or (p,); mass and place of a wheel belong to `inertia`.
        stored: (3,) total angular momentum in space; zero if not given. [N m s]
        speed_limits, torque_limits: a number or (p,). [rad/s], [N m]

    Raises:
        InputError: another group; an inertia or limit that is not positive; a zero axis.
        ShapeError: wrong shapes.
    """
    group = as_group(group, "momentum_wheels")
    body_frame(group, "momentum_wheels")
    directions = read_directions(group, axes)
    p = directions.rows
    wheels = MomentumWheels(
        inertia=inertia,
        axes=directions,
        axial=read_each(wheel_inertia, p, "wheel_inertia"),
        transverse=read_each(transverse, p, "transverse"),
    )
    if any(not value > 0 for value in wheels.axial):
        raise InputError("momentum_wheels: wheel_inertia must be positive")
    momentum = np.zeros(3) if stored is None else np.asarray(stored, dtype=float)
    if momentum.shape != (3,):
        raise ShapeError(f"momentum_wheels: stored has shape {momentum.shape}; it is the total momentum in space, (3,)")
    if not np.all(np.isfinite(momentum)):
        raise NotFiniteError("momentum_wheels: stored is not finite")
    limits = [read_limits(each, p, what) for each, what in ((speed_limits, "speed"), (torque_limits, "torque"))]
    return WheelSystem(group, wheels, directions, momentum, *limits)
