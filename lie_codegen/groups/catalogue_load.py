"""lc.group: a group by its catalogue name, by the name of a family's member, or from a file."""

from __future__ import annotations

from functools import lru_cache
from pathlib import Path

from lie_codegen.algebra.lie_algebra import LieAlgebra
from lie_codegen.errors import UnknownGroupError
from lie_codegen.groups.catalogue_names import definition_source, group_path, is_generated, plain_name
from lie_codegen.groups.matrix_group import MatrixGroup, require_group
from lie_codegen.groups.recorded import recorded

#: What every function takes in the place of a group: the group, its name, or its file.
GroupLike = MatrixGroup | str | Path


def group(name_or_path: GroupLike) -> MatrixGroup:
    """The group of a name or a file; a group is returned as it is.

    Args:
        name_or_path: a catalogue name such as "so3" (or "SO(3)"), of a family such as "sl4", a group file (.toml), or a `MatrixGroup`.

    Raises:
        UnknownGroupError: no such name; lists those there are.
        GroupFileError, InputError: the file does not describe a group; names file, key and column.
    """
    if isinstance(name_or_path, MatrixGroup):
        return name_or_path
    if not isinstance(name_or_path, str | Path):
        raise UnknownGroupError(f"expected the name of a group or the path of a group file, got {name_or_path!r}")
    return group_of_source(name_or_path, definition_source(name_or_path))


def as_group(value: GroupLike, where: str = "") -> MatrixGroup:
    """The group itself, or that of a name or a file: what every function takes in the place of a group.

    Args:
        value: the group, its name or its file.
        where: the function that was called, for its message.

    Raises:
        InputError: it is none of these.
        UnknownGroupError, GroupFileError: as `group`.
    """
    if isinstance(value, str | Path):
        return group(value)
    return require_group(value, where) if where else group(value)


def as_algebra(value: GroupLike | LieAlgebra, where: str) -> LieAlgebra:
    """The algebra itself, or that of a group, of its name or of its file.

    Raises:
        InputError: as `as_group`.
    """
    return value if isinstance(value, LieAlgebra) else as_group(value, where).algebra


def group_of_source(name_or_path: str | Path, source: bytes) -> MatrixGroup:
    """The group whose `definition_source` was read before, whatever the file holds now.

    Raises:
        GroupFileError, InputError: as `group`.
    """
    if is_generated(name_or_path):
        return _generated(plain_name(name_or_path))
    return _parsed(source, str(group_path(name_or_path)))


@lru_cache(maxsize=64)
def _parsed(data: bytes, where: str) -> MatrixGroup:
    def made() -> MatrixGroup:
        # what reads files is imported for a group that no record holds
        from lie_codegen.groups.group_file import parse_group_file

        return parse_group_file(data, where)

    return recorded(["file", data.decode("utf-8", errors="replace")], made)


@lru_cache(maxsize=64)
def _generated(name: str) -> MatrixGroup:
    def made() -> MatrixGroup:
        from lie_codegen.groups.families import family

        return family(name)

    return recorded(["family", name], made)
