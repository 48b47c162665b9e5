"""lc.group: a group by its catalogue name or from a file."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

from lie_codegen.errors import GroupFileError
from lie_codegen.groups.catalogue_names import group_path
from lie_codegen.groups.group_file import parse_group_file
from lie_codegen.groups.matrix_group import MatrixGroup


def group(name_or_path: str | Path) -> MatrixGroup:
    """The group of a catalogue name such as "so3", or of a group file (a path that ends in .toml).

    Raises:
        UnknownGroupError: no such name; lists those there are.
        GroupFileError, InputError: the file does not describe a group; names file, key and column.
    """
    path = group_path(name_or_path)
    try:
        data = path.read_bytes()
    except OSError as error:
        raise GroupFileError(f"{path}: cannot be read: {error.strerror or error}") from None
    return _parsed(data, str(path))


@lru_cache(maxsize=64)
def _parsed(data: bytes, where: str) -> MatrixGroup:
    return parse_group_file(data, where)
