"""lc.structure: what the algebra of a group is made of."""

from __future__ import annotations

from lie_codegen.algebra.structure import Structure
from lie_codegen.algebra.structure import structure as algebra_structure
from lie_codegen.groups.catalogue_load import GroupLike, as_group


def structure(group: GroupLike) -> Structure:
    """Killing form, series, centre, radical and Levi subalgebra of the group's algebra; each computed when first read.

    Args:
        group: object, catalogue name or file.

    Raises:
        UnknownGroupError: no such group.
    """
    group = as_group(group, "structure")
    return algebra_structure(group.algebra)
