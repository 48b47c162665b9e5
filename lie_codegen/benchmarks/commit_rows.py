"""What `lie-codegen bench --against` times of one checkout: a script by public names alone, which runs with whatever lie_codegen it is given.

    python -P commit_rows.py [TEXT]      PYTHONPATH says which checkout

It says the names of its rows (those with TEXT in them), of those that this checkout cannot do the reason. Then a line "NAME COUNT" on its
stdin is answered with the processor seconds of a call, a plan's with its cost.
"""

from __future__ import annotations

import json
import random
import sys
import time
from collections.abc import Callable, Iterator
from functools import partial
from typing import Any

import numpy as np

import lie_codegen as lc

Work = Callable[[], Any]
#: Names of kernels whose calls and batches are timed.
KERNELS = (
    ("so3", "wei_norman_rate"), ("se3", "wei_norman_rate"), ("su3", "wei_norman_rate"), ("se_2_3", "wei_norman_rate"),
    ("so3", "exp"), ("se3", "exp"), ("se3", "log"), ("se3", "ljac_inv"),
)  # fmt: skip
_SMALL, _LARGE = 4_096, 1_000_000


def makers() -> Iterator[tuple[str, Callable[[], Work]]]:
    """Name -> what makes its work."""
    for group, name in KERNELS:
        yield from _kernel(f"{group} {name}", partial(_group_kernel, group, name))
    yield from _kernel("attitude law", lambda: lc.attitude_law("pd", inertia=[1, 2, 3], k_p=4, k_d=6))
    yield from _kernel("tracking law of SE(3)", _tracker)
    for step in ("rkmk4_step", "commutator_free_step"):
        yield f"{step}, scan of 20,000", partial(_scan, step)
        yield f"{step}, 1,000 trajectories of 100", partial(_scan_batch, step)
    for name, rtol in (("so3", 1e-6), ("so3", 1e-10), ("se3", 1e-10), ("su3", 1e-10)):
        yield f"simulate {name}, {rtol:g}", partial(_simulate, name, rtol)
    yield "propagator of a qubit", _propagator
    yield "closed loop, 1e-10", partial(_loop, 1, {"rtol": 1e-10})
    yield "1,000 closed loops of 500 steps", partial(_loop, 1000, {"step": 0.02})
    for name, controls, method in (
        ("h3", (0, 1), "optimal"), ("se2", (0, 1), "optimal"), ("so3", (0, 1), "optimal"), ("se3", (0, 1, 2, 3), "optimal"),
        ("so3", (0, 1), "area_rule"), ("so3", (0, 1), "transcription"), ("se2", (0, 1), "transcription"),
    ):  # fmt: skip
        yield f"steer {name}, {method}", partial(_steer, name, controls, method)
    for name, count in (("so3", 2), ("su2", 2), ("se3", 3)):
        yield f"steer {name}, bounds and drift", partial(_bounded, name, count)


def _group_kernel(group: str, name: str) -> Any:
    return next(kernel for kernel in lc.group_kernels(group) if kernel.name == name)


def _tracker() -> Any:
    gains = {"K_1": 4.0, "K_2": 3.0, "K_d": [2.0, 2, 2, 3, 3, 3]}
    return lc.tracking_law("se3", inertia=[2, 3, 4, 5, 6, 8], error="se3_1", gains=gains)


def _kernel(title: str, make: Callable[[], Any]) -> Iterator[tuple[str, Callable[[], Work]]]:
    yield f"{title}, call", partial(_call, make)
    for count in (_SMALL, _LARGE):
        yield f"{title}, batch of {count:,}", partial(_batch, make, count)


def _samples(kernel: Any, count: int) -> list[Any]:
    """(count, ...) of every input, 64 random ones over and over."""
    rng = random.Random(0)
    rows = [kernel.sampler(rng) for _ in range(64)]
    return [
        np.resize(np.array([row[i] for row in rows], float), (count, *port.shape))
        for i, port in enumerate(kernel.inputs)
    ]


def _call(make: Callable[[], Any]) -> Work:
    kernel = make()
    function, given = lc.build([kernel])[kernel.name], [each[0] for each in _samples(kernel, 1)]
    return lambda: function(*given)


