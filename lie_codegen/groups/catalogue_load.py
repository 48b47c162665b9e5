"""lc.group: a group by its catalogue name, by the name of a family's member, or from a file."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

from lie_codegen.errors import UnknownGroupError
from lie_codegen.groups.catalogue_names import definition_source, group_path, is_generated
from lie_codegen.groups.families import family
from lie_codegen.groups.group_file import parse_group_file
from lie_codegen.groups.matrix_group import MatrixGroup


def group(name_or_path: str | Path) -> MatrixGroup:
    """The group of a catalogue name such as "so3", of a family such as "sl4", or of a group file (.toml).

    Raises:
        UnknownGroupError: no such name; lists those there are.
        GroupFileError, InputError: the file does not describe a group; names file, key and column.
    """
    if not isinstance(name_or_path, str | Path):
        raise UnknownGroupError(f"expected the name of a group or the path of a group file, got {name_or_path!r}")
    return group_of_source(name_or_path, definition_source(name_or_path))


def as_group(value: MatrixGroup | str | Path) -> MatrixGroup:
    """The group itself, or that of a name or a file: what every function takes in the place of a group.

    Raises:
        UnknownGroupError, GroupFileError, InputError: as `group`.
    """
    return value if isinstance(value, MatrixGroup) else group(value)


def group_of_source(name_or_path: str | Path, source: bytes) -> MatrixGroup:
    """The group whose `definition_source` was read before, whatever the file holds now.

    Raises:
        GroupFileError, InputError: as `group`.
    """
    if is_generated(name_or_path):
        return _generated(str(name_or_path))
    return _parsed(source, str(group_path(name_or_path)))


@lru_cache(maxsize=64)
def _parsed(data: bytes, where: str) -> MatrixGroup:
    return parse_group_file(data, where)


@lru_cache(maxsize=64)
def _generated(name: str) -> MatrixGroup:
    return family(name)
