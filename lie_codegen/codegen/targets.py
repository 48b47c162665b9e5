"""The same C for other worlds: a Rust crate, an ES module of WebAssembly, a ROS 2 package, a unit of FMI 3.0.

Each target adds files around the package; the C in src/ and include/ stays byte for byte the same.
"""

from __future__ import annotations

import base64
import hashlib
import importlib.util
import json
import os
import re
import subprocess
import sys
import sysconfig
import tempfile
import zipfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from lie_codegen.codegen.fmu_loop import loop_unit
from lie_codegen.codegen.templates import render
from lie_codegen.errors import CompileError, InputError, MissingDependencyError

TARGETS = ("c", "fmu", "rust", "wasm", "ros2")
_RUST_WORDS = frozenset(
    "as break const continue crate dyn else enum extern false fn for if impl in let loop match mod move mut pub ref return self "
    "static struct super trait true type unsafe use where while async await box final gen macro override priv try typeof "
    "unsized virtual yield".split()
)
_JS_WORDS = frozenset(
    [
        "in",
        "function",
        "var",
        "let",
        "const",
        "new",
        "delete",
        "class",
        "default",
        "export",
        "import",
        "this",
        "with",
        "void",
    ]
)
#: A machine under load needs minutes for the first compilation, in which zig makes its C library.
_SECONDS = 900


@dataclass(frozen=True)
class _Port:
    name: str
    size: int
    shape: tuple[int, ...]
    said: str

    @property
    def scalar(self) -> bool:
        """Whether it goes into the C function by value."""
        return self.shape == ()

    @property
    def rust(self) -> str:
        return f"{self.name}_" if self.name in _RUST_WORDS else self.name

    @property
    def js(self) -> str:
        return f"{self.name}_" if self.name in _JS_WORDS else self.name


@dataclass(frozen=True)
class _Vector:
    inputs: Sequence[tuple[_Port, list[str]]]
    outputs: Sequence[tuple[_Port, list[str]]]


@dataclass(frozen=True)
class _Function:
    name: str
    symbol: str
    formula: str
    inputs: Sequence[_Port]
    outputs: Sequence[_Port]
    vectors: Sequence[_Vector]
    tunable: frozenset[str]
    start: Mapping[str, list[str]]

    @property
    def rust(self) -> str:
        return f"{self.name}_" if self.name in _RUST_WORDS else self.name

    @property
    def is_step(self) -> bool:
        """Whether an output p_next goes on from an input p."""
        sizes = {port.name: port.size for port in self.inputs}
        return any(
            sizes.get(port.name.removesuffix("_next")) == port.size
            for port in self.outputs
            if port.name.endswith("_next")
        )


def check_target(target: str, real: str) -> None:
    """Refuses a target that there is not, before anything is derived.

    Raises:
        InputError: naming those there are.
        MissingDependencyError: wasm without ziglang.
    """
    if target not in TARGETS:
        raise InputError(f"generate: target is one of {', '.join(TARGETS)}; given {target!r}")
    if real != "double" and target in ("fmu", "wasm"):
        raise InputError(f"generate: {target} takes doubles; real={real!r} is for C, Rust and ROS 2")
    if target == "wasm" and importlib.util.find_spec("ziglang") is None:
        raise MissingDependencyError(
            "generate: wasm is compiled by ziglang: install lie_codegen with its extra, lie_codegen[zig]"
        )


def with_target(tree: Mapping[str, str], target: str, real: str) -> dict[str, str]:
    """The package with the files of a target; the manifest lists them."""
    if target == "c":
        return dict(tree)
    manifest = json.loads(tree["manifest.json"])
    added = _ADDED[target](manifest, tree, real)
    whole = {**{path: text for path, text in tree.items() if path != "manifest.json"}, **added}
    manifest["target"] = target
    manifest["files"] = {path: hashlib.sha256(text.encode()).hexdigest() for path, text in sorted(whole.items())}
    return {**whole, "manifest.json": json.dumps(manifest, indent=2) + "\n"}


