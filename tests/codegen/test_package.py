"""The generated folder: strict C in two compilers, C++, CMake; deterministic bytes; writing that never harms."""

from __future__ import annotations

import csv
import hashlib
import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import toy_kernels

import lie_codegen as lc
from lie_codegen.codegen.generate import generate
from lie_codegen.codegen.package import render_library, render_package
from lie_codegen.codegen.templates import environment, template_folder
from lie_codegen.codegen.views import PackageMetadata, comment_lines
from lie_codegen.codegen.write import write_package
from lie_codegen.errors import CodegenError, IdentifierError, OutputFolderError, SystemRefusalError
from lie_codegen.kernel.kernel import Kernel, Port

ROOT = Path(__file__).resolve().parents[2]
METADATA = PackageMetadata(
    title="toy */ kernels",
    description="First line.\nA second one, with a trigraph ??/ and a splice \\",
    labels=("a", "b", "c"),
    units=("rad", "m", "m"),
)
STRICT = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-Wconversion", "-Wshadow", "-Wstrict-prototypes"]
COMPILERS = [name for name in ("gcc", "clang") if shutil.which(name)]


@pytest.fixture(scope="module")
def tree() -> dict[str, str]:
    return render_package("toy", toy_kernels.KERNELS, METADATA)


@pytest.fixture
def folder(tree: dict[str, str], tmp_path: Path) -> Path:
    return write_package(tree, tmp_path / "with space" / "toy")


def run(*command: str, cwd: Path) -> str:
    done = subprocess.run(command, cwd=cwd, capture_output=True, text=True, check=False)
    assert done.returncode == 0, f"{command}\n{done.stdout}\n{done.stderr}"
    return done.stdout


def test_the_folder_is_what_the_design_says(tree: dict[str, str]) -> None:
    assert sorted(tree) == sorted(
        [
            "include/toy.h",
            "src/toy.c",
            "CMakeLists.txt",
            "toyConfig.cmake.in",
            "example.c",
            "test_vectors.csv",
            "README.md",
            "manifest.json",
        ]
    )
    for path, text in tree.items():
        assert text.endswith("\n"), path
        assert not text.endswith("\n\n"), path
        assert "{{" not in text, path
        assert "{%" not in text, path
        assert str(ROOT) not in text, path


@pytest.mark.parametrize("compiler", COMPILERS)
def test_example_compiles_strictly_checks_itself_and_exits_0(folder: Path, compiler: str) -> None:
    run(compiler, *STRICT, "-O1", "-Iinclude", "example.c", "src/toy.c", "-lm", "-o", "example", cwd=folder)
    out = run("./example", cwd=folder)
    assert out.count(" ok\n") == len(toy_kernels.KERNELS)


@pytest.mark.parametrize("compiler", COMPILERS)
def test_binding_compiles_strictly(tmp_path: Path, compiler: str) -> None:
    sources = render_library("toy", toy_kernels.KERNELS)
    for name, text in sources.files.items():
        (tmp_path / name).write_text(text)
    run(compiler, *STRICT, "-O1", "-c", sources.main, "-o", "binding.o", cwd=tmp_path)


