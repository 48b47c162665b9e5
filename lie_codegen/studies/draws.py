"""Random numbers by sample index: the same for a sample whatever the chunks, the workers and their order.

Philox (Salmon, Moraes, Dror and Shaw, SC11) is a keyed function of a counter and has no state to be carried: the numbers of sample i
of one input are the blocks i b, ..., i b + b - 1 of four words each under the key (seed, digest of the input's name). A further
input, or another order of them, therefore leaves the numbers of the others as they are.
"""

from __future__ import annotations

import hashlib

import numpy as np

from lie_codegen.arrays import Array

_WORDS = 4
_SEED_LIMIT = 2**64


def uniforms(seed: int, name: str, first: int, count: int, slots: int) -> Array:
    """(count, slots) numbers in (0, 1), those of the samples first, first + 1, ... of one input.

    Each is the middle of one of 2^53 equal cells, so that neither 0 nor 1 occurs and a quantile function may be applied.
    """
    if slots == 0 or count == 0:
        return np.empty((count, slots))
    blocks = -(-slots // _WORDS)
    salt = int.from_bytes(hashlib.sha256(name.encode()).digest()[:8], "little")
    # numpy raises the counter before it draws, so the block of counter c comes from a generator set to c - 1
    start = (first * blocks - 1) % 2**256
    raw = np.random.Philox(key=seed % _SEED_LIMIT + (salt << 64), counter=start).random_raw(count * blocks * _WORDS)
    words = np.asarray(raw, dtype=np.uint64).reshape(count, blocks * _WORDS)[:, :slots]
    return np.asarray(((words >> np.uint64(11)).astype(float) + 0.5) * 2.0**-53)


def noise_seed(seed: int) -> int:
    """The seed of the noise inside the samples, apart from that of their inputs."""
    return int.from_bytes(hashlib.sha256(f"noise {seed}".encode()).digest()[:4], "little")
