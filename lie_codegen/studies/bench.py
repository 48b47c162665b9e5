"""Ours against the peers that are installed: calls, batches, trajectories, Monte Carlo, cold start; and the limits."""

from __future__ import annotations

import ctypes
import os
import platform
import random
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from lie_codegen.groups.catalogue_load import group as load
from lie_codegen.kernels.group_kernels import group_kernel
from lie_codegen.kernels.kernel import Kernel
from lie_codegen.kernels.rkmk import wei_norman_step
from lie_codegen.lowering.casadi_arithmetic import flatten
from lie_codegen.runtime.build import build_kernels
from lie_codegen.studies import bench_peers as peers
from lie_codegen.studies.bench_timing import Spread, Timing, interleaved

#: group, kernel: what is compared.
KERNELS = (
    ("so3", "wei_norman_rate"),
    ("se3", "wei_norman_rate"),
    ("su3", "wei_norman_rate"),
    ("se_2_3", "wei_norman_rate"),
    ("se3", "exp"),
    ("se3", "log"),
    ("se3", "ljac_inv"),
)
SMALL, LARGE = 4_096, 1_000_000
#: Above this many instructions jax compiles for minutes; it is left out.
JAX_LIMIT = 500
Report = Callable[[str], None]


@dataclass(frozen=True)
class Row:
    """One comparison.

    Attributes:
        area: call, batch, trajectory, Monte Carlo.
        what: group, kernel, size.
        unit: of the nanoseconds.
        timings: name -> timing; the first is ours.
        note: a limit beside it, or empty.
    """

    area: str
    what: str
    unit: str
    timings: dict[str, Timing]
    note: str = ""


@dataclass(frozen=True)
class Limits:
    """Of one core: bytes read per second, multiply-adds per second (2 operations each)."""

    read: float
    operations: float


@dataclass(frozen=True)
class Bench:
    """Everything that was measured."""

    machine: str
    rows: tuple[Row, ...]
    limits: Limits
    cold_start: dict[str, Spread]


def bench(rounds: int = 15, report: Report = lambda line: None, only: str = "") -> Bench:
    """Run every comparison.

    Args:
        rounds: of each comparison.
        report: is told what is going on.
        only: leaves out the kernels without this text in "group kernel" (numba compiles those of su3 for minutes).
    """
    with tempfile.TemporaryDirectory(prefix="lie_codegen-bench-") as name:
        folder = Path(name)
        hand = peers.hand_written(folder)
        bounds = limits(hand)
        rows: list[Row] = []
        for group, kernel in (each for each in KERNELS if only in " ".join(each)):
            report(f"{group} {kernel}")
            rows += kernel_rows(group_kernel(load(group), kernel), folder, rounds, bounds)
        report("trajectories")
        rows += loop_rows(folder, hand, rounds)
        report("cold start")
        return Bench(machine(), tuple(rows), bounds, cold_start(folder))


def machine() -> str:
    """The class of the processor."""
    name = platform.processor() or platform.machine()
    try:
        with open("/proc/cpuinfo", encoding="utf-8", errors="replace") as file:
            name = next((line.split(":")[1].strip() for line in file if line.startswith("model name")), name)
    except OSError:
        pass
    return f"{name}, {os.cpu_count()} cores, Python {platform.python_version()}, numpy {np.__version__}"


