"""What NumPy leaves out of an array without an error: masked entries lose their mask, complex numbers their imaginary part."""

from __future__ import annotations

import sys
import warnings
from collections.abc import Collection, Mapping
from typing import Any

#: What holds neither: most arguments are of these classes, and are passed over.
_WITHOUT_MASKS = frozenset({bool, int, float, complex, str, bytes, type(None)})

_ARE_WITHOUT_MASKS = _WITHOUT_MASKS.issuperset

_HOLDERS = (list, tuple, dict)


def would_lose_parts(args: tuple[Any, ...], named: Mapping[str, Any]) -> bool:
    """Whether arguments have masks, which every call of the public interface asks; that imaginary parts are refused is seen to as well.

    Most calls are told by the classes of their arguments, in a quarter of a microsecond.
    """
    filters = warnings.filters
    if not filters or filters[0] is not _entry[0]:
        refuse_lost_parts()
    if _ARE_WITHOUT_MASKS(map(type, args)) and (not named or _ARE_WITHOUT_MASKS(map(type, named.values()))):
        return False
    return has_masks([*args, *named.values()])


def has_masks(values: Collection[Any]) -> bool:
    """Whether one of the values is an array of numpy.ma with masked entries, or a list, a tuple, a mapping or an array of objects (at any
    depth) that holds one.

    numpy drops the mask where numbers are asked for, and what lay below it counts.
    """
    if "numpy.ma" not in sys.modules:  # then nobody can have made one
        return False
    masked, plain = sys.modules["numpy.ma"], sys.modules["numpy"].ndarray
    for value in values:
        kind = type(value)
        if kind in _WITHOUT_MASKS or (kind is plain and not value.dtype.hasobject):
            continue
        if isinstance(value, _HOLDERS):
            if not _ARE_WITHOUT_MASKS(map(type, value.values() if isinstance(value, dict) else value)):
                return _holds_masks(list(values))
        elif _holds_others(value) or isinstance(value, masked.MaskedArray):
            return _holds_masks(list(values))
    return False


def _holds_masks(left: list[Any]) -> bool:
    masked, seen = sys.modules["numpy.ma"], set[int]()
    while left:
        value = left.pop()
        if isinstance(value, masked.MaskedArray):
            if value.mask.any():
                return True
        elif _holds_others(value) and id(value) not in seen:  # a list may hold itself
            seen.add(id(value))
            inner = value.values() if isinstance(value, dict) else getattr(value, "flat", value)
            left.extend(each for each in inner if type(each) not in _WITHOUT_MASKS)
    return False


def _holds_others(value: Any) -> bool:
    return isinstance(value, _HOLDERS) or getattr(getattr(value, "dtype", None), "kind", "") == "O"


_entry: list[Any] = [None]


def refuse_lost_parts() -> None:
    """From here on NumPy's warning that an imaginary part is discarded is an error where a line of ours loses it.

    Reals are asked for in hundreds of places, and a list, an array or a function of the user may bring complex numbers into each; NumPy
    sees all of these. The user's own lines warn as before: the entry among the filters of warnings is for our modules. It is put in front
    again where others came before it, for to ignore warnings is not to agree to other numbers.
    """
    import numpy as np

    # filterwarnings puts an equal entry from behind to the front, so that there is never more than one
    warnings.filterwarnings("error", category=np.exceptions.ComplexWarning, module=r"lie_codegen\b")
    _entry[0] = warnings.filters[0]


def loses_parts(error: BaseException) -> bool:
    """Whether it is that warning, as an error."""
    return type(error).__name__ == "ComplexWarning"
