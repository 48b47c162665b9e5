"""The site: every public name has its place, links lead somewhere, what the pages promise can be found. CI builds it with no warning."""

from __future__ import annotations

import re
import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any

import pytest
from tools import front_door

DOCS = Path(__file__).resolve().parents[2] / "docs"
sys.path.insert(0, str(DOCS))  # as conf.py does
_place = spec_from_file_location("site_pages", DOCS / "pages.py")
assert _place is not None
assert _place.loader is not None
pages: Any = module_from_spec(_place)
_place.loader.exec_module(pages)
WRITTEN = sorted(path for path in DOCS.rglob("*.md") if not {"_build", "jupyter_execute"} & set(path.parts))


def test_every_public_name_has_a_place() -> None:
    assert pages.subjects() == front_door.subjects()
    for subject in pages.subjects():
        text = pages.api(subject)
        missing = [name for name in front_door.names(subject) if f"\n## {name}\n" not in text]
        assert not missing, f"lc.{subject}: {', '.join(missing)}"


@pytest.fixture(scope="module")
def reference(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("reference")
    pages.write(folder)
    return folder


def test_links_lead_somewhere(reference: Path) -> None:
    for path in WRITTEN:
        for link in re.findall(r"\]\((?!https?://|#)([^)#\s]+)", path.read_text(encoding="utf-8")):
            target = (path.parent / link).resolve()
            generated = (
                reference / target.relative_to(DOCS / "reference")
                if target.is_relative_to(DOCS / "reference")
                else target
            )
            assert any(
                each.with_name(each.name + end).exists() for each in (target, generated) for end in ("", ".md")
            ), f"{path}: {link}"


def test_the_command_line_and_the_errors_are_there(reference: Path) -> None:
    commands = (reference / "cli.md").read_text(encoding="utf-8")
    for name in ("steer", "study", "page", "generate", "cache"):
        assert f"## {name}\n" in commands
    import lie_codegen.errors as errors

    text = (reference / "errors.md").read_text(encoding="utf-8")
    for name in vars(errors):
        if name.endswith(("Error", "Warning")):
            assert f"`{name}`" in text


def test_the_gallery_has_every_figure_its_command_and_numbers(reference: Path) -> None:
    from lie_codegen.gallery.registry import TARGETS

    text = (reference / "gallery.md").read_text(encoding="utf-8")
    for target in TARGETS:
        assert f"lie-codegen reproduce {target.name}\n" in text
        assert (DOCS / "gallery" / f"{target.name}.webp").stat().st_size > 5_000
        assert (DOCS / "gallery" / f"{target.name}-dark.webp").stat().st_size > 5_000
    shown = {path.name.partition(".")[0].removesuffix("-dark") for path in (DOCS / "gallery").iterdir()}
    assert shown == {target.name for target in TARGETS}


@pytest.mark.parametrize(
    "word", ["two wheels", "CNOT", "keep-out cone", "pickle", "180 degrees", "Kapitza", "not controllable"]
)
def test_a_word_that_is_looked_for_is_found(reference: Path, word: str) -> None:
    texts = [path.read_text(encoding="utf-8").lower() for path in (*WRITTEN, *reference.rglob("*.md"))]
    assert any(all(part in text for part in word.lower().split()) for text in texts)
