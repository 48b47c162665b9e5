"""Groups kernel by kernel, and the C sources that ship with the package: asked for, compiled once, never a stale one."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from tools import prebuild

import lie_codegen as lc
from lie_codegen.codegen.package import render_library
from lie_codegen.errors import GroupFileError, InputError, JacobiError, NoCompilerWarning
from lie_codegen.groups import group_library, prebuilt
from lie_codegen.groups.buildable import object_definition, source_definition
from lie_codegen.groups.catalogue_names import definition_source, group_path
from lie_codegen.groups.kernels import KERNEL_NAMES, group_kernel
from lie_codegen.groups.prebuilt import find_prebuilt, prebuilt_folder
from lie_codegen.runtime import cache, compiler, compiling
from lie_codegen.runtime.compiler import find_compilers
from lie_codegen.runtime.digests import digest

pytestmark = pytest.mark.skipif(not find_compilers(), reason="needs a C compiler")
COMMAND = "run: python -m tests.tools.prebuild"
#: Compared with the generator in every run; the others only in slow ones.
FAST = ("h3", "se2", "so3")

HEISENBERG = """
name = "mine"
labels = ["x", "y", "z"]
[brackets]
"x,y" = { z = 1 }
"""


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "the cache"
    monkeypatch.setenv("LIE_CODEGEN_CACHE", str(folder))
    return folder


@pytest.fixture
def current() -> None:
    """Skip where the store is out of date: one test says so, and what to do."""
    if {*FAST} & {*prebuild.stale(prebuilt_folder())}:
        pytest.skip(COMMAND)


def index() -> dict[str, Any]:
    data: dict[str, Any] = json.loads((prebuilt_folder() / "index.json").read_text())
    return data


def by_name(name: str) -> str:
    return source_definition(definition_source(name))


def heavy_modules(code: str) -> str:
    """What a fresh process prints that runs the code and then names the heavy packages it has imported."""
    code += "; import sys; print([m for m in ('sympy', 'casadi', 'jinja2', 'scipy') if m in sys.modules])"
    root = str(Path(lc.__file__).parent.parent)
    environment = {**os.environ, "PYTHONPATH": root}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_a_kernel_is_compiled_when_it_is_first_asked_for(home: Path, compiles: list[str]) -> None:
    so3 = lc.build("so3")
    assert so3.kernels == KERNEL_NAMES
    assert set(KERNEL_NAMES) <= set(dir(so3))
    assert compiles == []
    x = np.array([0.1, 0.2, 0.3])
    np.testing.assert_allclose(so3.log(so3.exp(x)), x, atol=1e-15)
    assert len(compiles) == 2
    assert so3.exp is so3["exp"]
    assert len(compiles) == 2
    again = lc.build("so3")
    np.testing.assert_array_equal(again.exp(x), so3.exp(x))
    assert len(compiles) == 2
    assert again.ad(x).shape == (3, 3)
    assert len(compiles) == 3
    assert so3.path == home / "entries"
    assert any("samples at a time" in line for line in so3.build_log)


def test_kernels_can_be_had_at_once(home: Path, compiles: list[str]) -> None:
    lc.build("h3", kernels=("exp", "log"))
    assert len(compiles) == 2
    everything = lc.build("h3", kernels="all")
    assert len(compiles) == len(KERNEL_NAMES)
    for name in everything.kernels:
        assert everything[name].name == name
    assert len(compiles) == len(KERNEL_NAMES)


def test_an_unknown_kernel_is_refused(home: Path, compiles: list[str]) -> None:
    with pytest.raises(InputError, match=r"no kernel expp of so3: it has product_exp"):
        lc.build("so3", kernels=("expp",))
    with pytest.raises(InputError, match=r"no kernel expp of so3: it has exp$"):
        lc.build(group_kernel(lc.group("so3"), "exp"), kernels=("expp",))
    compiles.clear()
    library = lc.build("so3")
    with pytest.raises(AttributeError, match="near: exp"):
        library.expp  # noqa: B018
    with pytest.raises(KeyError):
        library["expp"]
    assert compiles == []


def test_threads_compile_a_kernel_once(home: Path, compiles: list[str]) -> None:
    library = lc.build("so3")
    found: list[Any] = []
    gate = threading.Barrier(8)

    def ask() -> None:
        gate.wait()
        found.append(library.exp)

    threads = [threading.Thread(target=ask) for _ in range(8)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(found) == 8
    assert all(each is found[0] for each in found)
    assert len(compiles) == 1


def test_processes_that_build_at_once_agree(home: Path) -> None:
    code = (
        "import lie_codegen as lc; lib = lc.build('h3', kernels='all');"
        "print(lib.exp([1, 2, 3]).tolist(), lib.wei_norman_rate([1, 2, 3], [4, 5, 6]).tolist())"
    )
    root = str(Path(lc.__file__).parent.parent)
    environment = {**os.environ, "PYTHONPATH": root}
    runs = [
        subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, text=True, env=environment)
        for _ in range(3)
    ]
    answers = {run.communicate()[0] for run in runs}
    assert answers == {"[[1.0, 1.0, 4.0], [0.0, 1.0, 2.0], [0.0, 0.0, 1.0]] [4.0, 5.0, -2.0]\n"}
    assert len(list((home / "entries").iterdir())) == len(KERNEL_NAMES)
    assert not list((home / "scratch").iterdir())


def test_a_failure_is_told_when_the_kernel_is_asked_for_and_is_not_kept(
    home: Path, compiles: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    library = lc.build("so3")
    with monkeypatch.context() as patch:
        patch.setattr(compiling, "compile_library", _full_disk)
        patch.setattr("lie_codegen.runtime.cache_door.temporary_folder", lambda reason: home)
        with pytest.raises(lc.errors.CacheError, match="No space left"):
            library.exp  # noqa: B018
    assert library.exp([0.0, 0.0, 0.0])[0, 0] == 1.0


def _full_disk(*args: Any) -> None:
    raise OSError(28, "No space left on device")


def test_a_wrong_definition_is_refused_at_once(home: Path, tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text(HEISENBERG.replace("z = 1", "w = 1"))
    with pytest.raises(GroupFileError, match="'w' is not one of the labels"):
        lc.build(file)
    file.write_text(HEISENBERG + '"y,z" = { x = 1 }\n"x,z" = { x = 1 }\n')
    with pytest.raises(JacobiError):
        lc.build(file)


def test_a_file_that_is_edited_meanwhile_is_built_as_it_was_read(home: Path, tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text(HEISENBERG)
    library = lc.build(file)
    file.write_text(HEISENBERG.replace("z = 1", "z = 5"))
    x, y = [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]
    np.testing.assert_array_equal(library.bracket(x, y), [0, 0, 1])
    np.testing.assert_array_equal(lc.build(file).bracket(x, y), [0, 0, 5])
    file.write_text(HEISENBERG)
    np.testing.assert_array_equal(lc.build(file).bracket(x, y), [0, 0, 1])


def test_a_cache_that_cannot_take_notes_is_no_obstacle(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def refused(*args: Any) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(cache, "store_note", refused)
    assert lc.build("so3").kernels == KERNEL_NAMES


def test_without_a_compiler_each_kernel_is_interpreted(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    x = np.array([0.1, 0.2, 0.3])
    expected = lc.build("so3").exp(x)
    monkeypatch.setenv("LIE_CODEGEN_CC", "none")
    compiler.warn_no_compiler.cache_clear()
    with pytest.warns(NoCompilerWarning):
        library = lc.build("so3")
    assert (library.compiled, library.path, library.kernels) == (False, None, KERNEL_NAMES)
    np.testing.assert_array_equal(library.exp(x), expected)


@pytest.mark.usefixtures("current")
def test_a_catalogue_group_is_built_and_loaded_without_sympy_and_casadi(home: Path) -> None:
    code = "import lie_codegen as lc; print(lc.build('so3').wei_norman_rate([0, 0, 0], [1, 2, 3]))"
    assert heavy_modules(code).split("\n")[:2] == ["[1. 2. 3.]", "[]"]
    assert heavy_modules(code).split("\n")[:2] == ["[1. 2. 3.]", "[]"]  # and from the cache


def test_a_group_of_ones_own_is_loaded_without_sympy_and_casadi(home: Path, tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text(HEISENBERG)
    code = f"import lie_codegen as lc; lc.build({str(file)!r}).exp([1, 0, 0])"
    assert "sympy" in heavy_modules(code)
    assert heavy_modules(code).strip() == "[]"


def test_the_store_is_current() -> None:
    data = index()
    assert prebuild.stale(prebuilt_folder()) == [], COMMAND
    expected = {digest(each): name for name in lc.group_names() for each in prebuild.definitions_of(name)}
    assert data["definitions"] == expected, COMMAND
    assert set(data["stores"]) == {*lc.group_names(), prebuilt.SHARED_STORE}
    files = {path.name for path in prebuilt_folder().iterdir()}
    assert files == {"index.json", *(f"{name}.json.xz" for name in data["stores"])}


@pytest.mark.parametrize("name", FAST)
def test_the_store_holds_what_the_generator_writes(name: str) -> None:
    made, kept = prebuild.derived(name), prebuild.unpack(prebuilt_folder() / f"{name}.json.xz")
    # What ran may have grown by a module that is imported for a type; `stale` judges whether that matters.
    assert {**kept, "made_from": None} == {**made["store"], "made_from": None}, COMMAND
    assert prebuild.unpack(prebuilt_folder() / f"{prebuilt.SHARED_STORE}.json.xz") == made["shared"], COMMAND


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(set(lc.group_names()) - set(FAST)))
def test_the_store_holds_what_the_generator_writes_for_every_group(name: str) -> None:
    test_the_store_holds_what_the_generator_writes(name)


@pytest.mark.usefixtures("current")
@pytest.mark.parametrize("name", FAST)
def test_sources_from_the_store_are_those_of_the_generator(name: str) -> None:
    group = lc.group(name)
    found = find_prebuilt(by_name(name))
    assert found is not None
    assert find_prebuilt(object_definition(group)) == found
    assert (found.namespace, found.kernels) == (name, KERNEL_NAMES)
    for kernel in KERNEL_NAMES:
        assert found.sources(kernel) == render_library(name, [group_kernel(group, kernel)])


@pytest.mark.usefixtures("current")
def test_what_does_not_match_is_not_used(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    folder = tmp_path / "prebuilt"
    shutil.copytree(prebuilt_folder(), folder)
    assert find_prebuilt(by_name("so3"), folder) is not None
    assert find_prebuilt(by_name("so3") + " ", folder) is None
    other = (folder / "se2.json.xz").read_bytes()
    kept = (folder / "so3.json.xz").read_bytes()
    for content in (other, b"", kept[:-10], kept + b"\0"):
        (folder / "so3.json.xz").write_bytes(content)
        assert find_prebuilt(by_name("so3"), folder) is None
    (folder / "so3.json.xz").unlink()
    assert find_prebuilt(by_name("so3"), folder) is None
    assert find_prebuilt(by_name("se2"), folder) is not None
    data = index()
    wrong_bytes = {**data, "sha256": "0" * 64}
    (folder / "index.json").write_text(json.dumps(prebuilt.sealed(wrong_bytes)))
    assert find_prebuilt(by_name("se2"), folder) is not None  # other bytes, the same functions
    for wrong in ({**wrong_bytes, "made_from": {"se2": "0" * 64}}, {**data, "files": ["gone.py"]}):
        (folder / "index.json").write_text(json.dumps(prebuilt.sealed(wrong)))
        assert find_prebuilt(by_name("se2"), folder) is None
    (folder / "index.json").unlink()
    assert find_prebuilt(by_name("se2"), folder) is None


@pytest.mark.usefixtures("current")
def test_an_edit_makes_those_groups_stale_that_are_made_from_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    package = tmp_path / "lie_codegen"
    shutil.copytree(Path(lc.__file__).parent, package, ignore=shutil.ignore_patterns("__pycache__"))
    monkeypatch.setattr(prebuilt, "_PACKAGE", package)
    folder = package / "prebuilt"

    def stale_after(file: str, edit: Callable[[str], str]) -> set[str]:
        path = package / file
        text = path.read_text()
        assert edit(text) != text
        path.write_text(edit(text))
        stale = {name for name in ("so3", "h3") if find_prebuilt(by_name(name), folder) is None}
        assert find_prebuilt(by_name("se2") + " ", folder) is None
        path.write_text(text)
        return stale

    assert stale_after("groups/kernels.py", lambda text: text + "# a remark\n") == set()
    assert stale_after("groups/kernels.py", lambda text: text.replace('"""', '"""About ', 1)) == set()
    assert (
        stale_after("groups/kernels.py", lambda text: text + "\ndef _unheard():\n    return _unseen\n_unseen = 3\n")
        == set()
    )
    assert (
        stale_after(
            "errors.py",
            lambda text: text + "\nclass FreshError(Exception):\n    def __str__(self):\n        return 1\n",
        )
        == set()
    )
    assert stale_after("averaging/magnus.py", lambda text: text + "\nraise ValueError\n") == set()
    assert stale_after("groups/kernels.py", lambda text: text + "\ndef _matrix(data, name):\n    return 0\n") == {
        "so3",
        "h3",
    }
    assert stale_after("groups/kernels.py", lambda text: text + "\ndel _MAKERS['log']\n") == {"so3", "h3"}
    assert stale_after(
        "groups/kernels.py", lambda text: text.replace("exp_matrix, jacobian", "exp_matrix, coordinates as jacobian")
    ) == {
        "so3",
        "h3",
    }
    assert stale_after(
        "groups/maps/log_blocks.py", lambda text: text.replace("q0 * q0 + square", "square + q0 * q0")
    ) == {"so3"}


def test_a_stale_store_changes_nothing_but_time(
    home: Path, compiles: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    x = np.array([0.1, 0.2, 0.3])
    expected = lc.build("so3").exp(x)
    monkeypatch.setattr(group_library, "find_prebuilt", lambda definition: None)
    shutil.rmtree(home / "requests")
    np.testing.assert_array_equal(lc.build("so3").exp(x), expected)
    assert len(compiles) == 1  # the same C text: nothing was compiled again


def test_the_path_of_a_catalogue_file_is_the_group_of_that_name(home: Path, compiles: list[str]) -> None:
    lc.build("so3", kernels=("exp",))
    lc.build(group_path("so3"), kernels=("exp",))
    lc.build(lc.group("so3"), kernels=("exp",))
    assert len(compiles) == 1
