"""SE(3) exp with numba, as one writes it by hand, entry by entry: a fresh process to its first value. Thrown away."""

import math

import numba
import numpy as np


@numba.njit
def exp(x, X):
    """X = exp(hat(x)), x = (w, v)."""
    p, q, r = x[0], x[1], x[2]
    s = p * p + q * q + r * r
    if s < 1e-4:
        a = 1.0 - s / 6.0 * (1.0 - s / 20.0)
        b = 0.5 - s / 24.0 * (1.0 - s / 30.0)
        c = 1.0 / 6.0 - s / 120.0 * (1.0 - s / 42.0)
    else:
        angle = math.sqrt(s)
        a, b = math.sin(angle) / angle, (1.0 - math.cos(angle)) / s
        c = (1.0 - a) / s
    X[0, 0], X[0, 1], X[0, 2] = 1.0 - b * (q * q + r * r), b * p * q - a * r, b * p * r + a * q
    X[1, 0], X[1, 1], X[1, 2] = b * p * q + a * r, 1.0 - b * (p * p + r * r), b * q * r - a * p
    X[2, 0], X[2, 1], X[2, 2] = b * p * r - a * q, b * q * r + a * p, 1.0 - b * (p * p + q * q)
    u, v, w = x[3], x[4], x[5]
    d = c * (p * u + q * v + r * w)
    k = 1.0 - c * s
    X[0, 3] = k * u + d * p + b * (q * w - r * v)
    X[1, 3] = k * v + d * q + b * (r * u - p * w)
    X[2, 3] = k * w + d * r + b * (p * v - q * u)
    X[3, 0] = X[3, 1] = X[3, 2] = 0.0
    X[3, 3] = 1.0


value = np.empty((4, 4))
exp(np.array([0.1, 0.2, 0.3, 0.4, 0.5, 0.6]), value)
