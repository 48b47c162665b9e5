"""The bounds of Corollaries 1 and 2 on SO(3), with their printed constants, against measured errors.

If |g - gbar|_1 <= k eps^p =: delta on [0, b / eps], then phi(Xbar^-1 X) <= delta and, entrywise,
|Xbar^-1 X - I|_1 <= 9 |cos delta - 1| + 7 |sin delta| + sin^2 delta.  TR 93-59, Corollary 1 (p = 1), Corollary 2 (p = 2).

The paper gives the constants 9, 7, 1 but no value for k: k is measured here, in the coordinates the theorem speaks of.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lie_codegen.averaging.averaged import average
from lie_codegen.averaging.order_check import checked_scales
from lie_codegen.flow.attitude_metrics import distances, rotation_angle
from lie_codegen.flow.reference_flow import reference_flow
from lie_codegen.groups.catalogue_load import GroupLike, as_group
from lie_codegen.kernel.saved import Saved
from lie_codegen.signals.periodic_reader import PeriodicLike, as_periodic


def corollary_bound(delta: ArrayLike) -> NDArray[np.float64]:
    """9 |cos delta - 1| + 7 |sin delta| + sin^2 delta, which bounds |Xbar^-1 X - I|_1 by the bound of the angle: TR 93-59, Corollaries 1 and 2.

    Args:
        delta: (...) angles. [rad]

    Returns:
        (...) bounds of the sum of the absolute entries.

    Raises:
        ArgumentError: delta is no number.
    """
    d = np.asarray(delta, dtype=float)
    return np.asarray(9 * np.abs(np.cos(d) - 1) + 7 * np.abs(np.sin(d)) + np.sin(d) ** 2)


@dataclass(frozen=True, eq=False, repr=False)
class BoundCheck(Saved):
    """Measured errors against the corollary's bounds, for each eps.

    Attributes:
        order: 1 (Corollary 1) or 2 (Corollary 2).
        eps: (k,).
        k: the smallest constant with |g - gbar|_1 <= k eps^order at all these eps.
        angle, angle_bound: sup phi(Xbar^-1 X) and k eps^order. [rad]
        norm, norm_bound: sup |Xbar^-1 X - I|_1, entrywise, and the corollary's bound.
        holds: whether every bound holds.
    """

    order: int
    eps: tuple[float, ...]
    k: float
    angle: tuple[float, ...]
    angle_bound: tuple[float, ...]
    norm: tuple[float, ...]
    norm_bound: tuple[float, ...]
    holds: bool


def corollary_check(
    group: GroupLike,
    u: PeriodicLike,
    order: int,
    *,
    eps: Sequence[float] = (0.2, 0.1, 0.05),
    horizon: float = 2.5,
) -> BoundCheck:
    """Corollary 1 (order 1, any mean) or 2 (order 2, u_av = 0) on rotations of space: of the actual and the averaged motion over 0 <= eps t <= horizon.

    Args:
        group: so3, or a group with its definition.
        u: three components, periodic, or a list of their formulas.
        order: 1 or 2, of the average.
        eps: scales, each of which is simulated.
        horizon: of eps t. [time unit]

    Raises:
        InputError: on another group; eps or horizon that are no positive numbers, or more periods than are simulated.
        AssumptionError: order 2 of an input with a mean.
        ChartError: if the coordinates leave |g_2| < pi / 2, where the corollaries say nothing.
    """
    group, u = as_group(group, "corollary_check"), as_periodic(u, "corollary_check")
    eps = checked_scales("corollary_check", float(u.period), eps, horizon)
    averaged = average(group, u, order, "product")
    coordinates, angles, norms = [], [], []
    for value in eps:
        flow = reference_flow(group, u, value, horizon / value)
        approximate = averaged.state(value, flow.t)
        relative = np.linalg.solve(approximate, flow.X)
        angles.append(float(np.max(rotation_angle(group, relative))))
        norms.append(float(np.max(np.sum(np.abs(relative - np.eye(3)), axis=(1, 2)))))
        coordinates.append(float(np.max(distances(group, flow.X, approximate, "product"))))
    k = max(c / value**order for c, value in zip(coordinates, eps, strict=True))
    deltas = np.array([k * value**order for value in eps])
    bounds = corollary_bound(deltas)
    holds = bool(np.all(np.array(angles) <= deltas) and np.all(np.array(norms) <= bounds))
    return BoundCheck(
        order, tuple(eps), k, tuple(angles), tuple(map(float, deltas)), tuple(norms), tuple(map(float, bounds)), holds
    )
