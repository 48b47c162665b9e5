"""The true motion of a body under torques: quaternion and angular velocity by steps of order 4 in C."""

from __future__ import annotations

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.rigid_body.free_rotation import FreeRotation
from lie_codegen.rigid_body.tumbling_body import TumblingBody
from lie_codegen.rigid_body.tumbling_kernels import matrix_of
from lie_codegen.rigid_body.tumbling_run import DirectRun
from lie_codegen.runtime.ode import fixed_steps


def direct_motion(model: TumblingBody, free: FreeRotation, t: Array, steps_per_turn: int) -> DirectRun:
    """q' = q omega / 2, J omega' = J omega x omega + N from the start of `free`, `steps_per_turn` in 2 pi / |omega|."""
    from scipy.spatial.transform import Rotation

    q = Rotation.from_matrix(free.X0).as_quat()
    z = np.array([q[3], *q[:3], *free.omega0])
    step = 2 * np.pi / max(float(np.linalg.norm(free.omega0)), 1e-300) / steps_per_turn
    rate = model.field("direct_rate", 7, "z", {})
    spans = np.diff(t)
    if np.allclose(spans, spans[0], rtol=1e-9, atol=0):
        parts = max(1, int(np.ceil(spans[0] / step - 1e-9)))
        steps = parts * len(spans)
        states = fixed_steps(rate, z, t[0], (t[-1] - t[0]) / steps, len(spans), parts)
    else:
        steps, states = 0, np.empty((len(t), 7))
        states[0] = z
        for i, span in enumerate(spans):
            parts = max(1, int(np.ceil(span / step - 1e-9)))
            states[i + 1] = fixed_steps(rate, states[i], t[i], span / parts, 1, parts)[1]
            steps += parts
    X: Array = np.moveaxis(np.array(matrix_of(list(states[:, :4].T))), -1, 0)
    w, J = states[:, 4:], model.J
    return DirectRun(t, X, w, np.einsum("nij,jk,nk->ni", X, J, w), np.einsum("ni,ij,nj->n", w, J, w) / 2, steps)
