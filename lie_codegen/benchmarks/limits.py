"""What the machine can do at most, beside which the figures are read."""

from __future__ import annotations

import ctypes
import os
import platform
import time
from dataclasses import dataclass

import numpy as np

from lie_codegen.benchmarks.rows import Work


@dataclass(frozen=True)
class Limits:
    """Of one core: bytes read per second, multiply-adds per second (2 operations each)."""

    read: float
    operations: float


def machine() -> str:
    """The class of the processor, and how busy it is."""
    name = platform.processor() or platform.machine()
    try:
        with open("/proc/cpuinfo", encoding="utf-8", errors="replace") as file:
            name = next((line.split(":")[1].strip() for line in file if line.startswith("model name")), name)
    except OSError:
        pass
    load = f", load {os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else ""
    return f"{name}, {os.cpu_count()} cores{load}, Python {platform.python_version()}, numpy {np.__version__}"


def limits(hand: ctypes.CDLL) -> Limits:
    """The best of several runs."""
    data, count = np.ones(32 * 2**20 // 4), 200_000
    reads, rates = [], []
    for _ in range(9):
        started = time.process_time()
        hand.read_all(ctypes.c_ssize_t(data.size), ctypes.c_void_p(data.ctypes.data))
        middle = time.process_time()
        hand.multiply_add(ctypes.c_ssize_t(count), ctypes.c_double(0.5))
        reads.append(data.nbytes / (middle - started))
        rates.append(2 * 12 * 8 * count / (time.process_time() - middle))
    return Limits(max(reads), max(rates))


def reading(hand: ctypes.CDLL, doubles: int) -> Work:
    """The work of reading so many doubles once."""
    data = np.ones(doubles)
    return lambda: hand.read_all(ctypes.c_ssize_t(data.size), ctypes.c_void_p(data.ctypes.data))


def keep_to_one_core() -> None:
    """This process and its children on one core, so that no peer runs on two; where the system can say so."""
    os.environ["XLA_FLAGS"] = "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1"
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"):
        os.environ[name] = "1"
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
