"""lc.device_source: kernels for a graphics processor, as text."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from lie_codegen.codegen.device import device_text
from lie_codegen.errors import InputError
from lie_codegen.groups.catalogue_load import as_group
from lie_codegen.groups.kernels import group_kernel, group_kernels
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernel.kernel import Kernel


def device_source(
    what: MatrixGroup | str | Path | Kernel | Sequence[Kernel],
    *,
    target: str = "opencl",
    kernels: Sequence[str] | None = None,
    real: str = "double",
) -> str:
    """CUDA or OpenCL text of kernels, <symbol>_batch each: one thread a sample.

    void <symbol>_batch(long count, input, long stride, ..., output, ...): arrays in the memory of the device as numpy lays them
    out, strides in reals from sample to sample (0 repeats one). The text is that of the scalar C: every value has one name, no
    memory but the arguments. It was compiled and run on a CPU by an OpenCL of the processor and against a header that stands in
    for CUDA; on a graphics processor it has not been timed.

    Args:
        what: a group, a catalogue name or a group file; or a Kernel, or several.
        target: "opencl" or "cuda".
        kernels: names of kernels of a group; those without loops of their own if None.
        real: "double" or "float".

    Raises:
        InputError: no such target or real; `kernels` without a group; nothing is left.
        CodegenError: a kernel calls a routine with loops; two kernels have one symbol.
    """
    if isinstance(what, Kernel) or (isinstance(what, Sequence) and not isinstance(what, str)):
        if kernels is not None:
            raise InputError("device_source: kernels= are names of kernels of a group")
        chosen = [what] if isinstance(what, Kernel) else list(what)
        if not chosen or not all(isinstance(each, Kernel) for each in chosen):
            raise InputError(f"device_source: give a group or Kernels, got {what!r:.80}")
        return device_text(chosen, target, real)
    group = as_group(what, "device_source")
    if kernels is None:
        chosen = [kernel for kernel in group_kernels(group) if not _loops(kernel)]
    else:
        chosen = [group_kernel(group, name) for name in kernels]
    if not chosen:
        raise InputError("device_source: no kernel is left")
    return device_text(chosen, target, real)


def _loops(kernel: Kernel) -> bool:
    from lie_codegen.codegen.tape import tape_of

    return any(statement.op == "CALL" for statement in tape_of(kernel, routines=False).statements)
