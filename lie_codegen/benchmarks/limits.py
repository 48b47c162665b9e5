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
    """Of one core: bytes read per second, bytes written past the caches, multiply-adds per second (2 operations each)."""

    read: float
    written: float
    operations: float


#: What processors call the widest vectors they compute with, the widest first, and how they are known to people.
_VECTORS = {"avx512f": "AVX-512", "avx2": "AVX2", "asimd": "NEON", "sse2": "SSE2"}


def machine() -> str:
    """The class of the processor, its vectors, and how busy it is."""
    name, flags = platform.processor() or platform.machine(), ""
    try:
        with open("/proc/cpuinfo", encoding="utf-8", errors="replace") as file:
            told = {key.strip(): value.strip() for key, _, value in (line.partition(":") for line in file)}
        name, flags = told.get("model name", name), told.get("flags", told.get("Features", ""))
    except OSError:
        pass
    vectors = next((f", {word}" for flag, word in _VECTORS.items() if flag in flags.split()), "")
    load = f", load {os.getloadavg()[0]:.1f}" if hasattr(os, "getloadavg") else ""
    return f"{name}{vectors}, {os.cpu_count()} cores{load}, Python {platform.python_version()}, numpy {np.__version__}"


def limits(hand: ctypes.CDLL) -> Limits:
    """The best of several runs."""
    doubles, count = 32 * 2**20 // 4, 200_000
    works = (memory_work(hand, doubles, 0), memory_work(hand, 0, doubles), arithmetic_work(hand, _AT_ONCE * count))
    units = (8 * doubles, 8 * doubles, 2 * _AT_ONCE * count)
    rates: list[list[float]] = [[], [], []]
    for _ in range(9):
        for work, amount, seen in zip(works, units, rates, strict=True):
            started = time.process_time()
            work()
            seen.append(amount / (time.process_time() - started))
    return Limits(*(max(seen) for seen in rates))


#: Multiply-adds in one round of the loop in bench_hand.c.
_AT_ONCE = 12 * 8


def memory_work(hand: ctypes.CDLL, read: int, written: int) -> Work:
    """The work of reading so many doubles and writing so many, once."""
    data, room = np.ones(read), np.ones(written + 8)
    room = room[-room.ctypes.data % 64 // 8 :]  # from a multiple of 64 bytes

    def work() -> None:
        hand.read_all(ctypes.c_ssize_t(read), ctypes.c_void_p(data.ctypes.data))
        hand.write_all(ctypes.c_ssize_t(written), ctypes.c_void_p(room.ctypes.data))

    return work


def arithmetic_work(hand: ctypes.CDLL, operations: int) -> Work:
    """So many multiply-adds of numbers that are at hand."""
    return lambda: hand.multiply_add(ctypes.c_ssize_t(operations // _AT_ONCE), ctypes.c_double(0.5))


def keep_to_one_core() -> None:
    """This process and its children on one core, so that no peer runs on two; where the system can say so."""
    os.environ["XLA_FLAGS"] = "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1"
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "NUMBA_NUM_THREADS"):
        os.environ[name] = "1"
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})
