"""Arguments that do not fit a function: which is missing or unknown, and what may be given for it, from the function's docstring."""

from __future__ import annotations

import inspect
import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any

from lie_codegen.identifiers import unknown_keywords

#: An entry of the section "Args:", by its names; "*args, out, **named: ..." are three.
_ENTRY = re.compile(r"(\*{0,2}\w+(?:, \*{0,2}\w+)*): (.*)")
_LONGEST = 400


def unbound(function: Callable[..., Any], name: str, args: Sequence[Any], named: Mapping[str, Any]) -> str | None:
    """What is wrong with the arguments before any of them was looked at; None if the function can be called with them.

    Args:
        function: with its docstring.
        name: of it, as the message has it.
        args, named: as it was called.
    """
    signature = inspect.signature(function)
    try:
        signature.bind(*args, **named)
    except TypeError as error:
        parameters = signature.parameters.values()
        unknown = [key for key in named if key not in signature.parameters]
        if unknown:
            known = [each.name for each in parameters if each.kind in (each.POSITIONAL_OR_KEYWORD, each.KEYWORD_ONLY)]
            return unknown_keywords(name, unknown, known)
        try:
            given = signature.bind_partial(*args, **named).arguments
        except TypeError:  # too many, or one given twice
            return f"{name}: {error}"
        missing = [
            each.name
            for each in parameters
            if each.default is each.empty
            and each.name not in given
            and each.kind not in (each.VAR_POSITIONAL, each.VAR_KEYWORD)
        ]
        said = described(function)
        told = "; ".join(f"{each} is {said[each]}" for each in missing if each in said)
        return f"{name}: {', '.join(f'{each}=' for each in missing)} missing{f' ({told})' if told else ''}"
    return None


def described(function: Callable[..., Any]) -> dict[str, str]:
    """What the docstring of a function says of each argument, in one line each."""
    section = (inspect.getdoc(function) or "").partition("Args:\n")[2].partition("\n\n")[0]
    lines = section.splitlines()
    found: dict[str, str] = {}
    names: list[str] = []
    if not lines:
        return found
    margin = len(lines[0]) - len(lines[0].lstrip())
    for line in lines:
        entry = _ENTRY.fullmatch(line.strip()) if len(line) - len(line.lstrip()) == margin else None
        if entry is not None:
            names = [each.lstrip("*") for each in entry[1].split(", ")]
        for each in names:
            found[each] = f"{found.get(each, '')} {line.strip() if entry is None else entry[2]}".strip()
    return {each: _short(text) for each, text in found.items()}


def _short(text: str) -> str:
    return (text if len(text) <= _LONGEST else f"{text[:_LONGEST]}...").rstrip(".")
