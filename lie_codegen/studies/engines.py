"""Where the chunks of a study run: this process, a pool of processes, a dask cluster, or any executor.

An engine is three methods, so that a Slurm array or MPI is a thin adapter: `submit` starts a call and returns at once, `finished`
waits until one ends, `close` lets go of what was not started.
"""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ProcessPoolExecutor, wait
from concurrent.futures.process import BrokenProcessPool
from typing import Any, Protocol, runtime_checkable

from lie_codegen.errors import InputError


class WorkerLostError(Exception):
    """The process that ran a call has died."""


@runtime_checkable
class Engine(Protocol):
    """Where calls run: a protocol, nothing that is made itself.

    Attributes:
        workers: how many run at once.
    """

    workers: int

    def submit(self, key: int, function: Callable[..., Any], *arguments: Any) -> None:
        """Start function(*arguments), to be known by the key."""

    def finished(self) -> tuple[int, Any]:
        """Wait for a call to end: its key, and what it returned or the exception that ended it."""

    def close(self) -> None:
        """Forget the calls that have not started; wait for those that have."""


class Here:
    """This process: a call runs when it is waited for."""

    workers = 1

    def __init__(self) -> None:
        self._waiting: list[tuple[int, Callable[..., Any], tuple[Any, ...]]] = []

    def submit(self, key: int, function: Callable[..., Any], *arguments: Any) -> None:
        """As `Engine`."""
        self._waiting.append((key, function, arguments))

    def finished(self) -> tuple[int, Any]:
        """As `Engine`."""
        key, function, arguments = self._waiting.pop(0)
        try:
            return key, function(*arguments)
        except Exception as error:
            return key, error

    def close(self) -> None:
        """As `Engine`."""
        self._waiting.clear()


class OfExecutor:
    """Any concurrent.futures.Executor, as that of mpi4py or of loky."""

    def __init__(self, executor: Executor, workers: int | None = None) -> None:
        self._executor = executor
        self.workers = workers or getattr(executor, "_max_workers", None) or os.cpu_count() or 1
        self._running: dict[Future[Any], int] = {}

    def submit(self, key: int, function: Callable[..., Any], *arguments: Any) -> None:
        """As `Engine`."""
        self._running[self._executor.submit(function, *arguments)] = key

    def finished(self) -> tuple[int, Any]:
        """As `Engine`."""
        done, _ = wait(self._running, return_when=FIRST_COMPLETED)
        future = next(iter(done))
        return self._running.pop(future), _outcome(future)

    def close(self) -> None:
        """As `Engine`; the executor is the caller's and stays open."""
        for future in self._running:
            future.cancel()
        wait([future for future in self._running if not future.cancelled()])
        self._running.clear()


def _outcome(future: Future[Any]) -> Any:
    error = future.exception()
    if isinstance(error, BrokenProcessPool):
        return WorkerLostError("a process of the pool died")
    return future.result() if error is None else error


class Pool:
    """Processes of this machine, started afresh where one of them dies."""

    def __init__(self, workers: int | None = None) -> None:
        self.workers = workers or os.cpu_count() or 1
        self._start()

    def _start(self) -> None:
        context = multiprocessing.get_context("spawn")
        self._executor = ProcessPoolExecutor(self.workers, mp_context=context, initializer=_one_thread)
        self._inner = OfExecutor(self._executor, self.workers)

    def submit(self, key: int, function: Callable[..., Any], *arguments: Any) -> None:
        """As `Engine`."""
        try:
            self._inner.submit(key, function, *arguments)
        except BrokenProcessPool:
            self._renew()
            self._inner.submit(key, function, *arguments)

    def _renew(self) -> None:
        """A pool of which a process died is of no more use; the calls that it had are told as lost one by one."""
        lost = self._inner._running
        self._executor.shutdown(wait=False, cancel_futures=True)
        self._start()
        self._inner._running.update(lost)

    def finished(self) -> tuple[int, Any]:
        """As `Engine`."""
        return self._inner.finished()

    def close(self) -> None:
        """As `Engine`."""
        self._executor.shutdown(wait=True, cancel_futures=True)


def _one_thread() -> None:
    """A worker of a pool: Ctrl-C is for the process that drives; linear algebra keeps to one thread."""
    import signal

    signal.signal(signal.SIGINT, signal.SIG_IGN)
    for name in ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"):
        os.environ.setdefault(name, "1")


class Dask:
    """A cluster, by its dask.distributed Client."""

    def __init__(self, client: Any) -> None:
        from distributed import as_completed

        self._client = client
        self.workers = max(1, sum(client.nthreads().values()))
        self._queue = as_completed()
        self._keys: dict[Any, int] = {}

    def submit(self, key: int, function: Callable[..., Any], *arguments: Any) -> None:
        """As `Engine`. The scheduler itself runs a chunk of a lost worker again, a few times."""
        future = self._client.submit(function, *arguments, pure=False)
        self._keys[future.key] = key
        self._queue.add(future)

    def finished(self) -> tuple[int, Any]:
        """As `Engine`."""
        from distributed.scheduler import KilledWorker

        future = next(self._queue)
        key = self._keys.pop(future.key)
        if future.status == "finished":
            return key, future.result()
        error = future.exception() if future.status == "error" else WorkerLostError(f"the cluster says {future.status}")
        return key, WorkerLostError(str(error)) if isinstance(error, KilledWorker) else error

    def close(self) -> None:
        """As `Engine`."""
        for future in list(self._queue.futures):
            future.cancel()
        self._keys.clear()


def engine_of(on: Any) -> tuple[Engine, bool]:
    """The engine of what a study was given, and whether its workers are other processes.

    Raises:
        InputError: it is none of the things that stand for an engine.
    """
    if on is None:
        return Here(), False
    if on == "pool":
        return Pool(), True
    if isinstance(on, int) and not isinstance(on, bool) and on > 0:
        return Pool(on), True
    if isinstance(on, Executor):
        return OfExecutor(on), True
    if isinstance(on, str) and "://" in on:
        from distributed import Client

        return Dask(Client(on)), True
    if type(on).__module__.split(".")[0] == "distributed" and hasattr(on, "submit"):
        return Dask(on), True
    if isinstance(on, Engine):
        return on, True
    raise InputError(
        f'study: on is None, "pool", a number of processes, a dask Client or its address, an Executor or an Engine; given {on!r:.60}'
    )
