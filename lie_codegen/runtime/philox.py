"""Philox4x32-10 in numpy: the numbers that templates/loop.c draws, for the calls outside its loop.

Salmon, Moraes, Dror and Shaw, Parallel random numbers: as easy as 1, 2, 3 (SC 2011). A counter goes in, four numbers come out:
no number depends on which others were drawn.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from lie_codegen.arrays import Array

_LOW = np.uint64(0xFFFFFFFF)
_MULTIPLIERS = np.uint64(0xD2511F53), np.uint64(0xCD9E8D57)
_WEYL = 0x9E3779B9, 0xBB67AE85


def philox(counter: NDArray[np.uint64], key: int) -> NDArray[np.uint64]:
    """(..., 4) words of 32 bits from counters (..., 4) and a key of 64 bits."""
    a, b, c, d = (np.asarray(counter[..., i], dtype=np.uint64) & _LOW for i in range(4))
    low, high = key & 0xFFFFFFFF, key >> 32 & 0xFFFFFFFF
    for _ in range(10):
        p, q = _MULTIPLIERS[0] * a, _MULTIPLIERS[1] * c
        a, b, c, d = (
            (q >> np.uint64(32)) ^ b ^ np.uint64(low),
            q & _LOW,
            (p >> np.uint64(32)) ^ d ^ np.uint64(high),
            p & _LOW,
        )
        low, high = low + _WEYL[0] & 0xFFFFFFFF, high + _WEYL[1] & 0xFFFFFFFF
    return np.stack([a, b, c, d], axis=-1)


def uniforms(key: int, what: NDArray[np.uint32], loops: NDArray[np.uint64], sample: int) -> Array:
    """(N, 4 blocks) numbers in (0, 1): of N loops at one sample."""
    counter = np.empty((len(loops), len(what), 4), dtype=np.uint64)
    counter[..., 0] = sample & 0xFFFFFFFF
    counter[..., 1] = (loops & _LOW)[:, None]
    counter[..., 2] = (loops >> np.uint64(32))[:, None]
    counter[..., 3] = what
    return ((philox(counter, key).astype(float) + 0.5) * 2.0**-32).reshape(len(loops), -1)
