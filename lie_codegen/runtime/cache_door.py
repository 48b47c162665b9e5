"""The one way into the cache for something to compile: by which key it is known, and what happens where it is not there."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

from lie_codegen.errors import CacheError
from lie_codegen.runtime import cache
from lie_codegen.runtime.cache_folder import temporary_folder
from lie_codegen.runtime.cache_upkeep import evict
from lie_codegen.runtime.compiler import Compiler
from lie_codegen.runtime.compiling import first_that_works
from lie_codegen.runtime.digests import cpu_identity, digest, package_digest, templates_digest, versions


def request_key(compiler: Compiler, flags: tuple[str, ...], **asked: Any) -> str:
    """Digest of what was asked for and of all that may change the answer: this package, its versions, compiler, processor."""
    return digest(
        {
            **asked,
            "package": package_digest(),
            "templates": templates_digest(),
            "versions": versions(),
            "flags": flags,
            "compiler": compiler.identity,
            "cpu": cpu_identity(),
        }
    )


#: (folder, number of the compiler, compiler) -> the entry found or made with it.
Attempt = Callable[[Path, int, Compiler], cache.Entry]


def compiled_entry(folder: Path, compilers: Sequence[Compiler], attempt: Attempt) -> cache.Entry:
    """The entry that `attempt` (folder, number of the compiler, compiler) finds or makes with the first compiler that works.

    Where the cache cannot be written a temporary folder takes its place; what is over the cache's limit is evicted.

    Raises:
        CompileError: a compiler that works refuses the text.
        CacheError: there is no folder to build in.
    """
    try:
        entry = _attempted(folder, compilers, attempt)
    except OSError as error:
        why = error.strerror or error
        folder = temporary_folder(f"the cache folder {folder} cannot be written: {why}")
        try:
            entry = _attempted(folder, compilers, attempt)
        except OSError as second:
            raise CacheError(
                f"no folder to compile in: the cache folder ({why}) and the temporary folder {folder} "
                f"({second.strerror or second}) cannot be written"
            ) from second
    evict(folder)
    return entry


def _attempted(folder: Path, compilers: Sequence[Compiler], attempt: Attempt) -> cache.Entry:
    return first_that_works(folder, compilers, lambda number, compiler: attempt(folder, number, compiler))
