"""Compiler ladder, build and cache: warm without heavy imports, never a wrong library, a clear word when stuck."""

from __future__ import annotations

import dataclasses
import gc
import json
import os
import shutil
import signal
import stat
import subprocess
import sys
import time
import warnings
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import toy_kernels

from lie_codegen.errors import CacheError, CacheWarning, CodegenError, CompileError, NoCompilerWarning
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.runtime import build, cache, cache_folder, compiler, entry_library
from lie_codegen.runtime.backend import load_library
from lie_codegen.runtime.build import build_kernels
from lie_codegen.runtime.cache_upkeep import cache_info, clear_cache, evict
from lie_codegen.runtime.compiler import FLAGS, compile_library, find_compilers, flags_for, lane_flags

ROOT = Path(__file__).resolve().parents[2]
#: A child imports the package, the helpers of the tests, and this file.
CHILD_PATH = os.pathsep.join(str(folder) for folder in (ROOT, ROOT / "tests", Path(__file__).resolve().parent))
pytestmark = pytest.mark.skipif(not find_compilers(), reason="needs a C compiler")


def scaled(factor: float, name: str = "scale") -> Kernel:
    return Kernel(name, "toy", (Port("x", ()),), (Port("y", ()),), lambda ops, x: (factor * x,), f"y = {factor} x")


