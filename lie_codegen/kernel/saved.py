"""Values in files: one npz a value, arrays as arrays and the rest as JSON; nothing in it is ever run.

A file holds "header", JSON in UTF-8 with the format's version and the value as nested records, and one entry an array. A
record names its class, which must be a value of this package; a group stands there as its definition.
"""

from __future__ import annotations

import csv
import io
import json
import zipfile
from collections.abc import Mapping
from dataclasses import fields
from enum import Enum
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.errors import InputError
from lie_codegen.kernel.definition import Definition, made_from
from lie_codegen.values import Value

FORMAT, VERSION = "lie_codegen value", 1


class Saved(Value):
    """A value that can be kept in a file."""

    def save(self, path: str | Path) -> Path:
        """Write it as an npz file that `lc.load` reads; returns the path.

        Raises:
            InputError: it holds something that is no data, as a function written by the user; names it.
            OSError: the file cannot be written.
        """
        arrays: dict[str, Array] = {}
        record = _encoded(self, arrays, type(self).__name__)
        header = json.dumps({"format": FORMAT, "version": VERSION, "value": record}, sort_keys=True)
        buffer = io.BytesIO()
        np.savez_compressed(buffer, header=np.frombuffer(header.encode(), dtype=np.uint8), **arrays)  # type: ignore[arg-type]
        target = Path(path)
        target.write_bytes(buffer.getvalue())
        return target


def load(path: str | Path) -> Any:
    """The value of a file that `save` wrote.

    Raises:
        InputError: no such file, not one of ours, of a later version, or it names something that is no value of this package.
    """
    try:
        with np.load(Path(path), allow_pickle=False) as data:
            entries = {name: data[name] for name in data.files}
        header = json.loads(bytes(entries.pop("header")).decode())
    except (OSError, ValueError, KeyError, zipfile.BadZipFile) as error:
        raise InputError(f"{path} is no file that save() wrote: {error}") from None
    if not isinstance(header, dict) or header.get("format") != FORMAT:
        raise InputError(f"{path} is no file that save() wrote")
    if header.get("version") != VERSION:
        raise InputError(
            f"{path} is of version {header.get('version')!r}; this package reads version {VERSION}: update it"
        )
    return _decoded(header["value"], entries, str(path))


def record_of(value: Any) -> Any:
    """A value without arrays as plain JSON data, from which `value_of` makes it again.

    Raises:
        InputError: it holds an array, or what is no data.
    """
    arrays: dict[str, Array] = {}
    record = _encoded(value, arrays, type(value).__name__)
    if arrays:
        raise InputError(f"{type(value).__name__} holds arrays; save it to a file")
    return record


def value_of(record: Any) -> Any:
    """The value of a record of `record_of`.

    Raises:
        InputError: it is none.
    """
    return _decoded(record, {}, "the record")


def table_text(columns: Mapping[str, Array]) -> str:
    """CSV with a header line; numbers to the last bit."""
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


def _encoded(value: Any, arrays: dict[str, Array], where: str) -> Any:
    if type(value) is np.ndarray and value.dtype.kind in "biufc":
        name = f"a{len(arrays)}"
        arrays[name] = value
        return {"array": name}
    if isinstance(value, np.generic):
        return _encoded(value.item(), arrays, where)
    if value is None or isinstance(value, bool | int | str):
        return value
    if isinstance(value, float):
        return {"float": value.hex() if np.isfinite(value) else repr(value)}
    if isinstance(value, complex):
        return {"complex": [_encoded(value.real, arrays, where), _encoded(value.imag, arrays, where)]}
    if isinstance(value, Enum):
        return {"enum": _name_of(type(value)), "member": value.name}
    if isinstance(value, list | tuple):
        inside = [_encoded(each, arrays, f"{where}[{i}]") for i, each in enumerate(value)]
        return {"list" if isinstance(value, list) else "tuple": inside}
    own = getattr(value, "definition", None)
    if isinstance(own, Definition):
        return {"definition": json.loads(own.text)}
    if isinstance(value, Mapping):
        return {"mapping": [[str(k), _encoded(v, arrays, f"{where}[{k!r}]")] for k, v in value.items()]}
    kept = _kept_names(type(value))
    if kept is not None and type(value).__module__.split(".")[0] == "lie_codegen":
        held = {name: _encoded(getattr(value, name), arrays, f"{where}.{name}") for name in kept}
        return {"record": _name_of(type(value)), "fields": held}
    if type(value).__module__.startswith("sympy."):
        return _formula(value, where)
    raise InputError(f"{where} cannot be saved: {type(value).__name__} is no data")


