"""What a user reads uses the field's words; those of the house stand in CONTRIBUTING.md's glossary and stay inside."""

from __future__ import annotations

import ast
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

import lie_codegen

PACKAGE = Path(lie_codegen.__file__).parent
#: Words of the house that mean something else, or nothing, to a reader from the field.
HOUSE = ("aim", "aims", "complaint", "flown", "ladder", "opened", "pivots", "tail", "tails", "twin", "twins")
#: In words of everyday language: an archive or a store is opened.
PLAIN = ("opened again",)
_HOUSE = re.compile(rf"\b({'|'.join(HOUSE)})\b")


def house_words(text: str) -> list[str]:
    for plain in PLAIN:
        text = text.replace(plain, "")
    return _HOUSE.findall(text)


def docstrings(name: str) -> Iterator[tuple[str, str]]:
    """Of a public name and, where it is a class of ours, of its public methods and properties."""
    value = getattr(lie_codegen, name)
    yield name, value.__doc__ or ""
    if isinstance(value, type) and value.__module__.startswith("lie_codegen"):
        for key, member in vars(value).items():
            if not key.startswith("_"):
                yield f"{name}.{key}", getattr(member, "__doc__", None) or ""


@pytest.mark.parametrize("name", [each for each in lie_codegen.__all__ if callable(getattr(lie_codegen, each))])
def test_public_docstrings_speak_the_language_of_the_field(name: str) -> None:
    for where, text in docstrings(name):
        assert not house_words(text), f"{where}: {house_words(text)}"


def test_messages_speak_the_language_of_the_field() -> None:
    found = []
    for path in sorted(PACKAGE.rglob("*.py")):
        text = path.read_text(encoding="utf-8")
        if not house_words(text):
            continue  # few files are worth a syntax tree
        said = [
            node
            for node in ast.walk(ast.parse(text))
            if isinstance(node, ast.Raise) or (isinstance(node, ast.Call) and ast.unparse(node.func) == "warn_caller")
        ]
        texts = [part for node in said for part in ast.walk(node) if isinstance(part, ast.Constant)]
        found += [
            f"{path.relative_to(PACKAGE)}:{each.lineno}: {each.value!r}"
            for each in texts
            if isinstance(each.value, str) and house_words(each.value)
        ]
    assert not found


def test_every_word_of_the_house_is_in_the_glossary(repository: Path) -> None:
    """What remains of them inside, as the name of a file, a reader can look up."""
    glossary = (repository / "CONTRIBUTING.md").read_text(encoding="utf-8").partition("## Words of the house")[2]
    files = {path.stem for path in PACKAGE.rglob("*.py")}
    for word in ("aim", "complaint", "finish", "flight", "frame", "ladder", "opened", "pose", "quick"):
        if {word, f"{word}s"} & files:
            assert re.search(rf"^\| {word}\b", glossary, flags=re.MULTILINE), word
