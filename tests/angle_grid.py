"""Points at angles from 0 to pi, where series switch, and the error of a result relative to the size of the right one."""

from __future__ import annotations

import numpy as np
from kernel_calls import load

#: The switches of the series are at angles 1, sqrt 6 and sqrt 12.
ANGLES = (0.0, 1e-8, 1e-5, 1e-3, 0.1, 0.999, 1.001, 2.0, 2.449, 2.45, 3.0, 3.14)


def point(name: str, angle: float, rng: np.random.Generator) -> np.ndarray:
    """A vector whose rotation, or hat(x) for su2 and sl2, has the given angle; its other components are of size 1."""
    x = rng.normal(size=load(name).dim)
    if name in ("so3", "su2", "se3"):
        x[:3] *= angle / np.linalg.norm(x[:3])
    elif name == "se2":
        x[0] = angle
    elif name == "sl2":
        x = np.array([0.3, 1.1, -0.9]) + 0.05 * x
        x *= angle / np.sqrt(-(x[0] ** 2) - x[1] * x[2])
    return x


def relative_error(actual: np.ndarray, expected: np.ndarray) -> float:
    assert np.all(np.isfinite(actual))
    size = float(np.max(np.abs(expected)))
    return float(np.max(np.abs(actual - expected))) / (size or 1.0)
