"""What a user claims of an error function is looked at before it is used: phi >= 0, and the constant L."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from lie_codegen.control.critical_points import CriticalPoints, check_positive, found_points
from lie_codegen.control.descent import place
from lie_codegen.control.error_function import ErrorFunction
from lie_codegen.control.error_inputs import at_numbers
from lie_codegen.control.error_samples import error_samples
from lie_codegen.errors import InputError

#: A claimed constant may exceed L by this much, relative to it: rounding of the one who computed it.
_SLACK = 1e-9


def is_claimed(pair: ErrorFunction) -> bool:
    """Whether a user wrote the pair; those of the catalogue are positive, and their constants known, by their construction."""
    definition = getattr(pair, "definition", None)
    return definition is None or not str(definition["kind"]).endswith(":catalogue_error")


@lru_cache(maxsize=64)
def check_claims(pair: ErrorFunction) -> None:
    """Refuses a pair whose phi is negative somewhere or whose constant is above L.

    Raises:
        InputError: naming the place and the value.
    """
    if not is_claimed(pair):
        return
    if pair.constant is None:
        pair = at_numbers(pair)
        check_positive(pair, error_samples(pair), np.random.default_rng(0))
    else:
        check_constant(pair)


def check_constant(pair: ErrorFunction) -> CriticalPoints:
    """The critical points, by which the claimed constant is valid.

    Raises:
        InputError: phi is negative somewhere, phi is not proper, or the constant is above L; names the place.
    """
    claimed = pair.constant
    if claimed is None:
        return found_points(pair)
    try:
        found = found_points(pair)
    except InputError as problem:
        raise InputError(f"constant = {claimed:g} is not valid: {problem}") from None
    if found.L is None:
        raise InputError(
            f"error function {pair.name} on {pair.group.name}: constant = {claimed:g} is not valid: phi stays bounded on the way to "
            "infinity, so no level keeps a state near the reference"
        )
    if claimed > found.L * (1 + _SLACK):
        point = found[1]
        raise InputError(
            f"error function {pair.name} on {pair.group.name}: constant = {claimed:g} is not valid: d phi = 0 with "
            f"phi = {point.value:.6g} at {place(pair.group, point.X)}"
        )
    return found
