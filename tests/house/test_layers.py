"""Imports point down only; heavy packages stay in their layers; the front door is frozen."""

from __future__ import annotations

import ast
import re
import subprocess
import sys
from dataclasses import dataclass, field
from functools import cache
from pathlib import Path

import pytest

import lie_codegen

#: From the ground up; imports point down (or stay on their floor), lazy ones and those for type checkers included.
LAYERS = (
    "errors", "whole_files", "identifiers", "unbound", "lost_parts", "door", "on_demand", "arrays", "shapes", "values", "exact", "algebra", "kernel", "codegen", "runtime", "groups", "signals", "flow", "mechanics",
    "control", "vehicles", "averaging", "rigid_body", "steering", "pictures", "studies", "gallery", "benchmarks", "cli",
)  # fmt: skip
PACKAGE = Path(lie_codegen.__file__).parent
FILES = sorted(PACKAGE.rglob("*.py"))
SUBJECTS = {"groups", "signals", "flow", "mechanics", "control", "vehicles", "averaging", "rigid_body", "steering"}
#: third-party package -> layers that may import it (numpy may be imported anywhere).
ALLOWED = {
    "sympy": {"on_demand", "exact", "algebra", "kernel", *SUBJECTS, "gallery"},
    "casadi": {"on_demand", "kernel", "codegen", "steering", "gallery", "benchmarks"},
    "jinja2": {"codegen"},
    "scipy": {"on_demand", *SUBJECTS, "studies", "gallery", "benchmarks"},
    "dask": {"studies", "benchmarks"},
    "distributed": {"studies"},
    "zarr": {"studies"},
    "xarray": {"studies"},
    "cloudpickle": {"studies"},
    "pyarrow": {"studies"},
    "rockit": {"benchmarks"},
    "crocoddyl": {"benchmarks"},
    "pinocchio": {"benchmarks"},
    "qutip": {"benchmarks", "steering"},
    "qutip_qtrl": {"benchmarks"},
    "rsplan": {"benchmarks"},
    "mpmath": {"gallery", "benchmarks"},
    "matplotlib": {"pictures", "gallery"},
    "anywidget": {"pictures"},
    "traitlets": {"pictures"},
    "typer": {"cli"},
    "rich": {"cli", "studies"},
    "platformdirs": {"runtime"},
    "filelock": {"runtime", "studies"},
    "numpy": set(LAYERS),
    "lazy_loader": {None, *LAYERS},
    "ziglang": {"runtime"},
    "jax": {"groups"},
    "torch": {"groups"},
}  # fmt: skip


def layer_of(parts: tuple[str, ...]) -> str | None:
    first = parts[0].removesuffix(".py") if parts else ""
    return first if first in LAYERS else None


#: What is loaded from above by its name alone, when it is asked for: (file, module). Each is a hook that its own file explains.
BY_NAME = {
    ("kernel/definition.py", "lie_codegen.runtime.recorded_kernels"),
    ("kernel/definition.py", "lie_codegen.groups.definition"),
    ("groups/generate.py", "lie_codegen.steering.shooting.package"),
}


@dataclass
class Noted:
    """What these tests ask of a file, from one walk through it."""

    imports: set[str] = field(default_factory=set)
    named: set[str] = field(default_factory=set)
    called: set[str] = field(default_factory=set)
    has_assert: bool = False
    has_bare_except: bool = False


def noted_in(source: str, package: str) -> Noted:
    """Of a file of that package: every import wherever it stands, in full, and modules of ours that texts name."""
    found, documentation = Noted(), set()
    for node in ast.walk(ast.parse(source)):
        if isinstance(node, ast.Expr) and isinstance(node.value, ast.Constant):
            documentation.add(id(node.value))
        if isinstance(node, ast.Import):
            found.imports |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            found.imports |= imported_from(node, package)
        elif isinstance(node, ast.Constant) and isinstance(node.value, str) and id(node) not in documentation:
            found.named |= set(re.findall(r"\blie_codegen(?:\.\w+)+", node.value))
        elif isinstance(node, ast.Call):
            found.called.add(dotted(node.func))
        found.has_assert |= isinstance(node, ast.Assert)
        found.has_bare_except |= isinstance(node, ast.ExceptHandler) and node.type is None
    return found


