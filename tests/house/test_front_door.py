"""The front door: stubs by subject, one flat stub from them, names that may be gained and not lost."""

from __future__ import annotations

import ast
import os
import subprocess
import sys
from importlib import import_module
from inspect import signature
from pathlib import Path

import pytest
from tools import front_door

import lie_codegen as lc

SUBJECTS = front_door.subjects()
REWRITE = "run: python tests/tools/front_door.py"


def test_the_flat_stub_is_the_stubs_of_the_subjects() -> None:
    assert (front_door.PACKAGE / "__init__.pyi").read_text(encoding="utf-8") == front_door.flat_stub(), REWRITE


def test_no_name_is_public_twice_or_the_name_of_a_package() -> None:
    names = [name for subject in SUBJECTS for name in front_door.names(subject)]
    assert sorted(names) == sorted(set(names))
    packages = {path.parent.name for path in front_door.PACKAGE.glob("*/__init__.py")}
    assert not packages & set(names)


@pytest.mark.parametrize("subject", SUBJECTS)
def test_every_public_name_is_the_same_object_by_both_doors(subject: str) -> None:
    package = import_module(f"lie_codegen.{subject}")
    assert getattr(lc, subject) is package
    assert set(dir(package)) == set(front_door.names(subject))
    for name in front_door.names(subject):
        value = getattr(package, name)
        assert value is getattr(lc, name)
        assert getattr(value, "__doc__", None), f"{name} has no docstring"
        if hasattr(value, "cache_info"):
            assert not signature(value).parameters, f"{name}: a memo hashes its arguments before any guard sees them"


@pytest.mark.parametrize("subject", SUBJECTS)
def test_a_public_name_is_not_hidden_by_the_module_of_its_name(subject: str) -> None:
    for stub in ast.parse((front_door.PACKAGE / subject / "__init__.pyi").read_text(encoding="utf-8")).body:
        if isinstance(stub, ast.ImportFrom) and stub.module:
            module = import_module(f"lie_codegen.{subject}.{stub.module}")
            for alias in stub.names:
                assert alias.name == alias.asname, f"write `import {alias.name} as {alias.name}`"
                assert getattr(lc, alias.name) is getattr(module, alias.name), f"rename {alias.name}.py"


def test_every_name_of_the_door_is_importable_at_once(repository: Path) -> None:
    """SPEC 1: with EAGER_IMPORT every stub line is resolved while the package is imported."""
    environment = {**os.environ, "PYTHONPATH": str(repository), "EAGER_IMPORT": "1"}
    done = subprocess.run([sys.executable, "-c", "import lie_codegen"], capture_output=True, text=True, env=environment)
    assert done.returncode == 0, done.stderr


def test_the_front_door_loses_no_name_and_no_parameter() -> None:
    """It may gain both; what was given up on purpose is struck from tests/tools/front_door.txt by hand."""
    present = front_door.present()
    lost = {name: parameters - present.get(name, set()) for name, parameters in front_door.frozen().items()}
    assert not {name: each for name, each in lost.items() if each or name not in present}
