"""How long the ways of two controls are at least, on groups of three dimensions where the shortest loops are known.

With [b1, b2] = b3, [b2, b3] = k b1, [b3, b1] = k b2 a way X' = X hat(u1 b1 + u2 b2), of length int |u| dt, lies over one on a surface of
curvature k, and turns about b3 by the area that it encloses. The shortest way to exp(hat(g b3)) lies over a circle:

    l(g)^2 = 4 pi |g| - k g^2     k >= 0, where k |g| <= 2 pi

(R. W. Brockett, in New Directions in Applied Mathematics (1982) 11 for k = 0; U. Boscain and F. Rossi, SIAM J. Control Optim. 47 (2008) 1851
for SU(2) and SO(3)). An element is exp(s) exp(hat(g b3)) with a straight way s, so that the triangle inequality gives l >= l(g) - |s|,
and l >= |s|.
"""

from __future__ import annotations

import numpy as np

from lie_codegen.algebra.brackets import bracket
from lie_codegen.arrays import Array
from lie_codegen.flow.batched_exponential import expm
from lie_codegen.flow.logarithm import matrix_log
from lie_codegen.groups.matrix_group import MatrixGroup

_SAME = 1e-12


def least_length(group: MatrixGroup, controls: Array, element: Array) -> float | None:
    """A length that no way of controls b1, b2 (2, n) to the element falls below; None where none is known."""
    if group.dim != 3 or len(controls) != 2:
        return None
    b1, b2 = controls
    b3 = bracket(group.algebra, b1, b2)
    back, across = bracket(group.algebra, b2, b3), bracket(group.algebra, b3, b1)
    k = float(back @ b1 / (b1 @ b1))
    scale = 1.0 + float(np.max(np.abs(controls))) ** 3
    if np.max(np.abs(back - k * b1)) > _SAME * scale or np.max(np.abs(across - k * b2)) > _SAME * scale or k < 0:
        return None
    frame = np.array([b1, b2, b3])
    if np.linalg.matrix_rank(frame) < 3:
        return None
    x, off = matrix_log(group, element)
    if not off <= 1e-9:
        return None
    x1, x2, x3 = np.linalg.solve(frame.T, x)
    if k == 0:
        return max(float(np.hypot(x1, x2)), float(np.sqrt(4 * np.pi * abs(x3)) - np.hypot(x1, x2)))
    # in units in which k = 1 the logarithm is a rotation vector, and the unit quaternion one of its two lifts
    turn = np.array([np.sqrt(k) * x1, np.sqrt(k) * x2, k * x3])
    angle = float(np.linalg.norm(turn))
    q = np.array([np.cos(angle / 2), *(0.5 * np.sinc(angle / (2 * np.pi)) * turn)])
    whole = expm(group.hat(2 * np.pi / k * b3)[None])[0]
    rotations = bool(np.allclose(whole, np.eye(group.degree), atol=1e-9))
    lengths = []
    for w, _, _, z in (q, -q) if rotations else (q,):
        g = 2 * abs(float(np.arctan2(z, w)))
        straight = 2 * float(np.arccos(min(1.0, np.hypot(w, z))))
        lengths.append(max(straight, float(np.sqrt(g * (4 * np.pi - g))) - straight))
    return min(lengths) / float(np.sqrt(k))
