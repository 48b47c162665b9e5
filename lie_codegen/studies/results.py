"""What a call gives back to a study, before anything is taken from it."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from lie_codegen.errors import InputError
from lie_codegen.groups.matrix_group import MatrixGroup


@dataclass(frozen=True)
class Single:
    """A result of one sample."""

    result: Any


@dataclass(frozen=True)
class Of:
    """A result of many samples, and the group that they live on."""

    group: MatrixGroup
    result: Any


@dataclass(frozen=True)
class Each:
    """A function that takes one sample by the names of its inputs."""

    function: Callable[..., Any]

    @property
    def __name__(self) -> str:
        return getattr(self.function, "__name__", "function")

    def __call__(self, *arguments: Any, **inputs: Any) -> Any:
        return self.function(*arguments, **inputs)


def each(function: Callable[..., Any]) -> Callable[..., Any]:
    """A function of one sample, for a study.

    Args:
        function: takes the inputs by name and returns a number, an array, a result or a dict of them.

    Raises:
        InputError: what cannot be called.
    """
    if not callable(function):
        raise InputError(f"studies.each takes a function, got {function!r:.60}")
    return Each(function)
