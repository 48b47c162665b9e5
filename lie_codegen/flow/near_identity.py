"""An arithmetic for maps of small arguments: a choice by size is made once, when the formula is written, not at every call."""

from __future__ import annotations

from typing import Any

from lie_codegen.kernel.arithmetic import Arithmetic, Scalar


class NearIdentity:
    """The arithmetic beneath, but that whatever is compared with a positive number is below it, as it is at 0.

    For exp(Theta) with |Theta| within the reach of a step: its closed form takes series below a switch, sines and cosines above,
    and evaluates both. Here the series are all that is written.
    """

    def __init__(self, ops: Arithmetic) -> None:
        self._ops = ops

    def __getattr__(self, name: str) -> Any:
        return getattr(self._ops, name)

    def less(self, a: Scalar, b: Scalar) -> Any:
        """True for a positive number b."""
        return True if isinstance(b, int) and b > 0 else self._ops.less(a, b)

    def where(self, condition: Any, then: Scalar, otherwise: Scalar) -> Scalar:
        """One of them, where it is known which."""
        return then if condition is True else self._ops.where(condition, then, otherwise)
