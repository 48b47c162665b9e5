"""One cache of compiled libraries for the whole run, shared by all workers and thrown away at the end.

Libraries are compiled with -Og, in half the time and to the same numbers; `LIE_CODEGEN_CFLAGS= python -m pytest` tests what users get, as `.ci/slow` does.
"""

from __future__ import annotations

import os
import shutil
import tempfile
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


def pytest_unconfigure(config: pytest.Config) -> None:
    folder = getattr(config, "lie_codegen_cache", None)
    if folder is not None:
        shutil.rmtree(folder, ignore_errors=True)


@pytest.fixture(scope="session")
def repository() -> Path:
    return Path(__file__).resolve().parent.parent


@pytest.fixture
def compiles(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """The main files of the runs of the compiler."""
    from lie_codegen.runtime import ladder  # not before the threads of BLAS are set

    runs: list[str] = []
    real = ladder.compile_library

    def counted(*args: Any) -> None:
        runs.append(args[2])
        real(*args)

    monkeypatch.setattr(ladder, "compile_library", counted)
    return runs
