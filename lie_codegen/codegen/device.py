"""Kernels as CUDA or OpenCL text: one thread a sample, the same straight-line program as the scalar C.

void <symbol>_batch(count, in_1, stride_1, ..., out_1, ...)     strides in reals from sample to sample, 0 to repeat one
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from lie_codegen.codegen.opcodes import C99, C99_FLOAT, C99_FORMS, Target, c_float_literal
from lie_codegen.codegen.tape import Tape, tape_of
from lie_codegen.codegen.templates import render
from lie_codegen.codegen.views import KernelView, PortView, kernel_view
from lie_codegen.errors import CodegenError, InputError
from lie_codegen.kernel.kernel import Kernel


@dataclass(frozen=True)
class Dialect:
    """How a language says that a function is run by threads.

    Attributes:
        function: what stands before a kernel.
        memory: what stands before a pointer to memory of the device.
        restricted: the word for pointers that do not overlap.
        thread: the number of the thread.
        header: lines before the kernels.
        targets: real -> how the straight line is printed.
    """

    function: str
    memory: str
    restricted: str
    thread: str
    header: Mapping[str, tuple[str, ...]]
    targets: Mapping[str, Target]


#: OpenCL's functions are one name for both precisions.
_OPENCL_FLOAT = Target(
    "float", {op: re.sub(r"(\d\.\d)", r"\1f", form).replace("(double)", "(float)") for op, form in C99_FORMS.items()}, c_float_literal
)  # fmt: skip
DIALECTS: Mapping[str, Dialect] = {
    "opencl": Dialect(
        "__kernel void", "__global ", "restrict", "get_global_id(0)",
        {"double": ("#pragma OPENCL EXTENSION cl_khr_fp64 : enable", "#pragma OPENCL FP_CONTRACT OFF"), "float": ("#pragma OPENCL FP_CONTRACT OFF",)},
        {"double": C99, "float": _OPENCL_FLOAT},
    ),
    "cuda": Dialect(
        'extern "C" __global__ void', "", "__restrict__", "blockIdx.x * (long)blockDim.x + threadIdx.x",
        {"double": (), "float": ()}, {"double": C99, "float": C99_FLOAT},
    ),
}  # fmt: skip


@dataclass(frozen=True)
class DevicePort:
    """An argument: the whole array, and in the body the thread's own sample."""

    view: PortView
    array: str
    stride: str


@dataclass(frozen=True)
class DeviceKernel:
    """One kernel with the names that its template needs beside its own."""

    view: KernelView
    inputs: tuple[DevicePort, ...]
    outputs: tuple[DevicePort, ...]
    count: str
    thread: str


def device_text(kernels: Sequence[Kernel], target: str, real: str) -> str:
    """The text of one file.

    Raises:
        InputError: no such target or real.
        CodegenError: a kernel calls a routine with loops, or two kernels have one symbol.
    """
    dialect = DIALECTS.get(target)
    if dialect is None:
        raise InputError(f"device_source: target is one of {', '.join(DIALECTS)}, given {target!r}")
    if real not in dialect.targets:
        raise InputError(f"device_source: real is one of {', '.join(dialect.targets)}, given {real!r}")
    symbols = [kernel.symbol for kernel in kernels]
    repeated = sorted({symbol for symbol in symbols if symbols.count(symbol) > 1})
    if repeated:
        raise CodegenError(f"device_source: two kernels have the symbol {repeated[0]}; give one a name of its own")
    views = [_named(kernel_view(kernel, _tape(kernel), dialect.targets[real])) for kernel in kernels]
    return render(
        "device.jinja", kernels=views, dialect=dialect, type=real, header=dialect.header[real], language=target
    )


def _tape(kernel: Kernel) -> Tape:
    tape = tape_of(kernel, routines=False)
    if any(statement.op == "CALL" for statement in tape.statements):
        raise CodegenError(
            f"{kernel.symbol} calls a routine with loops, which runs on the processor alone; leave it out of device_source"
        )
    return tape


def _named(view: KernelView) -> DeviceKernel:
    """Names for what the body does not know: the whole arrays, strides, the count and the thread."""
    # Inputs that C takes by value are read into a local of their name; a pointer's name is its sample.
    taken = {port.parameter for port in (*view.inputs, *view.outputs)} | {each.name for each in view.statements}

    def fresh(name: str) -> str:
        while name in taken:
            name += "_"
        taken.add(name)
        return name

    inputs = tuple(DevicePort(p, fresh(f"{p.parameter}_all"), fresh(f"{p.parameter}_stride")) for p in view.inputs)
    outputs = tuple(DevicePort(p, fresh(f"{p.parameter}_all"), "") for p in view.outputs)
    return DeviceKernel(replace(view, unused=()), inputs, outputs, fresh("count"), fresh("thread"))
