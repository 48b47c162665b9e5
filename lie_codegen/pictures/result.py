"""What a gallery target returns."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from lie_codegen.errors import InputError, write_refusal
from lie_codegen.pictures.dark import dark
from lie_codegen.pictures.style import require_matplotlib, style
from lie_codegen.whole_files import whole_file, write_whole

#: How a figure is drawn: on white, or on the dark page.
THEMES = ("light", "dark")
#: The formats a figure can be written in; the dates left out, so that equal figures are equal files.
FORMATS: dict[str, dict[str, None]] = {"png": {"Software": None}, "svg": {"Date": None}, "pdf": {"CreationDate": None}}


@dataclass(frozen=True)
class GalleryResult:
    """A reproduced figure.

    Attributes:
        name: the target.
        picture: where the picture lies.
        numbers: what was measured, plain data for JSON.
        figure: the matplotlib Figure, to be drawn on or written again.
    """

    name: str
    picture: Path
    numbers: Mapping[str, Any]
    figure: Any = field(default=None, repr=False, compare=False)

    def write(self, format: str, theme: str = "light") -> Path:
        """The figure once more beside its PNG: "png", or "svg" and "pdf" that stay sharp at any size; NAME.svg, or NAME-dark.svg.

        Raises:
            InputError: any other format or theme.
            OutputFolderError: the folder cannot be written.
        """
        path = self.picture.parent / f"{self.name}{file_ending(format, theme)}"
        with style():
            return write_figure(self.figure if theme == "light" else dark(self.figure), path)


def check_format(format: str) -> str:
    """The format, if it is one.

    Raises:
        InputError: it is none; lists those there are.
    """
    if format not in FORMATS:
        raise InputError(f"no picture format {format!r}; there are {', '.join(FORMATS)}")
    return format


def file_ending(format: str, theme: str) -> str:
    """What follows the name of a figure in that of its file: ".svg", "-dark.png".

    Raises:
        InputError: no such format or theme; lists those there are.
    """
    if theme not in THEMES:
        raise InputError(f"no theme {theme!r} of pictures; there are {', '.join(THEMES)}")
    return f"{'' if theme == 'light' else '-' + theme}.{check_format(format)}"


def write_figure(figure: Any, path: Path) -> Path:
    """The figure in the format of the path's ending."""
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with whole_file(path) as fresh:
            figure.savefig(fresh, dpi=150, metadata=FORMATS[path.suffix[1:].lower()])
    except OSError as error:
        raise write_refusal(f"{path}: cannot be written", error) from None
    return path


def save(name: str, folder: Path, figure: Any, numbers: Mapping[str, Any]) -> GalleryResult:
    """Writes name.png and name.json into the folder.

    Raises:
        OutputFolderError: the folder cannot be written.
    """
    picture = write_figure(figure, folder / f"{name}.png")
    write_whole(folder / f"{name}.json", json.dumps(numbers, indent=2) + "\n")
    return GalleryResult(name, picture, numbers, figure)


def new_figure(width: float, height: float) -> Any:
    """A matplotlib Figure that needs no display, and that a notebook shows.

    Raises:
        MissingDependencyError: without matplotlib.
    """
    require_matplotlib()
    from lie_codegen.pictures.shown_figure import ShownFigure

    return ShownFigure(figsize=(width, height), layout="constrained")
