"""The separatrix as the end of an averaged motion, and the mean states from which it may go on."""

from __future__ import annotations

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.kernel.arithmetic import FloatArithmetic
from lie_codegen.rigid_body.rotation_formulas import frame_of, shape_at
from lie_codegen.rigid_body.tumbling_body import BodyAxes, TumblingBody
from lie_codegen.rigid_body.tumbling_kernels import MARGIN
from lie_codegen.rigid_body.tumbling_run import TumblingEvent
from lie_codegen.runtime.ode import Motion


def event_of(model: TumblingBody, axes: BodyAxes, motion: Motion) -> TumblingEvent:
    """What ended a run: the separatrix, or no angular momentum left."""
    t, y = float(motion.t[-1]), motion.y[-1]
    if motion.event == 1:
        return TumblingEvent("tumbling stops", t, y[:3].copy(), axes.mode, axes.mode, {})
    entered = "LAM" if axes.mode == "SAM" else "SAM"
    return TumblingEvent("separatrix", t, y[:3].copy(), axes.mode, entered, states_beyond(model, entered, y[:3]))


def states_beyond(model: TumblingBody, entered: str, H: Array) -> dict[str, tuple[Array, Array]]:
    """(X, omega) of mean states with the same H just beyond the separatrix, by the sign of H along the new axis.

    k is slightly below the margin there, or the continued run would end where it begins.
    """
    _, moments, principal = model.principal
    order = [0, 1, 2] if entered == "SAM" else [2, 1, 0]
    P, inertia = principal[:, order], moments[order]
    P = P * np.array([np.sign(np.linalg.det(P)), 1.0, 1.0])
    I1, I2, I3 = inertia
    quotient = (0.9999 * MARGIN) ** 2 * I1 * (I2 - I3) / ((I1 - I2) * I3)
    first = quotient / (1 + quotient)
    L = float(np.linalg.norm(H))
    shape = shape_at(FloatArithmetic(), inertia.tolist(), L, float(first), float(1 - first))
    l = np.array([shape.r[0], 0.0, shape.r[2]])  # noqa: E741
    C: Array = np.array(frame_of(FloatArithmetic(), (H / L).tolist()))
    arc = np.array([[1 - l[0] ** 2 / (1 + l[2]), 0, -l[0]], [0, 1, 0], [l[0], 0, l[2]]])
    found = {}
    for name, sign in (("+1", 1.0), ("-1", -1.0)):
        turned = P * np.array([1.0, sign, sign])
        found[name] = (C @ arc @ turned.T, turned @ (L * l / inertia))
    return found
