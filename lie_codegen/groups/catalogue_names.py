"""Where the catalogue's group files are; importable without SymPy."""

from __future__ import annotations

from functools import cache
from pathlib import Path

from lie_codegen.errors import UnknownGroupError

_FOLDER = Path(__file__).parent / "catalogue"


@cache
def group_names() -> tuple[str, ...]:
    """The names in the catalogue, sorted."""
    return tuple(sorted(path.stem for path in _FOLDER.glob("*.toml")))


def group_path(name_or_path: str | Path) -> Path:
    """The file of a catalogue name, or the path itself if it names a TOML file.

    Raises:
        UnknownGroupError: if there is neither, with the names there are.
    """
    text = str(name_or_path)
    if text in group_names():
        return _FOLDER / f"{text}.toml"
    path = Path(name_or_path)
    if path.suffix == ".toml":
        return path
    raise UnknownGroupError(
        f"no group {text!r} in the catalogue ({', '.join(group_names())}); a file of your own ends in .toml"
    )
