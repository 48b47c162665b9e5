"""What goes wrong once is not slow for good: notes expire, warnings are given once, waiting is bounded, folders fall back."""

from __future__ import annotations

import gc
import os
import shutil
import subprocess
import sys
import time
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import toy_kernels

from lie_codegen.errors import CacheError, CacheWarning, CompilerStoppedError, DegradedWarning
from lie_codegen.runtime import cache, cache_door, cache_folder, cache_upkeep, degraded, entry_library, extension
from lie_codegen.runtime.build import build_kernels
from lie_codegen.runtime.cache_upkeep import cache_info, evict
from lie_codegen.runtime.call import Compiled
from lie_codegen.runtime.compiler import find_compilers

pytestmark = pytest.mark.skipif(not find_compilers() or os.name != "posix", reason="needs a C compiler on POSIX")
REAL = shutil.which("cc") or "cc"


@pytest.fixture(autouse=True)
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Path]:
    folder = tmp_path / "the cache"
    monkeypatch.setenv("LIE_CODEGEN_CACHE", str(folder))
    _forget()
    yield folder
    monkeypatch.undo()
    _forget()


def _forget() -> None:
    """As in a new process."""
    for memo in (cache_folder._warn_once, degraded.warn_degraded, extension._extension, cache._warn_held):
        memo.cache_clear()
    cache_folder._not_loaded.clear()
    extension._beside.clear()


def fake(tmp_path: Path, script: str) -> str:
    program = tmp_path / "fakecc"
    program.write_text(f'#!/bin/sh\n{script}\nexec {REAL} "$@"\n')
    program.chmod(0o700)
    return str(program)


