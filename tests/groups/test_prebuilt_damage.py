"""C that ships with the package and is not as it was written: derived again after one warning, never another group's numbers."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import warnings
from collections.abc import Callable
from pathlib import Path

import pytest

import lie_codegen as lc
from lie_codegen.errors import DegradedWarning
from lie_codegen.groups import prebuilt
from lie_codegen.groups.build import source_definition
from lie_codegen.groups.catalogue_names import definition_source
from lie_codegen.runtime import degraded
from lie_codegen.runtime.compiler import find_compilers

SO3, SE2 = "so3.json.xz", "se2.json.xz"


def _swap(folder: Path) -> None:
    first, second = (folder / SO3).read_bytes(), (folder / SE2).read_bytes()
    (folder / SO3).write_bytes(second)
    (folder / SE2).write_bytes(first)


def _flip(folder: Path) -> None:
    content = bytearray((folder / SO3).read_bytes())
    content[len(content) // 2] ^= 1
    (folder / SO3).write_bytes(bytes(content))


def _rename(folder: Path) -> None:
    """One bit: the definition of so3 is said to be that of so2."""
    index = (folder / "index.json").read_text()
    assert index.count('"so3"') >= 2
    (folder / "index.json").write_text(index.replace('": "so3"', '": "so2"'))


def _exchange_all(folder: Path) -> None:
    """Stores and their digests exchanged, as by a bad merge: each is whole."""
    _swap(folder)
    index = json.loads((folder / "index.json").read_text())
    for table in ("stores", "made_from"):
        index[table]["so3"], index[table]["se2"] = index[table]["se2"], index[table]["so3"]
    (folder / "index.json").write_text(json.dumps(index))


DAMAGE: dict[str, Callable[[Path], object]] = {
    "flipped": _flip,
    "truncated": lambda folder: (folder / SO3).write_bytes((folder / SO3).read_bytes()[:-100]),
    "empty": lambda folder: (folder / SO3).write_bytes(b""),
    "gone": lambda folder: (folder / SO3).unlink(),
    "swapped": _swap,
    "swapped with their digests": _exchange_all,
    "another group's name": _rename,
    "shared file": lambda folder: (folder / "lanes.json.xz").write_bytes((folder / SO3).read_bytes()),
    "index of nothing": lambda folder: (folder / "index.json").write_text("[]"),
    "half an index": lambda folder: (folder / "index.json").write_text((folder / "index.json").read_text()[:5000]),
}


def test_sealed_says_what_it_sealed() -> None:
    index = json.loads((prebuilt.prebuilt_folder() / "index.json").read_text())
    assert prebuilt.sealed(index) == index
    assert prebuilt.sealed({**index, "files": []}) != {**index, "files": []}


@pytest.mark.parametrize("name", DAMAGE)
def test_what_is_damaged_is_not_used_and_said_once(name: str, tmp_path: Path) -> None:
    folder = tmp_path / "prebuilt"
    shutil.copytree(prebuilt.prebuilt_folder(), folder)
    DAMAGE[name](folder)
    definition = source_definition(definition_source("so3"))
    degraded.warn_degraded.cache_clear()
    with pytest.warns(DegradedWarning, match="damaged and not used") as given:
        found = [prebuilt.find_prebuilt(definition, folder) for _ in range(2)]
    assert found == [None, None]
    assert len(given) == 1


def test_a_package_without_its_store_says_nothing(tmp_path: Path) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert prebuilt.find_prebuilt("anything", tmp_path) is None


BUILD = """
import sys
import warnings
from pathlib import Path
from lie_codegen.groups import prebuilt
prebuilt.prebuilt_folder = lambda: Path(sys.argv[1])
import lie_codegen as lc
with warnings.catch_warnings(record=True) as given:
    warnings.simplefilter("always")
    print(lc.build("so3").exp([0.1, 0.2, 0.3]).tolist())
print(len(given), file=sys.stderr)
"""


@pytest.mark.slow
@pytest.mark.skipif(not find_compilers(), reason="needs a C compiler")
@pytest.mark.parametrize("name", DAMAGE)
def test_numbers_are_right_whatever_is_damaged(name: str, tmp_path: Path) -> None:
    import scipy.linalg

    folder = tmp_path / "prebuilt"
    shutil.copytree(prebuilt.prebuilt_folder(), folder)
    DAMAGE[name](folder)
    root = str(Path(lc.__file__).parent.parent)
    environment = {**os.environ, "PYTHONPATH": root, "LIE_CODEGEN_CACHE": str(tmp_path / "cache")}
    done = subprocess.run(
        [sys.executable, "-c", BUILD, str(folder)], env=environment, capture_output=True, text=True, check=True
    )
    exact = scipy.linalg.expm([[0, -0.3, 0.2], [0.3, 0, -0.1], [-0.2, 0.1, 0]])
    assert abs(json.loads(done.stdout) - exact).max() < 1e-15
    assert done.stderr == "1\n"
