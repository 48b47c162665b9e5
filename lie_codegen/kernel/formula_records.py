"""Formulas and matrices of SymPy as plain records, and back: what is read is equal to what was written, node by node.

A formula stands as text in the closed grammar where reading that text gives the same expression. SymPy distributes numbers
over sums and orders factors as it builds, so some texts are read as another form of the same function; those stand as trees
of the few nodes that a formula may have.
"""

from __future__ import annotations

import contextlib
from collections.abc import Mapping
from typing import Any

from lie_codegen.errors import InputError
from lie_codegen.exact.expression import FORMULA_FUNCTIONS, NUMBER_NAMES, parse_expression, parse_number
from lie_codegen.on_demand import sympy as sp

_NODES = ("Add", "Mul", "Pow")


def formula_record(value: Any, where: str) -> dict[str, Any]:
    """An expression or a matrix of expressions as JSON data, its symbols by name and assumptions.

    Raises:
        InputError: it cannot be written so that it is read back equal.
    """
    if getattr(value, "is_Matrix", False):
        entries = [formula_record(entry, f"{where}[{i}]") for i, entry in enumerate(value.flat())]
        return {"matrix": entries, "shape": list(value.shape)}
    free = sorted(getattr(value, "free_symbols", ()), key=lambda symbol: symbol.name)
    symbols: dict[str, Any] = {"symbols": [symbol.name for symbol in free]}
    others = {symbol.name: assumed for symbol in free if (assumed := _assumed(symbol)) != {"real": True}}
    symbols |= {"assumptions": others} if others else {}
    with contextlib.suppress(InputError):
        for form in ({"formula": str(value)}, {"tree": _tree(value)}):
            with contextlib.suppress(InputError):
                if read_formula(record := {**form, **symbols}) == value:
                    return record
    raise InputError(f"{where} cannot be saved: {value!s:.60} is no formula of the closed grammar")


def read_formula(record: Mapping[str, Any]) -> Any:
    """The expression or the matrix of a `formula_record`.

    Raises:
        InputError: it names a node that no formula has, or a text outside the grammar.
    """
    if "matrix" in record:
        return sp.ImmutableMatrix(*record["shape"], [read_formula(entry) for entry in record["matrix"]])
    others = record.get("assumptions", {})
    names = {str(name): sp.Symbol(str(name), **others.get(name, {"real": True})) for name in record["symbols"]}
    if "tree" in record:
        return _grown(record["tree"], names)
    return parse_expression(record["formula"], {**NUMBER_NAMES, **names}, FORMULA_FUNCTIONS)


def _assumed(symbol: Any) -> dict[str, bool]:
    """What makes an equal symbol: the few assumptions that say it, or all that follow from them."""
    few: tuple[dict[str, bool], ...] = ({"real": True}, {}, {"positive": True})
    return next((each for each in few if type(symbol)(symbol.name, **each) == symbol), dict(symbol.assumptions0))


def _tree(value: Any) -> list[Any]:
    """[node, children ...]; a leaf is ["symbol", name] or ["number", text]."""
    if value.is_Symbol:
        return ["symbol", value.name]
    if not value.args:
        return ["number", str(value)]
    own = value.func.__name__
    # by the grammar's name, which need not be SymPy's: abs is its Abs
    node = (
        own if own in _NODES else next((name for name, made in FORMULA_FUNCTIONS.items() if made is value.func), None)
    )
    if node is None:
        raise InputError(f"a formula has no {own}")
    return [node, *map(_tree, value.args)]


def _grown(tree: Any, names: Mapping[str, Any]) -> Any:
    node, *children = tree
    if node == "symbol":
        return names[children[0]]
    if node == "number":
        return parse_number(children[0])
    grown = [_grown(each, names) for each in children]
    if node in _NODES:
        return getattr(sp, node)(*grown)
    if node in FORMULA_FUNCTIONS:
        return FORMULA_FUNCTIONS[node](*grown)
    raise InputError(f"a formula has no {node!s:.40}")