def _functions(manifest: Mapping[str, Any], tree: Mapping[str, str]) -> list[_Function]:
    vectors = _vectors(tree["test_vectors.csv"])
    found = []
    for each in manifest["functions"]:
        inputs, outputs = (tuple(_port(port) for port in each[side]) for side in ("inputs", "outputs"))
        given = (each.get("definition") or {}).get("parameters", {})
        tunable = frozenset(
            p.name for p in inputs if (given.get("tunable") is True and p.name in given) or given.get(p.name) == "input"
        )
        cases = [
            _Vector([(p, case["in"][p.name]) for p in inputs], [(p, case["out"][p.name]) for p in outputs])
            for case in vectors.get(each["symbol"], [])
        ]
        formula = " ".join(str(each.get("formula") or each["name"]).split())
        start = {port.name: values for port, values in cases[0].inputs} if cases else {}
        start |= {port: [repr(float(number)) for number in numbers] for port, numbers in each.get("start", {}).items()}
        found.append(
            _Function(
                each["name"],
                each["symbol"],
                formula,
                inputs,
                outputs,
                cases,
                tunable,
                start,
            )
        )
    names = [each.name for each in found]
    return [each if names.count(each.name) == 1 else replace(each, name=each.symbol) for each in found]


def _port(record: Mapping[str, Any]) -> _Port:
    shape = tuple(int(size) for size in record["shape"])
    size = 2 if record.get("is_complex") else 1
    for each in shape:
        size *= each
    units = f" [{record['units']}]" if record.get("units") else ""
    kind = " x ".join(map(str, shape)) or "number"
    said = f"{kind}{', complex' if record.get('is_complex') else ''}{units} {record.get('description', '')}".strip()
    # a complex array has its parts as one more axis
    return _Port(record["name"], size, (*shape, 2) if record.get("is_complex") else shape, " ".join(said.split()))


def _vectors(csv: str) -> dict[str, list[dict[str, dict[str, list[str]]]]]:
    found: dict[str, dict[int, dict[str, dict[str, list[str]]]]] = {}
    for line in csv.strip().splitlines()[1:]:
        symbol, number, direction, port, values = line.split(",")
        case = found.setdefault(symbol, {}).setdefault(int(number), {"in": {}, "out": {}})
        case[direction][port] = values.split()
    return {symbol: [cases[k] for k in sorted(cases)] for symbol, cases in found.items()}


def _sources(tree: Mapping[str, str]) -> list[str]:
    return sorted(path for path in tree if path.startswith("src/") and path.endswith(".c"))


def _crate(namespace: str) -> str:
    return re.sub(r"_+", "_", namespace.lower()).strip("_")


def _rust(manifest: Mapping[str, Any], tree: Mapping[str, str], real: str) -> dict[str, str]:
    functions = _functions(manifest, tree)
    names = {
        "namespace": manifest["namespace"], "crate": _crate(manifest["namespace"]), "version": manifest["version"],
        "functions": [_with_floats(each) for each in functions], "real": "f64" if real == "double" else "f32",
        "sources": _sources(tree), "tolerance": "1e-11" if real == "double" else "1e-5",
    }  # fmt: skip
    return {
        "Cargo.toml": render("rust_Cargo.toml.jinja", **names),
        "build.rs": render("rust_build.rs.jinja", **names),
        "src/lib.rs": render("rust_lib.rs.jinja", **names),
        "tests/vectors.rs": render("rust_vectors.rs.jinja", **names),
    }


def _with_floats(function: _Function) -> _Function:
    """Rust does not take 1 for 1.0."""

    def floats(pairs: Sequence[tuple[_Port, list[str]]]) -> list[tuple[_Port, list[str]]]:
        return [(port, [x if set(x) & set(".einf") else f"{x}.0" for x in values]) for port, values in pairs]

    vectors = [_Vector(floats(each.inputs), floats(each.outputs)) for each in function.vectors]
    return replace(function, vectors=vectors)


def _ros2(manifest: Mapping[str, Any], tree: Mapping[str, str], real: str) -> dict[str, str]:
    names = {"namespace": manifest["namespace"], "crate": _crate(manifest["namespace"]), "version": manifest["version"]}
    return {"package.xml": render("ros2_package.xml.jinja", **names)}


