"""C files -> an entry of the cache, by the first compiler of the ladder that works."""

from __future__ import annotations

import shlex
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path

from lie_codegen.codegen.signature import Signature
from lie_codegen.errors import CompileError, CompilerStoppedError
from lie_codegen.runtime import cache
from lie_codegen.runtime.compiler import Compiler, compile_library, is_working, warn_passed_over

_SUFFIX = ".so"


def compile_entry(
    folder: Path,
    key: str,
    files: Mapping[str, str],
    main: str,
    namespace: str,
    compiler: Compiler,
    flags: tuple[str, ...],
    signatures: Sequence[Signature] = (),
    notes: Sequence[str] = (),
) -> cache.Entry:
    """Compile {flat file name: text} and store the library; the caller holds the lock of the key.

    Raises:
        CompileError: with the command and what the compiler printed.
        OSError: the disk is full or the folder cannot be written.
    """
    with cache.scratch(folder) as home:
        for name, text in files.items():
            (home / Path(name).name).write_bytes(text.encode())
        output = f"{namespace}{_SUFFIX}"
        compile_library(compiler, home, main, output, flags)
        return cache.store_entry(folder, key, home / output, namespace, signatures, notes)


def first_that_works(
    folder: Path, compilers: Sequence[Compiler], attempt: Callable[[int, Compiler], cache.Entry]
) -> cache.Entry:
    """The entry of the first compiler that can compile at all; one that cannot is passed over.

    Raises:
        CompileError: a compiler that works refuses the text, or none works.
    """
    failure: CompileError | None = None
    for number, compiler in enumerate(compilers):
        try:
            try:
                return attempt(number, compiler)
            except CompilerStoppedError:
                return attempt(number, compiler)  # what stopped it may be over: once more
        except CompileError as error:
            with cache.scratch(folder) as probe:
                if is_working(compiler, probe):
                    raise
            failure = failure or error
            if number + 1 < len(compilers):
                warn_passed_over(shlex.join(compiler.command), "it cannot compile the smallest program")
    raise failure or CompileError("no compiler to try")
