"""The extension type behind fast calls: one C file and its header, compiled once for a Python, a numpy and a compiler.

    <cache>/python/entries/<digest>/...     as the cache of kernels
    <cache>/python/requests/<digest>.json   why a compiler refused it, so that not every process tries again (`degraded.py`)

Without Python's headers or a compiler there is none, and calls go through ctypes with the same results.
LIE_CODEGEN_CALL=ctypes does without it.
"""

from __future__ import annotations

import importlib.machinery
import importlib.util
import os
import sys
import threading
from collections.abc import Mapping
from functools import cache as memoised
from pathlib import Path
from typing import Any

from lie_codegen.codegen.templates import template_folder
from lie_codegen.door import on_behalf
from lie_codegen.errors import CacheError, CompileError, CompilerStoppedError
from lie_codegen.runtime import cache
from lie_codegen.runtime.cache_folder import note_not_loaded, usable_folder
from lie_codegen.runtime.compiler import Compiler, compile_library, find_compilers, is_working
from lie_codegen.runtime.degraded import CALLS, forget_refused, note_refused, refused_before, warn_degraded
from lie_codegen.runtime.digests import digest

_NAME = "lie_codegen_call"
_FILES = ("python_call.c", "output_pool.h")
#: -O2 takes half as long again and calls are no faster (measured: 130 ns either way).
_FLAGS = (
    "-std=c11",
    "-O1",
    "-fPIC",
    "-shared",
    *(("-undefined", "dynamic_lookup") if sys.platform == "darwin" else ()),
)


_lock = threading.Lock()
_beside: list[threading.Thread] = []


def prepare_extension() -> None:
    """Have it found, or compiled, beside what the caller does; numpy is not imported."""
    with _lock:
        if is_wanted() and not _beside:
            _beside.append(threading.Thread(target=on_behalf(_find_or_compile)))
            _beside[0].start()


def extension() -> Any:
    """The module, compiled if need be; None where it cannot be had or is not wanted."""
    if not is_wanted():
        return None
    with _lock:
        for thread in _beside:
            thread.join()
        return _extension()


def is_wanted() -> bool:
    """Whether calls are to go through the extension type: unless LIE_CODEGEN_CALL=ctypes."""
    return os.environ.get("LIE_CODEGEN_CALL", "").strip().lower() != "ctypes"


@memoised
def _extension() -> Any:
    library = _find_or_compile()
    try:
        return None if library is None else _load(library)
    except (OSError, ImportError) as error:
        if library is None or not note_not_loaded(library, str(error)):
            warn_degraded(CALLS, str(error))
            return None
    library = _find_or_compile()  # in the temporary folder
    try:
        return None if library is None else _load(library)
    except (OSError, ImportError) as error:
        warn_degraded(CALLS, str(error))
        return None


def _find_or_compile() -> Path | None:
    if not has_headers():
        return None  # `lie-codegen cache` says so: a warning in every process would be noise
    try:
        texts = {name: (template_folder() / name).read_text(encoding="utf-8") for name in _FILES}
        numpy = _numpy_folder()
        folder = usable_folder() / "python"
        folder.mkdir(mode=0o700, exist_ok=True)
        refusals: list[str] = []
        for compiler in find_compilers():
            library = _library(folder, texts, numpy, compiler, refusals)
            if library is not None:
                return library
    except (OSError, ImportError, CacheError) as error:
        warn_degraded(CALLS, str(error))
        return None
    if refusals:
        warn_degraded(CALLS, refusals[0])
    return None


def has_headers() -> bool:
    """Whether Python's own headers are there."""
    import sysconfig

    return (Path(sysconfig.get_path("include")) / "Python.h").is_file()


def _numpy_folder() -> Path:
    """Where numpy is installed, without importing it."""
    spec = importlib.util.find_spec("numpy")
    if spec is None or spec.origin is None:
        raise ImportError("numpy is no package on disk")
    return Path(spec.origin).parent


def _library(
    folder: Path, texts: Mapping[str, str], numpy: Path, compiler: Compiler, refusals: list[str]
) -> Path | None:
    version = (numpy / "version.py").read_text(encoding="utf-8")
    # The suffix of extension modules names the processor, and debug and free-threaded builds, whose objects are others.
    python = [sys.version, importlib.machinery.EXTENSION_SUFFIXES[0]]
    key = digest([dict(texts), _FLAGS, *python, version, compiler.identity])
    entry = cache.find_entry(folder, key)
    if entry is None and (reason := refused_before(folder, key)) is not None:
        refusals.append(reason)
    elif entry is None:
        with cache.lock(folder, key):
            entry = cache.find_entry(folder, key) or _fill(folder, key, texts, numpy, compiler, refusals)
    return None if entry is None else entry.library


def _fill(
    folder: Path, key: str, texts: Mapping[str, str], numpy: Path, compiler: Compiler, refusals: list[str]
) -> cache.Entry | None:
    import sysconfig

    include = sysconfig.get_path("include")
    with cache.scratch(folder) as home:
        for name, text in texts.items():
            (home / name).write_text(text, encoding="utf-8")
        core = "_core" if (numpy / "_core" / "include").is_dir() else "core"  # numpy 2 and 1
        flags = (*_FLAGS, f"-I{include}", f"-I{numpy / core / 'include'}")
        try:
            compile_library(compiler, home, _FILES[0], f"{_NAME}.so", flags)
        except CompileError as error:
            refusals.append(str(error))
            if not isinstance(error, CompilerStoppedError) and is_working(compiler, home):
                note_refused(folder, key, str(error))
            return None
        forget_refused(folder, key)
        return cache.store_entry(folder, key, home / f"{_NAME}.so", _NAME, ())


def _load(library: Path) -> Any:
    loader = importlib.machinery.ExtensionFileLoader(_NAME, str(library))
    spec = importlib.util.spec_from_file_location(_NAME, library, loader=loader)
    if spec is None:
        return None
    module = importlib.util.module_from_spec(spec)
    loader.exec_module(module)
    return module