def imported_from(node: ast.ImportFrom, package: str) -> set[str]:
    """The modules, or what is taken from a module where that is none: `from lie_codegen import control` imports lie_codegen.control."""
    above = package.split(".")[: len(package.split(".")) - node.level + 1] if node.level else []
    home = ".".join([*above, *([node.module] if node.module else [])])
    if home != "lie_codegen" and not home.startswith("lie_codegen."):
        return {home}
    inner = {alias.name: f"{home}.{alias.name}" for alias in node.names}
    modules = {full for name, full in inner.items() if is_module(full) or home == "lie_codegen"}
    third = set(inner) if home == "lie_codegen.on_demand" else set()
    return modules | third | ({home} if len(modules) < len(inner) and home != "lie_codegen" else set())


@cache
def noted(path: Path) -> Noted:
    return noted_in(path.read_text(encoding="utf-8"), ".".join(("lie_codegen", *path.relative_to(PACKAGE).parts[:-1])))


def module_of(path: Path) -> str:
    return ".".join(("lie_codegen", *path.relative_to(PACKAGE).with_suffix("").parts)).removesuffix(".__init__")


def dotted(node: ast.expr) -> str:
    """a.b.c as it is written; what is not a name counts as nothing."""
    if isinstance(node, ast.Attribute):
        return f"{dotted(node.value)}.{node.attr}"
    return node.id if isinstance(node, ast.Name) else ""


def check_layers(file: str, found: Noted) -> None:
    """Imports of a file point down and stay in their layer, and so do modules that it names."""
    mine = layer_of(Path(file).parts)
    for name in found.imports:
        root, *rest = name.split(".")
        if root == "lie_codegen":
            theirs = layer_of(tuple(rest))
            if mine and theirs:
                assert LAYERS.index(theirs) <= LAYERS.index(mine), f"{mine} imports {name}"
            elif not mine:
                assert theirs in (None, "door") or file == "__main__.py", f"{file} imports {name}"
        elif root not in sys.stdlib_module_names:
            assert root in ALLOWED, f"{file} imports {name}: not a known dependency"
            assert mine in ALLOWED[root], f"{mine} imports {name}"
    for name in found.named:
        theirs = layer_of(tuple(name.split(".")[1:]))
        if mine and theirs and LAYERS.index(theirs) > LAYERS.index(mine):
            assert (file, name) in BY_NAME, f"{mine} names {name}, which lies above"


@pytest.mark.parametrize("path", FILES, ids=lambda path: str(path.relative_to(PACKAGE)))
def test_imports_point_down_and_stay_in_their_layer(path: Path) -> None:
    check_layers(path.relative_to(PACKAGE).as_posix(), noted(path))


@pytest.mark.parametrize(
    "planted",
    [
        "from lie_codegen.control.closed_loop import closed_loop",
        "import lie_codegen.control.closed_loop",
        "def lazy():\n    from lie_codegen.control import closed_loop",
        "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    from lie_codegen.control.closed_loop import closed_loop",
        "from lie_codegen import control",
        "from ..control.closed_loop import closed_loop",
        "from .. import control",
        "def lazy():\n    import scipy.linalg",
        "from importlib import import_module\nloop = import_module('lie_codegen.control.closed_loop')",
        "HOME = 'lie_codegen.control.closed_loop:closed_loop'",
    ],
)
def test_an_import_that_points_up_is_found_wherever_it_stands(planted: str) -> None:
    with pytest.raises(AssertionError):
        check_layers("kernel/planted.py", noted_in(planted, "lie_codegen.kernel"))