def _wasm(manifest: Mapping[str, Any], tree: Mapping[str, str], real: str) -> dict[str, str]:
    functions = _functions(manifest, tree)
    room = max(sum(p.size for p in (*each.inputs, *each.outputs)) for each in functions)
    wrapper = (
        f"static double space[{room}];\ndouble *lie_space(void);\ndouble *lie_space(void)\n{{\n    return space;\n}}\n"
    )
    binary = wasm_binary(tree, wrapper, ["lie_space", *(each.symbol for each in functions)])
    names = {
        "namespace": manifest["namespace"], "crate": _crate(manifest["namespace"]), "version": manifest["version"],
        "functions": functions, "wasm": base64.b64encode(binary).decode(),
    }  # fmt: skip
    stem = manifest["namespace"]
    return {
        f"{stem}.mjs": render("wasm_module.mjs.jinja", **names),
        f"{stem}.d.ts": render("wasm_types.d.ts.jinja", **names),
        "example.mjs": render("wasm_example.mjs.jinja", **names),
        "package.json": render("wasm_package.json.jinja", **names),
    }


def wasm_binary(tree: Mapping[str, str], wrapper: str, exports: Sequence[str]) -> bytes:
    """The C of a package and a wrapper as WebAssembly, by ziglang.

    Raises:
        CompileError: the compiler's own words.
    """
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        _put(folder, {**{path: tree[path] for path in tree if path.endswith((".c", ".h"))}, "src/space.c": wrapper})
        sources = [str(folder / path) for path in (*_sources(tree), "src/space.c")]
        out = folder / "out.wasm"
        command = [
            sys.executable, "-m", "ziglang", "cc", "-target", "wasm32-wasi", "-O2", "-s", "-mexec-model=reactor",
            f"-I{folder / 'include'}", *(f"-Wl,--export={each}" for each in exports), *sources, "-o", str(out),
        ]  # fmt: skip
        _run(command)
        return out.read_bytes()


def _run(command: Sequence[str]) -> None:
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=_SECONDS, check=False)
    except (OSError, subprocess.TimeoutExpired) as error:
        raise CompileError(f"{command[0]} does not compile the package: {error}") from None
    if done.returncode:
        raise CompileError(f"{' '.join(command[:4])} ... does not compile the package:\n{done.stderr.strip()[-2000:]}")


def _put(folder: Path, files: Mapping[str, str]) -> None:
    for path, text in files.items():
        (folder / path).parent.mkdir(parents=True, exist_ok=True)
        (folder / path).write_text(text, encoding="utf-8")


def _fmu(manifest: Mapping[str, Any], tree: Mapping[str, str], real: str) -> dict[str, str]:
    functions = _functions(manifest, tree)
    if manifest.get("schedule"):
        variables, unit, at = loop_unit(manifest["schedule"], functions, _variable)
        return _fmu_files(manifest, tree, variables, [], at, unit)
    steps = [each for each in functions if each.is_step]
    shown = steps or functions
    variables = []
    calls = []
    at = 0
    for function in shown:
        prefix = f"{function.name}." if len(shown) > 1 else ""
        states = (
            {p.name.removesuffix("_next") for p in function.outputs if p.name.endswith("_next")}
            if function.is_step
            else set()
        )
        places: dict[str, int] = {}
        inputs, outputs = [], []
        for port in function.inputs:
            role = (
                "step"
                if function.is_step and port.name == "h" and port.size == 1
                else "time"
                if function.is_step and port.name == "t" and port.size == 1
                else ""
            )
            if not role:
                state, tuned = port.name in states, port.name in function.tunable
                places[port.name] = at
                variables.append(
                    _variable(
                        f"{prefix}{port.name}",
                        len(variables) + 1,
                        port,
                        at,
                        function.start.get(port.name),
                        "output" if state else "parameter" if tuned else "input",
                    )
                )
                at += port.size
            inputs.append({"role": role, "c": f"c_{port.name}", "at": places.get(port.name, 0), "scalar": port.scalar})
        for port in function.outputs:
            old = port.name.removesuffix("_next")
            if function.is_step and port.name.endswith("_next") and old in places:
                outputs.append({"role": "next", "c": f"c_{port.name}", "at": places[old], "size": port.size})
                continue
            variables.append(_variable(f"{prefix}{port.name}", len(variables) + 1, port, at, None, "output"))
            outputs.append({"role": "", "c": "", "at": at, "size": port.size})
            at += port.size
        calls.append({"symbol": function.symbol, "is_step": function.is_step, "inputs": inputs, "outputs": outputs})
    return _fmu_files(manifest, tree, variables, calls, at, None)


