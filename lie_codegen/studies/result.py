"""A study as one reads it: its store, its statuses, quantiles, worst samples run again, tables and pictures."""

from __future__ import annotations

import hashlib
import importlib.util
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.door import guard_methods
from lie_codegen.errors import ComputationError, InputError, write_refusal
from lie_codegen.studies.driver import Job
from lie_codegen.studies.store import DONE, FAILED, NOT_YET, Store
from lie_codegen.studies.tasks import SampleStatus
from lie_codegen.studies.work import Work
from lie_codegen.whole_files import whole_file

_READ = 200_000


@guard_methods
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


@guard_methods
class Study:
    """A study and its store; made by `lc.study`, read again by `lc.studies.open_study`.

    Attributes:
        place: the folder of the store, or the memory that holds it.
        job: what is run; None of a study that was read from its files.
    """

    def __init__(self, place: Any, store: Store, job: Job | None = None) -> None:
        self.place, self._store, self._job = place, store, job
        self._work: Work | None = None

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
        found = self._store.read(name, 0, self.n)
        if name == "status":  # a chunk that was cut off may have written it, and is run again whole
            found[np.repeat(self._store.done() == NOT_YET, self._store.chunk)[: self.n]] = SampleStatus.NOT_RUN
        return found

    @property
    def dataset(self) -> Any:
        """An xarray.Dataset that reads when it is asked; samples that have not been run are NaN and status -1."""
        import xarray

        data = xarray.open_zarr(self.place, consolidated=False, chunks=None)
        return data.drop_vars([name for name in data.variables if str(name).startswith("study_")]).isel(
            sample=slice(0, self.n)
        )

    def quantiles(self, q: Sequence[float] = (0.05, 0.5, 0.95), names: Sequence[str] | None = None) -> dict[str, Array]:
        """Quantiles of the outputs over the samples that are done and finite.

        Args:
            q: which, each in [0, 1].
            names: of the outputs, all if not given.

        Returns:
            name -> (len(q), ...).

        Raises:
            InputError: no such output.
            ArgumentError: a q outside [0, 1].
        """
        good = self["status"] == SampleStatus.DONE
        found = {}
        for name in names if names is not None else self.outputs:
            column = self[name][good]
            if column.dtype.kind in "iuf" and len(column):
                found[name] = np.quantile(column, q, axis=0)
        return found

    def worst(self, k: int = 5, by: str | None = None) -> list[Replay]:
        """The k samples with the largest output, run again; those without one first.

        Args:
            k: how many.
            by: an output that is a number a sample; the first of them if not given.

        Raises:
            InputError: no such output, one that is no number a sample, or a study that does not know what it ran.
        """
        job = self._needs_job("worst")
        order = self.worst_indices(k, by)
        return [self.replay(int(i), job=job) for i in order]

    def worst_indices(self, k: int = 5, by: str | None = None) -> Array:
        """Their indices: as `worst`, which runs them again.

        Args:
            k: how many.
            by: an output that is a number a sample; the first of them if not given.

        Raises:
            InputError: no such output, or one that is no number a sample.
        """
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
        """One sample, run again with all that its function returns.

        Args:
            index: of the sample.
            job: what is run, where the study was read from its files and does not know it.

        Raises:
            InputError: no such sample, or a study that does not know what it ran.
        """
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

        Raises:
            InputError: no such output or input.
            MissingDependencyError: matplotlib is not installed.
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
        """Wait for a study begun with wait=False.

        Args:
            timeout: at most so long [s]; until it ends if not given.

        Raises:
            LieCodegenError: what ended it.
        """
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
        """A table with a row a sample and a column a number; entries of arrays as name_0, name_1, ..., complex ones as _re and _im.

        Args:
            path: of the file.

        Raises:
            ComputationError: pyarrow is not installed.
            OutputFolderError, SystemRefusalError: the file cannot be written; what was there is untouched.
        """
        if importlib.util.find_spec("pyarrow") is None:
            raise ComputationError("parquet needs pyarrow: install it beside lie_codegen[study]")
        target = Path(path)
        try:
            with whole_file(target) as fresh:
                self._write_parquet(fresh)
        except OSError as error:
            raise write_refusal(f"{target} cannot be written", error) from error
        return target

    def _write_parquet(self, path: Path) -> None:
        import pyarrow
        from pyarrow import parquet

        writer = None
        try:
            for first in range(0, self.n, _READ):
                table = pyarrow.table(self._flat(first, min(_READ, self.n - first)))
                writer = writer or parquet.ParquetWriter(path, table.schema)
                writer.write_table(table)
        finally:
            if writer is not None:
                writer.close()

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
