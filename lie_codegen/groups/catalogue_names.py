"""Where groups come from by name: the catalogue's files and the families; importable without SymPy."""

from __future__ import annotations

import re
from functools import cache
from pathlib import Path

from lie_codegen.errors import GroupFileError, UnknownGroupError

_FOLDER = Path(__file__).parent / "catalogue"

#: kind of family -> the form of its names; the first that matches is taken.
_FAMILIES = {
    "translations": r"r(\d{1,2})",
    "orthogonal": r"so(\d)",
    "pseudo_orthogonal": r"so_?(\d)_?(\d)",
    "euclidean": r"se(\d)",
    "extended_euclidean": r"se_(\d)_(\d)",
    "unitary": r"su(\d)",
    "special_linear": r"sl(\d)",
    "general_linear": r"gl(\d)",
    "symplectic": r"sp(\d{1,2})",
    "heisenberg": r"h(\d{1,2})",
}
#: The name of a group file that comes on standard input.
STANDARD_INPUT = "-"
#: One member of each family, for messages and tests.
FAMILY_EXAMPLES = ("r4", "so5", "so22", "se4", "se_3_3", "su4", "sl4", "gl3", "sp6", "h7")


@cache
def _catalogue() -> dict[str, Path]:
    """The files of the catalogue by name, sorted."""
    return {path.stem: path for path in sorted(_FOLDER.glob("*.toml"), key=lambda path: path.stem)}


@cache
def group_names() -> tuple[str, ...]:
    """The names in the catalogue, sorted; families (so5, su4, ...) are made on demand and not listed."""
    return tuple(_catalogue())


def plain_name(name_or_path: str | Path) -> str:
    """A name as the catalogue writes it: "SO3", "SO(3)" and "so(3)" are "so3", "SE_2(3)" is "se_2_3", "SO(2,2)" is "so22"; paths stay."""
    text = str(name_or_path)
    found = re.fullmatch(r"([A-Za-z]+(?:_\d)?)(?:\((\d+(?:, ?\d+)?)\)|(\d+))", text, re.ASCII)
    if isinstance(name_or_path, Path) or text in group_names() or found is None:
        return text
    letters, sizes = found[1].lower(), re.sub(r"\D", "", found[2] or found[3])
    return f"{letters}_{sizes}" if "_" in letters else letters + sizes


def family_of(name: str) -> tuple[str, tuple[int, ...]] | None:
    """The family and the sizes a name stands for: "sl4" is ("special_linear", (4,)); None if it is no such name."""
    for kind, pattern in _FAMILIES.items():
        match = re.fullmatch(pattern, name, re.ASCII)
        if match:
            return kind, tuple(int(size) for size in match.groups())
    return None


def is_generated(name_or_path: str | Path) -> bool:
    """Whether the group is made from its name alone: a member of a family without a file in the catalogue."""
    text = plain_name(name_or_path)
    return text not in group_names() and family_of(text) is not None


def group_path(name_or_path: str | Path) -> Path:
    """The file of a catalogue name, or the path itself if it names a TOML file.

    Raises:
        UnknownGroupError: if there is neither, with the names there are.
    """
    text = plain_name(name_or_path)
    if text == STANDARD_INPUT:
        return Path("standard input")
    if text in _catalogue():
        return _catalogue()[text]
    path = Path(name_or_path)
    if path.suffix == ".toml":
        return path
    raise UnknownGroupError(
        f"no group {str(name_or_path)!r} in the catalogue ({', '.join(group_names())}) nor in its families "
        f"({', '.join(FAMILY_EXAMPLES)}, and other sizes); a file of your own ends in .toml"
    )


@cache
def _standard_input() -> bytes:
    """The group file that comes on standard input, which can be read once.

    Raises:
        GroupFileError: the process has none.
    """
    import sys

    if sys.stdin is None:
        raise GroupFileError("-: there is no standard input to read a group file from; give the path of one")
    # a notebook or a test may have put a stream of text in its place
    source = getattr(sys.stdin, "buffer", None)
    return bytes(source.read()) if source is not None else sys.stdin.read().encode()


@cache
def _catalogue_file(name: str) -> bytes:
    """A file of the catalogue, which is a part of the package and read once, as its code is."""
    return _catalogue()[name].read_bytes()


def definition_source(name_or_path: str | Path) -> bytes:
    """What determines the group: the bytes of its file, or the name of a member of a family.

    Raises:
        UnknownGroupError: no such name; lists those there are.
        GroupFileError: the file cannot be read.
    """
    if str(name_or_path) == STANDARD_INPUT:
        return _standard_input()
    name = plain_name(name_or_path)
    if is_generated(name_or_path):
        return f"family {name}".encode()
    path = group_path(name_or_path)
    try:
        if name in _catalogue():
            return _catalogue_file(name)
        # A pipe or a device may never end: only files are read.
        if path.exists() and not path.is_file():
            raise GroupFileError(f"{path}: cannot be read: it is not a file; a piped group file is named '-'")
        return path.read_bytes()
    except OSError as error:
        raise GroupFileError(f"{path}: cannot be read: {error.strerror or error}") from None
