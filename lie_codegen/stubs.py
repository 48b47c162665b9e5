"""The public names of a package, from the stub beside it: one line a name, `from .module import name as name`."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import lazy_loader


def attach_stub(package: str, file: str) -> tuple[Callable[[str], Any], Callable[[], list[str]], list[str]]:
    """(__getattr__, __dir__, __all__) of a package; a name is imported when it is first used.

    Lines are split into words: lazy_loader's own reader of stubs loads Python's parser, which takes as long as all else that an import does.
    """
    modules: dict[str, list[str]] = {}
    with open(f"{file}i", encoding="utf-8") as stub:
        for line in stub:
            if line.startswith("from "):
                _, module, _, name, _, _ = line.split()
                modules.setdefault(module[1:], []).append(name)
    return lazy_loader.attach(package, modules.pop("", None), modules)  # type: ignore[no-any-return]
