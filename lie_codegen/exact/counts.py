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
