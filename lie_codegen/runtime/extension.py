"""The extension type behind fast calls: one C file and its header, compiled once for a Python, a numpy and a compiler.

    <cache>/python/entries/<digest>/...     as the cache of kernels
    <cache>/python/requests/<digest>.json   why it could not be compiled, so that not every process tries again

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
from lie_codegen.errors import CacheError, CompileError
from lie_codegen.runtime import cache
from lie_codegen.runtime.cache_folder import usable_folder
from lie_codegen.runtime.compiler import Compiler, compile_library, find_compilers
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
        if _is_wanted() and not _beside:
            _beside.append(threading.Thread(target=_find_or_compile))
            _beside[0].start()


def extension() -> Any:
    """The module, compiled if need be; None where it cannot be had or is not wanted."""
    if not _is_wanted():
        return None
    with _lock:
        for thread in _beside:
            thread.join()
        return _extension()


def _is_wanted() -> bool:
    return os.environ.get("LIE_CODEGEN_CALL", "").strip().lower() != "ctypes"


@memoised
def _extension() -> Any:
    library = _find_or_compile()
    try:
        return None if library is None else _load(library)
    except (OSError, ImportError):
        return None


def _find_or_compile() -> Path | None:
    try:
        texts = {name: (template_folder() / name).read_text(encoding="utf-8") for name in _FILES}
        numpy = _numpy_folder()
        folder = usable_folder() / "python"
        folder.mkdir(mode=0o700, exist_ok=True)
        for compiler in find_compilers():
            library = _library(folder, texts, numpy, compiler)
            if library is not None:
                return library
    except (OSError, ImportError, CacheError):
        return None
    return None


def _numpy_folder() -> Path:
    """Where numpy is installed, without importing it."""
    spec = importlib.util.find_spec("numpy")
    if spec is None or spec.origin is None:
        raise ImportError("numpy is no package on disk")
    return Path(spec.origin).parent


def _library(folder: Path, texts: Mapping[str, str], numpy: Path, compiler: Compiler) -> Path | None:
    version = (numpy / "version.py").read_text(encoding="utf-8")
    key = digest([dict(texts), _FLAGS, sys.version, sys.implementation.cache_tag, version, compiler.identity])
    entry = cache.find_entry(folder, key)
    if entry is None and cache.find_note(folder, key) is None:
        with cache.lock(folder, key):
            entry = cache.find_entry(folder, key) or _fill(folder, key, texts, numpy, compiler)
    return None if entry is None else entry.library


def _fill(folder: Path, key: str, texts: Mapping[str, str], numpy: Path, compiler: Compiler) -> cache.Entry | None:
    import sysconfig

    include = sysconfig.get_path("include")
    if not (Path(include) / "Python.h").is_file():
        cache.store_note(folder, key, {"entry": None, "reason": "no Python.h"})
        return None
    with cache.scratch(folder) as home:
        for name, text in texts.items():
            (home / name).write_text(text, encoding="utf-8")
        core = "_core" if (numpy / "_core" / "include").is_dir() else "core"  # numpy 2 and 1
        flags = (*_FLAGS, f"-I{include}", f"-I{numpy / core / 'include'}")
        try:
            compile_library(compiler, home, _FILES[0], f"{_NAME}.so", flags)
        except CompileError as error:
            cache.store_note(folder, key, {"entry": None, "reason": str(error)})
            return None
        return cache.store_entry(folder, key, home / f"{_NAME}.so", _NAME, ())


def _load(library: Path) -> Any:
    loader = importlib.machinery.ExtensionFileLoader(_NAME, str(library))
    spec = importlib.util.spec_from_file_location(_NAME, library, loader=loader)
    if spec is None:
        return None
    module = importlib.util.module_from_spec(spec)
    loader.exec_module(module)
    return module
