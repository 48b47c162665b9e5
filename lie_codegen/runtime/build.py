"""Kernels -> Library: from the cache if an equal request was answered before, else generated and compiled.

definition -> request digest -> entry              (warm: neither sympy nor casadi is imported)
kernels -> C text -> entry digest -> entry         (known C text: nothing is compiled)
C text -> compiler -> shared library -> entry      (cold)
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lie_codegen.errors import CacheError, CodegenError
from lie_codegen.runtime import cache
from lie_codegen.runtime.cache_door import Attempt, compiled_entry, request_key
from lie_codegen.runtime.cache_folder import note_not_loaded, usable_folder
from lie_codegen.runtime.compiler import Compiler, find_compilers, flags_for, lane_flags, warn_no_compiler
from lie_codegen.runtime.compiling import compile_entry
from lie_codegen.runtime.digests import cpu_identity, digest
from lie_codegen.runtime.extension import prepare_extension
from lie_codegen.runtime.lane_library import ONE_LANE, keep_sources
from lie_codegen.runtime.library import Library, check_names
from lie_codegen.runtime.patience import progress

#: Times that an entry may go between its build and its opening.
_EVICTIONS = 3

if TYPE_CHECKING:
    from lie_codegen.codegen.library_sources import LibrarySources
    from lie_codegen.kernel.kernel import Kernel


def build_kernels(
    make_kernels: Callable[[], Sequence[Kernel]],
    *,
    namespace: str | None = None,
    definition: str | None = None,
    options: Mapping[str, Any] | None = None,
    real: str = "double",
    fused: bool = False,
) -> Library:
    """The kernels as a library of callables.

    Args:
        make_kernels: makes the kernels; not called when the answer to `definition` is in the cache.
        namespace: prefix of the C symbols; that of the kernels when None.
        definition: text that, with the source of this package, determines the kernels; None if they
            come from elsewhere.
        options: plain data that `make_kernels` depends on beside the definition.
        real: "double", or "float": what the library computes in, takes and gives.
        fused: whether multiplications and additions may become one operation: for kernels whose bits nobody compares with the interpreter's,
            as rates that an integrator calls.

    Raises:
        CodegenError: a kernel cannot become C.
        CompileError: a compiler that works refuses the C text.
        CacheError: there is no folder to build in.
    """
    compilers = find_compilers()
    if not compilers:
        warn_no_compiler()
        return interpreted(make_kernels(), namespace=namespace, real=real)

    def make_sources() -> LibrarySources:
        from lie_codegen.codegen import package

        kernels = tuple(make_kernels())
        return package.render_library(_namespace(namespace, kernels), kernels, real)

    if real != "double":
        options = {**(options or {}), "real": real}
    return build_sources(
        make_sources, compilers, namespace=namespace, definition=definition, options=options, fused=fused
    )


def build_sources(
    make_sources: Callable[[], LibrarySources],
    compilers: Sequence[Compiler],
    *,
    namespace: str | None = None,
    definition: str | None = None,
    options: Mapping[str, Any] | None = None,
    fused: bool = False,
) -> Library:
    """As `build_kernels`, from what makes the C text; some compiler is there.

    Raises:
        CompileError, CacheError: as `build_kernels`.
    """
    folder = usable_folder()
    prepare_extension()
    requests = []
    if definition is not None:
        requests = [_request(namespace, definition, options or {}, compiler, fused) for compiler in compilers]
        for request in requests:
            entry = cache.find_request(folder, request)
            if entry is not None and (library := _open_or_none(entry)) is not None:
                return library
    with progress("build"):
        sources = make_sources()
        check_names(sources.signatures)
        return _compile(folder, sources, compilers, requests, fused)


def interpreted(kernels: Sequence[Kernel], *, namespace: str | None = None, real: str = "double") -> Library:
    """The kernels run by CasADi's interpreter, in doubles: no compiler, the same results (rounded, for floats)."""
    from lie_codegen.codegen.package import render_library
    from lie_codegen.kernel.casadi_arithmetic import function_of
    from lie_codegen.runtime.call import Compiled
    from lie_codegen.runtime.interpreted import InterpretedBackend, Rounded

    namespace = _namespace(namespace, kernels)
    signatures = render_library(namespace, kernels, real).signatures  # refuses what C would refuse
    check_names(signatures)
    backends = [InterpretedBackend(function_of(kernel)) for kernel in kernels]
    functions: list[Compiled[Any]] = [
        Compiled(signature, backend if real == "double" else Rounded(backend), compiled=False)
        for signature, backend in zip(signatures, backends, strict=True)
    ]
    return Library(namespace, functions, None)


