"""lc.study: many runs of one thing over distributions of its inputs, in a store that one can open, stop and go on with."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from contextlib import AbstractContextManager, nullcontext
from pathlib import Path
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.errors import InputError
from lie_codegen.exact.counts import whole_seed
from lie_codegen.runtime.digests import package_digest
from lie_codegen.studies.distributions import Choice, Grid
from lie_codegen.studies.driver import Job, drive, pilot
from lie_codegen.studies.engines import engine_of
from lie_codegen.studies.result import Study
from lie_codegen.studies.space import Space
from lie_codegen.studies.stopping import Quantile
from lie_codegen.studies.store import Store, bit_class, same_manifest, zarr_module
from lie_codegen.studies.tasks import as_run, mark
from lie_codegen.studies.work import Work

_LARGEST_CHUNK, _MEMORY, _SECONDS = 10_000, 2**26, 10.0


def study(
    what: Any,
    space: Mapping[Any, Any],
    *,
    n: int | None = None,
    seed: int = 0,
    store: str | Path | None = "study.zarr",
    chunk: int | str = "auto",
    on: Any = None,
    resume: bool = True,
    progress: bool | Callable[[int, int], None] | None = None,
    until: Quantile | None = None,
    reduce: Callable[[Any], Mapping[str, Any]] | None = None,
    wait: bool = True,
) -> Study:
    """Run `what` for n samples of the space, in chunks that are written as they end.

    The inputs of sample i follow from (seed, name of the input, i) alone: neither chunks nor workers nor a kill change them.

    Args:
        what: `functools.partial(lc.closed_loop, "so3", law=law, t=(0, 60), step=.1)` or the same as `lc.studies.Run(...)`; likewise
            lc.simulate, lc.steer, lc.order_check; a Kernel; a Propagator; or a function of named columns (N, ...) that returns
            a dict of columns; `lc.studies.each(f)` for one of a single sample.
        space: name of an argument -> a distribution of `lc.studies`, a list (gone through), a number, or a function of other
            inputs by their names; a tuple of names -> a Joint. Names that are no arguments of closed_loop are inputs of its law.
        n: samples; the product of the grids if not given. A larger n than before makes a study longer.
        seed: of all that is drawn, the noise of closed loops included.
        store: a folder, a URL or store that zarr opens, None to keep the results in memory.
        chunk: samples of a task; "auto" takes some that are held at once in 64 MiB and 10 seconds, at most 10^4.
        on: None for this process (`threads=` among the arguments of closed_loop uses its cores), "pool" or a number of processes, a dask
            Client or its address, a concurrent.futures Executor, or an Engine.
        resume: whether a store that is there is gone on with; False refuses it.
        progress: a bar in a terminal or a notebook, always, never, or a function of (samples done, samples).
        until: stop once a quantile is known well enough.
        reduce: what is kept of a result: result -> dict of arrays, sample first (see `lie_codegen.studies.summaries`).
        wait: False returns at once; `Study.wait` waits.

    Raises:
        InputError: what cannot be run or read; a store of another study, with what differs.
        ComputationError: no chunk can be run, or the store cannot be written. What was done is kept, here as after a kill.
    """
    run, inputs = as_run(what, reduce), Space(space)
    count = _samples(n, inputs, store)
    whole_seed(seed, "study")
    if until is not None and not isinstance(until, Quantile):
        raise InputError(f"study: until is a lc.studies.Quantile, given {until!r:.60}")
    engine, remote = engine_of(on)
    place = _place(store)
    if remote and store is None:
        raise InputError("study: results in memory are those of this process; give store= with on=")
    labels = {
        name: sorted({*map(str, value.values)})
        for (name, *_), value in inputs.inputs.items()
        if isinstance(value, Grid | Choice) and value.values.dtype.kind == "U"
    }
    job = Job(run, inputs, int(seed), place, labels, bit_class())
    lock = _lock(place)
    with lock:
        opened = _opened(place, job, count, chunk, resume=resume)
    made = Study(place, opened, job)
    work = Work(lambda tell: drive(job, opened, engine, remote=remote, until=until, tell=tell), lock, progress)
    made._work = work
    if wait:
        work.here()
    else:
        work.beside()
    return made


def _samples(n: int | None, space: Space, store: Any) -> int | None:
    if n is not None and (isinstance(n, bool) or not isinstance(n, int | np.integer) or n < 1):
        raise InputError(f"study: n is a number of samples, given {n!r}")
    if n is None:
        n = space.whole
    if n is None and not (isinstance(store, str | Path) and Path(store).exists()):
        raise InputError("study: n is missing; only grids say by themselves how many samples there are")
    return None if n is None else int(n)


def _place(store: Any) -> Any:
    if store is None:
        return zarr_module().storage.MemoryStore()
    return (
        Path(store).absolute() if isinstance(store, Path) or (isinstance(store, str) and "://" not in store) else store
    )


def _lock(place: Any) -> AbstractContextManager[Any]:
    """Two drivers of one store would run every chunk twice."""
    if not isinstance(place, Path):
        return nullcontext()
    from filelock import FileLock, Timeout

    class Guard(AbstractContextManager[Any]):
        def __init__(self) -> None:
            self._lock = FileLock(place.with_name(f".{place.name}.lock"), timeout=0)

        def __enter__(self) -> Any:
            place.parent.mkdir(parents=True, exist_ok=True)
            try:
                return self._lock.acquire()
            except Timeout:
                raise InputError(
                    f"study: {place} is being filled by another process; open it with lc.studies.open_study"
                ) from None

        def __exit__(self, *_: object) -> None:
            self._lock.release()

    return Guard()


def _opened(place: Any, job: Job, n: int | None, chunk: int | str, *, resume: bool) -> Store:
    manifest = {"what": job.run.fingerprint, "space": _described(job.space), "seed": job.seed}
    if isinstance(place, Path) and place.exists():
        old = Store(place)
        if not resume:
            raise InputError(
                f"study: {place} is there already; go on with it (resume=True), remove it, or give another store="
            )
        different = same_manifest(old.manifest, manifest)
        if different:
            raise InputError(
                f"study: {place} holds another study: its {' and its '.join(different)} differ; give another store="
            )
        if n is not None and n < old.n:
            raise InputError(f"study: {place} has {old.n} samples, more than n = {n}; a study only grows")
        if n is not None and n > old.n:
            if job.space.fixed_size:
                raise InputError(
                    f"study: a Latin hypercube is laid out for its {old.n} samples and does not grow; use Sobol"
                )
            old.grow(n)
        return old
    if n is None:
        raise InputError("study: n is missing")
    started = time.perf_counter()
    columns, outputs = pilot(job, n)
    first = time.perf_counter() - started
    size = chunk if chunk != "auto" else _chunk(job, n, columns, outputs, first)
    if isinstance(size, bool) or not isinstance(size, int | np.integer) or size < 1:
        raise InputError(f'study: chunk is a number of samples or "auto", given {chunk!r}')
    rest = {
        "n": n, "chunk": min(int(size), n), "names": [*columns, *outputs], "labels": job.labels, "bits": job.bits,
        "package": package_digest()[:16],
    }  # fmt: skip
    return Store.create(place, {**manifest, **rest}, job.coded(columns), outputs)


def _chunk(job: Job, n: int, columns: Mapping[str, Array], outputs: Mapping[str, Array], first: float) -> int:
    """So many samples that a chunk is held at once and a kill loses seconds; an eighth of n where that is less."""
    times = np.size(job.run.options.get("t", ()))
    size = 8 * sum(column.size for column in (*columns.values(), *outputs.values())) * (1 + times)
    most = min(_LARGEST_CHUNK, max(1, _MEMORY // size), max(1, n // 8))
    if first < 1e-3 or most == 1:
        return most
    started = time.perf_counter()  # a second run: the first one may have compiled
    pilot(job, n)
    second = time.perf_counter() - started
    few = max(1, int(_SECONDS / second))
    if few >= most:
        return most
    # a few more samples tell whether they cost less together
    several = min(n, most, 64)
    started = time.perf_counter()
    job.outputs(job.columns(0, several, n), 0)
    return int(min(most, max(1, int(_SECONDS / ((time.perf_counter() - started) / several)))))


def _described(space: Space) -> Any:
    return {
        **{",".join(names): mark(value) for names, value in space.inputs.items()},
        **{name: mark(function) for name, (function, _) in space.derived.items()},
    }


def open_study(
    store: str | Path, what: Any = None, space: Mapping[Any, Any] | None = None, *, reduce: Any = None
) -> Study:
    """A study by its store, also while it is being filled.

    Args:
        store: the folder or URL.
        what, space: as `study` had them: needed to run samples again (`worst`, `replay`).
        reduce: as `study` had it.

    Raises:
        InputError: no study there, or of another one.
    """
    place = _place(store)
    if isinstance(place, Path) and not place.exists():
        raise InputError(f"study: there is no {place}")
    opened = Store(place)
    if what is None or space is None:
        return Study(place, opened)
    manifest = opened.manifest
    job = Job(
        as_run(what, reduce),
        Space(space),
        int(manifest["seed"]),
        place,
        dict(manifest["labels"]),
        int(manifest["bits"]),
    )
    different = same_manifest(manifest, {"what": job.run.fingerprint, "space": _described(job.space), "seed": job.seed})
    if different:
        raise InputError(f"study: {place} is another study: its {' and its '.join(different)} differ")
    return Study(place, opened, job)