def _kept_names(kind: type) -> tuple[str, ...] | None:
    """What is kept of a value of that class, and what its constructor takes; None where it is no record of data.

    Fields of a dataclass, those left out that follow from the others (metadata: {"derived": True}); an array with more to it
    than its entries lists its attributes in SAVED.
    """
    if hasattr(kind, "__dataclass_fields__"):
        return tuple(field.name for field in fields(kind) if field.init and not field.metadata.get("derived"))
    return getattr(kind, "SAVED", None)


def _formula(value: Any, where: str) -> dict[str, Any]:
    """A SymPy expression in the closed grammar of formulas, its symbols named; one that cannot be written so is refused."""
    symbols = sorted(symbol.name for symbol in getattr(value, "free_symbols", ()))
    record = {"formula": str(value), "symbols": symbols}
    try:
        readable = _read_formula(record) == value
    except InputError:
        readable = False
    if not readable:
        raise InputError(f"{where} cannot be saved: {value!s:.60} is no formula of the closed grammar")
    return record


def _read_formula(record: Mapping[str, Any]) -> Any:
    import sympy as sp

    from lie_codegen.exact.expression import FORMULA_FUNCTIONS, NUMBER_NAMES, parse_expression

    names = {**NUMBER_NAMES, **{str(name): sp.Symbol(str(name), real=True) for name in record["symbols"]}}
    return parse_expression(record["formula"], names, FORMULA_FUNCTIONS)


def _name_of(kind: type) -> str:
    return f"{kind.__module__}:{kind.__qualname__}"


def _decoded(record: Any, arrays: Mapping[str, Array], path: str) -> Any:
    if record is None or isinstance(record, bool | int | str):
        return record
    if not isinstance(record, dict):
        raise InputError(f"{path}: {record!r:.60} is no record")
    try:
        return _record(record, arrays, path)
    except (KeyError, TypeError, ValueError, AttributeError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{path} is damaged: {error}") from None


def _record(record: dict[str, Any], arrays: Mapping[str, Array], path: str) -> Any:
    if "array" in record:
        return arrays[record["array"]]
    if "float" in record:
        text = record["float"]
        return float.fromhex(text) if "0x" in text else float(text)
    if "complex" in record:
        return complex(*(_decoded(part, arrays, path) for part in record["complex"]))
    if "enum" in record:
        return _class_of(record["enum"], path, enum=True)[record["member"]]
    for kind, make in (("list", list), ("tuple", tuple)):
        if kind in record:
            return make(_decoded(each, arrays, path) for each in record[kind])
    if "mapping" in record:
        return {key: _decoded(each, arrays, path) for key, each in record["mapping"]}
    if "definition" in record:
        check_kinds(record["definition"], path)
        return made_from(record["definition"])
    if "formula" in record:
        return _read_formula(record)
    made = _class_of(record["record"], path, enum=False)
    unknown = sorted(set(record["fields"]) - set(_kept_names(made) or ()))
    if unknown:
        raise InputError(f"{path}: a {made.__name__} has no {', '.join(unknown)}; was it written by a later version?")
    held = {name: _decoded(each, arrays, path) for name, each in record["fields"].items()}
    # a value whose derived fields the constructor does not find by itself says how it is made again
    return getattr(made, "restored", made)(**held)


def _class_of(name: str, path: str, *, enum: bool) -> Any:
    """A class of this package that holds data; nothing else is imported, let alone called."""
    module, _, attribute = str(name).partition(":")
    if module.split(".")[0] != "lie_codegen":
        raise InputError(f"{path} names {name!r}, which is no value of this package")
    try:
        found = getattr(import_module(module), attribute)
    except (ImportError, AttributeError):
        raise InputError(f"{path} names {name!r}, which this version does not have") from None
    fits = isinstance(found, type) and (issubclass(found, Enum) if enum else _kept_names(found) is not None)
    if not fits:
        raise InputError(f"{path} names {name!r}, which is no value of this package")
    return found


def check_kinds(definition: Any, path: str) -> None:
    """Every factory that a definition names is one of this package."""
    if isinstance(definition, Mapping):
        kind = definition.get("kind")
        # the mappings that `made_from` takes for definitions; another may well have a key "parameters"
        named = {"kind", "parameters"} <= definition.keys() <= {"kind", "parameters", "units", "member"}
        if named and not str(kind).startswith("lie_codegen."):
            raise InputError(f"{path} names {kind!r}, which is no value of this package")
        for each in definition.values():
            check_kinds(each, path)
    elif isinstance(definition, list | tuple):
        for each in definition:
            check_kinds(each, path)
