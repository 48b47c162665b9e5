"""C text that is not made of kernels -> a shared library, through the same cache and the same ladder of compilers."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path

from lie_codegen.runtime import cache
from lie_codegen.runtime.cache_folder import temporary_folder, usable_folder
from lie_codegen.runtime.cache_upkeep import evict
from lie_codegen.runtime.compiler import Compiler, find_compilers, warn_no_compiler
from lie_codegen.runtime.digests import cpu_identity, digest, package_digest, templates_digest, versions
from lie_codegen.runtime.ladder import compile_entry, first_that_works

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
        if entry is not None:
            return entry.library
    files = make_files()
    try:
        return _compile(folder, files, main, namespace, definition, compilers, flags)
    except OSError as error:
        reason = f"the cache folder {folder} cannot be written: {error.strerror or error}"
        return _compile(temporary_folder(reason), files, main, namespace, definition, compilers, flags)


def _key(compiler: Compiler, namespace: str, definition: str, flags: tuple[str, ...]) -> str:
    return digest(
        {
            "source": namespace,
            "definition": definition,
            "package": package_digest(),
            "templates": templates_digest(),
            "versions": versions(),
            "flags": flags,
            "compiler": compiler.identity,
            "cpu": cpu_identity(),
        }
    )


def _compile(
    folder: Path,
    files: Mapping[str, str],
    main: str,
    namespace: str,
    definition: str,
    compilers: tuple[Compiler, ...],
    flags: tuple[str, ...],
) -> Path:
    def attempt(number: int, compiler: Compiler) -> cache.Entry:
        key = _key(compiler, namespace, definition, flags)
        with cache.lock(folder, key):
            return cache.find_entry(folder, key) or compile_entry(folder, key, files, main, namespace, compiler, flags)

    entry = first_that_works(folder, compilers, attempt)
    evict(folder, keep=entry.library.parent.name)
    return entry.library
