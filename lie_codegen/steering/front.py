"""lc.steer: one front door to every steering method."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

from numpy.typing import ArrayLike

from lie_codegen.errors import SteeringInputError
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.steering.four_phase import four_phase
from lie_codegen.steering.optimal import optimal
from lie_codegen.steering.plan import Plan
from lie_codegen.steering.task import make_task

_METHODS: Mapping[str, Callable[..., Plan]] = {"four_phase": four_phase, "optimal": optimal}


def steer(
    group: MatrixGroup,
    target: ArrayLike,
    controls: Sequence[str | int],
    duration: float,
    method: str = "optimal",
    *,
    tolerance: float = 1e-6,
    **options: Any,
) -> Plan:
    """Controls that take X' = X sum_i u_i A_i from the identity to the target.

    Args:
        group: the group.
        target: (d, d) group element, or (n,) coordinates of the second kind.
        controls: labels (or positions) of the actuated basis elements.
        duration: seconds.
        method: "four_phase" (closed form, section 5.2 of the paper) or "optimal" (minimum energy).
        tolerance: endpoint error |log(target^-1 X)| below which the plan counts as solved.
        **options: of the method: q for "four_phase"; intervals, starts, progress for "optimal".

    Raises:
        UncontrollableError: with the growth vector and the missing directions.
        SteeringInputError: an unknown method or option, or a task the method cannot do.
        ShapeError, NotFiniteError, NotOnGroupError: about the target.
        SteeringError: the solver found nothing admissible; says what was tried.
    """
    solver = _METHODS.get(method)
    if solver is None:
        raise SteeringInputError(f"no method {method!r}; there are {', '.join(sorted(_METHODS))}")
    known = (solver.__kwdefaults__ or {}).keys()
    unknown = sorted(set(options) - known)
    if unknown:
        raise SteeringInputError(f"{method} has no option {', '.join(unknown)}; it has {', '.join(known) or 'none'}")
    return solver(make_task(group, target, controls, duration, tolerance), **options)