def circle_in(graph: dict[str, set[str]]) -> tuple[str, ...]:
    """Modules that import each other in a circle; none if there is none."""
    state: dict[str, int] = {}

    def visit(module: str, trail: tuple[str, ...]) -> tuple[str, ...]:
        if state.get(module) == 1:
            return (*trail, module)
        if state.get(module) == 2:
            return ()
        state[module] = 1
        for other in sorted(graph.get(module, ())):
            circle = visit(other, (*trail, module))
            if circle:
                return circle
        state[module] = 2
        return ()

    return next((circle for module in graph if (circle := visit(module, ()))), ())


def test_no_modules_import_each_other_in_a_circle() -> None:
    graph = {module_of(path): noted(path).imports for path in FILES}
    assert not circle_in(graph)


@pytest.mark.parametrize(
    "planted",
    [
        "from lie_codegen.kernel.records import encoded",
        "def lazy():\n    from lie_codegen.kernel import records",
        "from typing import TYPE_CHECKING\nif TYPE_CHECKING:\n    import lie_codegen.kernel.records",
        "from .records import encoded",
    ],
)
def test_a_circle_is_found_however_it_closes(planted: str) -> None:
    graph = {module_of(path): noted(path).imports for path in FILES}
    assert "lie_codegen.kernel.plain_data" in graph["lie_codegen.kernel.records"]
    planted_imports = noted_in(planted, "lie_codegen.kernel").imports
    assert circle_in({**graph, "lie_codegen.kernel.plain_data": planted_imports})


def is_module(name: str) -> bool:
    return PACKAGE.joinpath(*name.split(".")[1:]).with_suffix(".py").is_file()


def test_the_type_of_arrays_is_one() -> None:
    own = [path for path in FILES if "\nArray = " in path.read_text(encoding="utf-8")]
    assert own == [PACKAGE / "arrays.py"], "import lie_codegen.arrays.Array"


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
    forbidden = {"eval", "exec", "sympify", "sp.sympify", "sp.S", "parse_expr", "os.chdir"}
    for path in FILES:
        found = noted(path)
        assert not found.has_assert, f"assert in {path}"
        assert not found.has_bare_except, f"bare except in {path}"
        wrong = {name for name in found.called if name in forbidden or name.endswith("parse_expr")}
        assert not wrong, f"{wrong} in {path}"


def test_every_gallery_target_is_a_function_with_a_docstring() -> None:
    from importlib import import_module

    from lie_codegen.gallery.registry import TARGETS

    for target in TARGETS:
        function = getattr(import_module(f"lie_codegen.gallery.{target.module}"), target.name)
        assert function.__doc__, target.name


def test_no_test_asks_the_product_which_tolerance_to_grant() -> None:
    """atol, rtol, rel and abs of a comparison are numbers of the test, never names or attributes of the package."""
    for path in sorted(Path(__file__).parents[1].rglob("test_*.py")):
        nodes = list(ast.walk(ast.parse(path.read_text(encoding="utf-8"))))
        ours = {
            alias.asname or alias.name
            for node in nodes
            if isinstance(node, ast.ImportFrom) and (node.module or "").startswith("lie_codegen")
            for alias in node.names
        }
        for call in (node for node in nodes if isinstance(node, ast.Call)):
            name = call.func.attr if isinstance(call.func, ast.Attribute) else getattr(call.func, "id", "")
            if name not in ("assert_allclose", "allclose", "isclose", "approx"):
                continue
            for keyword in call.keywords:
                if keyword.arg not in ("atol", "rtol", "rel", "abs"):
                    continue
                granted = {node.id for node in ast.walk(keyword.value) if isinstance(node, ast.Name)} & ours
                granted |= {
                    node.attr
                    for node in ast.walk(keyword.value)
                    if isinstance(node, ast.Attribute) and node.attr in ("tolerance", "error_estimate", "rounding")
                }
                assert not granted, f"{path.name}:{call.lineno}: {keyword.arg} is {ast.unparse(keyword.value)}"
