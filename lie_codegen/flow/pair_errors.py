"""Local errors of two runs of the pair 8(5,3), and what their difference says about the better one."""

from __future__ import annotations

from lie_codegen.flow.pair_system import System

#: The run that is given has local errors so much smaller than the one it is compared with.
RATIO = 16.0
#: By so much its steps are shorter.
SHORTER = RATIO ** (-1 / 8)
#: An interpolated state may err so many times more than a step: once, where the errors of steps add up. The same part of the tolerance for both.
_BETWEEN, _BETWEEN_SHORT = 2.0, 4.0
#: Local errors are not asked for below.
SMALLEST = 1e-15


def local_errors(rtol: float, atol: float, share: float) -> tuple[float, float]:
    """Relative and absolute local errors of that share of the tolerance."""
    return max(rtol * share, SMALLEST), max((atol + rtol) * share, SMALLEST)


def estimate_of(difference: float, left: float, steps: int, coarse: float, free: bool) -> float:
    """The error of the better of two runs.

    It is in proportion to the local tolerance: of two whose tolerances differ by a factor r the better errs by about their difference over
    r - 1. Twice that is reported, for proportion is not exact. Where steps go as they like errors go as the eighth power of these: where
    they hardly became shorter, the tolerances promise too much.
    """
    ratio = min(RATIO, max((steps / coarse) ** 8, 2.0)) if free else RATIO
    return 2 * difference / (ratio - 1) + left


def most_between(system: System) -> float:
    """How many times more than a step a state between steps may err."""
    return _BETWEEN if system.lift is None else _BETWEEN_SHORT
