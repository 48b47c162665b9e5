"""An underwater vehicle steered by three of its six forces: oscillations make the other three."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from lie_codegen.flow.batched_exponential import expm
from lie_codegen.groups.catalogue_load import group
from lie_codegen.mechanics.driven import simulate_driven
from lie_codegen.pictures.result import GalleryResult, new_figure, save
from lie_codegen.pictures.style import caption
from lie_codegen.steering.front import steer

_J = (3.0, 2.0, 1.0, 5.0, 6.0, 7.0)
_T = 20.0


def vehicle_by_three_forces(folder: Path, progress: Callable[[str], None] = lambda line: None) -> GalleryResult:
    """Two torques and one thrust, from rest to rest, at 3, 2 and 1.5 cycles."""
    se3 = group("se3")
    target = expm(se3.hat((0.3, -0.2, 0.4, 0.5, 0.2, -0.3)))
    figure = new_figure(12, 4.8)
    figure.suptitle("An underwater vehicle moved in six directions by two torques and one thruster")
    axes: Any = figure.subplots(1, 3)
    t = np.linspace(0, _T, 801)
    numbers: dict[str, Any] = {}
    for cycles, colour in ((3.0, "#8a8f98"), (2.0, "#1f5aa6"), (1.5, "#c8442f")):
        progress(f"{cycles} cycles")
        plan = steer(se3, target, ("w1", "w2", "v3"), _T, method="symmetric_product", inertia=_J, cycles=cycles)
        run = simulate_driven(se3, plan.u, np.diag(_J), t=t, tolerance=1e-9)
        axes[0].plot(t, run.X[:, :3, 3], color=colour, lw=1, label=[f"{cycles:g} cycles", None, None])
        axes[1].plot(t, run.xi[:, 3:], color=colour, lw=0.8)
        numbers[str(cycles)] = {"cost": plan.cost, "error": plan.error, "first_error": plan.details["first_error"]}
        if cycles == 2.0:
            axes[2].plot(t, plan.inputs(t), lw=1, label=["torque 1 [N m]", "torque 2 [N m]", "thrust 3 [N]"])
    axes[0].set(title="position $x, y, z$", xlabel="t [s]", ylabel="position [m]")
    axes[1].set(title="velocities $v_1, v_2, v_3$", xlabel="t [s]", ylabel="velocity [m/s]")
    axes[2].set(title="forces, 2 cycles", xlabel="t [s]", ylabel="torque [N m], force [N]", ylim=(-2.2, 3))
    for axis in (axes[0], axes[2]):
        axis.legend(loc="upper left")
    caption(
        figure,
        "From rest to rest in 20 s by symmetric products of the inputs; more cycles follow the average closer and cost more.",
    )
    return save("vehicle_by_three_forces", folder, figure, numbers)
