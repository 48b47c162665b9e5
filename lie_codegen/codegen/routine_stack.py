"""The stack of a routine, read off its C: each function's variables, along the deepest chain of calls.

The text is ours (a template, C99, one declaration a line, a `}` at the margin ends a function): no more of C is read than it uses, and where a size
cannot be read there is no figure. tests/codegen/test_stack.py holds it against what compilers say and what a painted stack shows.
"""

from __future__ import annotations

import ast
import math
import operator
import re
from collections.abc import Mapping
from dataclasses import dataclass

from lie_codegen.codegen.frames import FRAME

_FUNCTION = re.compile(r"^static [^;={}]*?(\w+)\(([^;{}]*)\)\s*\{(.*?)^\}", re.MULTILINE | re.DOTALL)
_STRUCT = re.compile(r"typedef struct \{(.*?)\} (\w+);", re.DOTALL)
_ENUM = re.compile(r"enum \{([^}]*)\}")
_COMMENT = re.compile(r"/\*.*?\*/", re.DOTALL)
_SIZES = {"double": 8, "float": 8, "int": 4, "unsigned long": 8, "size_t": 8, "ptrdiff_t": 8}
#: Of whole numbers above 0, where C divides as Python's //.
_OPERATORS = {ast.Add: operator.add, ast.Sub: operator.sub, ast.Mult: operator.mul, ast.Div: operator.floordiv}


class _UnreadableError(Exception):
    """A size that is no number here."""


@dataclass(frozen=True)
class _Function:
    """Bytes of a frame, and what it calls."""

    bytes: int
    calls: frozenset[str]


def routine_stack(text: str, name: str, helpers: Mapping[str, int]) -> int | None:
    """Bytes of stack of a routine of that name in a C text, with all that it calls; None where a size cannot be read or it calls itself.

    `helpers`: those of the kernels that it calls, by symbol.
    """
    plain = _COMMENT.sub("", text)
    sizes = dict(_SIZES)
    for fields, kind in _STRUCT.findall(plain):
        sizes[kind] = 8 * (fields.count(",") + fields.count(";"))
    try:
        functions = {
            symbol: _function(f"{arguments};{body}", plain, sizes)
            for symbol, arguments, body in _FUNCTION.findall(plain)
        }
        return _deepest(name, functions, helpers, ())
    except _UnreadableError:
        return None


def _function(text: str, whole: str, sizes: Mapping[str, int]) -> _Function:
    numbers: dict[str, int] = {}
    for listed in _ENUM.findall(whole.replace(text, "")) + _ENUM.findall(text):
        for each in listed.split(","):
            key, _, value = each.partition("=")
            numbers[key.strip()] = _number(value, numbers)
    arguments, _, body = text.partition(";")
    kinds = "|".join(sorted(sizes, key=len, reverse=True))
    total = 8 * (arguments.count(",") + 1)
    for constant, kind, declared in re.findall(
        rf"(static )?(?:const )?\b({kinds}) ([^;()]*(?:\([^;]*\)[^;()]*)*);", body
    ):
        total += 0 if constant else sum(_variable(each, sizes[kind], numbers) for each in _parted(declared))
    # a structure that a function returns has a place of its own for each call
    structures = [kind for kind in sizes if kind not in _SIZES]
    returning = {each for kind in structures for each in re.findall(rf"^static {kind} (\w+)\(", whole, re.MULTILINE)}
    called = re.findall(r"\b(\w+)\s*\(", body)
    total += sum(max(sizes[kind] for kind in structures) for each in called if each in returning)
    return _Function(total * 3 // 2 + FRAME, frozenset(called))


def _parted(declared: str) -> list[str]:
    """Declarators, parted by the commas outside brackets."""
    depth, parts = 0, [""]
    for letter in declared:
        depth += (letter in "([{") - (letter in ")]}")
        if letter == "," and depth == 0:
            parts.append("")
        else:
            parts[-1] += letter
    return parts


def _variable(declarator: str, size: int, numbers: Mapping[str, int]) -> int:
    name = declarator.partition("=")[0]
    if "*" in name:
        return 8
    return max(8, size * math.prod(_number(each, numbers) for each in re.findall(r"\[([^\]]*)\]", name)))


def _number(text: str, numbers: Mapping[str, int]) -> int:
    try:
        return _value(ast.parse(text.strip(), mode="eval").body, numbers)
    except SyntaxError:
        raise _UnreadableError(text) from None


def _value(node: ast.expr, numbers: Mapping[str, int]) -> int:
    if isinstance(node, ast.Constant) and isinstance(node.value, int):
        return node.value
    if isinstance(node, ast.Name) and node.id in numbers:
        return numbers[node.id]
    if isinstance(node, ast.BinOp) and type(node.op) in _OPERATORS:
        return int(_OPERATORS[type(node.op)](_value(node.left, numbers), _value(node.right, numbers)))
    raise _UnreadableError(ast.dump(node))


def _deepest(name: str, functions: Mapping[str, _Function], helpers: Mapping[str, int], above: tuple[str, ...]) -> int:
    if name in above:
        raise _UnreadableError(f"{name} calls itself")
    own = functions[name]
    below = [helpers[each] for each in own.calls if each in helpers]
    below += [_deepest(each, functions, helpers, (*above, name)) for each in own.calls if each in functions]
    return own.bytes + max(below, default=0)
