"""A Monte Carlo study of the satellite's law: drawn, run, summarised and stored, against the bare loop by numba and by jax."""

from __future__ import annotations

import shutil
from collections.abc import Iterator
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.benchmarks import peers
from lie_codegen.benchmarks.rows import AbsentError, Entrant, Row, Work, compete
from lie_codegen.control.attitude_law import attitude_law
from lie_codegen.control.closed_loop import closed_loop
from lie_codegen.control.loop_kernels import loop_step
from lie_codegen.control.loop_result import ClosedLoop
from lie_codegen.kernel.kernel import Kernel
from lie_codegen.studies.distributions import Distribution, Normal, Uniform
from lie_codegen.studies.on_group import OnGroup
from lie_codegen.studies.space import Space
from lie_codegen.studies.study import study

COUNT, STEPS, H = 10_000, 500, 0.02
_SEED = 1


def study_row(folder: Path, rounds: int) -> Row:
    """Inertia, gains and start of each loop its own; the peers are given the numbers and keep the angle at the end."""
    what = f"so3 attitude law, {COUNT} loops of {STEPS} RKMK4 steps"
    return compete("study", what, "ns a step", COUNT * STEPS, max(3, rounds // 3), list(_entrants(folder)))


def _space() -> dict[str, Distribution]:
    return {
        "inertia": Normal([1, 2, 2.5], 0.05),
        "k_p": Uniform(3, 5),
        "k_d": Uniform(2, 4),
        "X0": OnGroup("so3"),
        "xi0": Normal(np.zeros(3), 0.1),
    }


def _entrants(folder: Path) -> Iterator[Entrant]:
    law = attitude_law("pd", tunable=True)
    loop = partial(closed_loop, "so3", law=law, t=(0, STEPS * H), step=H, threads=1)
    columns = Space(_space()).columns(_SEED, 0, COUNT, COUNT)

    def by_us() -> Work:
        peers.need("zarr")
        store = folder / "study.zarr"

        def work() -> Array:
            shutil.rmtree(store, ignore_errors=True)
            return np.asarray(study(loop, _space(), n=COUNT, seed=_SEED, store=store)["error_final"])

        return work

    yield Entrant("lie_codegen, drawn and stored", by_us)
    if not any(peers.is_there(name) for name in ("numba", "jax")):
        return
    few = {name: value[:2] for name, value in columns.items() if name in ("k_p", "k_d")}
    run = loop(
        inertia=columns["inertia"][:2, :, None] * np.eye(3), X0=columns["X0"][:2], xi0=columns["xi0"][:2], gains=few
    )
    step, given = _step(run), _numbers(_step(run), columns)
    start = np.concatenate([columns["X0"].reshape(COUNT, 9), columns["xi0"]], axis=1)

    def by_numba() -> Work:
        numba = peers.need("numba")
        point = peers.as_python(step, folder, "math", scalars=True).point

        @numba.njit(error_model="numpy")  # type: ignore[untyped-decorator]
        def whole(states: Any, numbers: Any) -> None:
            for j in range(states.shape[0]):
                for k in range(STEPS):
                    point(states[j], k * H, H, numbers[0][j], numbers[1][j], numbers[2][j], numbers[3][j], states[j])

        def work() -> Array:
            states = start.copy()
            whole(states, given)
            return _angle(states)

        return work

    def by_jax() -> Work:
        jax, jnp = peers.jax_modules()
        point = peers.as_python(step, folder, "jax.numpy", scalars=False).point
        numbers = [jnp.asarray(each) for each in given]
        whole = jax.jit(lambda x: jax.lax.fori_loop(0, STEPS, lambda k, s: point(s, k * H, H, *numbers)[0], x))
        states = jnp.asarray(start)
        return lambda: _angle(np.asarray(jax.block_until_ready(whole(states))))

    yield Entrant("numba, the loop alone", by_numba)
    yield Entrant("jax, batched, the loop alone", by_jax)


def _step(run: ClosedLoop) -> Kernel:
    made = run._making
    if made is None:
        raise AbsentError("the loop does not tell its step")
    return loop_step(made.run.loop)


def _numbers(step: Kernel, columns: dict[str, Array]) -> tuple[Array, ...]:
    """What the step takes beside state, t and h, in its order, flat."""
    inertia = columns["inertia"][:, :, None] * np.eye(3)
    known = {**columns, "inertia": inertia, "inertia_inverse": np.linalg.inv(inertia)}
    given = (known[port.name].reshape(COUNT, -1) if port.shape else known[port.name] for port in step.inputs[3:])
    return tuple(np.ascontiguousarray(each) for each in given)


def _angle(states: Array) -> Array:
    """Of the rotation, in [0, pi], without cancellation at 0."""
    size = np.linalg.norm(states[:, :9] - np.eye(3).ravel(), axis=1)
    return np.asarray(2 * np.arcsin(np.minimum(1, size / np.sqrt(8))))
