"""The compiled integrators of a group, built once a process."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING

from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.runtime.build import build_kernels
from lie_codegen.runtime.library import Library

if TYPE_CHECKING:
    from lie_codegen.kernels.kernel import Kernel


@lru_cache(maxsize=32)
def integrators(group: MatrixGroup) -> Library:
    """rkmk4_step, wei_norman_step, wei_norman_matrix and product_exp of the group, compiled."""

    def kernels() -> list[Kernel]:
        from lie_codegen.kernels.group_kernels import group_kernel
        from lie_codegen.kernels.rkmk import rkmk4_step, wei_norman_step

        named = [group_kernel(group, name) for name in ("wei_norman_matrix", "product_exp")]
        return [rkmk4_step(group), wei_norman_step(group), *named]

    return build_kernels(kernels, namespace=group.name, definition=f"integrators\n{group.definition}")
