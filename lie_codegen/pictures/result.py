"""What a gallery target returns."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lie_codegen.errors import MissingDependencyError, OutputFolderError


@dataclass(frozen=True)
class GalleryResult:
    """A reproduced figure.

    Attributes:
        name: the target.
        picture: where the picture lies.
        numbers: what was measured, plain data for JSON.
    """

    name: str
    picture: Path
    numbers: Mapping[str, Any]


def save(name: str, folder: Path, figure: Any, numbers: Mapping[str, Any]) -> GalleryResult:
    """Writes name.png and name.json into the folder.

    Raises:
        OutputFolderError: the folder cannot be written.
    """
    picture = folder / f"{name}.png"
    try:
        folder.mkdir(parents=True, exist_ok=True)
        figure.savefig(picture, dpi=150, metadata={"Software": None})
        (folder / f"{name}.json").write_text(json.dumps(numbers, indent=2) + "\n", encoding="utf-8")
    except OSError as error:
        raise OutputFolderError(f"{folder}: cannot be written: {error.strerror or error}") from None
    return GalleryResult(name, picture, numbers)


def new_figure(width: float, height: float) -> Any:
    """A matplotlib Figure that needs no display.

    Raises:
        MissingDependencyError: without matplotlib.
    """
    try:
        from matplotlib.figure import Figure
    except ImportError:
        raise MissingDependencyError(
            "pictures need matplotlib: install lie_codegen with its extra, lie_codegen[plot]"
        ) from None
    return Figure(figsize=(width, height), layout="constrained")
