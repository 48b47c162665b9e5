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
import json
import re
import sys
from collections.abc import Callable, Mapping
from decimal import Decimal
from fractions import Fraction
from importlib import import_module
from typing import Any, NoReturn, TypeVar, cast

import numpy as np

from lie_codegen.errors import InputError

#: The kind of a group, and the length from which a fraction is shown with its decimal.
_GROUP, _LONG = "lie_codegen.groups.definition:defined_group", 8
#: Where kernels that were made before are found, above this file: named here and loaded when a factory is called.
RECORDED = "lie_codegen.runtime.recorded_kernels"
#: An exponent that no number of a law or a body has: a fraction of such a text fills the memory.
_HUGE = re.compile(r"[eE][+-]?[0-9_]{4,}\s*$")
Factory = TypeVar("Factory", bound=Callable[..., Any])
#: Units of the numbers by parameter, or what tells them from the parameters.
Units = Mapping[str, str] | Callable[[Mapping[str, Any]], Mapping[str, str]]


class NoDefinitionError(TypeError):
    """A value that is no plain data and has no definition, as a function written by the user."""


class Definition(dict[str, Any]):
    """A mapping of plain data that cannot be changed, and therefore has a hash."""

    def __hash__(self) -> int:  # type: ignore[override]
        return hash(self.text)

    @functools.cached_property
    def text(self) -> str:
        """Canonical JSON: equal definitions have equal texts."""
        return json.dumps(self, sort_keys=True, separators=(",", ":"))

    def _refuse(self, *_: Any, **__: Any) -> NoReturn:
        raise TypeError("a definition cannot be changed; make another thing")

    __setitem__ = __delitem__ = update = setdefault = pop = popitem = clear = __ior__ = _refuse

    def __reduce__(self) -> tuple[Any, ...]:
        return Definition, (dict(self),)

    def __copy__(self) -> Definition:
        return self

    def __deepcopy__(self, _: Any) -> Definition:
        return self


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
    if isinstance(value, Mapping):
        return Definition({str(key): plain(each) for key, each in value.items()})
    own = getattr(value, "definition", None)
    if isinstance(own, Definition):
        return own
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
            inner = "; ".join(described(value))
            lines.append(f"{key}: {value['kind'].partition(':')[2]}" + (f" with {inner}" if inner else ""))
        else:
            lines.append(f"{key} = {_shown(value)}" + (f" [{units[key]}]" if key in units else ""))
    return tuple(lines)


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


def made_from(definition: Any) -> Any:
    """What a definition defines; plain data stays what it is.

    Raises:
        InputError: the kind is not that of a factory.
    """
    if isinstance(definition, list | tuple):
        return tuple(made_from(each) for each in definition)
    if not isinstance(definition, Mapping):
        return definition
    if not {"kind", "parameters"} <= definition.keys() <= {"kind", "parameters", "units", "member"}:
        return {key: made_from(each) for key, each in definition.items()}
    made = _factory(definition["kind"])(**{key: made_from(each) for key, each in definition["parameters"].items()})
    if "member" not in definition:
        return made
    return next(kernel for kernel in made if kernel.name == definition["member"])


def _factory(kind: str) -> Callable[..., Any]:
    module, _, name = str(kind).partition(":")
    try:
        function = getattr(import_module(module), name)
    except (ImportError, AttributeError, ValueError):
        raise InputError(f"nothing makes {kind!r}: was it moved or is its module not installed?") from None
    if not getattr(function, "__makes_defined__", False):
        raise InputError(f"{kind!r} is no factory of kernels or records (@kernel_factory)")
    return cast(Callable[..., Any], function)


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
        object.__setattr__(made, "definition", definition)  # beside the fields, so that neither == nor repr sees it
        return made

    return _factory_of(define, None, reads)


def makes_records(function: Factory) -> Factory:
    """Decorates a function that `made_from` may call, for records that say their definition themselves."""
    function.__makes_defined__ = True  # type: ignore[attr-defined]
    return function


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
