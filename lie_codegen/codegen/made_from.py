"""What a generated text is made from: the functions that ran to make it, not the files they stand in.

A file is read as parts: functions, and the statements around them, without comments, docstrings, annotations and layout.
A text depends on

- the bodies of the functions that ran while it was made: observed, not guessed;
- the statements of every module that was imported, for they ran too;
- of what only binds a name (an import, a plain constant, a class, a function that did not run) on those whose name is mentioned by
  some of the above: the others could come or go unnoticed. To mention is to use as a variable, an attribute, a keyword
  or a text (`getattr`); special methods count as mentioned, for operators call them.

So a new function in the same file, a changed comment or another subject's function leaves the digest alone.
"""

from __future__ import annotations

import ast
import hashlib
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path

_FUNCTION = (ast.FunctionDef, ast.AsyncFunctionDef)
#: Decorators that do nothing but wrap: the function they stand before is found by its name alone.
_WRAPPERS = {"cache", "lru_cache", "property", "cached_property", "staticmethod", "classmethod", "overload",
             "abstractmethod", "contextmanager"}  # fmt: skip


@dataclass(frozen=True)
class _Part:
    """A piece of a file.

    Attributes:
        within: the outermost class around it; None in the module.
        function: qualified name, where it is the body of a function, which counts if it ran.
        binds: names, where it does nothing but bind them; None for a statement that counts always.
        text: its syntax tree, written out.
        mentions: identifiers in it.
    """

    within: str | None
    function: str | None
    binds: frozenset[str] | None
    text: str
    mentions: frozenset[str]


def source_digest(folder: Path, ran: Mapping[str, Sequence[str]]) -> str:
    """Digest of what ran.

    Args:
        folder: where the package is.
        ran: file of an imported module, relative to the folder -> qualified names of its functions that ran.

    Raises:
        OSError: a file is not there.
        SyntaxError: a file is not Python.
    """
    kept: list[tuple[str, str]] = []
    waiting: list[tuple[str, _Part]] = []
    # A class whose method ran counts, wherever its name came from.
    mentioned = {name.split(".")[0] for functions in ran.values() for name in functions}

    def keep(found: Iterable[tuple[str, _Part]]) -> None:
        for name, part in found:
            kept.append((name, part.text))
            mentioned.update(part.mentions)

    for name, functions in ran.items():
        parts = _parts((folder / name).read_text(encoding="utf-8"))
        keep((name, part) for part in parts if part.function in functions)
        waiting += [(name, part) for part in parts if part.function is None]
    # What is kept mentions names that other parts bind: until nothing more is found.
    while found := [each for each in waiting if _counts(each[1], mentioned)]:
        waiting = [each for each in waiting if not _counts(each[1], mentioned)]
        keep(found)
    return hashlib.sha256("\0".join(f"{name}\n{text}" for name, text in sorted(kept)).encode()).hexdigest()


def _counts(part: _Part, mentioned: set[str]) -> bool:
    around = part.within is None or part.within in mentioned
    return around and (part.binds is None or not mentioned.isdisjoint(part.binds))


@lru_cache(maxsize=512)
def _parts(source: str) -> tuple[_Part, ...]:
    tree = ast.parse(source)
    _Plain().visit(tree)
    return tuple(_walk(tree.body, None, ""))


def _walk(statements: Sequence[ast.stmt], within: str | None, scope: str) -> Iterator[_Part]:
    for node in statements:
        if isinstance(node, _FUNCTION):
            yield _Part(within, scope + node.name, None, ast.dump(node), _mentions(node))
            yield _head(node, within, scope)
        elif isinstance(node, ast.ClassDef):
            # A class that nothing mentions does nothing: no class of the package is called when it is subclassed.
            inner, node.body = node.body, []
            yield _Part(within, None, frozenset([node.name]), scope + ast.dump(node), _mentions(node))
            yield from _walk(inner, within or node.name, f"{scope}{node.name}.")
        elif isinstance(node, ast.Import | ast.ImportFrom):
            for alias in node.names:
                # "import a as b" mentions a as well: another import may have bound it.
                names = frozenset((alias.asname or alias.name).split(".")) | set(alias.name.split("."))
                origin = getattr(node, "module", None)
                yield _Part(within, None, names, f"{scope}{origin} {alias.name} {alias.asname}", names)
        else:
            yield _Part(within, None, _constants(node), scope + ast.dump(node), _mentions(node))


def _head(node: ast.FunctionDef | ast.AsyncFunctionDef, within: str | None, scope: str) -> _Part:
    """That the function is there, its defaults and decorators: these are evaluated whether or not it runs."""
    own = ast.FunctionDef(scope + node.name, node.args, [], node.decorator_list)
    wrapped = all(_mentions(each) & _WRAPPERS for each in node.decorator_list)
    special = bool(within) and node.name.startswith("__") and node.name.endswith("__")
    return _Part(
        within, None, frozenset([node.name]) if wrapped and not special else None, ast.dump(own), _mentions(own)
    )


def _constants(node: ast.stmt) -> frozenset[str] | None:
    """The names that an assignment binds without calling anything; None of other statements."""
    if not isinstance(node, ast.Assign) or any(isinstance(each, ast.Call) for each in ast.walk(node)):
        return None
    if not all(isinstance(target, ast.Name) for target in node.targets):
        return None
    return frozenset(target.id for target in node.targets if isinstance(target, ast.Name))


def _mentions(tree: ast.AST) -> frozenset[str]:
    found: set[str | None] = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.Name):
            found.add(node.id)
        elif isinstance(node, ast.Attribute):
            found.add(node.attr)
        elif isinstance(node, ast.keyword):
            found.add(node.arg)
        elif isinstance(node, ast.alias):
            found.update(node.name.split("."))
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and node.value.isidentifier():
            found.add(node.value)
    return frozenset(each for each in found if each)


class _Plain(ast.NodeTransformer):
    """Without what does not run: docstrings, annotations of functions, imports for type checkers."""

    def visit(self, node: ast.AST) -> ast.AST | None:
        if isinstance(node, ast.If) and isinstance(node.test, ast.Name) and node.test.id == "TYPE_CHECKING":
            return None
        if isinstance(node, _FUNCTION):
            node.returns = None
        if isinstance(node, ast.arg):
            node.annotation = None
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            return None
        return self.generic_visit(node)
