"""Values in files: one npz a value, arrays as arrays and the rest as JSON; nothing in it is ever run.

A file holds "header", JSON in UTF-8 with the format's version and the value as nested records, and one entry an array. A
record names its class, which must be a value of this package; a group stands there as its definition.
"""

from __future__ import annotations

import io
import json
from collections.abc import Mapping
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.errors import InputError
from lie_codegen.kernel.records import check_kinds, complete, decoded, encoded
from lie_codegen.values import Value
from lie_codegen.whole_files import write_whole

FORMAT, VERSION = "lie_codegen value", 1


class Saved(Value):
    """A value that can be kept in a file."""

    def save(self, path: str | Path) -> Path:
        """Write it as an npz file that `lc.load` reads; returns the path.

        Raises:
            InputError: it holds something that is no data, as a function written by the user; names it.
            OutputFolderError, SystemRefusalError: the file cannot be written; what was there is untouched.
        """
        return _write(self, path)


def save_definition(thing: Any, path: str | Path, what: str) -> Path:
    """Write a kernel, a library or a compiled function as its definition; returns the path.

    Raises:
        InputError: it has no definition, or one that names a factory of the user's, which `load` would not call.
        OutputFolderError, SystemRefusalError: the file cannot be written; what was there is untouched.
    """
    if thing.definition is None:
        raise InputError(
            f"{what} cannot be saved: a function written by hand is no data; make it by a factory of this package, or pickle it"
        )
    try:
        check_kinds(thing.definition, what)
    except InputError as problem:
        raise InputError(f"{problem} and cannot be saved; pickle it") from None
    return _write(thing, path)


def _write(value: Any, path: str | Path) -> Path:
    arrays: dict[str, Array] = {}
    record = encoded(value, arrays, type(value).__name__)
    header = json.dumps({"format": FORMAT, "version": VERSION, "value": record}, sort_keys=True)
    buffer = io.BytesIO()
    np.savez_compressed(buffer, header=np.frombuffer(header.encode(), dtype=np.uint8), **arrays)  # type: ignore[arg-type]
    return write_whole(path, buffer.getvalue())


def load(path: str | Path) -> Any:
    """The value of a file that `save` wrote; a library is built again, or found in the cache.

    Args:
        path: of the file.

    Raises:
        InputError: no such file, not one of ours, of a later version, or it names something that is no value of this package.
    """
    from zipfile import BadZipFile

    try:
        with np.load(Path(path), allow_pickle=False) as data:
            entries = {name: data[name] for name in data.files}
        header = json.loads(bytes(entries.pop("header")).decode())
    except (OSError, ValueError, KeyError, BadZipFile) as error:
        raise InputError(f"{path} is no file that save() wrote: {error}") from None
    if not isinstance(header, dict) or header.get("format") != FORMAT:
        raise InputError(f"{path} is no file that save() wrote")
    if header.get("version") != VERSION:
        raise InputError(
            f"{path} is of version {header.get('version')!r}; this package reads version {VERSION}: update it"
        )
    return decoded(header["value"], entries, str(path))


def record_of(value: Any) -> Any:
    """A small value as plain JSON data, its arrays in it, from which `value_of` makes it again.

    Raises:
        InputError: it holds what is no data.
    """
    arrays: dict[str, Array] = {}
    return complete(encoded(value, arrays, type(value).__name__), arrays)


def value_of(record: Any) -> Any:
    """The value of a record of `record_of`.

    Raises:
        InputError: it is none.
    """
    return decoded(record, {}, "the record")


def table_text(columns: Mapping[str, Array]) -> str:
    """CSV with a header line; numbers to the last bit."""
    import csv

    out = io.StringIO()
    writer = csv.writer(out, lineterminator="\n")
    writer.writerow(columns)
    writer.writerows([repr(float(entry)) for entry in row] for row in zip(*columns.values(), strict=True))
    return out.getvalue()


def json_value(value: Any) -> Any:
    """A value as plain JSON data for other programs: arrays as lists, complex numbers as [re, im]."""
    if isinstance(value, np.ndarray):
        return json_value(value.tolist())
    if isinstance(value, complex | np.complexfloating):
        return [float(value.real), float(value.imag)]
    if isinstance(value, np.generic):
        return json_value(value.item())
    if isinstance(value, float) and not np.isfinite(value):
        return repr(value)
    if value is None or isinstance(value, str | int | float):
        return value
    if isinstance(value, Enum):
        return value.name
    if isinstance(value, Mapping):
        return {str(key): json_value(each) for key, each in value.items()}
    if isinstance(value, list | tuple):
        return [json_value(each) for each in value]
    name = getattr(value, "name", None)
    return name if isinstance(name, str) else type(value).__name__
