"""Kernels under another prefix, so that two sets of them go into one program."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from lie_codegen.kernel.definition import kernel_factory
from lie_codegen.kernel.kernel import Kernel


def in_namespace(kernels: Sequence[Kernel], name: str | None) -> tuple[Kernel, ...]:
    """The same kernels with symbols that begin with `name`; as they are if None.

    Raises:
        IdentifierError: it is no C identifier.
    """
    return tuple(kernels) if name is None else tuple(with_namespace(kernel, name) for kernel in kernels)


@kernel_factory()
def with_namespace(kernel: Kernel, namespace: str) -> Kernel:
    """The same kernel in another namespace; C routines that it shares with other kernels keep their names."""
    return replace(kernel, namespace=namespace)