def _fmu_files(
    manifest: Mapping[str, Any],
    tree: Mapping[str, str],
    variables: Sequence[dict[str, Any]],
    calls: Sequence[dict[str, Any]],
    total: int,
    unit: dict[str, Any] | None,
) -> dict[str, str]:
    """The description of the unit and its C."""
    token = "{" + hashlib.sha256(tree["manifest.json"].encode()).hexdigest()[:32] + "}"
    names = {
        "namespace": manifest["namespace"], "version": manifest["version"], "token": token, "variables": variables, "functions": calls,
        "total": total, "unit": unit, "sources": ["fmi3.c", *(Path(path).name for path in _sources(tree))],
    }  # fmt: skip
    return {
        "fmu/modelDescription.xml": render("fmi3_modelDescription.xml.jinja", **names),
        "fmu/buildDescription.xml": render("fmi3_buildDescription.xml.jinja", **names),
        "fmu/fmi3.c": render("fmi3.c.jinja", **names),
    }


def _variable(
    name: str, reference: int, port: _Port, at: int, start: list[str] | None, causality: str
) -> dict[str, Any]:
    values = start if start is not None else ["0"] * port.size
    state = causality == "output" and start is not None
    initial = "exact" if state or causality == "parameter" else "calculated" if causality == "output" else ""
    return {
        "name": name, "reference": reference, "causality": causality, "initial": initial, "shape": port.shape, "at": at,
        "variability": "tunable" if causality == "parameter" else "continuous", "description": port.said,
        "start": values if initial != "calculated" else None, "first": values, "computed": initial == "calculated",
    }  # fmt: skip


def pack_fmu(folder: Path, compilers: Sequence[Sequence[str]]) -> Path:
    """Compile the unit for this machine and pack <namespace>.fmu in the folder: description, sources, and the library where there
    is a compiler. Returns its path, which the manifest lists.

    Raises:
        CompileError: the compiler's own words.
    """
    manifest = json.loads((folder / "manifest.json").read_text(encoding="utf-8"))
    namespace = manifest["namespace"]
    path = folder / f"{namespace}.fmu"
    with tempfile.TemporaryDirectory() as name, zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as packed:

        def add(place: str, content: bytes) -> None:
            # a fixed date: the same package is the same file
            packed.writestr(zipfile.ZipInfo(place, (1980, 1, 1, 0, 0, 0)), content)

        add("modelDescription.xml", (folder / "fmu" / "modelDescription.xml").read_bytes())
        add("sources/buildDescription.xml", (folder / "fmu" / "buildDescription.xml").read_bytes())
        sources = [folder / "fmu" / "fmi3.c", *sorted((folder / "src").glob("*.c"))]
        for source in sources:
            add(f"sources/{source.name}", source.read_bytes())
        for header in sorted((folder / "include").glob("*.h")):
            add(f"sources/include/{header.name}", header.read_bytes())
        if compilers:
            place, ending = _platform()
            library = Path(name) / f"{namespace}{ending}"
            maths = [] if os.name == "nt" else ["-lm"]
            _run(
                [
                    *compilers[0],
                    "-O2",
                    "-std=c99",
                    "-shared",
                    "-fPIC",
                    f"-I{folder / 'include'}",
                    *map(str, sources),
                    "-o",
                    str(library),
                    *maths,
                ]
            )
            add(f"binaries/{place}/{library.name}", library.read_bytes())
    manifest["files"][path.name] = hashlib.sha256(path.read_bytes()).hexdigest()
    (folder / "manifest.json").write_text(json.dumps(manifest, indent=2) + "\n", encoding="utf-8")
    return path


def _platform() -> tuple[str, str]:
    """The name of this machine in FMI 3.0, and the ending of its libraries."""
    machine = sysconfig.get_platform().rsplit("-", 1)[-1].lower()
    word = {"amd64": "x86_64", "arm64": "aarch64"}.get(machine, machine)
    if sys.platform.startswith("win"):
        return f"{word}-windows", ".dll"
    return (f"{word}-darwin", ".dylib") if sys.platform == "darwin" else (f"{word}-linux", ".so")


_ADDED = {"rust": _rust, "wasm": _wasm, "ros2": _ros2, "fmu": _fmu}
