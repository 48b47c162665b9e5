"""lc.controllability: the growth report of a group's controls."""

from __future__ import annotations

from collections.abc import Sequence

from lie_codegen.algebra.controllability import Controllability
from lie_codegen.algebra.controllability import controllability as algebra_controllability
from lie_codegen.groups.catalogue_load import GroupLike, as_group


def controllability(group: GroupLike, controls: Sequence[str | int]) -> Controllability:
    """Whether X' = X sum u_i A_i over the given controls reaches every X, with the growth vector; exact.

    Args:
        group: object, catalogue name or file.
        controls: labels or positions of the actuated basis elements.

    Raises:
        InputError: an unknown or repeated control, or none.
    """
    group = as_group(group, "controllability")
    return algebra_controllability(group.algebra, controls)
