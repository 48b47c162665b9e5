"""Values of this package as plain records, and back; nothing in a record is ever run.

A record names its class, which must be a value of this package, and holds its fields: numbers to the last bit, arrays beside
it or in it, formulas of SymPy as text in the closed grammar; what a factory made stands there as its definition.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import fields
from enum import Enum
from importlib import import_module
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.errors import InputError
from lie_codegen.kernel.formula_records import formula_record, read_formula
from lie_codegen.kernel.plain_data import Definition, NoDefinitionError, made_from, makes_records


def record_definition(value: Any) -> Definition:
    """A value of this package that no factory made, as a definition: its fields, every number to the last bit.

    Raises:
        NoDefinitionError: it holds something that is no data; names it.
    """
    arrays: dict[str, Array] = {}
    try:
        record = encoded(value, arrays, type(value).__name__)
    except InputError as problem:
        raise NoDefinitionError(str(problem)) from None
    return Definition({"kind": RECORD, "parameters": Definition({"record": complete(record, arrays)})})


@makes_records
def defined_record(record: Mapping[str, Any]) -> Any:
    """The value that `record_definition` describes."""
    return decoded(record, {}, "a definition")


#: `made_from` leaves a record to it as it stands: a field of a record may be named as a definition's are.
defined_record.__reads_plain_data__ = True  # type: ignore[attr-defined]
RECORD = f"{__name__}:{defined_record.__name__}"


def complete(record: Any, arrays: Mapping[str, Array]) -> Any:
    """A record as it stands in a definition: it cannot be changed, and the arrays that `encoded` put beside it are in it."""
    if isinstance(record, list):
        return tuple(complete(each, arrays) for each in record)
    if not isinstance(record, dict):
        return record
    if record.keys() == {"array"}:
        return Definition({"array": _written(arrays[record["array"]])})
    return Definition({key: complete(each, arrays) for key, each in record.items()})


def _written(array: Array) -> Definition:
    """An array with its entries row by row; a complex one as its real and imaginary parts in turn."""
    entries = array.ravel().tolist()
    if array.dtype.kind == "c":
        entries = [part for entry in entries for part in (entry.real, entry.imag)]
    kept = tuple(each.hex() if isinstance(each, float) else each for each in entries)
    return Definition({"type": array.dtype.str, "shape": array.shape, "entries": kept})


def _array(written: Mapping[str, Any]) -> Array:
    kind = np.dtype(written["type"])
    entries = [float.fromhex(each) if isinstance(each, str) else each for each in written["entries"]]
    parts = np.array(entries, dtype=float if kind.kind == "c" else kind)
    return (parts.view(complex) if kind.kind == "c" else parts).astype(kind).reshape(tuple(written["shape"]))


def encoded(value: Any, arrays: dict[str, Array], where: str) -> Any:
    """A value as JSON data whose arrays are put beside it, named.

    Args:
        value: numbers, texts, arrays, formulas, containers and values of this package.
        arrays: receives the arrays.
        where: what it is, for the message.

    Raises:
        InputError: it holds something that is no data; names it.
    """
    if type(value) is np.ndarray and value.dtype.kind in "biufc":
        name = f"a{len(arrays)}"
        arrays[name] = value
        return {"array": name}
    if isinstance(value, np.generic):
        return encoded(value.item(), arrays, where)
    if value is None or isinstance(value, bool | int | str):
        return value
    if isinstance(value, float):
        return {"float": value.hex() if np.isfinite(value) else repr(value)}
    if isinstance(value, complex):
        return {"complex": [encoded(value.real, arrays, where), encoded(value.imag, arrays, where)]}
    if isinstance(value, Enum):
        return {"enum": _name_of(type(value)), "member": value.name}
    if isinstance(value, list | tuple):
        inside = [encoded(each, arrays, f"{where}[{i}]") for i, each in enumerate(value)]
        return {"list" if isinstance(value, list) else "tuple": inside}
    own = getattr(value, "definition", None)
    if isinstance(own, Definition):
        return {"definition": json.loads(own.text)}
    if isinstance(value, Mapping):
        # a text stands for itself, another key (the frequencies of a series are tuples) as a value of its own
        keys = [k if isinstance(k, str) else [encoded(k, arrays, f"a key of {where}")] for k in value]
        held = zip(keys, value.items(), strict=True)
        return {"mapping": [[key, encoded(v, arrays, f"{where}[{k!r}]")] for key, (k, v) in held]}
    kept = _kept_names(type(value))
    if kept is not None and type(value).__module__.split(".")[0] == "lie_codegen":
        kept_values = {name: encoded(getattr(value, name), arrays, f"{where}.{name}") for name in kept}
        return {"record": _name_of(type(value)), "fields": kept_values}
    if type(value).__module__.startswith("sympy."):
        return formula_record(value, where)
    raise InputError(f"{where} cannot be saved: {type(value).__name__} is no data")


def _kept_names(kind: type) -> tuple[str, ...] | None:
    """What is kept of a value of that class, and what its constructor takes; None where it is no record of data.

    Fields of a dataclass, those left out that follow from the others (metadata: {"derived": True}); an array with more to it
    than its entries lists its attributes in SAVED.
    """
    if hasattr(kind, "__dataclass_fields__"):
        return tuple(field.name for field in fields(kind) if field.init and not field.metadata.get("derived"))
    return getattr(kind, "SAVED", None)


def _name_of(kind: type) -> str:
    return f"{kind.__module__}:{kind.__qualname__}"


def decoded(record: Any, arrays: Mapping[str, Array], path: str) -> Any:
    """The value of a record of `encoded`.

    Raises:
        InputError: the record is damaged, of a later version, or names something that is no value of this package.
    """
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
        return _array(record["array"]) if isinstance(record["array"], Mapping) else arrays[record["array"]]
    if "float" in record:
        text = record["float"]
        return float.fromhex(text) if "0x" in text else float(text)
    if "complex" in record:
        return complex(*(decoded(part, arrays, path) for part in record["complex"]))
    if "enum" in record:
        return _class_of(record["enum"], path, enum=True)[record["member"]]
    for kind, make in (("list", list), ("tuple", tuple)):
        if kind in record:
            return make(decoded(each, arrays, path) for each in record[kind])
    if "mapping" in record:
        keys = (key if isinstance(key, str) else decoded(key[0], arrays, path) for key, _ in record["mapping"])
        return dict(zip(keys, (decoded(each, arrays, path) for _, each in record["mapping"]), strict=True))
    if "definition" in record:
        check_kinds(record["definition"], path)
        return made_from(record["definition"])
    if not {"formula", "tree", "matrix"}.isdisjoint(record):
        return read_formula(record)
    made = _class_of(record["record"], path, enum=False)
    unknown = sorted(set(record["fields"]) - set(_kept_names(made) or ()))
    if unknown:
        raise InputError(f"{path}: a {made.__name__} has no {', '.join(unknown)}; was it written by a later version?")
    held = {name: decoded(each, arrays, path) for name, each in record["fields"].items()}
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
