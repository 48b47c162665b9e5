"""Periodic body rates that momentum wheels and a point-mass oscillator produce, and the drift they cause."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.averaging.areas import areas
from lie_codegen.averaging.averaged import average
from lie_codegen.errors import AssumptionError, InputError, ShapeError
from lie_codegen.exact.expression import time_symbol
from lie_codegen.groups.catalogue_load import GroupLike, as_group
from lie_codegen.kernel.saved import Saved
from lie_codegen.mechanics.actuators import MomentumWheels, PointMassOscillator
from lie_codegen.on_demand import sympy as sp
from lie_codegen.signals.periodic_input import PeriodicInput
from lie_codegen.signals.periodic_reader import PeriodicLike, as_periodic


def wheel_input(wheels: MomentumWheels, wheel_rates: PeriodicLike) -> PeriodicInput:
    """u = C theta', TR 93-59, (69): the body rate of wheel rates theta' (p components), exactly.

    Args:
        wheels: a body with p momentum wheels.
        wheel_rates: theta', p components, or a list of their formulas. [rad/s]

    Raises:
        ShapeError: if there are not p components.
        InputError: wheel_rates is no `PeriodicInput`, nor formulas of one.
    """
    wheel_rates = as_periodic(wheel_rates, "wheel_input")
    if wheel_rates.dim != wheels.count:
        raise ShapeError(f"wheel_input: {wheel_rates.dim} wheel rates for {wheels.count} wheels")
    return wheel_rates.linear(wheels.exact_C)


@dataclass(frozen=True, eq=False, repr=False)
class OscillatorAverage(Saved):
    """The drift of a body with a point mass moving along y = eps x(t): Omega = eps^2 u_2 + eps^4 u_4 + O(eps^6).

    Attributes:
        u: u_2 = -alpha_m I_0^{-1} (x cross x'), (74): X' = ebar X hat(u) with ebar = eps^2.
        correction: u_4 = alpha_m^2 I_0^{-1} (|x|^2 I - x x^T) I_0^{-1} (x cross x'), the next term of (71)-(73).
        first: (3, 1) u_av, the paper's average (77): X ~ X(0) exp(eps^2 t u_av), error O(eps^2) on [0, b / eps^2].
        second: (3, 1) mean(u_4) + F_2[u_2]: exp(t (eps^2 first + eps^4 second)) follows X at whole periods to O(eps^4).
    """

    u: PeriodicInput
    correction: PeriodicInput
    first: sp.ImmutableMatrix
    second: sp.ImmutableMatrix

    def drift(self, eps: float, order: int = 2) -> Array:
        """(3,) the mean angular velocity, with one term or two. [rad / time unit]"""
        if order not in (1, 2):
            raise InputError(f"OscillatorAverage.drift: order 1 or 2, got {order!r}")
        total = eps**2 * _doubles(self.first)
        return total if order == 1 else total + eps**4 * _doubles(self.second)


def oscillator_average(group: GroupLike, oscillator: PointMassOscillator, x_dot: PeriodicInput) -> OscillatorAverage:
    """Both averages of section 6.2, for the velocity x' of the point mass per unit eps, x(0) = 0.

    Args:
        group: rotations of space, with the basis hat(e_1), hat(e_2), hat(e_3).
        oscillator: masses and inertia.
        x_dot: three components with zero mean, sums of sines and cosines.

    Raises:
        AssumptionError: a non-zero mean: x would not be periodic.
        InputError, ShapeError: another group, a sampled input, not three components.
    """
    group = as_group(group, "oscillator_average")
    table = {(0, 1): {2: 1}, (0, 2): {1: -1}, (1, 2): {0: 1}}
    if group.dim != 3 or {key: dict(row) for key, row in group.algebra.table.items()} != table:
        raise InputError(f"oscillator_average: {group.name} is not the group of rotations in the basis hat(e_i)")
    if x_dot.dim != 3:
        raise ShapeError(f"oscillator_average: x_dot has {x_dot.dim} components; the mass moves in 3 dimensions")
    if not x_dot.zero_mean:
        raise AssumptionError(
            f"oscillator_average: section 6.2 asks for zero-mean x', and its mean is {list(x_dot.exact_mean)}"
        )
    calculus, signal = x_dot.waveform.calculus({}, 3)
    x = x_dot.waveform.expressions(calculus, calculus.primitive(signal), 3, time_symbol()) / x_dot.waveform.omega
    momentum = sp.Matrix(x).cross(sp.Matrix(x_dot.expressions))
    inverse = sp.Matrix(oscillator.inertia).inv()
    mass = oscillator.reduced_mass
    shape = (sp.Matrix(x).dot(sp.Matrix(x))) * sp.eye(3) - sp.Matrix(x) * sp.Matrix(x).T
    names = x_dot.parameters
    u = PeriodicInput(tuple(-mass * inverse * momentum), x_dot.period, names)
    correction = PeriodicInput(tuple(mass**2 * inverse * shape * inverse * momentum), x_dot.period, names)
    second = correction.exact_mean + average(group, u, 2).exact_F[1]
    return OscillatorAverage(u, correction, u.exact_mean, sp.ImmutableMatrix(second))


def oscillator_areas(x_dot: PeriodicInput) -> sp.ImmutableMatrix:
    """(3, 3) areax_ij(T), as `areas`; u_av = -2 alpha_m / T I_0^{-1} (areax_23, areax_31, areax_12).

    Args:
        x_dot: the three rates of the oscillators over one period T.

    Raises:
        ArgumentError: x_dot is no `PeriodicInput`.
    """
    return areas(x_dot)


def _doubles(vector: sp.ImmutableMatrix) -> Array:
    return np.array([float(value) for value in vector])
