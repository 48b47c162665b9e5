"""lc.study: many runs of one thing over distributions of its inputs, in a store that one can open, stop and go on with."""

from __future__ import annotations

import hashlib
import threading
import time
from collections.abc import Callable, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.door import on_behalf
from lie_codegen.errors import ComputationError, InputError
from lie_codegen.runtime.digests import package_digest
from lie_codegen.studies.distributions import Choice, Grid
from lie_codegen.studies.driver import Job, drive, pilot
from lie_codegen.studies.engines import engine_of
from lie_codegen.studies.progress import bar
from lie_codegen.studies.space import Space
from lie_codegen.studies.stopping import Quantile
from lie_codegen.studies.store import DONE, FAILED, Store, bit_class, same_manifest, zarr_module
from lie_codegen.studies.tasks import SampleStatus, as_run, mark

_LARGEST_CHUNK, _MEMORY, _SECONDS = 10_000, 2**26, 10.0
_READ = 200_000


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
    if isinstance(seed, bool) or not isinstance(seed, int | np.integer) or not 0 <= seed < 2**64:
        raise InputError(f"study: seed is an integer from 0 to 2^64 - 1, given {seed!r}")
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
    work = _Work(lambda tell: drive(job, opened, engine, remote=remote, until=until, tell=tell), lock, progress)
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


class _Work:
    """The driving of a study, here or in a thread beside."""

    def __init__(
        self, drive: Callable[[Callable[[int, int], None]], None], lock: AbstractContextManager[Any], progress: Any
    ) -> None:
        self._drive, self._lock, self._progress = drive, lock, progress
        self._thread: threading.Thread | None = None
        self._error: BaseException | None = None

    def here(self) -> None:
        """Until it ends; Ctrl-C leaves a store to go on with."""
        with self._lock, bar(self._progress) as tell:
            self._drive(tell)

    def beside(self) -> None:
        """Returns at once."""
        self._thread = threading.Thread(target=on_behalf(self._caught), daemon=True)
        self._thread.start()

    def _caught(self) -> None:
        try:
            self.here()
        except BaseException as error:
            self._error = error

    def wait(self, timeout: float | None) -> None:
        """Until it ends; raises what ended it."""
        if self._thread is not None:
            self._thread.join(timeout)
            if self._error is not None:
                raise self._error


@dataclass(frozen=True)
class Replay:
    """One sample, run again.

    Attributes:
        index: of the sample.
        inputs: its inputs by name.
        result: what the function returned: a closed loop, a plan, a trajectory ...
    """

    index: int
    inputs: Mapping[str, Any]
    result: Any


