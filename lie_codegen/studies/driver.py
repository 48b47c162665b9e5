"""Running the chunks of a study: what a worker does with one, and how all are handed out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.door import warn_caller
from lie_codegen.errors import ComputationError, InputError, LieCodegenError
from lie_codegen.studies.draws import noise_seed
from lie_codegen.studies.engines import Engine, WorkerLostError
from lie_codegen.studies.space import Space
from lie_codegen.studies.stopping import Quantile
from lie_codegen.studies.store import DONE, Store, bit_class
from lie_codegen.studies.tasks import Columns, Run, quiet

#: A chunk whose worker dies so often is given up.
_TRIES = 3
#: Calls handed out beside those that run, so that no worker waits.
_AHEAD = 3


class FailedChunkWarning(UserWarning):
    """Chunks of a study could not be run; going on with the study tries them again."""


@dataclass(frozen=True)
class Job:
    """All that a worker needs to run a chunk."""

    run: Run
    space: Space
    seed: int
    place: Any
    labels: dict[str, list[str]]
    bits: int

    def columns(self, first: int, count: int, n: int) -> dict[str, Array]:
        """The inputs of some samples."""
        return self.space.columns(self.seed, first, count, n)

    def outputs(self, columns: Columns, first: int) -> dict[str, Array]:
        """What the run makes of them."""
        with quiet():
            return self.run.outputs(columns, first, noise_seed(self.seed))

    def coded(self, columns: Columns) -> dict[str, Array]:
        """Inputs as numbers: texts by their place among those that there are."""
        return {
            name: np.searchsorted(np.array(self.labels[name]), column).astype(np.int16)
            if name in self.labels
            else np.asarray(column)
            for name, column in columns.items()
        }

    def chunk(self, k: int, store: Store) -> str | None:
        """Run a chunk and write it; the message where it cannot be run.

        Raises:
            OSError: it cannot be written.
        """
        first, count = store.span(k)
        try:
            if self.bits and bit_class() and bit_class() != self.bits:
                raise ComputationError(
                    "this processor rounds differently (fused multiply-add or not) from the one that the study was begun on; its "
                    "samples would not be the same bits"
                )
            columns = self.columns(first, count, store.n)
            outputs = self.outputs(columns, first)
            expected = [*store.names("output"), "status"]
            if sorted(outputs) != sorted(expected):
                raise InputError(
                    f"chunk {k} gives {', '.join(sorted(outputs))}, the first sample gave {', '.join(sorted(expected))}"
                )
        except OSError:
            raise
        except Exception as error:  # whatever a user's function raises fails its chunk and not the study
            message = f"{type(error).__name__}: {error}"
            store.fail(k, message)
            return message
        store.write(k, {**self.coded(columns), **outputs})
        return None


@lru_cache(maxsize=4)
def _unpacked(payload: bytes) -> tuple[Job, Store]:
    import cloudpickle

    job: Job = cloudpickle.loads(payload)
    return job, Store(job.place)


def run_chunk(payload: bytes, k: int) -> str | None:
    """`Job.chunk` in a worker, which keeps the job of its study between chunks."""
    job, store = _unpacked(payload)
    return job.chunk(k, store)


def drive(
    job: Job, store: Store, engine: Engine, *, remote: bool, until: Quantile | None, tell: Callable[[int, int], None]
) -> None:
    """Run all chunks that are not done; the study's status tells which failed.

    Raises:
        ComputationError: the store cannot be written, or no chunk at all could be run. What was done is kept.
    """
    done = store.done()
    todo = [int(k) for k in np.flatnonzero(done != DONE)]
    stop = _Stop(store, until)
    finished = store.chunks - len(todo)
    tell(store.span(0)[1] * finished, store.n)
    if stop.met():
        return
    payload = _packed(job) if remote else b""
    tries: dict[int, int] = {}
    messages: dict[int, str] = {}
    waiting = iter(todo)
    running = 0

    def start(k: int) -> None:
        nonlocal running
        engine.submit(k, *((run_chunk, payload, k) if remote else (job.chunk, k, store)))
        running += 1

    try:
        for k in waiting:
            start(k)
            if running >= engine.workers + (_AHEAD * engine.workers if remote else 0):
                break
        while running:
            k, outcome = engine.finished()
            running -= 1
            if isinstance(outcome, WorkerLostError):
                tries[k] = tries.get(k, 0) + 1
                if tries[k] < _TRIES:
                    start(k)
                    continue
                outcome = f"the worker died {_TRIES} times in this chunk ({outcome})"
                store.fail(k, outcome)
            if isinstance(outcome, OSError):
                raise ComputationError(
                    f"study: {store.place} cannot be written: {outcome.strerror or outcome}; {finished} of {store.chunks} chunks are kept, call "
                    "study again when there is room"
                )
            if isinstance(outcome, Exception):
                outcome = f"{type(outcome).__name__}: {outcome}"
                store.fail(k, outcome)
            if isinstance(outcome, str):
                messages[k] = outcome
            else:
                finished += 1
            tell(min(finished * store.chunk, store.n), store.n)
            if until is not None and stop.met():
                return
            following = next(waiting, None)
            if following is not None:
                start(following)
    finally:
        engine.close()
    if messages:
        first = min(messages)
        said = f"study: {len(messages)} of {store.chunks} chunks failed; chunk {first}: {messages[first]}"
        if finished == 0:
            raise ComputationError(said)
        warn_caller(f"{said}; the others are in the store, and study called again tries these", FailedChunkWarning)


def _packed(job: Job) -> bytes:
    try:
        import cloudpickle
    except ImportError:
        raise ComputationError(
            "other processes need cloudpickle: install lie_codegen with its extra, lie_codegen[study]"
        ) from None
    try:
        return bytes(cloudpickle.dumps(job))
    except Exception as error:
        raise InputError(f"study: what it runs cannot be sent to another process: {error}") from None


class _Stop:
    """Whether the study may end, by the samples in their order: the same ones whatever the workers."""

    def __init__(self, store: Store, until: Quantile | None) -> None:
        self._store, self._until = store, until
        self._next = 0
        self._values: list[Array] = []
        if until is not None and until.output not in store.names("output"):
            raise InputError(f"study: until names {until.output!r}; the outputs are {', '.join(store.names('output'))}")

    def met(self) -> bool:
        """Goes on over the chunks that are done; notes where the study ends once the interval is narrow enough."""
        store = self._store
        if self._until is None:
            return False
        done = store.done()
        while self._next < store.chunks and done[self._next] == DONE:
            first, count = store.span(self._next)
            values = store.read(self._until.output, first, count)
            if values.ndim != 1:
                raise InputError(
                    f"study: until looks at one number a sample; {self._until.output} has shape {values.shape[1:]}"
                )
            self._values.append(values.astype(float))
            self._next += 1
            if self._until.met(np.concatenate(self._values)):
                store.note(stopped=first + count)
                return True
        return False


def pilot(job: Job, n: int) -> tuple[dict[str, Array], dict[str, Array]]:
    """Inputs and outputs of one of the first samples that can be run: what the arrays of the store look like.

    Raises:
        LieCodegenError: none of the first samples can be.
    """
    errors: list[LieCodegenError] = []
    for first in range(min(n, 8)):
        columns = job.columns(first, 1, n)
        try:
            return columns, job.outputs(columns, first)
        except LieCodegenError as raised:
            errors.append(raised)
    raise errors[0]
