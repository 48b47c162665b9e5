"""The steering solver as a C package: strict compilation, its own example, the same bytes, no allocation."""

from __future__ import annotations

import csv
import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

import lie_codegen as lc
from lie_codegen.codegen.templates import template_folder
from lie_codegen.errors import InputError, UncontrollableError
from lie_codegen.steering.shooting.package import render_steering_package
from lie_codegen.steering.shooting.shooter import shooter

STRICT = ("-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-O2")
COMPILER = shutil.which("gcc") or shutil.which("cc")


def write(tree: dict[str, str], folder: Path) -> Path:
    for path, text in tree.items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_text(text)
    return folder


@pytest.mark.skipif(COMPILER is None, reason="no C compiler")
@pytest.mark.parametrize(
    ("name", "controls", "lanes"),
    [
        ("so3", ("w1", "w2"), ()),
        ("so3", ("w1", "w2"), ("-DLIE_CODEGEN_ONE_LANE",)),
        ("se3", (0, 1, 3), ()),
        *(
            pytest.param(name, controls, lanes, marks=pytest.mark.slow)
            for name, controls, lanes in [
                ("se2", (0, 1), ()),
                ("su2", (0, 1), ()),
                ("se2", (0, 1), ("-DLIE_CODEGEN_ONE_LANE",)),
                ("su2", (0, 1), ("-DLIE_CODEGEN_ONE_LANE",)),
                ("se3", (0, 1, 3), ("-DLIE_CODEGEN_ONE_LANE",)),
            ]
        ),
    ],
)
def test_the_example_compiles_by_itself_and_is_content(
    name: str, controls: tuple[str | int, ...], lanes: tuple[str, ...], tmp_path: Path
) -> None:
    write(render_steering_package(lc.group(name), controls), tmp_path)
    command = [str(COMPILER), *STRICT, *lanes, "-Iinclude", "example.c", f"src/{name}_steer.c", "-lm", "-o", "example"]
    subprocess.run(command, cwd=tmp_path, check=True, capture_output=True)
    done = subprocess.run([tmp_path / "example"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
    assert done.stdout.count(" ok\n") == 8
    if name == "so3":
        energy = float(re.search(r"energy (\S+) in 24 s", done.stdout)[1])  # type: ignore[index]
        assert energy == pytest.approx(0.80350066222184167 / 24, rel=1e-10)


@pytest.mark.skipif(shutil.which("clang") is None, reason="no clang")
def test_clang_agrees(tmp_path: Path) -> None:
    """Without the flags of this machine: vectors wider than its registers may not be passed by value."""
    write(render_steering_package(lc.group("so3"), ("w1", "w2")), tmp_path)
    command = ["clang", *STRICT, "-Iinclude", "example.c", "src/so3_steer.c", "-lm", "-o", "example"]
    done = subprocess.run(command, cwd=tmp_path, check=False, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert subprocess.run([tmp_path / "example"], check=False, capture_output=True).returncode == 0


def test_nothing_is_allocated_and_nothing_is_global() -> None:
    tree = render_steering_package(lc.group("so3"), ("w1", "w2"))
    source = tree["src/steering_problem.h"] + tree["src/so3_steer.c"]
    assert not re.search(r"\b(malloc|calloc|realloc|free|alloca)\b", source)
    outside = re.sub(r"\{[^{}]*\}", "", source)
    assert not re.findall(r"^static (?!const|void|int|double|inline)\w+ \w+( =|;)", outside, flags=re.MULTILINE)


@pytest.mark.parametrize(("name", "controls"), [("so3", ("w1", "w2", "w3")), ("se2", ("omega", "vx")), ("su2", (0, 1))])
def test_the_core_is_plain_c_that_tools_read_as_it_is(
    name: str, controls: tuple[int | str, ...], tmp_path: Path
) -> None:
    core = template_folder() / "steering_core.c"
    assert not re.search(r"\{[{%#]|[%#}]\}", core.read_text())
    tree = render_steering_package(lc.group(name), controls)
    assert tree[f"src/{name}_steer.c"] == core.read_text()
    for path in (f"include/{name}_steer.h", "src/steering_problem.h"):
        (tmp_path / Path(path).name).write_text(tree[path])
    for lanes in ((), ("-DLIE_CODEGEN_ONE_LANE",)):
        command = [str(COMPILER), *STRICT, *lanes, "-fsyntax-only", f"-I{tmp_path}", str(core)]
        done = subprocess.run(command, check=False, capture_output=True, text=True)
        assert done.returncode == 0, done.stderr


def test_the_same_bytes_twice_and_vectors_that_the_library_agrees_with(tmp_path: Path) -> None:
    group = lc.group("so3")
    tree = render_steering_package(group, ("w1", "w2"))
    assert tree == render_steering_package(group, (0, 1))
    rows = list(csv.DictReader(tree["test_vectors.csv"].splitlines()))
    targets = np.array([[float(x) for x in row["target"].split()] for row in rows]).reshape(-1, 3, 3)
    np.testing.assert_allclose(
        targets @ np.swapaxes(targets, 1, 2), np.broadcast_to(np.eye(3), targets.shape), atol=1e-13
    )
    found = shooter(group, (0, 1)).solve(targets)
    bounds = np.array([float(row["cost"]) for row in rows])
    assert np.all(found.cost <= bounds * (1 + 1e-9))


def test_generate_puts_it_beside_the_group(tmp_path: Path) -> None:
    folder = lc.generate(lc.group("se2"), tmp_path / "package", steering=(0, 1))
    assert (folder / "src" / "se2.c").is_file()
    assert (folder / "steering" / "src" / "se2_steer.c").is_file()
    assert "steering/example.c" in (folder / "manifest.json").read_text()
    lc.generate(lc.group("se2"), tmp_path / "package")
    assert not (folder / "steering" / "example.c").exists()


def test_generate_refuses(tmp_path: Path) -> None:
    with pytest.raises(UncontrollableError, match="growth"):
        lc.generate(lc.group("so3"), tmp_path / "package", steering=("w1",))
    assert not (tmp_path / "package").exists()
    with pytest.raises(InputError, match="group"):
        lc.generate(list(lc.group_kernels(lc.group("so3")))[:1], tmp_path / "package", steering=("w1", "w2"))