class Study:
    """A study and its store; made by `lc.study`, opened again by `lc.studies.open_study`."""

    def __init__(self, place: Any, store: Store, job: Job | None = None) -> None:
        self.place, self._store, self._job = place, store, job
        self._work: _Work | None = None

    def __getstate__(self) -> dict[str, Any]:
        return {"place": self.place, "job": self._job}

    def __setstate__(self, state: Mapping[str, Any]) -> None:
        self.__init__(state["place"], Store(state["place"]), state["job"])  # type: ignore[misc]

    def __repr__(self) -> str:
        status = self.status
        said = ", ".join(f"{count} {name}" for name, count in status.items() if count)
        where = self.place if isinstance(self.place, Path | str) else "memory"
        return f"Study({where}: {self.n} samples: {said}; outputs {', '.join(self.outputs)})"

    @property
    def n(self) -> int:
        """Samples; those up to the end where `until` stopped it."""
        return int(Store(self.place).manifest.get("stopped", self._store.n))

    @property
    def inputs(self) -> list[str]:
        """Names of the inputs."""
        return self._store.names("input")

    @property
    def outputs(self) -> list[str]:
        """Names of the outputs."""
        return self._store.names("output")

    @property
    def status(self) -> dict[str, int]:
        """Samples by what became of them (done, not_finite, raised, not_solved, not_run), and failed_chunks."""
        found = self["status"]
        counts = {each.name.lower(): int(np.sum(found == each)) for each in SampleStatus}
        return counts | {"failed_chunks": int(np.sum(self._store.done() == FAILED))}

    @property
    def complete(self) -> bool:
        """Whether every chunk is done."""
        last = -(-self.n // self._store.chunk)
        return bool(np.all(self._store.done()[:last] == DONE))

    @property
    def errors(self) -> dict[int, str]:
        """Chunk -> why it failed."""
        return {int(k): self._store.error(int(k)) for k in np.flatnonzero(self._store.done() == FAILED)}

    def __getitem__(self, name: str) -> Array:
        """All samples of an input or an output."""
        if name not in {*self.inputs, *self.outputs, "status"}:
            raise InputError(f"study: no {name!r}; there are {', '.join([*self.inputs, *self.outputs, 'status'])}")
        return self._store.read(name, 0, self.n)

    @property
    def dataset(self) -> Any:
        """An xarray.Dataset that reads when it is asked; samples that have not been run are NaN and status -1."""
        import xarray

        data = xarray.open_zarr(self.place, consolidated=False, chunks=None)
        return data.drop_vars([name for name in data.variables if str(name).startswith("study_")]).isel(
            sample=slice(0, self.n)
        )

    def quantiles(self, q: Sequence[float] = (0.05, 0.5, 0.95), names: Sequence[str] | None = None) -> dict[str, Array]:
        """name -> (len(q), ...) quantiles of the outputs over the samples that are done and finite."""
        good = self["status"] == SampleStatus.DONE
        found = {}
        for name in names if names is not None else self.outputs:
            column = self[name][good]
            if column.dtype.kind in "iuf" and len(column):
                found[name] = np.quantile(column, q, axis=0)
        return found

    def worst(self, k: int = 5, by: str | None = None) -> list[Replay]:
        """The k samples with the largest output `by` (the first number a sample if not given), run again; those without one first."""
        job = self._needs_job("worst")
        order = self.worst_indices(k, by)
        return [self.replay(int(i), job=job) for i in order]

    def worst_indices(self, k: int = 5, by: str | None = None) -> Array:
        """Their indices."""
        named = by or next(
            (each for each in self.outputs if self[each].ndim == 1 and self[each].dtype.kind == "f"), None
        )
        if named is None:
            raise InputError("study: no output is one number a sample; give by=")
        values = self[named].astype(float)
        if values.ndim != 1:
            raise InputError(f"study: worst goes by one number a sample; {named} has shape {values.shape[1:]}")
        run = self["status"] != SampleStatus.NOT_RUN
        ranked = np.where(np.isnan(values), np.inf, values)
        order = np.argsort(-ranked, kind="stable")
        return np.asarray(order[run[order]][:k])

    def replay(self, index: int, *, job: Job | None = None) -> Replay:
        """One sample, run again with all that its function returns."""
        job = job or self._needs_job("replay")
        if not 0 <= index < self._store.n:
            raise InputError(f"study: sample {index} of {self._store.n}")
        columns = job.columns(index, 1, self._store.n)
        return Replay(
            index, {name: column[0] for name, column in columns.items()}, job.run.replay(columns, index, job.seed)
        )

    def _needs_job(self, name: str) -> Job:
        if self._job is None:
            raise InputError(f"study: {name} runs samples again; give what was studied: open_study(store, what, space)")
        return self._job

    def plot(
        self, path: str | Path | None = None, output: str | None = None, *, inputs: Sequence[str] | None = None
    ) -> Any:
        """Histograms of the outputs; of one `output` with a time axis its band; over two `inputs` a map. Needs matplotlib.

        Args:
            path: file to write; None returns the figure.
            output: what to draw, all if not given.
            inputs: one or two numeric inputs against which the output is drawn.
        """
        from lie_codegen.pictures.study_picture import draw_study

        good = self["status"] == SampleStatus.DONE
        names = (
            [output]
            if output
            else [each for each in self.outputs if self[each].dtype.kind in "biuf" and self[each].ndim < 3]
        )
        data = {name: self[name][good] for name in names}
        against = {name: self[name][good] for name in inputs or ()}
        return draw_study(data, against, path, labels=self._store.manifest.get("labels", {}))

    def wait(self, timeout: float | None = None) -> Study:
        """Wait for a study begun with wait=False; raises what ended it."""
        if self._work is not None:
            self._work.wait(timeout)
        return self

    def digest(self) -> str:
        """SHA-256 of all inputs, outputs and statuses: equal for equal bits, whatever the chunks and the workers were."""
        total = hashlib.sha256()
        for name in sorted([*self.inputs, *self.outputs, "status"]):
            total.update(name.encode())
            for first in range(0, self.n, _READ):
                column = self._store.read(name, first, min(_READ, self.n - first))
                total.update(np.ascontiguousarray(column).tobytes())
        return total.hexdigest()

    def to_parquet(self, path: str | Path) -> Path:
        """A table with a row a sample and a column a number; entries of arrays as name_0, name_1, ..., complex ones as _re and _im."""
        try:
            import pyarrow
            from pyarrow import parquet
        except ImportError:
            raise ComputationError("parquet needs pyarrow: install it beside lie_codegen[study]") from None
        target = Path(path)
        writer = None
        try:
            for first in range(0, self.n, _READ):
                table = pyarrow.table(self._flat(first, min(_READ, self.n - first)))
                writer = writer or parquet.ParquetWriter(target, table.schema)
                writer.write_table(table)
        finally:
            if writer is not None:
                writer.close()
        return target

    def _flat(self, first: int, count: int) -> dict[str, Array]:
        found: dict[str, Array] = {"sample": np.arange(first, first + count)}
        labels = self._store.manifest.get("labels", {})
        for name in [*self.inputs, *self.outputs, "status"]:
            column = self._store.read(name, first, count)
            if name in labels:
                column = np.array(labels[name])[column]
            flat = column.reshape(count, -1)
            for i in range(flat.shape[1]):
                key = name if column.ndim == 1 else f"{name}_{i}"
                parts = (
                    {key: flat[:, i]}
                    if column.dtype.kind != "c"
                    else {f"{key}_re": flat[:, i].real, f"{key}_im": flat[:, i].imag}
                )
                found.update({part: np.ascontiguousarray(values) for part, values in parts.items()})
        return found


def open_study(
    store: str | Path, what: Any = None, space: Mapping[Any, Any] | None = None, *, reduce: Any = None
) -> Study:
    """A study by its store, also while it is being filled.

    Args:
        store: the folder or URL.
        what, space: as `study` had them: needed to run samples again (`worst`, `replay`).

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
