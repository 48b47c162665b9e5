"""Write lie_codegen/__init__.pyi, the flat front door, from the stubs of the subjects: `python tests/tools/front_door.py`.

A public name is one line in its subject's stub, `from .attitude_law import attitude_law as attitude_law` in
lie_codegen/control/__init__.pyi; `lc.attitude_law` follows from it by this script. tests/house compares.
"""

from __future__ import annotations

import ast
import inspect
import sys
from importlib import import_module
from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[2] / "lie_codegen"

#: Names and parameters of the door that users have; `--freeze` adds those of today.
FROZEN = Path(__file__).with_name("front_door.txt")

HEADING = '''"""The front door, indexed by subject: `lc.NAME` for every public name.

Written by tests/tools/front_door.py from lie_codegen/SUBJECT/__init__.pyi; add names there.
"""

__version__: str

'''


def subjects() -> list[str]:
    """Packages with a stub, which is what makes them public."""
    return sorted(stub.parent.name for stub in PACKAGE.glob("*/__init__.pyi"))


def names(subject: str) -> list[str]:
    """Public names of a subject, in the order of ruff's import sorting: constants, classes, functions."""
    tree = ast.parse((PACKAGE / subject / "__init__.pyi").read_text(encoding="utf-8"))
    found = [alias.name for node in tree.body if isinstance(node, ast.ImportFrom) for alias in node.names]
    return sorted(found, key=lambda name: (not name.isupper(), name[0].islower(), name))


def flat_stub() -> str:
    """Text of lie_codegen/__init__.pyi."""
    packages = "".join(f"from . import {subject} as {subject}\n" for subject in sorted(["errors", *subjects()]))
    indexed = "".join(
        f"\n# {subject}\n" + "".join(f"from .{subject} import {name} as {name}\n" for name in names(subject))
        for subject in subjects()
    )
    return f"{HEADING}{packages}{indexed}"


def frozen() -> dict[str, set[str]]:
    """Names that may not be lost, each with its parameters."""
    lines = FROZEN.read_text(encoding="utf-8").splitlines() if FROZEN.is_file() else []
    return {name: set(parameters.split()) for name, _, parameters in (line.partition(":") for line in lines)}


def present() -> dict[str, set[str]]:
    """Names that there are, each with its parameters."""
    values = {name: getattr(import_module("lie_codegen"), name) for subject in subjects() for name in names(subject)}
    return {name: set(inspect.signature(value).parameters) - {"unknown"} for name, value in values.items()}


def freeze() -> None:
    """Add what there is to what may not be lost."""
    kept, found = frozen(), present()
    both = {name: kept.get(name, set()) | found.get(name, set()) for name in sorted({*kept, *found})}
    FROZEN.write_text("".join(f"{name}: {' '.join(sorted(each))}\n" for name, each in both.items()), encoding="utf-8")


if __name__ == "__main__":
    (PACKAGE / "__init__.pyi").write_text(flat_stub(), encoding="utf-8")
    if "--freeze" in sys.argv:
        freeze()
