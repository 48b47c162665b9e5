"""Where a plan leads: the states of the true system under its controls, whatever kind of system it is."""

from __future__ import annotations

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.flow.simulate import simulate
from lie_codegen.mechanics.driven import simulate_driven
from lie_codegen.steering.direct.inputs import Drive
from lie_codegen.steering.plan import Controls, Plan


def states(plan: Plan, t: Array) -> Array:
    """X (k, d, d) at increasing times (k,), the first zero.

    The controls are torques where the plan names an inertia; else velocities, to which the drift is added, that act from the right
    of X, or from the left where the plan's system says so.
    """
    details = plan.details
    start = details.get("start")
    if details.get("inertia") is not None:
        run = simulate_driven(plan.group, plan.u, details["inertia"], t=t, xi0=details["start_velocity"])
        return run.X if start is None else np.asarray(start @ run.X)
    system = details.get("system")
    if system is None:
        drift = details.get("drift")
        velocity = plan.u if drift is None else plan.u.plus(np.asarray(drift, dtype=float))
        return simulate(plan.group, velocity, t=t, X0=start).X
    velocity = Controls(Drive(system, details["inputs"], True), plan.u.breakpoints)
    if not system.right:
        return simulate(plan.group, velocity, t=t, X0=system.start).X
    # the inverse of X' = hat(a) X is left-invariant: Y' = -Y hat(a)
    inverse = simulate(plan.group, velocity.scaled(-np.ones(plan.group.dim)), t=t, X0=np.linalg.inv(system.start)).X
    return np.asarray(np.linalg.inv(inverse))
