"""SE(3) exp with numba, as one writes it by hand: a fresh process to its first value. Thrown away."""

import math

import numba
import numpy as np


@numba.njit
def exp(x):
    w, v = x[:3], x[3:]
    angle2 = w @ w
    if angle2 < 1e-8:
        a, b, c = 1.0 - angle2 / 6.0, 0.5 - angle2 / 24.0, 1.0 / 6.0 - angle2 / 120.0
    else:
        angle = math.sqrt(angle2)
        a, b = math.sin(angle) / angle, (1.0 - math.cos(angle)) / angle2
        c = (1.0 - a) / angle2
    W = np.array([[0.0, -w[2], w[1]], [w[2], 0.0, -w[0]], [-w[1], w[0], 0.0]])
    W2 = W @ W
    X = np.eye(4)
    X[:3, :3] += a * W + b * W2
    X[:3, 3] = v + b * (W @ v) + c * (W2 @ v)
    return X


exp(np.array([0.1, 0.2, 0.3, 0.4, 0.5, 0.6]))