def _batch(make: Callable[[], Any], count: int) -> Work:
    kernel = make()
    function, given = lc.build([kernel])[kernel.name].batch, _samples(kernel, count)
    out = function(*given)
    return lambda: function(*given, out=out)


def _scan(name: str) -> Work:
    step, steps = lc.build([getattr(lc, name)("so3")])[name], 20_000
    u = 0.3 * np.sin(1e-3 * np.arange(steps)[:, None] + [0, 1, 2])
    return lambda: step.scan(np.eye(3), *[u] * _velocities(name), 1e-3, n=steps, every=steps)


def _scan_batch(name: str) -> Work:
    step, starts = lc.build([getattr(lc, name)("so3")])[name], np.tile(np.eye(3), (1000, 1, 1))
    u = np.array([0.3, 0.2, -0.1])
    return lambda: step.scan_batch(starts, *[u] * _velocities(name), 1e-2, n=100, every=100)


def _velocities(name: str) -> int:
    return len(getattr(lc, name)("so3").inputs) - 2


def _simulate(name: str, rtol: float) -> Work:
    n = lc.group(name).dim
    u = lc.PeriodicInput(tuple(f"cos({k + 1}*t/2)/{k + 2}" for k in range(n)), period="4*pi")
    t = np.linspace(0, 20, 11)
    return lambda: lc.simulate(name, u, t=t, rtol=rtol)


def _propagator() -> Work:
    u = lc.ParametricInput(("-a*cos(w*t)", "0", "-1"), parameters=("a", "w"))
    U = lc.propagator("su2", u, duration=50.0, rtol=1e-10)
    return lambda: U(a=0.5, w=1.1).X


def _loop(members: int, how: dict[str, Any]) -> Work:
    law = lc.attitude_law("pd", tunable=True)
    given: dict[str, Any] = {
        "law": law,
        "inertia": np.tile(np.diag([1.0, 2, 3]), (members, 1, 1)),
        "gains": {"k_p": 4, "k_d": 6},
    }
    xi0, t = np.linspace([1.0, 0.5, -0.2], [0.5, 0.2, 0.1], members), np.linspace(0, 10, 11)
    return lambda: lc.closed_loop("so3", xi0=xi0, t=t, **given, **how)


def _steer(name: str, controls: tuple[int, ...], method: str) -> Work:
    target = np.resize([0.4, -0.3, 0.5, 0.2], lc.group(name).dim)
    labels = [lc.group(name).labels[k] for k in controls]
    return lambda: lc.steer(name, target, controls=labels, duration=4.0, method=method)


def _bounded(name: str, count: int) -> Work:
    G = lc.group(name)
    target, drift = np.resize([0.4, -0.3, 0.5, 0.2], G.dim), np.zeros(G.dim)
    drift[-1] = 0.3
    labels = G.labels[:count]
    return lambda: lc.steer(name, target, controls=labels, duration=4.0, bounds=1.5, drift=drift, method="direct")


def main(text: str) -> None:
    """Answer until stdin ends."""
    out, sys.stdout = sys.stdout, sys.stderr

    def say(what: dict[str, Any]) -> None:
        out.write(json.dumps(what) + "\n")
        out.flush()

    made = {name: make for name, make in makers() if text.lower() in name.lower()}
    say({"rows": list(made)})
    works: dict[str, Work] = {}
    for line in sys.stdin:
        name, _, count = line.rstrip("\n").rpartition(" ")
        try:
            if name not in works:
                works = {name: made[name]()}  # one row's arrays at a time
                works[name]()
            start = time.process_time()
            for _ in range(int(count)):
                result = works[name]()
            seconds = (time.process_time() - start) / int(count)
            say({"seconds": seconds, "cost": float(result.cost) if name.startswith("steer") else None})
        except Exception as error:  # another checkout may lack it, or refuse
            say({"absent": f"{type(error).__name__}: {str(error).partition(chr(10))[0][:120]}"})


if __name__ == "__main__":
    main(sys.argv[1] if len(sys.argv) > 1 else "")
