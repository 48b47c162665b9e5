"""Group files: a TOML description of a group, read as data.

name = "osc4"
description = "oscillator algebra"      # optional
labels = ["J", "P", "Q", "Z"]
units = ["rad", "m", "m", "m^2"]        # optional
[brackets]                              # either brackets ...
"J,P" = { Q = 1 }
[matrices]                              # ... or matrices, one for each label
J = [[0, "-1/2"], ["sqrt(3)/2", 0]]
[metadata]                              # optional, free text, kept and not interpreted
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping
from decimal import Decimal
from typing import Any

from lie_codegen.errors import ExpressionError, GroupFileError, InputError, ShapeError
from lie_codegen.exact.budget import current_budget, over
from lie_codegen.exact.numbers import Number, exact_number
from lie_codegen.groups.definition import from_brackets, from_matrices
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.identifiers import shown

_KEYS = ("name", "labels", "description", "source", "units", "matrices", "brackets", "metadata")
#: A dotted key from its first part on; the parser of TOML takes time that grows with the square of its length.
_DOTTED = r"""(?<![\w"'-])(?:[\w"'-]+[ \t]*\.[ \t]*){%d}"""


def parse_group_file(data: bytes, where: str) -> MatrixGroup:
    """The group a TOML text describes; `where` names it in messages.

    Raises:
        GroupFileError: not TOML, a key unknown or missing, an entry that is not a number; names file, key and column.
        InputError: what the definition itself violates (closure, independence, Jacobi, names), prefixed by `where`.
    """
    budget = current_budget()
    if len(data) > budget.size:
        raise GroupFileError(over("size", f"{where}: {len(data)} bytes; a group file has at most {budget.size}"))
    try:
        text = data.decode("utf-8")
        if re.search(_DOTTED % budget.nesting, text):
            raise GroupFileError(over("nesting", f"{where}: a dotted key has too many parts"))
        table = tomllib.loads(text, parse_float=Decimal)
    except GroupFileError:
        raise
    except (ValueError, ArithmeticError, RecursionError) as error:  # a TOML error, an integer of 5,000 digits, ...
        raise GroupFileError(f"{where}: not a TOML file: {error}") from None
    return group_from_table(table, where)


def group_from_table(table: Mapping[str, Any], where: str) -> MatrixGroup:
    """The group described by a parsed table."""
    _check_keys(table, where)
    name = _text(table, "name", where)
    labels = _texts(table, "labels", where)
    units = _units(table, labels, where)
    description = _text(table, "description", where, default="")
    try:
        if "matrices" in table:
            return from_matrices(
                name, labels, _matrices(table["matrices"], labels, where), units=units, description=description
            )
        return from_brackets(
            name, labels, _brackets(table["brackets"], labels, where), units=units, description=description
        )
    except GroupFileError:
        raise
    except InputError as error:
        raise type(error)(f"{where}: {error}") from None


def _check_keys(table: Mapping[str, Any], where: str) -> None:
    for key in table:
        if key not in _KEYS:
            raise GroupFileError(f"{where}: unknown key {key!r}; known keys: {', '.join(_KEYS)}")
    for key in ("name", "labels"):
        if key not in table:
            raise GroupFileError(f"{where}: the key {key!r} is missing")
    if ("matrices" in table) == ("brackets" in table):
        raise GroupFileError(f"{where}: give either [matrices] or [brackets], exactly one of them")
    if not isinstance(table.get("metadata", {}), dict):
        raise GroupFileError(f"{where}: key 'metadata' must be a table")


def _text(table: Mapping[str, Any], key: str, where: str, default: str | None = None) -> str:
    value = table.get(key, default)
    if not isinstance(value, str):
        raise GroupFileError(f"{where}: key {key!r} must be a text, got {shown(value)}")
    return value


def _texts(table: Mapping[str, Any], key: str, where: str) -> list[str]:
    value = table[key]
    if not isinstance(value, list) or not value or not all(isinstance(item, str) for item in value):
        raise GroupFileError(f"{where}: key {key!r} must be a non-empty list of texts, got {shown(value)}")
    if len(value) > current_budget().dimension:
        raise GroupFileError(over("dimension", f"{where}: {len(value)} labels"))
    return value


def _units(table: Mapping[str, Any], labels: list[str], where: str) -> list[str] | None:
    units = table.get("units")
    if units is None:
        return None
    if isinstance(units, dict):
        _check_labels(units, labels, where, "units")
        units = [units.get(label, "") for label in labels]
    if not isinstance(units, list) or len(units) != len(labels) or not all(isinstance(unit, str) for unit in units):
        raise GroupFileError(f"{where}: key 'units' must be a list of {len(labels)} texts, one for each label")
    return units


def _check_labels(table: Mapping[str, Any], labels: list[str], where: str, key: str) -> None:
    for label in table:
        if label not in labels:
            raise GroupFileError(f"{where}: key {key!r}: {label!r} is not one of the labels {', '.join(labels)}")


def _matrices(value: Any, labels: list[str], where: str) -> list[Any]:
    if not isinstance(value, dict):
        raise GroupFileError(f"{where}: key 'matrices' must be a table with one matrix for each label")
    _check_labels(value, labels, where, "matrices")
    matrices = []
    for label in labels:
        key = f"matrices.{label}"
        if label not in value:
            raise GroupFileError(f"{where}: key {key!r} is missing; give one matrix for each label")
        matrices.append(_matrix(value[label], where, key))
    return matrices


def _matrix(rows: Any, where: str, key: str) -> list[list[Number]]:
    if not isinstance(rows, list) or not rows or not all(isinstance(row, list) for row in rows):
        raise GroupFileError(f"{where}: key {key!r} must be a list of rows")
    if len(rows) > current_budget().dimension:
        raise GroupFileError(over("dimension", f"{where}: key {key!r}: {len(rows)} rows"))
    for number, row in enumerate(rows, start=1):
        if len(row) != len(rows):
            raise ShapeError(
                f"{where}: key {key!r}: row {number} has {len(row)} entries in a matrix of {len(rows)} rows (ragged)"
            )
    return [
        [_number(entry, where, f"{key}[{r}][{k}]") for k, entry in enumerate(row, start=1)]
        for r, row in enumerate(rows, start=1)
    ]


def _brackets(value: Any, labels: list[str], where: str) -> dict[tuple[str, str], dict[str, Number]]:
    if not isinstance(value, dict):
        raise GroupFileError(f"{where}: key 'brackets' must be a table such as \"x,y\" = {{ z = 1 }}")
    brackets: dict[tuple[str, str], dict[str, Number]] = {}
    for pair, combination in value.items():
        key = f"brackets.{pair!r}"
        names = tuple(part.strip() for part in pair.strip("[] ").split(","))
        if len(names) != 2:
            raise GroupFileError(f'{where}: key {key} must name two labels, as in "x,y"')
        if not isinstance(combination, dict):
            raise GroupFileError(f"{where}: key {key} must be a table of label = coefficient, got {shown(combination)}")
        for label in (*names, *combination):
            if label not in labels:
                raise GroupFileError(f"{where}: key {key}: {label!r} is not one of the labels {', '.join(labels)}")
        first, second = names
        if (first, second) in brackets:
            raise GroupFileError(f"{where}: key {key}: this bracket is given twice")
        brackets[first, second] = {
            label: _number(entry, where, f"{key}.{label}") for label, entry in combination.items()
        }
    return brackets


def _number(entry: Any, where: str, key: str) -> Number:
    if isinstance(entry, bool) or not isinstance(entry, int | str | Decimal):
        raise GroupFileError(
            f"{where}: key {key}: {shown(entry)} is not a number; write an integer, a decimal or a text"
        )
    try:
        return exact_number(entry)
    except ExpressionError as error:
        raise GroupFileError(f"{where}: key {key}, {error}") from None
    except InputError as error:
        raise GroupFileError(f"{where}: key {key}: {error}") from None