@pytest.mark.skipif(not COMPILERS, reason="needs a C compiler")
def test_example_exits_1_when_a_number_is_wrong(folder: Path) -> None:
    source = folder / "src" / "toy.c"
    text = source.read_text()
    assert "sin(" in text
    source.write_text(text.replace("sin(", "cos(", 1))
    run(COMPILERS[0], "-Iinclude", "example.c", "src/toy.c", "-lm", "-o", "example", cwd=folder)
    done = subprocess.run(["./example"], cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 1
    assert "WRONG" in done.stdout


@pytest.mark.skipif(shutil.which("g++") is None or shutil.which("gcc") is None, reason="needs g++")
def test_header_serves_cpp(folder: Path) -> None:
    (folder / "use.cpp").write_text(
        '#include "toy.h"\n#include "toy.h"\n'
        "int main() { double x[3] = {0, 0, 0}, X[9]; toy_exp(x, X); return X[0] == 1.0 ? 0 : 1; }\n"
    )
    run("gcc", "-c", "-Iinclude", "src/toy.c", "-o", "toy.o", cwd=folder)
    run("g++", "-Wall", "-Wextra", "-Werror", "-pedantic", "-Iinclude", "use.cpp", "toy.o", "-o", "use", cwd=folder)
    run("./use", cwd=folder)


@pytest.mark.skipif(shutil.which("g++") is None, reason="needs g++")
@pytest.mark.parametrize("real", ["double", pytest.param("float", marks=pytest.mark.slow)])
def test_sources_are_cpp_too(real: str, tmp_path: Path) -> None:
    """Calls of routines passed compound literals, which C++ has not: no package with a logarithm compiled as C++."""
    for name in ("so3", "sim2", "su3"):
        folder = lc.generate(lc.group_kernels(name), tmp_path / name, real=real)
        flags = ("-x", "c++", "-std=c++17", "-Wall", "-Wextra", "-Werror", "-pedantic", "-Iinclude")
        run("g++", *flags, "example.c", f"src/{name}.c", "-lm", "-o", "use", cwd=folder)
        run("./use", cwd=folder)


@pytest.mark.skipif(shutil.which("nm") is None or not COMPILERS, reason="needs nm")
def test_every_global_symbol_bears_the_namespace(folder: Path) -> None:
    run(COMPILERS[0], "-c", "-Iinclude", "src/toy.c", "-o", "toy.o", cwd=folder)
    symbols = [line.split() for line in run("nm", "-P", "toy.o", cwd=folder).splitlines()]
    defined = {name.lstrip("_") for name, kind, *_ in symbols if kind in "TDBRC"}
    assert defined == {kernel.symbol for kernel in toy_kernels.KERNELS}


@pytest.mark.skipif(shutil.which("cmake") is None or not COMPILERS, reason="needs cmake")
def test_cmake_builds_tests_installs_and_is_found(folder: Path, tmp_path: Path) -> None:
    prefix = tmp_path / "prefix"
    run("cmake", "-S", ".", "-B", "build", cwd=folder)
    run("cmake", "--build", "build", cwd=folder)
    run("ctest", "--test-dir", "build", "--output-on-failure", cwd=folder)
    run("cmake", "--install", "build", "--prefix", str(prefix), cwd=folder)
    shutil.rmtree(folder / "build")
    consumer = tmp_path / "consumer"
    consumer.mkdir()
    (consumer / "main.c").write_text(
        "#include <toy.h>\nint main(void) { double E[6]; toy_constant(E); return E[2] == 3.0 ? 0 : 1; }\n"
    )
    for how in ("find_package(toy 0.1 REQUIRED)", f'add_subdirectory("{folder.as_posix()}" toy)'):
        (consumer / "CMakeLists.txt").write_text(
            f"cmake_minimum_required(VERSION 3.14)\nproject(consumer C)\n{how}\nadd_executable(consumer main.c)\n"
            "target_link_libraries(consumer PRIVATE lie-codegen::toy)\n"
        )
        run("cmake", "-S", ".", "-B", "build", f"-DCMAKE_PREFIX_PATH={prefix}", cwd=consumer)
        run("cmake", "--build", "build", cwd=consumer)
        run("./build/consumer", cwd=consumer)
        assert not (consumer / "build" / "toy_example").exists()
        shutil.rmtree(consumer / "build")


def test_texts_cannot_leave_their_comment(tree: dict[str, str]) -> None:
    assert comment_lines("a */ b /* c ??/ d\\") == ("a * / b / * c ? ? / d\\",)
    assert comment_lines("a\u2028b\x00c") == ("a", "b c")
    assert tree["include/toy.h"].count("/*") == tree["include/toy.h"].count("*/")


def test_csv_has_the_numbers_compiled_into_the_example(tree: dict[str, str]) -> None:
    rows = list(csv.DictReader(tree["test_vectors.csv"].splitlines()))
    assert {row["function"] for row in rows} == {kernel.symbol for kernel in toy_kernels.KERNELS}
    for row in rows:
        for number in row["values"].split():
            assert repr(float(number)) == number
            assert number in tree["example.c"]


def test_manifest_lists_every_file_and_function(tree: dict[str, str]) -> None:
    manifest = json.loads(tree["manifest.json"])
    assert manifest["generator"] == "lie_codegen"
    assert [each["symbol"] for each in manifest["functions"]] == [kernel.symbol for kernel in toy_kernels.KERNELS]
    assert manifest["files"] == {
        path: hashlib.sha256(text.encode()).hexdigest() for path, text in tree.items() if path != "manifest.json"
    }


def test_bytes_do_not_depend_on_the_hash_seed(tree: dict[str, str]) -> None:
    code = (
        "import hashlib, toy_kernels\n"
        "from lie_codegen.codegen.package import render_package\n"
        "tree = render_package('toy', toy_kernels.KERNELS)\n"
        "print(hashlib.sha256(repr(sorted(tree.items())).encode()).hexdigest())\n"
    )
    digests = set()
    for seed in ("0", "1", "4242"):
        environment = {**os.environ, "PYTHONHASHSEED": seed, "PYTHONPATH": f"{ROOT}{os.pathsep}{ROOT / 'tests'}"}
        digests.add(
            subprocess.run([sys.executable, "-c", code], env=environment, capture_output=True, check=True).stdout
        )
    assert len(digests) == 1


def test_templates_are_strict() -> None:
    import jinja2

    assert environment().undefined is jinja2.StrictUndefined
    assert (template_folder() / "source.c.jinja").is_file()


def test_replaces_its_own_folder(folder: Path) -> None:
    generate([toy_kernels.EXP], folder, namespace="toy", metadata={"labels": ["x"], "units": ["m"]})
    assert "toy_rate" not in (folder / "src/toy.c").read_text()
    assert sorted(path.name for path in folder.parent.iterdir()) == ["toy"]


def test_refuses_a_folder_with_a_foreign_file(tree: dict[str, str], folder: Path) -> None:
    (folder / "src" / "mine.c").write_text("int mine;\n")
    before = sorted(folder.rglob("*"))
    with pytest.raises(OutputFolderError, match=r"src/mine\.c"):
        write_package(tree, folder)
    assert sorted(folder.rglob("*")) == before


def test_refuses_a_folder_with_an_edited_file(tree: dict[str, str], folder: Path) -> None:
    (folder / "example.c").write_text("int main(void) { return 0; }\n")
    with pytest.raises(OutputFolderError, match=r"edited.*example\.c"):
        write_package(tree, folder)
    assert (folder / "example.c").read_text() == "int main(void) { return 0; }\n"


@pytest.mark.parametrize("content", [None, "{", "[]", '{"generator": "another", "files": {}}'])
def test_refuses_a_folder_that_is_not_ours(tree: dict[str, str], tmp_path: Path, content: str | None) -> None:
    (tmp_path / "notes.txt").write_text("precious")
    if content is not None:
        (tmp_path / "manifest.json").write_text(content)
    with pytest.raises(OutputFolderError):
        write_package(tree, tmp_path)
    assert (tmp_path / "notes.txt").read_text() == "precious"
    assert not list(tmp_path.parent.glob(f".{tmp_path.name}*"))


def test_a_manifest_cannot_name_files_outside(tree: dict[str, str], tmp_path: Path) -> None:
    outside = tmp_path / "outside.txt"
    outside.write_text("precious")
    target = tmp_path / "toy"
    target.mkdir()
    digest = hashlib.sha256(b"precious").hexdigest()
    (target / "manifest.json").write_text(json.dumps({"generator": "lie_codegen", "files": {"../outside.txt": digest}}))
    write_package(tree, target)
    assert outside.read_text() == "precious"


def test_refuses_a_file_and_an_unwritable_place(tree: dict[str, str], tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    for place in (tmp_path / "file", tmp_path / "file" / "below", Path("/proc/nowhere/toy")):
        with pytest.raises(OutputFolderError):
            write_package(tree, place)
    assert (tmp_path / "file").read_text() == ""


def test_an_empty_folder_is_welcome_and_a_failed_write_leaves_it(
    tree: dict[str, str], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    target = tmp_path / "empty"
    target.mkdir()

    def full(self: Path, data: bytes) -> int:
        raise OSError(28, "No space left on device")

    with monkeypatch.context() as patch:
        patch.setattr(Path, "write_bytes", full)
        with pytest.raises(SystemRefusalError, match="No space left"):
            write_package(tree, target)
    assert [path.name for path in tmp_path.iterdir()] == ["empty"]
    assert (write_package(tree, target) / "src/toy.c").is_file()


def test_colliding_symbols_are_refused_and_namespaces_told_apart() -> None:
    def kernel(name: str, namespace: str = "toy") -> Kernel:
        return Kernel(name, namespace, (Port("x", ()),), (Port("y", ()),), lambda ops, x: (x,))

    with pytest.raises(CodegenError, match="toy_a_batch"):
        render_library("toy", [kernel("a"), kernel("a_batch")])
    with pytest.raises(CodegenError, match="both need the symbol toy_a"):
        render_library("toy", [kernel("a"), kernel("a")])
    both = render_library("toy", [kernel("a"), kernel("a", "other")])
    assert [each.name for each in both.signatures] == ["toy_a", "other_a"]
    with pytest.raises(CodegenError, match="no kernel"):
        render_library("toy", [])
    with pytest.raises(IdentifierError):
        render_library("not-c", [kernel("a")])


def test_a_sampler_outside_the_domain_is_named() -> None:
    kernel = Kernel(
        "root", "toy", (Port("x", ()),), (Port("y", ()),), lambda ops, x: (ops.sqrt(x),), sampler=lambda rng: (-1.0,)
    )
    with pytest.raises(CodegenError, match=r"toy_root.*sampler"):
        render_package("toy", [kernel])
