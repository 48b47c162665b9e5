"""Kernels -> Library: from the cache if an equal request was answered before, else generated and compiled.

definition -> request digest -> entry              (warm: neither sympy nor casadi is imported)
kernels -> C text -> entry digest -> entry         (known C text: nothing is compiled)
C text -> compiler -> shared library -> entry      (cold)
"""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from lie_codegen.errors import CacheError, CodegenError
from lie_codegen.kernels.kernel import Kernel
from lie_codegen.runtime import cache
from lie_codegen.runtime.backend import CtypesBackend, InterpretedBackend, load_library
from lie_codegen.runtime.cache_folder import temporary_folder, usable_folder
from lie_codegen.runtime.cache_upkeep import evict
from lie_codegen.runtime.call import Compiled
from lie_codegen.runtime.compiler import Compiler, find_compilers, flags_for, warn_no_compiler
from lie_codegen.runtime.digests import cpu_identity, digest, package_digest, templates_digest, versions
from lie_codegen.runtime.extension import extension
from lie_codegen.runtime.ladder import compile_entry, first_that_works
from lie_codegen.runtime.lane_library import ONE_LANE, LaneLibrary, keep_sources
from lie_codegen.runtime.library import Library, check_names
from lie_codegen.runtime.quick import quick

if TYPE_CHECKING:
    from lie_codegen.codegen.package import LibrarySources


def build_kernels(
    make_kernels: Callable[[], Sequence[Kernel]],
    *,
    namespace: str | None = None,
    definition: str | None = None,
    options: Mapping[str, Any] | None = None,
) -> Library:
    """The kernels as a library of callables.

    Args:
        make_kernels: makes the kernels; not called when the answer to `definition` is in the cache.
        namespace: prefix of the C symbols; that of the kernels when None.
        definition: text that, with the source of this package, determines the kernels; None if they
            come from elsewhere.
        options: plain data that `make_kernels` depends on beside the definition.

    Raises:
        CodegenError: a kernel cannot become C.
        CompileError: a compiler that works refuses the C text.
        CacheError: there is no folder to build in.
    """
    compilers = find_compilers()
    if not compilers:
        warn_no_compiler()
        return interpreted(make_kernels(), namespace=namespace)
    folder = usable_folder()
    requests = []
    if definition is not None:
        requests = [_request(namespace, definition, options or {}, compiler) for compiler in compilers]
        for request in requests:
            entry = cache.find_request(folder, request)
            if entry is not None and (library := _open_or_none(entry)) is not None:
                return library
    beside = threading.Thread(target=extension, daemon=True)  # compiled, if need be, while the kernels are derived
    beside.start()
    kernels = tuple(make_kernels())
    try:
        return _compile(folder, namespace, kernels, compilers, requests, beside)
    except OSError as error:
        reason = f"the cache folder {folder} cannot be written: {error.strerror or error}"
        return _compile(temporary_folder(reason), namespace, kernels, compilers, requests, beside)


def interpreted(kernels: Sequence[Kernel], *, namespace: str | None = None) -> Library:
    """The kernels run by CasADi's interpreter: no compiler, the same results."""
    from lie_codegen.codegen.package import render_library
    from lie_codegen.lowering.casadi_arithmetic import function_of

    namespace = _namespace(namespace, kernels)
    signatures = render_library(namespace, kernels).signatures  # refuses what C would refuse
    check_names(signatures)
    functions = [
        Compiled(signature, InterpretedBackend(function_of(kernel)), compiled=False)
        for signature, kernel in zip(signatures, kernels, strict=True)
    ]
    return Library(namespace, functions, None)


def _namespace(given: str | None, kernels: Sequence[Kernel]) -> str:
    if given is None and not kernels:
        raise CodegenError("no kernel given")
    return kernels[0].namespace if given is None else given


def _request(namespace: str | None, definition: str, options: Mapping[str, Any], compiler: Compiler) -> str:
    return digest(
        {
            "namespace": namespace,
            "definition": definition,
            "options": dict(options),
            "package": package_digest(),
            "templates": templates_digest(),
            "versions": versions(),
            "flags": flags_for(0),
            "compiler": compiler.identity,
            "cpu": cpu_identity(),
        }
    )


def _compile(
    folder: Path,
    namespace: str | None,
    kernels: Sequence[Kernel],
    compilers: Sequence[Compiler],
    requests: Sequence[str],
    beside: threading.Thread,
) -> Library:
    from lie_codegen.codegen.package import render_library

    namespace = _namespace(namespace, kernels)
    sources = render_library(namespace, kernels)
    check_names(sources.signatures)
    flags = flags_for(sources.statements)

    def attempt(number: int, compiler: Compiler) -> cache.Entry:
        key = digest(
            {
                "files": dict(sources.files),
                "signatures": [signature.to_json() for signature in sources.signatures],
                "flags": flags,
                "compiler": compiler.identity,
                "versions": versions(),
                "templates": templates_digest(),
                "cpu": cpu_identity(),
            }
        )
        with cache.lock(folder, key):
            entry = cache.find_entry(folder, key) or _fill(folder, key, namespace, sources, compiler, flags)
            if requests:
                cache.store_request(folder, requests[number], key)
        return entry

    entry = first_that_works(folder, compilers, attempt)
    beside.join()
    library = _open(entry)
    evict(folder, keep=entry.library.parent.name)
    return library


def _fill(
    folder: Path, key: str, namespace: str, sources: LibrarySources, compiler: Compiler, flags: tuple[str, ...]
) -> cache.Entry:
    one_lane = (*flags, ONE_LANE)
    entry = compile_entry(
        folder, key, sources.files, sources.main, namespace, compiler, one_lane, sources.signatures, sources.notes
    )
    keep_sources(entry, sources.files, sources.main, flags, compiler)
    return entry


def _open_or_none(entry: cache.Entry) -> Library | None:
    """None where another process evicted the entry meanwhile."""
    try:
        return _open(entry)
    except CacheError:
        return None


def _open(entry: cache.Entry) -> Library:
    shared = load_library(entry.library)
    lanes = LaneLibrary(entry, shared)
    functions = [
        quick(Compiled(signature, CtypesBackend(shared, signature, lanes), compiled=True), shared, lanes, signature)
        for signature in entry.signatures
    ]
    how = "the extension type" if functions and not isinstance(functions[0], Compiled) else "ctypes"
    return Library(entry.namespace, functions, entry.library, (f"calls: through {how}", *entry.notes), lanes.lanes)
