"""The command about documentation: docs."""

from __future__ import annotations

from typing import TYPE_CHECKING, Annotated, Any

import typer

from lie_codegen.cli.groups import Json
from lie_codegen.cli.output import emit
from lie_codegen.errors import InputError

if TYPE_CHECKING:
    from inspect import Signature


def docs(
    name: Annotated[
        str | None,
        typer.Argument(
            help="A public name, or one of its methods: steer, Plan.save, lc.Plan.u. All names by subject if not given."
        ),
    ] = None,
    json: Json = False,
) -> None:
    """Print what the documentation says of a public name: signature, formula, arguments, errors; no network."""
    import lie_codegen as lc

    if name is None:
        subjects = _subjects()
        lines = [f"{subject}\n  " + "\n  ".join(_wrapped(names)) for subject, names in subjects.items()]
        emit("\n".join([*lines, "lie-codegen docs NAME says more."]), {"subjects": subjects}, json)
        return
    path = name.removeprefix("lie_codegen.").removeprefix("lc.").split(".")
    found: Any = lc
    for depth, part in enumerate(path):
        fields = [each for each in getattr(found, "__dataclass_fields__", ()) if not each.startswith("_")]
        known = dir(lc) if depth == 0 else [*fields, *(each for each in dir(found) if not each.startswith("_"))]
        if part not in known:
            raise InputError(_unknown(name, path[:depth], part, known))
        if part in fields:  # what a field is stands in the words of its class
            path = path[:depth]
            break
        found = getattr(found, part)
    _show(".".join(path), found, json)


def _subjects() -> dict[str, list[str]]:
    """Subject -> its public names."""
    from types import ModuleType

    import lie_codegen as lc

    rooms = {name: getattr(lc, name) for name in dir(lc)}
    return {
        name: sorted(n for n in dir(room) if n in rooms or n.endswith("Error"))
        for name, room in rooms.items()
        if isinstance(room, ModuleType)
    }


def _wrapped(names: list[str]) -> list[str]:
    from textwrap import wrap

    return wrap(", ".join(names), 110)


def _unknown(name: str, before: list[str], part: str, known: list[str]) -> str:
    from difflib import get_close_matches

    near = get_close_matches(part, known, n=3, cutoff=0.5)
    where = f"lc.{'.'.join(before)} has no {part}" if before else f"{name} is no public name"
    return f"docs: {where}" + (f"; did you mean {' or '.join(near)}?" if near else "; lie-codegen docs lists them")


def _show(name: str, found: Any, json: bool) -> None:
    import inspect

    try:
        signature = _without_types(inspect.signature(found)) if callable(found) else ""
    except (TypeError, ValueError):  # of a class of errors, of what C wrote
        signature = ""
    about = repr(found) if isinstance(found, str | int | float | tuple) else inspect.getdoc(found) or ""
    emit(f"lc.{name}{signature}\n\n{about}".rstrip(), {"name": name, "signature": signature, "about": about}, json)


def _without_types(signature: Signature) -> str:
    """The docstring says what an argument is."""
    bare = [each.replace(annotation=each.empty) for each in signature.parameters.values()]
    return str(signature.replace(parameters=bare, return_annotation=signature.empty))


commands = (docs,)
