"""What averaging saves: cost and error over 1/eps against direct integration; elliptic kernels against SciPy."""

from __future__ import annotations

import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from lie_codegen.groups.build import build
from lie_codegen.pictures.result import GalleryResult, new_figure, save
from lie_codegen.pictures.style import BLUE, GREY, RED, caption
from lie_codegen.rigid_body.elliptic_kernels import elliptic_kernels
from lie_codegen.rigid_body.euler_average import euler_average
from lie_codegen.rigid_body.euler_solutions import solve_actual, solve_averaged
from lie_codegen.rigid_body.free_rigid_body import free_rigid_body

_EPSILONS = (0.05, 0.025, 0.0125, 0.00625, 0.003125, 0.0015625)


def rigid_body_cost(folder: Path, progress: Callable[[str], None] = lambda line: None) -> GalleryResult:
    """Seconds and error of the averaged system against the full one over t = 1/eps; ns of sn, cn, dn."""
    body = free_rigid_body((3, 4, 5))
    flow = euler_average(body, ["-0.3*w1 + 0.2*w3", "0.25*w2 - 0.1", "0.15*w3 - 0.2*w1"])
    start = body.from_slow(1.0, 0.5, 0.1)
    errors, seconds = [], []
    solve_actual(flow, start, [0, 1], 0.1)
    solve_averaged(flow, 1.0, 0.5, [0, 1], 0.1, phi0=0.1)
    for eps in _EPSILONS:
        progress(f"eps = {eps}")
        t = np.linspace(0, 1 / eps, 60)
        direct, omega = _least(partial(solve_actual, flow, start, t, eps, rtol=1e-9))
        averaged, slow = _least(partial(solve_averaged, flow, 1.0, 0.5, t, eps, phi0=0.1, rtol=1e-9))
        actual = body.to_slow(omega)
        errors.append(max(np.abs(actual.Omega - slow.Omega).max(), np.abs(actual.k - slow.k).max()))
        seconds.append((direct, averaged))
    slopes = np.diff(np.log(errors)) / np.diff(np.log(_EPSILONS))
    progress("elliptic functions against scipy.special.ellipj")
    nanoseconds = elliptic_timings()
    numbers = {
        "eps": list(_EPSILONS),
        "error": [float(e) for e in errors],
        "slopes": [float(s) for s in slopes],
        "seconds_direct": [s for s, _ in seconds],
        "seconds_averaged": [s for _, s in seconds],
        "elliptic_ns": nanoseconds,
    }
    figure = new_figure(12, 4.8)
    figure.suptitle("What averaging a tumbling body costs and errs over $1/\\epsilon$")
    axes: Any = figure.subplots(1, 3)
    axes[0].loglog(_EPSILONS, errors, "o-", color=BLUE, label=f"error, slope {slopes[-1]:.2f}")
    axes[0].loglog(_EPSILONS, np.array(_EPSILONS) * errors[-1] / _EPSILONS[-1], "--", color=GREY, label="slope 1")
    axes[0].set(title="slow variables over $1/\\epsilon$", xlabel="$\\epsilon$", ylabel="largest error")
    axes[1].loglog(_EPSILONS, [s for s, _ in seconds], "o-", color=RED, label="full equations")
    axes[1].loglog(_EPSILONS, [s for _, s in seconds], "o-", color=BLUE, label="averaged")
    axes[1].set(title="cost over $1/\\epsilon$, tolerance $10^{-9}$", xlabel="$\\epsilon$", ylabel="processor time [s]")
    axes[1].invert_xaxis()
    axes[0].invert_xaxis()
    names = list(nanoseconds)
    axes[2].barh(names, [nanoseconds[n] for n in names], color=[BLUE if "kernel" in n else GREY for n in names])
    axes[2].set(title="sn, cn, dn (kernels: and Zeta)", xlabel="time of an evaluation [ns]", xscale="log")
    for axis in axes[:2]:
        axis.legend(frameon=False)
        axis.set_xticks(_EPSILONS, [f"1/{round(1 / eps)}" for eps in _EPSILONS])
        axis.minorticks_off()
    caption(
        figure,
        "Inertia (3, 4, 5) under a linear torque. Times: the least of several calls; right: means over 100,000 points.",
    )
    return save("rigid_body_cost", folder, figure, numbers)


def elliptic_timings(count: int = 100_000) -> dict[str, float]:
    """ns an evaluation: compiled kernel on lanes and by single calls, SciPy vectorised and by single calls."""
    from scipy.special import ellipj, ellipk

    library = build(elliptic_kernels())
    rng = np.random.default_rng(0)
    phi, k = rng.uniform(-0.5, 0.5, count), rng.uniform(0, 0.99, count)
    m = k**2
    u = 4 * ellipk(m) * phi
    few = list(zip(phi[:2000].tolist(), k[:2000].tolist(), strict=True))
    pairs = list(zip(u[:2000].tolist(), m[:2000].tolist(), strict=True))

    def loop(function: Callable[..., Any], points: list[tuple[float, float]]) -> Callable[[], None]:
        def run() -> None:
            for a, b in points:
                function(a, b)

        return run

    return {
        "kernel, lanes": _least(lambda: library.jacobi.batch(phi, k))[0] / count * 1e9,
        "scipy, vectorised": _least(lambda: ellipj(u, m))[0] / count * 1e9,
        "kernel, single calls": _least(loop(library.jacobi, few))[0] / len(few) * 1e9,
        "scipy, single calls": _least(loop(ellipj, pairs))[0] / len(pairs) * 1e9,
    }


def _least(function: Callable[[], Any], repeats: int = 5) -> tuple[float, Any]:
    """Processor seconds of the quickest call, which others on the machine disturb least, and what the last one returned."""
    seconds = []
    for _ in range(repeats):
        start = time.process_time()
        value = function()
        seconds.append(time.process_time() - start)
    return min(seconds), value
