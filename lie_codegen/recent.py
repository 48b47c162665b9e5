"""What was found last: a few values by their keys, the oldest of which goes when there are too many."""

from __future__ import annotations

from collections.abc import Hashable
from typing import Generic, TypeVar

T = TypeVar("T")


class Recent(Generic[T]):
    """Values by keys, where `functools.lru_cache` will not do: what is kept is not always a function of the key alone.

    Args:
        most: values that are kept.
    """

    def __init__(self, most: int) -> None:
        self._most = most
        self._kept: dict[Hashable, T] = {}

    def get(self, key: Hashable) -> T | None:
        """The value that was kept; None where there is none."""
        return self._kept.get(key)

    def keep(self, key: Hashable, value: T) -> None:
        """Keep a value for those who ask with this key."""
        while len(self._kept) >= self._most:
            self._kept.pop(next(iter(self._kept)), None)  # another thread may have been quicker
        self._kept[key] = value
