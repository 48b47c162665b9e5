"""The gallery targets by name; a target's module is imported when it is run."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any

from lie_codegen.errors import InputError
from lie_codegen.gallery.result import GalleryResult


@dataclass(frozen=True)
class Target:
    """A figure that `lie-codegen reproduce NAME` makes."""

    name: str
    module: str
    about: str


TARGETS = (Target("satellite", "lie_codegen.gallery.satellite", "TR 93-59, Figures 2 and 3: two-wheel satellite"),)


def target(name: str) -> Target:
    """The target of that name.

    Raises:
        InputError: if there is none; lists those there are.
    """
    for candidate in TARGETS:
        if candidate.name == name:
            return candidate
    raise InputError(f"no figure {name!r}; there are {', '.join(each.name for each in TARGETS)}")


def reproduce(name: str, folder: Path, progress: Callable[[str], None]) -> GalleryResult:
    """Runs a target; its picture and numbers are written to the folder."""
    chosen = target(name)
    function: Any = getattr(import_module(chosen.module), name)
    result: GalleryResult = function(folder, progress)
    return result
