"""How often: the number of levels, derivatives or steps that a caller asks for, checked before any work."""

from __future__ import annotations

from typing import Any

import numpy as np

from lie_codegen.errors import InputError
from lie_codegen.identifiers import shown


def count_between(value: Any, least: int, most: int, what: str) -> int:
    """The value as an int.

    Args:
        value: an integer of Python or NumPy; a bool is none.
        least, most: both allowed.
        what: the function and its parameter, for the message.

    Raises:
        InputError: it is no integer, or out of range.
    """
    if isinstance(value, bool) or not isinstance(value, int | np.integer) or not least <= value <= most:
        raise InputError(f"{what} is an integer from {least} to {most}, given {shown(value)}")
    return int(value)


def whole_seed(seed: Any, what: str) -> int:
    """The seed as an int.

    Raises:
        InputError: it is no integer from 0 to 2^64 - 1. NumPy takes more, and reads a list that holds itself until the stack ends.
    """
    return count_between(seed, 0, 2**64 - 1, f"{what}: seed")


def seeded(seed: Any, what: str) -> np.random.Generator:
    """NumPy's generator of a seed; the same numbers for the same seed.

    Raises:
        InputError: as `whole_seed`.
    """
    return np.random.default_rng(whole_seed(seed, what))
