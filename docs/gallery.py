"""Makes the pictures and numbers of the gallery page: `python docs/gallery.py [FIGURE ...]`, all by default; look at them."""

from __future__ import annotations

import json
import sys
import tempfile
from pathlib import Path
from typing import Any

from lie_codegen.gallery.registry import TARGETS, reproduce
from lie_codegen.pictures.dark import dark
from lie_codegen.pictures.style import style

FOLDER = Path(__file__).parent / "gallery"
_WIDTH = 1200


def make(name: str) -> None:
    """The picture of a figure on both pages, 1,200 pixels wide, and its numbers."""
    with tempfile.TemporaryDirectory() as folder:
        result = reproduce(name, Path(folder), lambda line: None)
    FOLDER.mkdir(exist_ok=True)
    with style():
        for ending, figure in (("", result.figure), ("-dark", dark(result.figure))):
            figure.savefig(
                FOLDER / f"{name}{ending}.webp",
                dpi=_WIDTH / figure.get_size_inches()[0],
                pil_kwargs={"quality": 80, "method": 6},
            )
    (FOLDER / f"{name}.json").write_text(json.dumps(result.numbers, indent=1) + "\n", encoding="utf-8")


def page() -> str:
    """The page: of every figure the picture, the command that makes it, and its numbers."""
    lines = [
        "# Gallery",
        "",
        "Every figure is made by one command; `lie-codegen reproduce all` makes all of them. Each writes NAME.png and its numbers,",
        "NAME.json; `--format svg,pdf` adds files that stay sharp at any size, `--theme light,dark` a picture for dark pages.",
        "",
    ]
    for target in TARGETS:
        lines += [f"## {target.name.replace('_', ' ')}", "", f"{target.about[0].upper()}{target.about[1:]}.", ""]
        lines += ["::::{div} figure-scroll", ""]
        for theme, ending in (("light", ""), ("dark", "-dark")):
            lines += [
                f"```{{image}} ../gallery/{target.name}{ending}.webp",
                f":class: only-{theme}",
                f":alt: {target.about}",
                "```",
                "",
            ]
        lines += ["::::", "", "```sh", f"lie-codegen reproduce {target.name}", "```", ""]
        numbers = json.loads((FOLDER / f"{target.name}.json").read_text(encoding="utf-8"))
        rows = _rows(numbers)
        if rows:
            lines += ["| number | value |", "|---|---|", *(f"| {key} | {value} |" for key, value in rows), ""]
    return "\n".join(lines)


def _rows(numbers: dict[str, Any], most: int = 8) -> list[tuple[str, str]]:
    """The first numbers that a line can hold: scalars, words and short lists."""
    rows = []
    for key, value in numbers.items():
        if isinstance(value, list) and 0 < len(value) <= 6 and all(isinstance(each, int | float) for each in value):
            rows.append((_named(key), ", ".join(_told(each) for each in value)))
        elif isinstance(value, str | int | float):
            rows.append((_named(key), _told(value)))
        elif isinstance(value, dict):
            rows += [(f"{_named(key)}, {_named(k)}", _told(v)) for k, v in value.items() if isinstance(v, int | float)]
    return rows[:most]


def _named(key: str) -> str:
    return key.replace("_", " ").replace("|", "\\|")


def _told(value: Any) -> str:
    return f"{value:.6g}" if isinstance(value, float) else str(value).replace("|", "\\|")


if __name__ == "__main__":
    for each in sys.argv[1:] or [target.name for target in TARGETS]:
        print(each, flush=True)  # noqa: T201
        make(each)
