"""A kernel without the entries of its results that are the same for all inputs, as the last row of a rigid motion: less is written."""

from __future__ import annotations

from dataclasses import replace
from math import prod
from typing import Any

from lie_codegen.codegen.tape import tape_of
from lie_codegen.kernel.arithmetic import Arithmetic
from lie_codegen.kernel.definition import kernel_factory
from lie_codegen.kernel.kernel import Kernel, Port

#: For each output, the flat places of its entries that vary; a complex entry is one.
Places = tuple[tuple[int, ...], ...]


def varying_places(kernel: Kernel) -> tuple[Places, tuple[tuple[complex, ...], ...]]:
    """The entries that vary, and the values of all: of those that vary, 0. An output that never varies is kept whole.

    Raises:
        CodegenError: the kernel cannot become C.
    """
    tape = tape_of(kernel)
    places, values = [], []
    for port, entries in zip(kernel.outputs, tape.outputs, strict=True):
        parts = 2 if port.is_complex else 1
        made = [[tape.statements[index] for index in entries[k : k + parts]] for k in range(0, len(entries), parts)]
        varies = [any(each.op != "CONST" for each in entry) for entry in made]
        found = [k for k, value in enumerate(varies) if value]
        places.append(tuple(found or range(len(made))))
        values.append(tuple(0j if v else complex(*[s.value for s in e]) for v, e in zip(varies, made, strict=True)))
    return tuple(places), tuple(values)


@kernel_factory()
def varying(kernel: Kernel) -> Kernel:
    """The kernel with every matrix or vector replaced by its entries that vary, (m,) in C order.

    Raises:
        CodegenError: the kernel cannot become C.
    """
    places, _ = varying_places(kernel)

    def port(each: Port, kept: tuple[int, ...]) -> Port:
        return each if _is_whole(each, kept) else replace(each, shape=(len(kept),))

    def body(ops: Arithmetic, *arguments: Any) -> tuple[Any, ...]:
        found = kernel.evaluate(ops, *arguments)
        return tuple(_entries(p, k, value) for p, k, value in zip(kernel.outputs, places, found, strict=True))

    return Kernel(
        name=f"{kernel.name}_varying",
        namespace=kernel.namespace,
        inputs=kernel.inputs,
        outputs=tuple(port(each, kept) for each, kept in zip(kernel.outputs, places, strict=True)),
        body=body,
        formula=f"the entries that vary of: {kernel.formula}",
        source=kernel.source,
        sampler=kernel.sample,
    )


def _is_whole(port: Port, kept: tuple[int, ...]) -> bool:
    return len(kept) == prod(port.shape)


def _entries(port: Port, kept: tuple[int, ...], value: Any) -> Any:
    if _is_whole(port, kept):
        return value
    if len(port.shape) == 1:
        return [value[k] for k in kept]
    columns = port.shape[1]
    return [value[k // columns][k % columns] for k in kept]