def test_a_compiler_killed_once_is_forgotten_by_the_next_process(
    home: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kill = f'case "$*" in *lie_codegen_call*) [ -e {tmp_path}/once ] || kill -9 $$;; esac'
    monkeypatch.setenv("LIE_CODEGEN_CC", fake(tmp_path, kill))
    monkeypatch.setattr(extension, "find_compilers", lambda: find_compilers()[:1])
    with pytest.warns(DegradedWarning, match=r"ctypes.*stopped"):
        slow = build_kernels(lambda: [toy_kernels.RATE], definition="rate")
    assert slow.build_log[1] == "calls: through ctypes"
    assert isinstance(slow.rate, Compiled)
    (tmp_path / "once").touch()
    _forget()
    fast = build_kernels(lambda: [toy_kernels.RATE], definition="rate")
    assert fast.build_log[1] == "calls: through the extension type"
    assert cache_info().degraded == ()


def test_a_compiler_killed_once_is_asked_once_more(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    script = f'case "$*" in *toy_binding*) [ -e {tmp_path}/once ] || {{ touch {tmp_path}/once; kill -9 $$; }};; esac'
    monkeypatch.setenv("LIE_CODEGEN_CC", fake(tmp_path, script))
    assert build_kernels(lambda: [toy_kernels.RATE]).compiled
    assert (tmp_path / "once").exists()


def test_a_refusal_is_kept_for_a_day_and_shown(home: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    script = 'case "$*" in *lie_codegen_call*) echo "the headers are broken" >&2; exit 1;; esac'
    monkeypatch.setenv("LIE_CODEGEN_CC", fake(tmp_path, script))
    monkeypatch.setattr(extension, "find_compilers", lambda: find_compilers()[:1])
    with pytest.warns(DegradedWarning, match="ctypes"):
        build_kernels(lambda: [toy_kernels.RATE])
    (line,) = cache_info().degraded
    assert "the headers are broken" in line
    done = subprocess.run([sys.executable, "-m", "lie_codegen", "cache"], capture_output=True, text=True, check=True)
    assert "the headers are broken" in done.stdout
    (note,) = (home / "python").glob("requests/*.json")
    cache.write_json(note, {**cache.read_json(note), "time": time.time() - 90_000})
    assert cache_info().degraded == ()
    fake(tmp_path, "")
    _forget()
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        library = build_kernels(lambda: [toy_kernels.RATE])
    assert library.build_log[1] == "calls: through the extension type"


def test_lanes_that_fail_are_said_once_and_tried_by_the_next_process(
    home: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    broken = f'case "$*" in *LCG_LANES=1*|*lie_codegen_call*) ;; *) [ -e {tmp_path}/well ] || kill -9 $$;; esac'
    monkeypatch.setenv("LIE_CODEGEN_CC", fake(tmp_path, broken))
    library = build_kernels(lambda: [toy_kernels.RATE], definition="rate")
    with pytest.warns(DegradedWarning, match=r"one sample at a time.*stopped"):
        assert library.build_log[0] == "batches: 1 samples at a time"
    np.testing.assert_array_equal(library.rate.batch(np.zeros((5, 3)), [1.0, 2.0, 3.0]), [[1.0, 2.0, 3.0]] * 5)
    (tmp_path / "well").touch()
    _forget()
    again = build_kernels(lambda: [toy_kernels.RATE], definition="rate")
    assert int(again.build_log[0].split()[1]) > 1


def test_a_small_limit_leaves_what_is_in_use(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("LIE_CODEGEN_CACHE_LIMIT", "1")
    first = build_kernels(lambda: [toy_kernels.RATE])
    second = build_kernels(lambda: [toy_kernels.EXP])
    for library in (first, second):
        assert int(library.build_log[0].split()[1]) > 1
    del library, first
    gc.collect()
    evict(cache_folder.cache_folder())
    assert cache_info().entries == 1  # the second library, whose sources this process may read again


def test_a_late_compiler_is_ended(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("LIE_CODEGEN_COMPILE_SECONDS", "0.3")
    monkeypatch.setenv("LIE_CODEGEN_CALL", "ctypes")
    monkeypatch.setenv("LIE_CODEGEN_CC", fake(tmp_path, "sleep 60"))
    monkeypatch.setattr("lie_codegen.runtime.build.find_compilers", lambda: find_compilers()[:1])
    began = time.monotonic()
    with pytest.raises(CompilerStoppedError, match=r"no answer in 0.3 s.*LIE_CODEGEN_COMPILE_SECONDS"):
        build_kernels(lambda: [toy_kernels.RATE])
    assert time.monotonic() - began < 20


def test_a_lock_is_not_waited_for_for_ever(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    from filelock import FileLock

    home.mkdir(mode=0o700)
    (home / "locks").mkdir()
    monkeypatch.setenv("LIE_CODEGEN_COMPILE_SECONDS", "0.2")
    key = "0" * 64
    with (
        FileLock(home / "locks" / f"{key}.lock"),
        pytest.warns(CacheWarning, match=r"held a lock.*building beside it"),
        cache.lock(home, key),
    ):
        pass


def test_a_full_disk_and_a_full_temporary_folder_are_one_error(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(*_: Any) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(cache, "write_json", full)
    with pytest.warns(CacheWarning), pytest.raises(CacheError, match=r"cache folder \(No space.*temporary folder"):
        build_kernels(lambda: [toy_kernels.RATE])


def test_a_compiler_without_space_falls_back(tmp_path: Path, home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    script = f'case "$PWD" in {tmp_path}*) echo "error writing x.s: No space left on device" >&2; exit 1;; esac'
    monkeypatch.setenv("LIE_CODEGEN_CC", fake(tmp_path, script))
    with pytest.warns(CacheWarning, match="No space left"):
        library = build_kernels(lambda: [toy_kernels.RATE])
    assert library.compiled
    assert library.path is not None
    assert home not in library.path.parents


def test_a_folder_mounted_noexec_falls_back(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    real = entry_library.load_library

    def refused(path: Path) -> Any:
        if home in path.parents:
            raise CacheError(f"{path}: failed to map segment from shared object")
        return real(path)

    monkeypatch.setattr(entry_library, "load_library", refused)
    with pytest.warns(CacheWarning, match=r"loads no library.*noexec"):
        library = build_kernels(lambda: [toy_kernels.RATE])
    assert library.path is not None
    assert home not in library.path.parents
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert home not in (build_kernels(lambda: [toy_kernels.EXP]).path or home).parents


def test_an_entry_evicted_between_build_and_opening_is_built_again(
    compiles: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    real, left = cache_door.evict, [2]

    def evicted(folder: Path) -> None:
        real(folder)
        if left[0]:
            left[0] -= 1
            shutil.rmtree(folder / "entries")

    monkeypatch.setattr(cache_door, "evict", evicted)
    assert build_kernels(lambda: [toy_kernels.RATE]).compiled
    assert len(compiles) == 3


def test_a_child_leaves_the_parents_temporary_folder() -> None:
    code = """
import os, sys, warnings
warnings.simplefilter("ignore")
from lie_codegen.runtime.cache_folder import temporary_folder
folder = temporary_folder("a test")
child = os.fork()
if not child:
    sys.exit(0)
os.waitpid(child, 0)
print(folder.is_dir(), folder)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    there, _, folder = done.stdout.strip().partition(" ")
    assert there == "True"
    assert not Path(folder).exists()


def test_old_requests_and_locks_go(home: Path) -> None:
    library = build_kernels(lambda: [toy_kernels.RATE], definition="rate")
    (kept,) = home.glob("requests/*.json")
    old, orphan, lock = (
        home / "requests" / f"{'1' * 64}.json",
        home / "requests" / f"{'2' * 64}.json",
        home / "locks" / f"{'3' * 64}.lock",
    )
    old.write_text("{}")
    lock.write_text("")
    for file in (old, lock):
        os.utime(file, (1, 1))
    cache.write_json(orphan, {"entry": "4" * 64})
    evict(home)
    assert old.exists()  # looked after once a day
    (home / "requests" / ".looked-after").unlink()
    evict(home)
    assert kept.exists()
    assert not any(file.exists() for file in (old, orphan, lock))
    assert library.compiled
    cache_upkeep.clear_cache()
    assert not (home / "requests").exists()
