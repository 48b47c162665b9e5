"""What the key of a library notices: another compiler at the same path, another processor, another version, another Python."""

from __future__ import annotations

import builtins
import importlib.machinery
import io
import os
import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import toy_kernels

from lie_codegen.runtime import cache_door, digests, extension
from lie_codegen.runtime.build import build_kernels
from lie_codegen.runtime.compiler import _words_of, find_compilers

pytestmark = pytest.mark.skipif(not find_compilers() or os.name != "posix", reason="needs a C compiler on POSIX")
REAL = shutil.which("cc") or "cc"
ONE, OTHER = (
    "flags\t\t: fpu sse2 avx2\nmodel name\t: one\n\n",
    "flags\t\t: fpu sse2 avx2 avx512f\nmodel name\t: one\n\n",
)


@pytest.fixture(autouse=True)
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "the cache"
    monkeypatch.setenv("LIE_CODEGEN_CACHE", str(folder))
    return folder


def build() -> None:
    assert build_kernels(lambda: [toy_kernels.RATE], definition="rate").compiled


@pytest.fixture
def processor(monkeypatch: pytest.MonkeyPatch) -> Callable[[str], None]:
    """Make /proc/cpuinfo say that."""
    real = builtins.open

    def say(text: str) -> None:
        def opened(path: Any, *args: Any, **named: Any) -> Any:
            return io.StringIO(text) if path == "/proc/cpuinfo" else real(path, *args, **named)

        monkeypatch.setattr(digests, "open", opened, raising=False)
        digests.cpu_identity.cache_clear()
        monkeypatch.setattr(cache_door, "cpu_identity", digests.cpu_identity)

    return say


@pytest.fixture(autouse=True)
def afterwards() -> Any:
    yield
    digests.cpu_identity.cache_clear()


def test_another_processor_compiles_anew(processor: Callable[[str], None], compiles: list[str]) -> None:
    """-march=native for a processor with AVX-512 ends on one without by an illegal instruction."""
    for text, count in (
        (ONE, 1),
        (ONE, 1),
        (OTHER, 2),
        (ONE, 2),
        (ONE.replace("model name\t: one", "model name\t: two"), 3),
    ):
        processor(text)
        build()
        assert len(compiles) == count


def _script(program: Path, text: str) -> None:
    program.write_text(f'#!/bin/sh\n{text}exec {REAL} "$@"\n')
    program.chmod(0o700)


def test_another_compiler_compiles_anew(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, compiles: list[str]) -> None:
    first, second = tmp_path / "one-cc", tmp_path / "other-cc"
    for program in (first, second):
        _script(program, "")
    os.utime(first, (1, 1))
    os.utime(second, (1, 1))
    monkeypatch.setenv("LIE_CODEGEN_CC", str(first))
    build()
    build()
    assert len(compiles) == 1
    _script(first, "# version 2\n")  # upgraded in place
    build()
    assert len(compiles) == 2
    os.utime(first, (2, 2))  # installed again
    build()
    assert len(compiles) == 3
    monkeypatch.setenv("LIE_CODEGEN_CC", str(second))  # another path
    build()
    assert len(compiles) == 4
    link = tmp_path / "cc"
    link.symlink_to(first)
    monkeypatch.setenv("LIE_CODEGEN_CC", str(link))
    build()
    assert len(compiles) == 5
    link.unlink()
    link.symlink_to(second)  # as update-alternatives does
    build()
    assert len(compiles) == 6


def test_a_wrapper_that_runs_another_compiler_is_noticed(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, compiles: list[str]
) -> None:
    """A script in $CC stays what it is while the compiler that it runs changes: its own words tell."""
    behind, wrapper = tmp_path / "behind", tmp_path / "wrapper"
    _script(behind, "")
    wrapper.write_text(f'#!/bin/sh\nexec {behind} "$@"\n')
    wrapper.chmod(0o700)
    monkeypatch.setenv("LIE_CODEGEN_CC", str(wrapper))
    build()
    _words_of.cache_clear()
    build()
    assert len(compiles) == 1
    _script(behind, 'case "$*" in *--version*) echo "cc 99.0"; exit 0;; esac\n')
    _words_of.cache_clear()  # as in the next process
    build()
    assert len(compiles) == 2


def test_variables_that_change_what_a_compiler_does_compile_anew(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, compiles: list[str]
) -> None:
    build()
    monkeypatch.setenv("CPATH", str(tmp_path))  # gcc takes <math.h> from there
    build()
    assert len(compiles) == 2
    monkeypatch.delenv("CPATH")
    build()
    assert len(compiles) == 2


@pytest.mark.parametrize("what", ["package_digest", "templates_digest"])
def test_another_version_of_the_package_asks_anew(what: str, monkeypatch: pytest.MonkeyPatch) -> None:
    (compiler, *_) = find_compilers()
    before = cache_door.request_key(compiler, (), definition="x")
    monkeypatch.setattr(cache_door, what, lambda: "other")
    assert cache_door.request_key(compiler, (), definition="x") != before


def test_another_kind_of_python_has_an_extension_type_of_its_own(monkeypatch: pytest.MonkeyPatch, home: Path) -> None:
    """A debug or a free-threaded Python of the same version has other objects."""
    home.mkdir()
    keys = []
    monkeypatch.setattr(extension.cache, "find_entry", lambda folder, key: keys.append(key))
    monkeypatch.setattr(extension, "refused_before", lambda folder, key: "not tried")
    for suffix in (
        ".cpython-311-x86_64-linux-gnu.so",
        ".cpython-311d-x86_64-linux-gnu.so",
        ".cpython-311-aarch64-linux-gnu.so",
    ):
        monkeypatch.setattr(importlib.machinery, "EXTENSION_SUFFIXES", [suffix])
        extension._library(home, {}, extension._numpy_folder(), find_compilers()[0], [])
    assert len(set(keys)) == 3
