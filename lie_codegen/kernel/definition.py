"""Definitions: what a kernel (or a record that kernels are made from) is, as plain data.

    {"kind": "lie_codegen.control.attitude_law:attitude_law", "parameters": {"kind": "pd", "k_p": 4, ...}, "units": {...}}

`kind` names the factory by its module, and `parameters` are its arguments, defaults included, with every number exact:
an int, or a text such as "1/10" or "sqrt(2)/2"; a float is the decimal that it prints as. Records inside (a group, an error
function, another kernel) stand there as their own definitions. So equality, hash, pickle, cache key and the text of
the generated header follow from it, and `made_from` makes the thing again anywhere.
"""

from __future__ import annotations

import functools
import inspect
import re
import sys
from collections.abc import Callable, Mapping
from dataclasses import is_dataclass
from decimal import Decimal
from fractions import Fraction
from importlib import import_module
from typing import Any, cast

import numpy as np

from lie_codegen.kernel.plain_data import Definition, Factory, NoDefinitionError, makes_records
from lie_codegen.kernel.records import RECORD, record_definition
from lie_codegen.values import settle

#: The kind of a group, and the length from which a fraction is shown with its decimal.
_GROUP, _LONG = "lie_codegen.groups.definition:defined_group", 8
#: Where kernels that were made before are found, above this file: named here and loaded when a factory is called.
RECORDED = "lie_codegen.runtime.recorded_kernels"
#: An exponent that no number of a law or a body has: a fraction of such a text fills the memory.
_HUGE = re.compile(r"[eE][+-]?[0-9_]{4,}\s*$")
#: Units of the numbers by parameter, or what tells them from the parameters.
Units = Mapping[str, str] | Callable[[Mapping[str, Any]], Mapping[str, str]]


def plain(value: Any) -> Any:
    """A value as plain data: None, bool, int, text, tuples and `Definition`s of these.

    Raises:
        NoDefinitionError: it holds something that is no data.
    """
    if value is None or isinstance(value, bool | np.bool_):
        return None if value is None else bool(value)
    if isinstance(value, str):
        return _text(value)
    if isinstance(value, int | np.integer):
        return int(value)
    if isinstance(value, float | np.floating):
        # The decimal that it prints as, as every gain and inertia is read; infinities and NaN have no fraction.
        return _rational(Fraction(repr(float(value)))) if np.isfinite(value) else repr(float(value))
    if isinstance(value, Fraction | Decimal):
        return _rational(Fraction(value))
    if isinstance(value, np.ndarray):
        return plain(value.tolist())
    if isinstance(value, complex):
        return f"{plain(value.real)} + I*({plain(value.imag)})"
    if isinstance(value, list | tuple):
        return tuple(plain(each) for each in value)
    if isinstance(value, Definition):
        return value
    if isinstance(value, Mapping):
        return Definition({str(key): plain(each) for key, each in value.items()})
    own = getattr(value, "definition", None)
    if isinstance(own, Definition):
        return own
    if is_dataclass(value) and not isinstance(value, type) and type(value).__module__.startswith("lie_codegen."):
        return record_definition(value)
    return _symbolic(value)


def _text(value: str) -> Any:
    """A number written as a text is that number: "0.5" and "1/2" are equal."""
    if _HUGE.search(value):
        return value
    try:
        return _rational(Fraction(value))
    except (ValueError, ZeroDivisionError):
        return value


def _rational(value: Fraction) -> int | str:
    return value.numerator if value.denominator == 1 else str(value)


def _symbolic(value: Any) -> Any:
    sympy = sys.modules.get("sympy")  # a value of SymPy exists only where SymPy was imported
    if sympy is not None and isinstance(value, sympy.MatrixBase):
        return plain(value.tolist())
    if sympy is not None and isinstance(value, sympy.Expr):
        return _text(str(value))
    raise NoDefinitionError(f"{type(value).__name__} is no plain data and has no definition")


def definition_of(kind: str, parameters: Mapping[str, Any], units: Mapping[str, str] | None = None) -> Definition:
    """The definition of what `kind` ("module:function") makes from these arguments.

    Raises:
        NoDefinitionError: an argument is no data.
    """
    data = {"kind": kind, "parameters": plain(parameters)}
    return Definition({**data, **({"units": Definition(units)} if units else {})})


def described(definition: Definition | None) -> tuple[str, ...]:
    """The parameters in lines, as "k_p = 4 [N m/rad]": every number that is compiled in.

    The group and what it determines are left out, for it has a description of its own; so are the names and what was
    not given.
    """
    if definition is None:
        return ()
    units = definition.get("units", {})
    lines = []
    for key, value in definition["parameters"].items():
        if value is None or key in ("name", "namespace") or _is_record(value, _GROUP):
            continue
        if _is_record(value):
            own = value["parameters"]["record"] if value["kind"] == RECORD else None
            inner = "; ".join(_fields(own["fields"]) if own else described(value))
            made = (own["record"] if own else value["kind"]).partition(":")[2]
            lines.append(f"{key}: {made}" + (f" with {inner}" if inner else ""))
        else:
            lines.append(f"{key} = {_shown(value)}" + (f" [{units[key]}]" if key in units else ""))
    return tuple(lines)


