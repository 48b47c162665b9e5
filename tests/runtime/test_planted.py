"""What lies in the cache and was not put there by this user's own builds: another entry's files, another user's, a FIFO; never wrong numbers."""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import pytest

import lie_codegen as lc
from lie_codegen.errors import CacheWarning
from lie_codegen.groups.recorded import recorded
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.runtime import cache, cache_folder
from lie_codegen.runtime.build import build_kernels
from lie_codegen.runtime.compiler import find_compilers
from tests.hunt.hostile import alarmed

ROOT = Path(lc.__file__).parent.parent
pytestmark = pytest.mark.skipif(not find_compilers() or os.name != "posix", reason="needs a C compiler on POSIX")
#: No other process of the machine runs as this user.
OTHER = 64_999

PATH = [str(ROOT), str(ROOT / "tests"), str(ROOT / "tests" / "runtime")]
#: Where packages are, and a Python that all users can read, by which another user finds them.
SITE = sorted({Path(np.__file__).parents[1]})
OTHERS_PYTHON = f"/usr/bin/python3.{sys.version_info.minor}"


def environment(folder: Path, **more: str) -> dict[str, str]:
    return {**os.environ, "PYTHONPATH": os.pathsep.join(PATH), "LIE_CODEGEN_CACHE": str(folder), **more}


@pytest.fixture
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "cache"
    monkeypatch.setenv("LIE_CODEGEN_CACHE", str(folder))
    return folder


def scaled(factor: float) -> Kernel:
    return Kernel("scale", "toy", (Port("x", ()),), (Port("y", ()),), lambda ops, x: (factor * x,), f"y = {factor} x")


def scale(factor: float) -> float:
    """What the library of that definition multiplies by, through the cache."""
    library = build_kernels(lambda: [scaled(factor)], namespace="toy", definition=str(factor))
    return float(library.scale(1.0))


def exchange(first: Path, second: Path) -> None:
    aside = first.with_name("aside")
    first.rename(aside)
    second.rename(first)
    aside.rename(second)


def test_files_of_two_entries_exchanged_are_not_taken(home: Path) -> None:
    assert (scale(2.0), scale(3.0)) == (2.0, 3.0)
    exchange(*(path.parent for path in home.glob("entries/*/sources.json")))
    assert (scale(2.0), scale(3.0)) == (2.0, 3.0)
    # beside the digest of the package
    asked = [path for path in home.glob("requests/*.json") if '"entry"' in path.read_text()]
    exchange(*asked)
    assert (scale(2.0), scale(3.0)) == (2.0, 3.0)


def test_records_of_two_groups_exchanged_or_damaged_are_made_again(home: Path) -> None:
    """Of another group, or with one digit changed, a record would be another group."""

    lc.group("so3"), lc.group("se2")
    for note in home.glob("requests/*.json"):
        note.unlink()

    def made(name: str) -> str:
        return recorded(name, lambda: lc.group(name)).name

    assert (made("so3"), made("se2")) == ("so3", "se2")
    notes = sorted(home.glob("requests/*.json"))
    exchange(*notes)
    assert (made("so3"), made("se2")) == ("so3", "se2")
    for note in notes:
        text = note.read_text()
        note.write_text(text.replace("so3", "so9").replace("1", "3"))
    assert (made("so3"), made("se2")) == ("so3", "se2")


def test_a_file_says_where_it_belongs(tmp_path: Path) -> None:
    folder = tmp_path / "requests"
    cache.write_json(folder / "a.json", {"entry": "x", "é": [1.5, None]})
    assert cache.read_json(folder / "a.json") == {"entry": "x", "é": [1.5, None]}
    assert json.loads((folder / "a.json").read_text())["data"]["entry"] == "x"
    shutil.copy(folder / "a.json", folder / "b.json")
    assert cache.read_json(folder / "b.json") is None
    whole = (folder / "a.json").read_bytes()
    rng = np.random.default_rng(0)
    for at in rng.integers(0, len(whole), 60):
        damaged = bytearray(whole)
        damaged[at] ^= 1 << int(rng.integers(0, 7))
        (folder / "a.json").write_bytes(damaged)
        assert cache.read_json(folder / "a.json") is None, at
    for text in ("", "{", "[]", '{"entry": "x"}', whole.decode() + " "):
        (folder / "a.json").write_text(text)
        assert cache.read_json(folder / "a.json") is None


def test_a_fifo_in_the_place_of_an_entry_is_not_waited_for(home: Path) -> None:
    assert scale(2.0) == 2.0
    for file in (*home.glob("requests/*.json"), *home.glob("entries/*/*.json")):
        file.unlink()
        os.mkfifo(file)
    assert alarmed(60.0, lambda: scale(2.0)) == 2.0


def give_away(folder: Path) -> None:
    for each in (folder, *folder.rglob("*")):
        os.chown(each, OTHER, OTHER, follow_symlinks=False)


@pytest.mark.skipif(os.geteuid() != 0, reason="only root may give files to another user")
def test_another_users_folder_and_files_are_not_used(
    home: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, compiles: list[str]
) -> None:
    assert scale(2.0) == 2.0
    give_away(home)
    link = tmp_path / "link"
    link.symlink_to(home)
    for folder in (home, link):
        cache_folder._warn_once.cache_clear()
        monkeypatch.setenv("LIE_CODEGEN_CACHE", str(folder))
        with pytest.warns(CacheWarning, match="belongs to user 64999, not to you"):
            assert scale(2.0) == 2.0
    # A folder that was open to all is closed again: what another user planted in it meanwhile is not ours, and is built anew.
    monkeypatch.setenv("LIE_CODEGEN_CACHE", str(home))
    os.chown(home, 0, 0)
    for entry in home.glob("entries/*"):
        assert cache.find_entry(home, entry.name) is None
    compiles.clear()
    assert scale(2.0) == 2.0
    assert len(compiles) == 1
    assert scale(2.0) == 2.0
    assert len(compiles) == 1


AS_OTHER = """
import sys, warnings
from lie_codegen.runtime.build import build_kernels
from test_build import scaled
with warnings.catch_warnings(record=True) as given:
    warnings.simplefilter("always")
    print(build_kernels(lambda: [scaled(2.0)], namespace="toy").scale(1.0), *(each.message for each in given))
"""


@pytest.mark.slow
@pytest.mark.skipif(os.geteuid() != 0, reason="only root may become another user")
def test_a_process_of_another_user_leaves_our_folder_alone(tmp_path: Path) -> None:
    # Not below the folder of the tests, which is closed to others.
    with tempfile.TemporaryDirectory() as place:
        Path(place).chmod(0o755)
        ours = Path(place) / "ours"
        for mode in (0o700, 0o755, 0o777):
            ours.mkdir(exist_ok=True)
            ours.chmod(mode)
            done = subprocess.run(
                [OTHERS_PYTHON, "-B", "-c", AS_OTHER],
                env=environment(ours, HOME="/nonexistent", PYTHONPATH=os.pathsep.join([*PATH, *map(str, SITE)])),
                user=OTHER, group=OTHER, extra_groups=[], capture_output=True, text=True, check=False,
            )  # fmt: skip
            if "No module named" in done.stderr or "Permission denied" in done.stderr:
                pytest.skip("another user can read neither this Python nor this package")
            assert done.stdout.startswith("2.0 the cache folder"), done.stderr
            assert not list(ours.iterdir())
