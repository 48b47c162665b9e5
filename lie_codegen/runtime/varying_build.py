"""Compiles what gives the entries that vary; it stands on what builds libraries, and so above the compiled kernels that ask for it."""

from __future__ import annotations

import numpy as np

from lie_codegen.codegen.varying import varying, varying_places
from lie_codegen.kernel.kernel import Kernel
from lie_codegen.runtime.arguments import dtype_of
from lie_codegen.runtime.build import build_kernels, defined_together
from lie_codegen.runtime.varying import Varying


def varying_of(kernel: Kernel) -> Varying:
    """The entries that vary, compiled.

    Raises:
        CompileError, CacheError: as `lc.build`.
    """
    made = varying(kernel)
    library = build_kernels(lambda: [made], namespace=made.namespace, definition=defined_together([made]))
    library.compiled_from(lambda name: made)
    library[made.name].belongs_to(library)
    places, values = varying_places(kernel)
    index = tuple(
        np.unravel_index(np.array(kept), p.shape) if p.shape else ()
        for kept, p in zip(places, kernel.outputs, strict=True)
    )
    constant = []
    for port, entries in zip(kernel.outputs, values, strict=True):
        kind = dtype_of(port)
        flat = np.array(entries)
        constant.append((flat if kind.kind == "c" else flat.real).astype(kind).reshape(port.shape))
    return Varying(library[made.name], index, kernel.outputs, tuple(constant))
