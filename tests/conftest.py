"""One cache of compiled libraries for the whole run, shared by all workers and thrown away at the end.

Libraries are compiled with -Og, in half the time and to the same numbers; `LIE_CODEGEN_CFLAGS= python -m pytest` tests what users get, as `.ci/slow` does.
"""

from __future__ import annotations

import copy
import gc
import multiprocessing
import os
import shutil
import tempfile
import warnings
from collections.abc import Callable, Iterator
from concurrent.futures import ProcessPoolExecutor
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest


def pytest_configure(config: pytest.Config) -> None:
    if not hasattr(config, "workerinput"):
        config.lie_codegen_cache = tempfile.mkdtemp(prefix="lie-codegen-tests-")
        os.environ["LIE_CODEGEN_CACHE"] = config.lie_codegen_cache
        os.environ.setdefault("LIE_CODEGEN_CFLAGS", "-Og")
        os.environ["OMP_NUM_THREADS"] = os.environ["OPENBLAS_NUM_THREADS"] = "1"
        # Where no byte code may be kept, every process that a test starts compiles hundreds of modules anew.
        os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    # Collecting makes hundreds of thousands of objects that stay: looking through them again and again is 13 to 28 % of its time.
    gc.set_threshold(100_000, 50, 50)


def pytest_unconfigure(config: pytest.Config) -> None:
    folder = getattr(config, "lie_codegen_cache", None)
    if folder is not None:
        shutil.rmtree(folder, ignore_errors=True)


def pytest_collection_finish(session: pytest.Session) -> None:
    # What was collected stays to the end: the collector need not walk thousands of tests again for every few hundred new objects.
    gc.freeze()
    gc.set_threshold(20_000, 20, 20)


@pytest.fixture(scope="session")
def repository() -> Path:
    return Path(__file__).resolve().parent.parent


@pytest.fixture(scope="session")
def elsewhere() -> Iterator[Callable[[Any], list[Any]]]:
    """What comes back of a value that went to a process of each start method, and through dask's serializer."""
    from distributed.protocol import deserialize, serialize

    with ExitStack() as stack, warnings.catch_warnings():
        warnings.filterwarnings("ignore", ".*multi-threaded", DeprecationWarning)
        contexts = [multiprocessing.get_context(start) for start in ("fork", "forkserver", "spawn")]
        pools = [stack.enter_context(ProcessPoolExecutor(1, mp_context=context)) for context in contexts]

        def back(value: Any) -> list[Any]:
            sent = [pool.submit(copy.copy, value) for pool in pools]
            return [*(each.result(120) for each in sent), deserialize(*serialize(value))]

        yield back


@pytest.fixture
def compiles(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The main files of the runs of the compiler."""
    from lie_codegen.runtime import compiling  # not before the threads of BLAS are set

    runs: list[str] = []
    real = compiling.compile_library

    def counted(*args: Any) -> None:
        runs.append(args[2])
        real(*args)

    monkeypatch.setattr(compiling, "compile_library", counted)
    return runs
