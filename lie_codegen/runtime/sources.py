"""C text that is not made of kernels -> a shared library, through the same cache and the same ladder of compilers."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from lie_codegen.errors import CacheError
from lie_codegen.runtime import cache
from lie_codegen.runtime.backend import load_library
from lie_codegen.runtime.cache_door import compiled_entry, request_key
from lie_codegen.runtime.cache_folder import note_not_loaded, usable_folder
from lie_codegen.runtime.compiler import Compiler, find_compilers, warn_no_compiler
from lie_codegen.runtime.compiling import compile_entry

#: Multiplications and additions may fuse here: an iterative solver has no bits to reproduce.
SOLVER_FLAGS = ("-O2", "-march=native", "-std=c99", "-fno-math-errno", "-ffp-contract=fast", "-fPIC", "-shared")


def build_source(
    make_files: Callable[[], Mapping[str, str]],
    main: str,
    *,
    namespace: str,
    definition: str,
    more_flags: tuple[str, ...] = (),
) -> Path | None:
    """The shared library of some C files, from the cache where it is there; None where there is no compiler.

    Args:
        make_files: makes {flat file name: text}; not called when the answer is in the cache.
        main: the file to compile.
        namespace: C identifier, the stem of the library's file name.
        definition: text that, with the source of this package, determines the files.
        more_flags: behind `SOLVER_FLAGS`.

    Raises:
        CompileError: a compiler that works refuses the text.
        CacheError: there is no folder to build in.
    """
    compilers = find_compilers()
    if not compilers:
        warn_no_compiler()
        return None
    folder, flags = usable_folder(), (*SOLVER_FLAGS, *more_flags)
    for compiler in compilers:
        entry = cache.find_entry(folder, _key(compiler, namespace, definition, flags))
        if entry is not None and _loads(entry.library):
            return entry.library
    files = make_files()

    def attempt(folder: Path, _: int, compiler: Compiler) -> cache.Entry:
        key = _key(compiler, namespace, definition, flags)
        with cache.lock(folder, key):
            return cache.find_entry(folder, key) or compile_entry(folder, key, files, main, namespace, compiler, flags)

    library = compiled_entry(folder, compilers, attempt).library
    return library if _loads(library) else compiled_entry(usable_folder(), compilers, attempt).library


def _loads(library: Path) -> bool:
    """Whether the system loads it; where it does not, a temporary folder is used from now on. It stays open: the caller loads it next."""
    try:
        load_library(library)
    except CacheError as error:
        note_not_loaded(library, str(error))
        return False
    return True


def _key(compiler: Compiler, namespace: str, definition: str, flags: tuple[str, ...]) -> str:
    return request_key(compiler, flags, source=namespace, definition=definition)