@pytest.fixture(autouse=True)
def home(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    folder = tmp_path / "the cache"
    monkeypatch.setenv("LIE_CODEGEN_CACHE", str(folder))
    for memo in (cache_folder._warn_once, compiler.warn_no_compiler):
        memo.cache_clear()
    return folder


def load_copy(path: Path) -> Any:
    """Load what is on disk now, whatever this process has open under that name."""
    if not path.is_file():
        raise CacheError(f"{path} is gone")
    return load_library(path)


def run_python(code: str, **variables: str) -> str:
    environment = {**os.environ, "PYTHONPATH": CHILD_PATH, **variables}
    done = subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout + done.stderr


def never() -> list[Kernel]:
    raise RuntimeError("make_kernels was called on the warm path")


def test_a_known_definition_never_makes_its_kernels(compiles: list[str]) -> None:
    cold = build_kernels(lambda: [scaled(2)], namespace="toy", definition="two", options={"a": 1})
    warm = build_kernels(never, namespace="toy", definition="two", options={"a": 1})
    assert (cold.scale(3.0), warm.scale(3.0)) == (6.0, 6.0)
    assert warm.path == cold.path
    assert warm.namespace == "toy"
    assert len(compiles) == 1
    for other in ({"definition": "three"}, {"definition": "two", "options": {"a": 2}}):
        with pytest.raises(RuntimeError, match="warm path"):
            build_kernels(never, namespace="toy", **other)  # type: ignore[arg-type]


def test_equal_c_text_is_compiled_once(compiles: list[str]) -> None:
    first = build_kernels(lambda: [scaled(2)])
    second = build_kernels(lambda: [scaled(2)])
    third = build_kernels(lambda: [scaled(3)])
    assert first.path == second.path != third.path
    assert len(compiles) == 2
    assert (second.scale(1.0), third.scale(1.0)) == (2.0, 3.0)


WARM = """
import sys
import warnings
warnings.simplefilter("error")
from lie_codegen.runtime.backend import load_library
from lie_codegen.runtime.build import build_kernels
def make():
    import toy_kernels
    return toy_kernels.KERNELS
lib = build_kernels(make, namespace="toy", definition="all the toys")
assert lib.compiled
print(lib.rate([0, 0, 0], [1, 2, 3]).tolist(), sorted({"sympy", "casadi", "jinja2", "scipy"} & set(sys.modules)))
"""


def test_a_warm_process_imports_neither_sympy_nor_casadi() -> None:
    assert run_python(WARM) == "[1.0, 2.0, 3.0] ['casadi', 'jinja2']\n"
    assert run_python(WARM) == "[1.0, 2.0, 3.0] []\n"


def entry_files(home: Path) -> tuple[Path, Path]:
    (library,) = home.glob("entries/*/*.so")
    return library, library.parent / "entry.json"


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A cache with one library, by a child: one that this process has open must not be overwritten in place."""
    folder = tmp_path_factory.mktemp("built") / "the cache"
    code = "import test_build as t\nt.build_kernels(lambda: [t.scaled(2)], namespace='toy', definition='two')\n"
    run_python(code, LIE_CODEGEN_CACHE=str(folder))
    return folder


@pytest.mark.parametrize(
    "damage",
    [
        lambda library, entry: library.write_bytes(library.read_bytes()[:-1] + b"!"),
        lambda library, entry: library.write_bytes(b""),
        lambda library, entry: library.unlink(),
        lambda library, entry: entry.write_text("{"),
        lambda library, entry: entry.write_text("[]"),
        lambda library, entry: cache.write_json(entry, {**cache.read_json(entry), "signatures": [{}]}),
        lambda library, entry: cache.write_json(entry, {**cache.read_json(entry), "sha256": "0" * 64}),
        lambda library, entry: cache.write_json(entry, {**cache.read_json(entry), "file": "../../x.so"}),
        lambda library, entry: entry.write_text(entry.read_text().replace('"x"', '"z"')),
        lambda library, entry: entry.unlink(),
        lambda library, entry: shutil.rmtree(entry.parent),
    ],
    ids=[
        "flipped",
        "empty",
        "gone",
        "json",
        "list",
        "signatures",
        "digest",
        "outside",
        "no-seal",
        "no-entry",
        "no-folder",
    ],
)
def test_a_damaged_entry_is_rebuilt_never_loaded(
    damage: Callable[[Path, Path], object], built: Path, home: Path, compiles: list[str]
) -> None:
    shutil.copytree(built, home)
    damage(*entry_files(home))
    library = build_kernels(lambda: [scaled(2)], namespace="toy", definition="two")
    assert library.scale(4.0) == 8.0
    assert len(compiles) == 1
    build_kernels(never, namespace="toy", definition="two")


def test_a_damaged_request_is_answered_again(home: Path, compiles: list[str]) -> None:
    build_kernels(lambda: [scaled(2)], definition="two")
    (request,) = home.glob("requests/*.json")
    for text in ("", "[]", '{"entry": "../../etc"}', json.dumps({"entry": "0" * 64})):
        request.write_text(text)
        assert build_kernels(lambda: [scaled(2)], definition="two").scale(1.0) == 2.0
        if text.startswith("{"):
            cache.write_json(request, json.loads(text))
            assert build_kernels(lambda: [scaled(2)], definition="two").scale(1.0) == 2.0
    assert len(compiles) == 1


def test_the_name_of_a_library_is_its_content(home: Path) -> None:
    import hashlib

    build_kernels(lambda: [scaled(2)])
    library, _ = entry_files(home)
    assert library.stem == f"toy-{hashlib.sha256(library.read_bytes()).hexdigest()[:32]}"


def test_the_cache_is_private(home: Path) -> None:
    build_kernels(lambda: [scaled(2)], definition="two")
    for folder in (home, *home.rglob("*")):
        if folder.is_dir():
            assert stat.S_IMODE(folder.stat().st_mode) == 0o700, folder


def test_processes_that_build_at_once_agree(home: Path) -> None:
    code = "import test_build as t; print(t.build_kernels(lambda: [t.scaled(7)], definition='s').scale(2.0))"
    environment = {**os.environ, "PYTHONPATH": CHILD_PATH}
    running = [
        subprocess.Popen([sys.executable, "-c", code], env=environment, stdout=subprocess.PIPE) for _ in range(3)
    ]
    assert [process.communicate(timeout=120)[0] for process in running] == [b"14.0\n"] * 3
    assert len(list(home.glob("entries/*/*.so"))) == 1
    assert not list(home.glob("scratch/*"))


def test_a_build_killed_half_way_leaves_nothing_in_the_way(home: Path, tmp_path: Path) -> None:
    slow = tmp_path / "slowcc"
    slow.write_text("#!/bin/sh\nsleep 30\n")
    slow.chmod(0o700)
    code = "import test_build as t; t.build_kernels(lambda: [t.scaled(7)], definition='s')"
    environment = {**os.environ, "PYTHONPATH": CHILD_PATH, "LIE_CODEGEN_CC": str(slow)}
    process = subprocess.Popen([sys.executable, "-c", code], env=environment, start_new_session=True)
    deadline = time.monotonic() + 60
    while not list(home.glob("scratch/build-*/*.c")) and time.monotonic() < deadline:
        time.sleep(0.02)
    os.killpg(process.pid, signal.SIGKILL)
    process.wait()
    (left,) = home.glob("scratch/build-*")
    slow.write_text('#!/bin/sh\nexec cc "$@"\n')  # the same compiler, well again: the same entry if it were cached
    run_python(code + "; print('built')", LIE_CODEGEN_CC=str(slow))
    assert len(list(home.glob("entries/*/entry.json"))) == 1
    os.utime(left, (0, 0))
    evict(home)
    assert not left.exists()


def test_a_full_disk_falls_back_to_a_temporary_folder(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    real = cache.write_json

    def full(path: Path, data: Any) -> None:
        if home in path.parents:
            raise OSError(28, "No space left on device")
        real(path, data)

    monkeypatch.setattr(cache, "write_json", full)
    with pytest.warns(CacheWarning, match="No space left on device"):
        library = build_kernels(lambda: [scaled(5)], definition="five")
    assert library.scale(2.0) == 10.0
    assert library.path is not None
    assert home not in library.path.parents
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # said once
        assert build_kernels(lambda: [scaled(5)], definition="five").scale(2.0) == 10.0


def test_a_cache_that_cannot_be_written_is_still_read(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    build_kernels(lambda: [scaled(5)], definition="five")

    def refused(*args: Any) -> Any:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(cache, "write_json", refused)
    monkeypatch.setattr(cache.os, "utime", refused)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert build_kernels(never, definition="five").scale(2.0) == 10.0


def test_a_library_that_goes_between_check_and_load_is_built_again(
    compiles: list[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    build_kernels(lambda: [scaled(5)], definition="five")
    real = cache.find_request

    def evicted(folder: Path, request: str) -> Any:
        entry = real(folder, request)
        shutil.rmtree(folder / "entries", ignore_errors=True)
        return entry

    monkeypatch.setattr(cache, "find_request", evicted)
    monkeypatch.setattr(entry_library, "load_library", load_copy)
    assert build_kernels(lambda: [scaled(5)], definition="five").scale(2.0) == 10.0
    assert len(compiles) == 2


def test_a_cache_that_cannot_be_made_falls_back(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("LIE_CODEGEN_CACHE", str(tmp_path / "file" / "cache"))
    with pytest.warns(CacheWarning, match=r"cannot be used.*LIE_CODEGEN_CACHE"):
        library = build_kernels(lambda: [scaled(5)])
    assert library.scale(2.0) == 10.0


@pytest.mark.skipif(not hasattr(os, "getuid"), reason="needs POSIX ownership")
def test_a_cache_that_others_may_write_or_own_is_refused(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    home.mkdir()
    home.chmod(0o777)
    assert "others may write" in str(cache_folder.why_unusable(home))
    home.chmod(0o700)
    assert cache_folder.why_unusable(home) is None
    monkeypatch.setattr(os, "getuid", lambda: 12345)
    assert "belongs to user" in str(cache_folder.why_unusable(home))
    with pytest.warns(CacheWarning, match="belongs to user"):
        assert build_kernels(lambda: [scaled(6)]).scale(1.0) == 6.0
    assert not list(home.iterdir())


def test_info_and_clear_touch_only_what_is_ours(home: Path) -> None:
    assert cache_info().entries == 0
    assert not home.exists()
    build_kernels(lambda: [scaled(2)], definition="two")
    build_kernels(lambda: [scaled(3)], definition="three")
    info = cache_info()
    assert (info.folder, info.problem, info.entries) == (home, None, 2)
    assert info.bytes > 10_000
    (home / "mine.txt").write_text("precious")
    (home / "entries" / "mine").mkdir()
    assert clear_cache() == 2
    assert sorted(path.relative_to(home).as_posix() for path in home.rglob("*")) == [
        "entries",
        "entries/mine",
        "mine.txt",
    ]
    assert build_kernels(lambda: [scaled(2)], definition="two").scale(1.0) == 2.0


def test_the_least_recently_used_go_first(home: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    for factor in (2, 3):
        build_kernels(lambda factor=factor: [scaled(factor)], definition=str(factor))
    size = cache_info().bytes
    gc.collect()  # what this process has open it does not evict
    for when, entry in enumerate(sorted(home.glob("entries/*/entry.json"))):
        os.utime(entry, (when + 1, when + 1))
    build_kernels(never, definition="2")  # used last, whatever its age was
    monkeypatch.setenv("LIE_CODEGEN_CACHE_LIMIT", str(int(size * 1.2)))
    build_kernels(lambda: [scaled(4)], definition="4")
    assert cache_info().entries == 2
    build_kernels(never, definition="2")
    build_kernels(never, definition="4")


def test_flags_never_change_the_arithmetic_of_the_process() -> None:
    for flags in (flags_for(10), flags_for(10**6), lane_flags(1000)):
        assert "-ffp-contract=off" in flags
        assert not any("fast" in flag or "unsafe" in flag for flag in flags)
    assert flags_for(10)[0] == "-O2"
    assert flags_for(10**6)[0] == "-O1"
    assert set(FLAGS) < set(flags_for(1))
    assert set(flags_for(1000)) < set(lane_flags(1000))
    assert lane_flags(10) == flags_for(10)


@pytest.mark.parametrize("name", ["gcc", "clang"])
def test_a_compiler_that_cannot_schedule_compiles_lanes_without(name: str, tmp_path: Path) -> None:
    if shutil.which(name) is None:
        pytest.skip(f"no {name}")
    compiler = find_compilers({**os.environ, "CC": name})[0]
    (tmp_path / "lanes.c").write_text("int one(void);\nint one(void) { return 1; }\n")
    compile_library(compiler, tmp_path, "lanes.c", "lanes.so", lane_flags(1000))
    assert (tmp_path / "lanes.so").stat().st_size > 0
    (tmp_path / "wrong.c").write_text("int one(void) { return two; }\n")
    with pytest.raises(CompileError, match="two"):
        compile_library(compiler, tmp_path, "wrong.c", "wrong.so", lane_flags(1000))


def test_the_ladder(tmp_path: Path) -> None:
    for name in ("cc", "clang", "mycc"):
        program = tmp_path / name
        program.write_text(f"#!/bin/sh\n# {name}\n")
        program.chmod(0o700)
    (tmp_path / "gcc").symlink_to("cc")
    path = str(tmp_path)
    first = find_compilers({"PATH": path})
    assert [each.command[0] for each in first][:2] == [str(tmp_path / "cc"), str(tmp_path / "clang")]  # gcc is cc
    assert find_compilers({"PATH": path, "CC": "mycc -m64 '-DA B'"})[0].command == (
        str(tmp_path / "mycc"),
        "-m64",
        "-DA B",
    )
    assert find_compilers({"PATH": path, "CC": "nosuch"})[0].command == (str(tmp_path / "cc"),)
    assert find_compilers({"PATH": path, "CC": "clang", "LIE_CODEGEN_CC": "mycc"})[0].command[0].endswith("mycc")
    assert find_compilers({"PATH": path, "LIE_CODEGEN_CC": "none"}) == ()
    (tmp_path / "cc").write_text("#!/bin/sh\n# cc, upgraded\n")
    assert find_compilers({"PATH": path})[0].identity != first[0].identity


def test_further_flags_come_last_and_make_another_entry(monkeypatch: pytest.MonkeyPatch, compiles: list[str]) -> None:
    monkeypatch.setenv("LIE_CODEGEN_CFLAGS", "-O1 '-DA B'")
    compiler = find_compilers()[0]
    assert compiler.further == ("-O1", "-DA B")
    monkeypatch.setenv("LIE_CODEGEN_CFLAGS", "-O0 -DNDEBUG")
    assert find_compilers()[0].identity != compiler.identity
    build_kernels(lambda: toy_kernels.KERNELS)
    assert compiles, "a library of other flags is another"
    monkeypatch.setenv("LIE_CODEGEN_CFLAGS", "-fno-such-flag")
    with pytest.raises(CompileError, match="-fno-such-flag"):
        build_kernels(lambda: toy_kernels.KERNELS)
    monkeypatch.setenv("LIE_CODEGEN_CFLAGS", "'not closed")
    assert find_compilers()[0].further == ()


def test_without_a_compiler_it_is_interpreted_after_one_warning(monkeypatch: pytest.MonkeyPatch) -> None:
    compiled = build_kernels(lambda: toy_kernels.KERNELS)
    monkeypatch.setenv("LIE_CODEGEN_CC", "none")
    with pytest.warns(NoCompilerWarning, match="interpreted"):
        library = build_kernels(lambda: toy_kernels.KERNELS, definition="toys")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        build_kernels(lambda: toy_kernels.KERNELS, definition="toys")
    assert not library.compiled
    assert library.path is None
    g, u = np.array([0.1, 0.2, 0.3]), np.array([1.0, 2.0, 3.0])
    np.testing.assert_array_equal(library.rate(g, u), compiled.rate(g, u))


def fake_compiler(tmp_path: Path, name: str, script: str) -> str:
    program = tmp_path / name
    program.write_text(f"#!/bin/sh\n{script}\n")
    program.chmod(0o700)
    return str(program)


def test_a_compiler_that_refuses_native_is_asked_without(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    script = 'for a in "$@"; do [ "$a" = -march=native ] && { echo no native >&2; exit 1; }; done; exec cc "$@"'
    monkeypatch.setenv("LIE_CODEGEN_CC", fake_compiler(tmp_path, "oldcc", script))
    assert build_kernels(lambda: [scaled(2)]).scale(1.0) == 2.0


def test_a_compiler_that_cannot_compile_at_all_is_passed_over(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("LIE_CODEGEN_CC", fake_compiler(tmp_path, "stub", "echo 'install the tools' >&2; exit 1"))
    library = build_kernels(lambda: [scaled(2)], definition="two")
    assert library.compiled
    assert library.scale(1.0) == 2.0
    build_kernels(never, definition="two")  # and is not asked again


def test_when_all_compilers_fail_the_error_has_command_and_words(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    stub = fake_compiler(tmp_path, "stub", "echo 'install the tools' >&2; exit 1")
    only = compiler.Compiler((stub,), "stub")
    monkeypatch.setattr(build, "find_compilers", lambda: (only,))
    with pytest.raises(CompileError, match=r"(?s)stub -O2.*exit status 1.*install the tools"):
        build_kernels(lambda: [scaled(2)])


def test_a_working_compiler_that_refuses_the_text_is_an_error(monkeypatch: pytest.MonkeyPatch) -> None:
    from lie_codegen.codegen import package

    real = package.render_library

    def broken(*args: Any) -> Any:
        sources = real(*args)
        files = {name: text.replace("const double", "const dubble") for name, text in sources.files.items()}
        return dataclasses.replace(sources, files=files)

    monkeypatch.setattr(package, "render_library", broken)
    with pytest.raises(CompileError, match="dubble"):
        build_kernels(lambda: [toy_kernels.EXP])


def test_the_ziglang_wheel_is_a_compiler() -> None:
    pytest.importorskip("ziglang")
    zig = find_compilers({"PATH": ""})
    assert [each.command[1:] for each in zig] == [("-m", "ziglang", "cc")]


def test_kernels_may_not_hide_attributes_of_the_library() -> None:
    for name in ("kernels", "path", "compiled"):
        with pytest.raises(CodegenError, match=name):
            build_kernels(lambda name=name: [scaled(2, name)])


def test_no_kernels_is_an_error() -> None:
    with pytest.raises(CodegenError, match="no kernel"):
        build_kernels(lambda: [])


def test_versions_are_those_of_the_distributions() -> None:
    from importlib import metadata

    from lie_codegen.runtime.digests import versions

    assert versions() == {name: metadata.version(name) for name in ("casadi", "sympy", "jinja2")}
