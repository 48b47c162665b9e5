"""Pages of the reference that follow from the package: every public name by subject, the command line, errors, guides, decisions."""

from __future__ import annotations

import ast
import importlib
import inspect
import re
from functools import cached_property
from pathlib import Path

from cures import CURES
from gallery import page as gallery_page

PACKAGE = Path(__file__).resolve().parent.parent / "lie_codegen"


def subjects() -> list[str]:
    """The public packages."""
    return sorted(stub.parent.name for stub in PACKAGE.glob("*/__init__.pyi"))


def names(subject: str) -> list[str]:
    """The public names of a subject, as its stub lists them."""
    tree = ast.parse((PACKAGE / subject / "__init__.pyi").read_text(encoding="utf-8"))
    return [alias.name for node in tree.body if isinstance(node, ast.ImportFrom) for alias in node.names]


def write(folder: Path) -> None:
    """All generated pages."""
    for subject in subjects():
        _put(folder / "api" / f"{subject}.md", api(subject))
        guides = sorted((PACKAGE / subject).rglob("*.md"))
        text = "\n\n".join(plain(path.read_text(encoding="utf-8")) for path in guides)
        _put(folder / "guides" / f"{subject}.md", text or f"# {subject}\n")
    _put(folder / "api" / "index.md", _index("Names by subject", subjects()))
    _put(folder / "guides" / "index.md", _index("Guides by subject", subjects()))
    _put(folder / "errors.md", errors())
    _put(folder / "cli.md", command_line())
    notes = sorted((PACKAGE / "decisions").glob("*.md"))
    for note in notes:
        _put(folder / "decisions" / note.name, plain(note.read_text(encoding="utf-8")))
    _put(folder / "decisions" / "index.md", _index("Decisions", [note.stem for note in notes]))
    _put(folder / "gallery.md", gallery_page())
    for name in ("CHANGELOG", "CONTRIBUTING"):
        _put(folder / f"{name.lower()}.md", plain((PACKAGE.parent / f"{name}.md").read_text(encoding="utf-8")))


def api(subject: str) -> str:
    """Every public name of a subject: how it is called, and its docstring as it is written, which is plain text."""
    lines = [
        f"# lc.{subject}",
        "",
        f"Each is `lc.NAME` and `lc.{subject}.NAME`; the guide: [{subject}](../guides/{subject}).",
        "",
    ]
    for name in names(subject):
        value = getattr(importlib.import_module(f"lie_codegen.{subject}"), name)
        lines += [f"## {name}", "", *_documented(name, value)]
        if inspect.isclass(value):
            for key, member in vars(value).items():
                if (
                    not key.startswith("_")
                    and (callable(member) or isinstance(member, property | cached_property))
                    and inspect.getdoc(member)
                ):
                    lines += [f"### {name}.{key}", "", *_documented(key, member)]
    return "\n".join(lines)


def _documented(name: str, value: object) -> list[str]:
    try:
        called = f"{name}{inspect.signature(value)}" if callable(value) else name  # type: ignore[arg-type]
    except (TypeError, ValueError):
        called = name
    # annotations are texts in this package; their quotes say nothing to a reader
    called = re.sub(r"(: |-> )'([^']*)'", r"\1\2", called)
    return ["```python", called, "```", "", "```text", inspect.getdoc(value) or "", "```", ""]


def errors() -> str:
    """The named errors, from what they say of themselves."""
    module = importlib.import_module("lie_codegen.errors")
    found = [
        value
        for value in vars(module).values()
        if inspect.isclass(value) and issubclass(value, Exception) and value.__module__ == module.__name__
    ]
    lines = [
        "# Errors and warnings, with their cures",
        "",
        "An `InputError` says what was given wrongly (exit status 2), a `ComputationError` what failed (1). Every message says what, where and how",
        "to mend it; the cure is what helps most often.",
        "",
    ]
    for value in found:
        said = " ".join((inspect.getdoc(value) or "").split())
        lines += [
            f"## `{value.__name__}`",
            "",
            f"{said} ({value.__mro__[1].__name__})",
            "",
            f"**Cure:** {CURES[value.__name__]}.",
            "",
        ]
    return "\n".join(lines)


def command_line() -> str:
    """The help of every command."""

    from typer.testing import CliRunner

    from lie_codegen.cli.app import app

    def said(*words: str) -> str:
        done = CliRunner().invoke(app, [*words, "--help"], prog_name="lie-codegen", catch_exceptions=False)
        return done.output.strip()

    whole = said()
    commands = re.findall(r"^  ([a-z][a-z_-]*)\s", whole.partition("Commands:")[2], flags=re.MULTILINE)
    parts = [f"## {name}\n\n```text\n{said(name)}\n```" for name in commands]
    return "\n\n".join(["# The command line", f"```text\n{whole}\n```", *parts]) + "\n"


def plain(text: str) -> str:
    """A page from beside the code: its links to files are words here."""
    return re.sub(r"(?<!!)\[([^\]]+)\]\((?!https?://)[^)]*\)", r"\1", text)


def _index(title: str, entries: list[str]) -> str:
    return "\n".join([f"# {title}", "", "```{toctree}", ":maxdepth: 1", "", *entries, "```", ""])


def _put(path: Path, text: str) -> None:
    """Written only where it changed, so that a second build reads little."""
    path.parent.mkdir(parents=True, exist_ok=True)
    if not path.is_file() or path.read_text(encoding="utf-8") != text:
        path.write_text(text, encoding="utf-8")
