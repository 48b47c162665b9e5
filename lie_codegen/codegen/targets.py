"""The same C for other worlds: a Rust crate, an ES module of WebAssembly, a ROS 2 package, a unit of FMI 3.0.

Each target adds files around the package; the C in src/ and include/ stays byte for byte the same.
"""

from __future__ import annotations

import hashlib
import importlib.util
import json
from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from lie_codegen.codegen.fmu import fmu_files, packed_fmu
from lie_codegen.codegen.target_functions import (
    FunctionView,
    PortView,
    VectorView,
    c_sources,
    crate_name,
    functions_of,
)
from lie_codegen.codegen.templates import render
from lie_codegen.codegen.wasm import wasm_files
from lie_codegen.errors import InputError, MissingDependencyError

TARGETS = ("c", "fmu", "rust", "wasm", "ros2")


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


def with_target(
    tree: Mapping[str, str], target: str, real: str, compilers: Sequence[Sequence[str]] = ()
) -> dict[str, str | bytes]:
    """The package with the files of a target, all that are to be written; the manifest lists them.

    Args:
        tree: the package as C.
        target: one of `TARGETS`.
        real: type of its numbers.
        compilers: commands, best first, of which a unit of FMI takes its library for this machine; it has its sources alone without one.

    Raises:
        CompileError: the compiler's own words.
    """
    if target == "c":
        return dict(tree)
    manifest = json.loads(tree["manifest.json"])
    added = _ADDED[target](manifest, tree, real)
    whole = {**{path: text for path, text in tree.items() if path != "manifest.json"}, **added}
    manifest["target"] = target
    manifest["files"] = {path: hashlib.sha256(text.encode()).hexdigest() for path, text in sorted(whole.items())}
    packed: dict[str, str | bytes] = {}
    if target == "fmu":
        unit = f"{manifest['namespace']}.fmu"
        packed[unit] = content = packed_fmu(whole, manifest["namespace"], compilers)
        manifest["files"][unit] = hashlib.sha256(content).hexdigest()
    return {**whole, **packed, "manifest.json": json.dumps(manifest, indent=2) + "\n"}


def _rust(manifest: Mapping[str, Any], tree: Mapping[str, str], real: str) -> dict[str, str]:
    functions = functions_of(manifest, tree)
    names = {
        "namespace": manifest["namespace"], "crate": crate_name(manifest["namespace"]), "version": manifest["version"],
        "functions": [_with_floats(each) for each in functions], "real": "f64" if real == "double" else "f32",
        "sources": c_sources(tree), "tolerance": "1e-11" if real == "double" else "1e-5",
    }  # fmt: skip
    return {
        "Cargo.toml": render("rust_Cargo.toml.jinja", **names),
        "build.rs": render("rust_build.rs.jinja", **names),
        "src/lib.rs": render("rust_lib.rs.jinja", **names),
        "tests/vectors.rs": render("rust_vectors.rs.jinja", **names),
    }


def _with_floats(function: FunctionView) -> FunctionView:
    """Rust does not take 1 for 1.0."""

    def floats(pairs: Sequence[tuple[PortView, list[str]]]) -> list[tuple[PortView, list[str]]]:
        return [(port, [x if set(x) & set(".einf") else f"{x}.0" for x in values]) for port, values in pairs]

    vectors = [VectorView(floats(each.inputs), floats(each.outputs)) for each in function.vectors]
    return replace(function, vectors=vectors)


def _ros2(manifest: Mapping[str, Any], tree: Mapping[str, str], real: str) -> dict[str, str]:
    names = {
        "namespace": manifest["namespace"],
        "crate": crate_name(manifest["namespace"]),
        "version": manifest["version"],
    }
    return {"package.xml": render("ros2_package.xml.jinja", **names)}


_ADDED = {"rust": _rust, "wasm": wasm_files, "ros2": _ros2, "fmu": fmu_files}
