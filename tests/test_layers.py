"""Imports point left only; heavy packages stay in their layers; the front door is frozen."""

from __future__ import annotations

import ast
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

import lie_codegen

LAYERS = (
    "algebra", "groups", "mechanics", "averaging", "control", "kernels", "lowering", "codegen", "runtime", "simulation",
    "steering", "studies", "gallery", "plots", "cli",
)  # fmt: skip
PACKAGE = Path(lie_codegen.__file__).parent
FILES = sorted(PACKAGE.rglob("*.py"))
#: third-party package -> layers that may import it (numpy may be imported anywhere).
ALLOWED = {
    "sympy": {"algebra", "groups", "mechanics", "averaging", "control", "kernels", "lowering", "simulation", "studies", "gallery"},
    "casadi": {"lowering", "codegen", "runtime", "simulation", "steering", "studies"},
    "jinja2": {"codegen"},
    "scipy": {"control", "simulation", "steering", "studies", "gallery"},
    "dask": {"studies"},
    "rockit": {"studies"},
    "crocoddyl": {"studies"},
    "mpmath": {"studies"},
    "matplotlib": {"gallery", "plots"},
    "typer": {"cli"},
    "rich": {"cli"},
    "platformdirs": {"runtime"},
    "filelock": {"runtime"},
    "numpy": set(LAYERS),
    "ziglang": {"runtime"},
}  # fmt: skip


def layer_of(parts: tuple[str, ...]) -> str | None:
    return parts[0] if parts and parts[0] in LAYERS else None


def imports(path: Path) -> Iterator[str]:
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
            yield node.module


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_imports_point_left_and_stay_in_their_layer(path: Path) -> None:
    mine = layer_of(path.relative_to(PACKAGE).parts)
    for name in imports(path):
        root, *rest = name.split(".")
        if root == "lie_codegen":
            theirs = layer_of(tuple(rest))
            if mine and theirs:
                assert LAYERS.index(theirs) <= LAYERS.index(mine), f"{mine} imports {name}"
            elif not mine:
                assert theirs is None or path.name == "__main__.py", f"{path.name} imports {name}"
        elif root not in sys.stdlib_module_names:
            assert root in ALLOWED, f"{path.name} imports {name}: not a known dependency"
            assert mine in ALLOWED[root], f"{mine} imports {name}"


def test_no_two_modules_import_each_other() -> None:
    graph: dict[str, set[str]] = {}
    for path in FILES:
        module = ".".join(("lie_codegen", *path.relative_to(PACKAGE).with_suffix("").parts))
        tree = ast.parse(path.read_text(encoding="utf-8"))
        top = [node for node in tree.body if isinstance(node, ast.ImportFrom) and node.module]
        graph[module] = {node.module for node in top if node.module and node.module.startswith("lie_codegen")}
    state: dict[str, int] = {}

    def visit(module: str, trail: tuple[str, ...]) -> None:
        assert state.get(module) != 1, " -> ".join((*trail, module))
        if state.get(module) == 2:
            return
        state[module] = 1
        for other in sorted(graph.get(module, ())):
            visit(other, (*trail, module))
        state[module] = 2

    for module in graph:
        visit(module, ())


def test_the_front_door_is_importable_and_documented() -> None:
    for name in lie_codegen.__all__:
        value = getattr(lie_codegen, name)
        if callable(value):
            assert value.__doc__, name


def test_importing_the_package_imports_nothing_heavy() -> None:
    code = "import lie_codegen, sys; print([m for m in ('sympy', 'casadi', 'numpy', 'scipy', 'matplotlib') if m in sys.modules])"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_no_forbidden_construct_in_the_package() -> None:
    for path in FILES:
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            assert not isinstance(node, ast.Assert), f"assert in {path}"
            assert not (isinstance(node, ast.ExceptHandler) and node.type is None), f"bare except in {path}"
            if isinstance(node, ast.Call):
                called = ast.unparse(node.func)
                assert called not in {"eval", "exec", "sympify", "sp.sympify", "sp.S", "parse_expr", "os.chdir"}, (
                    f"{called} in {path}"
                )
                assert not called.endswith("parse_expr"), f"{called} in {path}"


def test_every_gallery_target_is_a_function_with_a_docstring() -> None:
    from importlib import import_module

    from lie_codegen.gallery.registry import TARGETS

    for target in TARGETS:
        function = getattr(import_module(f"lie_codegen.gallery.{target.module}"), target.name)
        assert function.__doc__, target.name
