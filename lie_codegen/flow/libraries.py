"""The compiled integrators of a group, built once a process."""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, Any

from lie_codegen.errors import InputError
from lie_codegen.flow.simulate_arguments import FOURTH_ORDER
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.runtime.build import build_kernels
from lie_codegen.runtime.call import Compiled
from lie_codegen.runtime.library import Library

if TYPE_CHECKING:
    from lie_codegen.kernel.kernel import Kernel


@lru_cache(maxsize=32)
def integrators(group: MatrixGroup) -> Library:
    """rkmk4_step, wei_norman_step, wei_norman_matrix and product_exp of the group, compiled."""

    def kernels() -> list[Kernel]:
        from lie_codegen.groups.kernels import group_kernel
        from lie_codegen.groups.maps.rkmk import rkmk4_step, wei_norman_step

        named = [group_kernel(group, name) for name in ("wei_norman_matrix", "product_exp")]
        return [rkmk4_step(group), wei_norman_step(group), *named]

    return build_kernels(kernels, namespace=group.name, definition=f"integrators\n{group.definition_text}")


def step_of(group: MatrixGroup, method: str) -> Compiled[Any]:
    """The compiled step (X, u0, um, u1, h) -> X_next of a method.

    Raises:
        InputError: no such method.
    """
    if method not in FOURTH_ORDER:
        raise InputError(f"simulate({group.name}): method is one of {', '.join(FOURTH_ORDER)}; given {method!r}")
    return integrators(group).rkmk4_step if method == "rkmk4" else _commutator_free(group).commutator_free_step


@lru_cache(maxsize=32)
def _commutator_free(group: MatrixGroup) -> Library:
    def kernels() -> list[Kernel]:
        from lie_codegen.groups.maps.commutator_free import commutator_free_step

        return [commutator_free_step(group)]

    return build_kernels(kernels, namespace=group.name, definition=f"commutator_free\n{group.definition_text}")