def limits(hand: ctypes.CDLL) -> Limits:
    """The best of several runs."""
    data, count = np.ones(32 * 2**20 // 4), 200_000
    reads, rates = [], []
    for _ in range(9):
        started = time.perf_counter()
        hand.read_all(ctypes.c_ssize_t(data.size), ctypes.c_void_p(data.ctypes.data))
        middle = time.perf_counter()
        hand.multiply_add(ctypes.c_ssize_t(count), ctypes.c_double(0.5))
        reads.append(data.nbytes / (middle - started))
        rates.append(2 * 12 * 8 * count / (time.perf_counter() - middle))
    return Limits(max(reads), max(rates))


def samples(kernel: Kernel, count: int) -> list[np.ndarray[Any, Any]]:
    """Admissible inputs, (count, size) each; a few, repeated."""
    rng = random.Random(0)
    few = [kernel.sample(rng) for _ in range(64)]
    arrays = []
    for number, port in enumerate(kernel.inputs):
        rows = np.array([[float(x) for x in flatten(port, sample[number])] for sample in few])
        arrays.append(np.ascontiguousarray(np.tile(rows, (-(-count // len(rows)), 1))[:count]))
    return arrays


def kernel_rows(kernel: Kernel, folder: Path, rounds: int, bounds: Limits) -> list[Row]:
    """Calls and batches of one kernel."""
    function = build_kernels(lambda: [kernel])[kernel.name]
    loop, external = peers.as_casadi_c(kernel, folder)
    rows = [Row("call", kernel.symbol, "ns a call", interleaved(_calls(kernel, function, external, folder), 1, rounds))]
    doubles = sum(port.size for port in kernel.inputs + kernel.outputs)
    for count in (SMALL, LARGE):
        timings = interleaved(
            _batches(kernel, function, loop, folder, count), count, rounds if count == SMALL else max(3, rounds // 4)
        )
        share = doubles * 8 / timings["lie_codegen, out="].nanoseconds.low * 1e9 / bounds.read
        note = f"{share:.0%} of the read bandwidth" if count == LARGE else ""
        rows.append(Row("batch", f"{kernel.symbol}, {count}", "ns a sample", timings, note))
    return rows


def _shaped(kernel: Kernel, flat: list[np.ndarray[Any, Any]]) -> list[np.ndarray[Any, Any]]:
    shaped = []
    for port, array in zip(kernel.inputs, flat, strict=True):
        entries = array.view(np.complex128) if port.is_complex else array
        shaped.append(entries.reshape(len(array), *port.shape))
    return shaped


def _calls(kernel: Kernel, function: Any, external: Any, folder: Path) -> dict[str, peers.Work]:
    flat = [array[0].copy() for array in samples(kernel, 1)]
    shaped = [array[0].copy() for array in _shaped(kernel, samples(kernel, 1))]
    outputs = [np.empty(port.size) for port in kernel.outputs]
    columns = [array.reshape(-1, 1) for array in flat]
    buffer, trigger = external.buffer()
    for number, array in enumerate(flat):
        buffer.set_arg(number, memoryview(array.data))
    for number, array in enumerate(outputs):
        buffer.set_res(number, memoryview(array.data))
    works: dict[str, peers.Work] = {
        "lie_codegen": lambda: function(*shaped),
        "CasADi f(numpy), compiled": lambda: external(*columns),
        "CasADi buffer(), preset": partial(_preset, trigger, buffer),
    }
    if peers.installed("numba"):
        point = peers.as_python(kernel, folder, "math", scalars=True).point

        def numba_call() -> object:
            made = [np.empty(port.size) for port in kernel.outputs]
            point(*flat, *made)
            return made

        works["numba"] = numba_call
    jax, jnp = peers.jax_modules()
    if jax is not None and peers.instructions(kernel) <= JAX_LIMIT:
        jitted = jax.jit(peers.as_python(kernel, folder, "jax.numpy", scalars=False).point)
        given = [jnp.asarray(array) for array in flat]
        works["jax jit, jax arrays"] = lambda: jax.block_until_ready(jitted(*given))
    liecasadi = peers.installed("liecasadi")
    if liecasadi is not None and kernel.symbol == "se3_exp":
        import casadi as ca

        tangent = ca.SX.sym("x", 6)
        theirs = ca.Function("f", [tangent], [liecasadi.SE3Tangent(tangent).exp().as_matrix()])
        works["liecasadi f(numpy)"] = lambda: theirs(columns[0])
    return works


def _preset(trigger: Any, buffer: Any) -> None:
    """The buffer must live as long as its trigger."""
    trigger()


def _batches(kernel: Kernel, function: Any, loop: ctypes.CDLL, folder: Path, count: int) -> dict[str, peers.Work]:
    flat = samples(kernel, count)
    shaped = _shaped(kernel, flat)
    made = function.batch(*shaped)
    several = isinstance(made, tuple)
    outputs = [np.empty((count, port.size)) for port in kernel.outputs]
    given, strides, to = peers.pointers(flat), peers.sizes([p.size for p in kernel.inputs]), peers.pointers(outputs)
    works: dict[str, peers.Work] = {
        "lie_codegen, out=": lambda: function.batch(*shaped, out=tuple(made) if several else made),
        "lie_codegen, new arrays": lambda: function.batch(*shaped),
        "CasADi's C in a loop": lambda: loop.bench_batch(ctypes.c_ssize_t(count), given, strides, to),
    }
    arrays = peers.as_python(kernel, folder, "numpy", scalars=False).point
    works["numpy"] = lambda: arrays(*flat)
    if peers.installed("numba"):
        batch = peers.as_python(kernel, folder, "math", scalars=True).batch
        works["numba"] = lambda: batch(*flat, *outputs)
    jax, jnp = peers.jax_modules()
    if jax is not None and peers.instructions(kernel) <= JAX_LIMIT:
        jitted = jax.jit(jax.vmap(peers.as_python(kernel, folder, "jax.numpy", scalars=False).point))
        on_device = [jnp.asarray(array) for array in flat]
        works["jax vmap + jit"] = lambda: jax.block_until_ready(jitted(*on_device))
        jaxlie = peers.installed("jaxlie")
        if jaxlie is not None and kernel.symbol == "se3_exp":
            theirs = jax.jit(jax.vmap(lambda x: jaxlie.SE3.exp(x).as_matrix()))
            works["jaxlie vmap + jit"] = lambda: jax.block_until_ready(theirs(on_device[0]))
    return works


def loop_rows(folder: Path, hand: ctypes.CDLL, rounds: int) -> list[Row]:
    """RK4 of the SO(3) Wei-Norman equations: one trajectory of 10^4 steps, and 2000 of 100 steps at once."""
    kernel = wei_norman_step(load("so3"))
    step = build_kernels(lambda: [kernel]).wei_norman_step
    loop, _ = peers.as_casadi_c(kernel, folder)
    n, h = 10_000, 1e-3
    t = h * np.arange(n)[:, None]
    u0, um, u1 = (np.ascontiguousarray(0.3 * np.sin(t + shift + [0, 1, 2])) for shift in (0, h / 2, h))
    g, hs, trajectory = np.zeros(3), np.array([h]), np.empty((n + 1, 3))
    given, strides = peers.pointers([g, u0, um, u1, hs]), peers.sizes([0, 3, 3, 3, 0])
    addresses = [ctypes.c_void_p(array.ctypes.data) for array in (g, u0, um, u1)]
    target = ctypes.c_void_p(trajectory.ctypes.data)
    one: dict[str, peers.Work] = {
        "lie_codegen": lambda: step.scan(g, u0, um, u1, h, n=n, out=trajectory),
        "hand-written C": lambda: hand.hand_scan(ctypes.c_ssize_t(n), *addresses, ctypes.c_double(h), target),
        "CasADi's C in a loop": lambda: loop.bench_scan(ctypes.c_ssize_t(n), given, strides, target),
    }
    count, steps = 2_000, 100
    starts = np.random.default_rng(0).uniform(-0.3, 0.3, (count, 3))
    last = np.empty((count, 2, 3))
    many: dict[str, peers.Work] = {
        "lie_codegen": lambda: step.scan_batch(starts, u0[0], um[0], u1[0], h, n=steps, every=steps, out=last)
    }
    if peers.installed("numba"):
        numba = peers.as_python(kernel, folder, "math", scalars=True)
        one["numba"] = lambda: numba.scan(g, u0, um, u1, h, trajectory)
        many["numba"] = lambda: numba.many(starts.copy(), u0[0], um[0], u1[0], h, steps)
    jax, jnp = peers.jax_modules()
    if jax is not None:
        move = peers.as_python(kernel, folder, "jax.numpy", scalars=False).point
        scan = jax.jit(lambda x, u: jax.lax.scan(lambda s, v: (move(s, *v, h)[0],) * 2, x, u)[1])
        inputs = tuple(jnp.asarray(u) for u in (u0, um, u1))
        constant = tuple(u[0] for u in inputs)
        whole = jax.jit(lambda xs: jax.lax.fori_loop(0, steps, lambda _, s: move(s, *constant, h)[0], xs))
        first, several = jnp.asarray(g), jnp.asarray(starts)
        one["jax scan"] = lambda: jax.block_until_ready(scan(first, inputs))
        many["jax, batched"] = lambda: jax.block_until_ready(whole(several))
    from scipy.integrate import solve_ivp

    def field(s: float, x: Any) -> Any:
        u = 0.3 * np.sin(s + np.arange(3.0))
        c, d = np.cos(x[2]), np.sin(x[2])
        top = (u[0] * c - u[1] * d) / np.cos(x[1])
        return np.array([top, u[0] * d + u[1] * c, u[2] - np.sin(x[1]) * top])

    one["scipy solve_ivp, max_step = h"] = lambda: solve_ivp(field, (0, 200 * h), g, max_step=h).y.repeat(n // 200)
    timings = interleaved(one, n, rounds)
    name = "scipy solve_ivp, max_step = h"
    slow = timings[name]  # ran a fiftieth of the steps
    timings[name] = Timing(_times(slow.nanoseconds, n / 200), _times(slow.ratio, n / 200))
    return [
        Row("trajectory", f"so3 RK4, {n} steps", "ns a step", timings),
        Row("Monte Carlo", f"so3 RK4, {count} x {steps}", "ns a step", interleaved(many, count * steps, rounds)),
    ]


def _times(spread: Spread, factor: float) -> Spread:
    return Spread(spread.low * factor, spread.middle * factor, spread.high * factor)


def cold_start(folder: Path, rounds: int = 5) -> dict[str, Spread]:
    """Seconds of a fresh process to build("so3") and one call: cold but for the extension, and warm."""
    cache = folder / "cache"
    cache.mkdir(mode=0o700)
    code = "import lie_codegen as lc, numpy as np; lc.build('so3').exp(np.zeros(3))"
    environment = {**os.environ, "LIE_CODEGEN_CACHE": str(cache)}
    environment["PYTHONPATH"] = os.pathsep.join(path for path in sys.path if path)

    def seconds() -> float:
        started = time.perf_counter()
        subprocess.run([sys.executable, "-c", code], env=environment, check=True)
        return time.perf_counter() - started

    seconds()
    cold, warm = [], []
    for _ in range(rounds):
        for file in (*cache.glob("entries/*/entry.json"), *cache.glob("requests/*.json")):
            file.unlink()
        cold.append(seconds())
        warm.append(seconds())
    return {"cold": Spread.of(cold), "warm": Spread.of(warm)}
