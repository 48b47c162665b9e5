"""The manoeuvre in motor torques as a problem of `lc.ocp`: all of it in formulas."""

from __future__ import annotations

from typing import Any

import numpy as np

from lie_codegen.steering.wheels.body import WheeledBody

#: Weight of the torques beside the speeds: their square, with this part of the duration as the unit of time.
_SMOOTHING = 0.05


def torque_problem(system: WheeledBody, duration: float, intervals: int, rest: bool) -> dict[str, Any]:
    """The problem: axial momenta as states, motor torques as inputs, whose limits hold exactly; limits of the speeds as constraints."""
    p, three = system.count, range(3)
    axial = [float(j) for j in system.wheels.axial]
    floating = np.linalg.inv(system.inertia - (system.axes.T * axial) @ system.axes)
    H = system.stored

    def total(terms: Any) -> str:
        kept = [f"({float(c)!r})*{name}" for c, name in terms if c != 0]
        return "(" + (" + ".join(kept) or "0") + ")"

    by_momenta, by_carried = -floating @ system.axes.T, floating
    carried = [total((H[i], f"X{i + 1}{k + 1}") for i in three) for k in three]
    wheels = [f"h{i + 1}" for i in range(p)]
    rate = [
        total([*zip(by_momenta[k], wheels, strict=True), *zip(by_carried[k] * np.any(H), carried, strict=True)])
        for k in three
    ]
    speeds = [total([(1 / axial[i], wheels[i]), *((-system.axes[i, k], rate[k]) for k in three)]) for i in range(p)]
    size = float(np.linalg.norm(system.inertia)) / (min(axial) * duration)  # speeds that turn the body by a radian
    constraints = []
    if system.speed_limits is not None:
        pairs = zip(speeds, map(float, system.speed_limits), strict=True)
        constraints = [f"({sign}{speed} - {limit!r})/{limit!r}" for speed, limit in pairs for sign in ("", "-")]
    scaled = [f"{_SMOOTHING * duration / (size * axial[i])!r}*u{i + 1}" for i in range(p)]
    # with nothing stored and no spare wheel, a body at rest has wheels at rest: p conditions that never depend on each other
    end = (
        [f"h{i + 1}/{size * axial[i]!r}" for i in range(p)]
        if not np.any(H) and p == system.rank
        else [f"{each}*{duration!r}" for each in rate]
    )
    return {
        "inputs": {"u": p},
        "states": {"h": p},
        "velocity": rate,
        "rates": {"h": "u"},
        "stage_cost": (*(f"{1 / size!r}*{each}" for each in speeds), *scaled),
        "constraints": tuple(constraints),
        "terminal": tuple(end) if rest else (),
        "target": "Rd",
        "bounds": None if system.torque_limits is None else {"u": system.torque_limits},
        "duration": duration,
        "intervals": intervals,
        "name": "wheels",
    }
