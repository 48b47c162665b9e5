"""When lc.steer takes the direct method: asked for by name, or by what no other method can do, or where it is the surer."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from lie_codegen.errors import SteeringInputError
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.steering.direct.method import direct
from lie_codegen.steering.plan import Plan


def direct_plan(
    group: MatrixGroup,
    target: Any,
    controls: Sequence[Any],
    duration: float,
    tolerance: float,
    options: Mapping[str, Any],
) -> Plan:
    """The plan of the direct method.

    Raises:
        SteeringInputError: an option it does not have.
        Others as `direct`.
    """
    known = direct_options()
    unknown = sorted(set(options) - known)
    if unknown:
        raise SteeringInputError(f"direct has no option {', '.join(unknown)}; it has {', '.join(sorted(known))}")
    return direct(group, target, controls, duration, tolerance=tolerance, **options)


def direct_options() -> set[str]:
    """Names of the options that the direct method has."""
    return set(direct.__kwdefaults__ or {}) - {"tolerance"}