def defined_together(kernels: Sequence[Kernel]) -> str | None:
    """What determines these kernels, as one text; None if one of them has no definition."""
    if any(kernel.definition is None for kernel in kernels):
        return None
    texts = [f"{kernel.symbol} {kernel.definition.text}" for kernel in kernels if kernel.definition is not None]
    return "\n".join(["kernels", *texts])


def _namespace(given: str | None, kernels: Sequence[Kernel]) -> str:
    if given is None and not kernels:
        raise CodegenError("no kernel given")
    return kernels[0].namespace if given is None else given


def _request(
    namespace: str | None, definition: str, options: Mapping[str, Any], compiler: Compiler, fused: bool
) -> str:
    flags = flags_for(0, fused=fused)
    return request_key(compiler, flags, namespace=namespace, definition=definition, options=dict(options))


def _compile(
    folder: Path, sources: LibrarySources, compilers: Sequence[Compiler], requests: Sequence[str], fused: bool
) -> Library:
    flags, over_lanes = flags_for(sources.statements, fused=fused), lane_flags(sources.statements, fused=fused)

    def attempt(folder: Path, number: int, compiler: Compiler) -> cache.Entry:
        # The C text itself is the key: another request for the same text, from another version, compiles nothing.
        key = digest(
            {
                "files": dict(sources.files),
                "signatures": [signature.to_json() for signature in sources.signatures],
                "flags": [flags, over_lanes],
                "compiler": compiler.identity,
                "cpu": cpu_identity(),
            }
        )
        with cache.lock(folder, key):
            entry = cache.find_entry(folder, key) or _fill(folder, key, sources, compiler, flags, over_lanes)
            if requests:
                cache.store_request(folder, requests[number], key)
        return entry

    return _opened_somewhere(folder, compilers, attempt)


def _opened_somewhere(folder: Path, compilers: Sequence[Compiler], attempt: Attempt) -> Library:
    """The library, opened: another process may evict it before that, and a disk may be mounted so that nothing on it is loaded."""
    for _ in range(_EVICTIONS):
        entry = compiled_entry(folder, compilers, attempt)
        try:
            return _open(entry)
        except CacheError as error:
            if entry.library.is_file() and note_not_loaded(entry.library, str(error)):
                break
    return _open(compiled_entry(usable_folder(), compilers, attempt))


def _fill(
    folder: Path,
    key: str,
    sources: LibrarySources,
    compiler: Compiler,
    flags: tuple[str, ...],
    over_lanes: tuple[str, ...],
) -> cache.Entry:
    one_lane = (*flags, ONE_LANE)
    entry = compile_entry(
        folder,
        key,
        sources.files,
        sources.main,
        sources.namespace,
        compiler,
        one_lane,
        sources.signatures,
        sources.notes,
    )
    keep_sources(entry, sources.files, sources.main, over_lanes, compiler)
    return entry


def _open_or_none(entry: cache.Entry) -> Library | None:
    """None where another process evicted the entry meanwhile."""
    try:
        return _open(entry)
    except CacheError:
        return None


def _open(entry: cache.Entry) -> Library:
    from lie_codegen.runtime.entry_library import open_entry  # numpy, which a cold build imports while compilers run

    return open_entry(entry)
