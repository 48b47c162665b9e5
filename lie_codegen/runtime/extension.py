"""The extension type behind fast calls: one C file, compiled once for a Python, a numpy and a compiler.

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
from functools import cache as memoised
from pathlib import Path
from typing import Any

import numpy as np

from lie_codegen.codegen.templates import template_folder
from lie_codegen.errors import CompileError
from lie_codegen.runtime import cache
from lie_codegen.runtime.cache_folder import usable_folder
from lie_codegen.runtime.compiler import Compiler, compile_library, find_compilers
from lie_codegen.runtime.digests import digest

_NAME = "lie_codegen_call"
_FLAGS = (
    "-std=c11",
    "-O2",
    "-fPIC",
    "-shared",
    *(("-undefined", "dynamic_lookup") if sys.platform == "darwin" else ()),
)


def extension() -> Any:
    """The module, compiled if need be; None where it cannot be had or is not wanted."""
    if os.environ.get("LIE_CODEGEN_CALL", "").strip().lower() == "ctypes":
        return None
    return _extension()


@memoised
def _extension() -> Any:
    try:
        text = (template_folder() / "python_call.c").read_text(encoding="utf-8")
        folder = usable_folder() / "python"
        folder.mkdir(mode=0o700, exist_ok=True)
        for compiler in find_compilers():
            library = _library(folder, text, compiler)
            if library is not None:
                return _load(library)
    except (OSError, ImportError):
        return None
    return None


def _library(folder: Path, text: str, compiler: Compiler) -> Path | None:
    key = digest([text, _FLAGS, sys.version, sys.implementation.cache_tag, np.__version__, compiler.identity])
    entry = cache.find_entry(folder, key)
    if entry is None and not (folder / "requests" / f"{key}.json").exists():
        with cache.lock(folder, key):
            entry = cache.find_entry(folder, key) or _fill(folder, key, text, compiler)
    return None if entry is None else entry.library


def _fill(folder: Path, key: str, text: str, compiler: Compiler) -> cache.Entry | None:
    import sysconfig

    include = sysconfig.get_path("include")
    if not (Path(include) / "Python.h").is_file():
        cache.write_json(folder / "requests" / f"{key}.json", {"entry": None, "reason": "no Python.h"})
        return None
    with cache.scratch(folder) as home:
        (home / f"{_NAME}.c").write_text(text, encoding="utf-8")
        flags = (*_FLAGS, f"-I{include}", f"-I{np.get_include()}")
        try:
            compile_library(compiler, home, f"{_NAME}.c", f"{_NAME}.so", flags)
        except CompileError as error:
            cache.write_json(folder / "requests" / f"{key}.json", {"entry": None, "reason": str(error)})
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
