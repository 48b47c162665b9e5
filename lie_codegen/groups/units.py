"""Units of what acts on a group."""

from __future__ import annotations

from lie_codegen.groups.matrix_group import MatrixGroup


def force_units(group: MatrixGroup) -> str:
    """Units of a body force: N m for angles, N for lengths."""
    return ", ".join({"rad": "N m", "m": "N"}.get(unit, f"J/({unit or '1'})") for unit in group.units)
