"""Batches on lanes, compiled when a batch is first asked for.

The lane forms take ten times as long to compile as the scalar functions, and most programs never call a batch. A library is
therefore compiled first with one lane (a batch is a loop over the scalar function); its sources stay in the cache, and the
first batch compiles them again for the lanes of this machine. Should that fail, the loops serve.
"""

from __future__ import annotations

import ctypes
import threading
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from lie_codegen.errors import CompileError, CompilerStoppedError
from lie_codegen.runtime import cache
from lie_codegen.runtime.cache_folder import temporary_folder
from lie_codegen.runtime.compiler import Compiler, find_compilers
from lie_codegen.runtime.compiling import compile_entry
from lie_codegen.runtime.degraded import BATCHES, warn_degraded
from lie_codegen.runtime.digests import digest

#: What the first compilation defines: lanes of one sample.
ONE_LANE = "-DLCG_LANES=1"
_SOURCES = "sources.json"


class LaneLibrary:
    """The library with lanes, opened at first use; safe across threads and processes."""

    def __init__(self, entry: cache.Entry, scalar: ctypes.CDLL) -> None:
        self._entry = entry
        self._folder = entry.library.parent.parent.parent
        self._scalar = scalar
        self._lock = threading.Lock()
        self._opened: ctypes.CDLL | None = None
        self._blocks: dict[str, ctypes.CDLL | None] = {}

    def open(self) -> ctypes.CDLL:
        """The library whose batches run on lanes; the one without where lanes cannot be had."""
        with self._lock:
            if self._opened is None:
                self._opened = self._library(()) or self._scalar
            return self._opened

    def block(self, symbol: str) -> ctypes.CDLL | None:
        """A library of one kernel alone, over blocks of eight samples (`{symbol}_block`); None where it cannot be had."""
        with self._lock:
            if symbol not in self._blocks:
                self._blocks[symbol] = self._library(("-DLCG_BLOCK", f"-DLCG_BLOCK_{symbol}"))
            return self._blocks[symbol]

    def beside(self, main: str, more_files: Mapping[str, str], more_flags: tuple[str, ...]) -> ctypes.CDLL | None:
        """A library of the file `main`, which includes PAIR_SOURCE, the sources of this one; None where it cannot be had.

        Its name and the flags say which: of one name the files are always the same.
        """
        known = " ".join((main, *more_flags))
        with self._lock:
            if known not in self._blocks:
                self._blocks[known] = self._opened_at(lambda: self._beside(main, more_files, more_flags))
            return self._blocks[known]

    def _library(self, more_flags: tuple[str, ...]) -> ctypes.CDLL | None:
        return self._opened_at(lambda: self._find_or_compile(more_flags))

    def _opened_at(self, place: Callable[[], Path]) -> ctypes.CDLL | None:
        try:
            return ctypes.CDLL(str(place()))
        except (OSError, CompileError, LookupError, ValueError, TypeError) as error:
            warn_degraded(BATCHES, str(error))
            return None

    def lanes(self) -> int:
        """Samples at a time."""
        return int(self.open()[f"{self._entry.namespace}_lie_codegen_lanes"]())

    def _beside(self, main: str, more_files: Mapping[str, str], more_flags: tuple[str, ...]) -> Path:
        key = digest(["beside", self._entry.library.parent.name, main, dict(more_files), *more_flags])
        entry = cache.find_entry(self._folder, key)
        if entry is not None:  # without the sources, which take a millisecond to read
            return entry.library
        sources, compiler = self._sources()
        flags = (*sources["flags"], *more_flags, f'-DPAIR_SOURCE="{sources["main"]}"')
        whole = {**sources, "files": {**sources["files"], **more_files}, "main": main}
        return self._compiled(key, whole, compiler, flags)

    def _find_or_compile(self, more_flags: tuple[str, ...]) -> Path:
        sources, compiler = self._sources()
        flags = (*sources["flags"], *more_flags)
        key = digest(["lanes", self._entry.library.parent.name, compiler.identity, *flags])
        entry = cache.find_entry(self._folder, key)
        return self._compiled(key, sources, compiler, flags) if entry is None else entry.library

    def _sources(self) -> tuple[Mapping[str, Any], Compiler]:
        """What the library was compiled from, and the compiler that did."""
        home = self._entry.library.parent
        sources = cache.read_json(home / _SOURCES)
        if not isinstance(sources, dict):
            cache.unlink(home / "entry.json")  # the next process builds the whole entry again
            raise ValueError("the sources of the lanes are gone or damaged")
        compilers = find_compilers()
        return sources, next((each for each in compilers if each.identity == sources["compiler"]), compilers[0])

    def _compiled(self, key: str, sources: Mapping[str, Any], compiler: Compiler, flags: tuple[str, ...]) -> Path:
        try:
            return self._locked(self._folder, key, sources, compiler, flags).library
        except OSError as error:
            folder = temporary_folder(f"the cache folder {self._folder} cannot be written: {error.strerror or error}")
            return self._locked(folder, key, sources, compiler, flags).library

    def _locked(
        self, folder: Path, key: str, sources: Mapping[str, Any], compiler: Compiler, flags: tuple[str, ...]
    ) -> cache.Entry:
        with cache.lock(folder, key):
            found = cache.find_entry(folder, key)
            if found is not None:
                return found
            try:
                return self._compile(folder, key, sources, compiler, flags)
            except CompilerStoppedError:
                return self._compile(folder, key, sources, compiler, flags)

    def _compile(
        self, folder: Path, key: str, sources: Mapping[str, Any], compiler: Compiler, flags: tuple[str, ...]
    ) -> cache.Entry:
        return compile_entry(
            folder,
            key,
            sources["files"],
            sources["main"],
            self._entry.namespace,
            compiler,
            flags,
            self._entry.signatures,
        )


def keep_sources(
    entry: cache.Entry, files: Mapping[str, str], main: str, flags: tuple[str, ...], compiler: Compiler
) -> None:
    """Leave beside a library what its lanes will be compiled from.

    Raises:
        OSError: the disk is full or the folder cannot be written.
    """
    data = {
        "files": dict(files),
        "main": main,
        "flags": list(flags),
        "compiler": compiler.identity,
    }
    cache.write_json(entry.library.parent / _SOURCES, data)
