"""Write lie_codegen/__init__.pyi, the flat front door, from the stubs of the subjects: `python tests/tools/front_door.py`.

A public name is one line in its subject's stub, `from .attitude_law import attitude_law as attitude_law` in
lie_codegen/control/__init__.pyi; `lc.attitude_law` follows from it by this script. tests/house compares.
"""

from __future__ import annotations

import ast
from pathlib import Path

PACKAGE = Path(__file__).resolve().parents[2] / "lie_codegen"

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


if __name__ == "__main__":
    (PACKAGE / "__init__.pyi").write_text(flat_stub(), encoding="utf-8")
