"""An entry of the cache -> a Library whose kernels can be called."""

from __future__ import annotations

from lie_codegen.runtime import cache
from lie_codegen.runtime.backend import CtypesBackend, load_library
from lie_codegen.runtime.call import Compiled
from lie_codegen.runtime.extension_function import extension_function
from lie_codegen.runtime.lane_library import LaneLibrary
from lie_codegen.runtime.library import Library


def open_entry(entry: cache.Entry) -> Library:
    """The kernels of the shared library, each ready to be called.

    Raises:
        CacheError: the system cannot load it.
    """
    shared = load_library(entry.library)
    lanes = LaneLibrary(entry, shared)
    functions = [
        extension_function(
            Compiled(signature, CtypesBackend(shared, signature, lanes), compiled=True), shared, lanes, signature
        )
        for signature in entry.signatures
    ]
    how = "the extension type" if functions and not isinstance(functions[0], Compiled) else "ctypes"
    return Library(entry.namespace, functions, entry.library, (f"calls: through {how}", *entry.notes), lanes.lanes)
