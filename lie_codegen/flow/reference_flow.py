"""X' = eps X hat(u(t)) over many periods, to rounding, by a method that shares nothing with the averages.

One period is integrated by the sixth-order Magnus method at Gauss points (Blanes, Casas, Oteo and Ros, Phys. Rep. 470
(2009), (236), with the brackets reversed for X' = X U), its steps halved until they agree; left invariance,
X(t + T) = X(T) X(t), gives the rest.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from lie_codegen.arrays import Array
from lie_codegen.errors import ComputationError
from lie_codegen.flow.batched_exponential import expm
from lie_codegen.flow.magnus.exponent import GAUSS, from_gauss, reversed_bracket
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.signals.periodic_input import PeriodicInput

_AGREEMENT = 2e-14
_MOST_STEPS = 2**17

#: A step of the sixth order can be right up to about so much motion.
_WITHIN = 10.0


@dataclass(frozen=True)
class ReferenceFlow:
    """The solution from the identity.

    Attributes:
        t: (k,) times, the samples of each period, up to the horizon.
        X: (k, d, d).
        whole: (k,) whether t is a whole number of periods.
        error_estimate: difference of the monodromy to that with half the steps.
    """

    t: Array
    X: Array
    whole: NDArray[np.bool_]
    error_estimate: float


def reference_flow(
    group: MatrixGroup, u: PeriodicInput, eps: float, horizon: float, *, per_period: int = 48
) -> ReferenceFlow:
    """The solution on [0, horizon], sampled `per_period` times a period and at the breakpoints.

    Raises:
        ComputationError: if the steps do not converge (name the breakpoints of a non-smooth input), or cannot: u is too large.
    """
    knots = np.unique(np.concatenate([np.linspace(0.0, u.T, per_period + 1), u.breakpoints]))
    shortest = float(np.abs(eps * u(knots)).max()) * u.T / _MOST_STEPS
    if not shortest <= _WITHIN:
        raise ComputationError(
            f"reference_flow({group.name}): eps u moves by {shortest:.2g} within the shortest of {_MOST_STEPS} steps a period, "
            f"of which no series is the flow; make eps or u smaller"
        )
    parts = 4
    coarse = _one_period(group, u, eps, knots, parts)
    while True:
        parts *= 2
        fine = _one_period(group, u, eps, knots, parts)
        scale = max(1.0, float(np.max(np.abs(fine[-1]))))
        estimate = float(np.max(np.abs(fine[-1] - coarse[-1]))) / scale
        if estimate <= _AGREEMENT * np.sqrt(parts):  # rounding adds up as a random walk does
            break
        if parts * len(knots) > _MOST_STEPS:
            raise ComputationError(
                f"reference_flow({group.name}): {parts * len(knots)} steps a period differ by {estimate:.2g}; name the "
                "times at which u is not smooth as its breakpoints"
            )
        coarse = fine
    periods = int(np.floor(horizon / u.T + 1e-9)) + 1
    powers = [np.eye(group.degree, dtype=fine.dtype)]
    for _ in range(periods - 1):
        powers.append(powers[-1] @ fine[-1])
    inner = np.array(powers)[:, None] @ fine[None, :-1]
    times = (np.arange(periods)[:, None] * u.T + knots[None, :-1]).ravel()
    keep = times <= horizon * (1 + 1e-12)
    whole = np.tile(np.arange(len(knots) - 1) == 0, periods)
    return ReferenceFlow(times[keep], inner.reshape(-1, group.degree, group.degree)[keep], whole[keep], estimate)


def _one_period(group: MatrixGroup, u: PeriodicInput, eps: float, knots: Array, parts: int) -> Array:
    """X at the knots: (k, d, d)."""
    h = np.repeat(np.diff(knots) / parts, parts)
    starts = (knots[:-1, None] + np.diff(knots)[:, None] * np.arange(parts) / parts).ravel()
    values = eps * h[:, None, None] * u(starts[:, None] + h[:, None] * GAUSS)
    steps = expm(group.hat(from_gauss(reversed_bracket(group.algebra), *np.moveaxis(values, 1, 0))))
    states = [np.eye(group.degree, dtype=steps.dtype)]
    for start in range(0, len(steps), parts):
        block = steps[start]
        for step in steps[start + 1 : start + parts]:
            block = block @ step
        states.append(states[-1] @ block)
    return np.array(states)