def _fields(fields: Mapping[str, Any]) -> list[str]:
    """Those of a record that are numbers, texts, formulas, or tuples of these, in words."""
    shown = ((name, _entry(value)) for name, value in fields.items())
    return [f"{name} = {text}" for name, text in shown if text is not None]


def _entry(value: Any) -> str | None:
    """A field of a record in words; None where it is not given or holds another record."""
    if isinstance(value, Mapping):
        if "formula" in value:
            return str(value["formula"])
        if "float" in value:
            return repr(float.fromhex(value["float"]))
        if "array" in value:
            numbers = [float.fromhex(each) if isinstance(each, str) else each for each in value["array"]["entries"]]
            return f"({', '.join(map(repr, numbers))})"
        rows = value.get("tuple", value.get("list", value.get("matrix")))
        return None if rows is None else _entry(tuple(rows))
    if isinstance(value, tuple):
        entries = [_entry(each) for each in value]
        return f"({', '.join(map(str, entries))})" if entries and None not in entries else None
    return None if value is None else str(value)


def _is_record(value: Any, kind: str | None = None) -> bool:
    return isinstance(value, Mapping) and "parameters" in value and (kind is None or value.get("kind") == kind)


def _shown(value: Any) -> str:
    if isinstance(value, Mapping):
        return ", ".join(f"{key} = {_shown(each)}" for key, each in value.items())
    if isinstance(value, tuple):
        return f"({', '.join(_shown(each) for each in value)})"
    text = str(value)
    if re.fullmatch(r"-?[0-9]+/[0-9]+", text):
        return repr(float(Fraction(text))) if len(text) > _LONG else text
    return text


def kernel_factory(*, units: Units | None = None, **reads: Callable[[Any], Any]) -> Callable[[Factory], Factory]:
    """Decorates a function that makes a Kernel, or several, from arguments: they get their definition.

    The function must be one of a module, and what it makes must follow from its arguments alone. An argument that is no data
    (a Python function) leaves the kernels without a definition.

    Args:
        units: of the numbers among the arguments, for the generated header.
        reads: argument -> function that reads it first, as a group from its name.
    """

    def define(function: Callable[[], Any], definition: Definition) -> Any:
        made = import_module(RECORDED).recorded_kernel(definition, function)
        if made is None:
            return None  # a factory may have nothing to make, as where no closed form is known
        if not isinstance(made, tuple):
            return made.defined_by(definition)
        members = [Definition({**definition, "member": each.name}) for each in made]
        pairs = zip(made, members, strict=True)
        return tuple(each.defined_by(member) if each.definition is None else each for each, member in pairs)

    return _factory_of(define, units, reads)


def record_factory(**reads: Callable[[Any], Any]) -> Callable[[Factory], Factory]:
    """Decorates a function that makes a frozen record (a reference, an error function, a vehicle): it gets a `definition`.

    `dataclasses.replace` makes another record, which has none; so a definition is always true.
    """

    def define(function: Callable[[], Any], definition: Definition) -> Any:
        made = function()
        settle(made, definition=definition)  # beside the fields, so that neither == nor repr sees it
        return made

    return _factory_of(define, None, reads)


def _factory_of(
    define: Callable[[Callable[[], Any], Definition], Any],
    units: Units | None,
    reads: Mapping[str, Callable[[Any], Any]],
) -> Callable[[Factory], Factory]:
    def decorate(function: Factory) -> Factory:
        signature = inspect.signature(function)
        kind = f"{function.__module__}:{function.__qualname__}"

        @functools.wraps(function)
        def make(*args: Any, **named: Any) -> Any:
            bound = signature.bind(*args, **named)
            bound.apply_defaults()
            for name, read in reads.items():
                bound.arguments[name] = read(bound.arguments[name])
            made = functools.partial(function, *bound.args, **bound.kwargs)
            try:
                parameters = plain(_arguments(signature, bound))
            except NoDefinitionError:
                return made()
            shown = units(parameters) if callable(units) else units
            return define(made, definition_of(kind, parameters, shown))

        return cast(Factory, makes_records(make))

    return decorate


def double(value: Any) -> float:
    """A number, or the text that stands for it in a definition, as a double."""
    return float(Fraction(value))


def doubles(value: Any) -> Any:
    """An array of numbers, or of the texts that stand for them in a definition, as doubles; None stays None."""
    if value is None:
        return None
    if isinstance(value, str):
        real, _, imaginary = value.partition(" + I*")
        return (
            complex(float(Fraction(real)), float(Fraction(imaginary.strip("()"))))
            if imaginary
            else float(Fraction(real))
        )
    return np.array([doubles(each) for each in value]) if isinstance(value, list | tuple) else np.asarray(value)


def _arguments(signature: inspect.Signature, bound: inspect.BoundArguments) -> dict[str, Any]:
    """By name; those of **options beside the others."""
    found: dict[str, Any] = {}
    for name, value in bound.arguments.items():
        if signature.parameters[name].kind is inspect.Parameter.VAR_KEYWORD:
            found.update(value)
        else:
            found[name] = value
    return found
