"""Compiles a kernel in floats, for screening; as `varying_build` it stands on what builds libraries."""

from __future__ import annotations

from typing import Any

from lie_codegen.kernel.kernel import Kernel
from lie_codegen.runtime.build import build_kernels, defined_together
from lie_codegen.runtime.call import Compiled


def single_of(kernel: Kernel) -> Compiled[Any]:
    """The kernel in single precision: it takes and gives float32 or complex64.

    Raises:
        CodegenError: a constant of it is no float.
        CompileError, CacheError: as `lc.build`.
    """
    library = build_kernels(
        lambda: [kernel], namespace=kernel.namespace, definition=defined_together([kernel]), real="float"
    )
    return library[kernel.name]
