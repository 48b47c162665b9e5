"""The package as a unit of FMI 3.0: its description, its C around the functions, and the packed .fmu."""

from __future__ import annotations

import hashlib
import io
import os
import sys
import sysconfig
import zipfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from lie_codegen.codegen.fmu_loop import loop_unit
from lie_codegen.codegen.target_functions import (
    PortView,
    c_sources,
    compile_folder,
    functions_of,
    put_files,
    run_compiler,
)
from lie_codegen.codegen.templates import render


def fmu_files(manifest: Mapping[str, Any], tree: Mapping[str, str], real: str) -> dict[str, str]:
    """The files of the unit: the steps p -> p_next of the package, or all its functions where it has none."""
    functions = functions_of(manifest, tree)
    if manifest.get("schedule"):
        variables, unit, at = loop_unit(manifest["schedule"], functions, _variable)
        return _unit_files(manifest, tree, variables, [], at, unit)
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
    return _unit_files(manifest, tree, variables, calls, at, None)


def _unit_files(
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
        "total": total, "unit": unit, "sources": ["fmi3.c", *(Path(path).name for path in c_sources(tree))],
    }  # fmt: skip
    return {
        "fmu/modelDescription.xml": render("fmi3_modelDescription.xml.jinja", **names),
        "fmu/buildDescription.xml": render("fmi3_buildDescription.xml.jinja", **names),
        "fmu/fmi3.c": render("fmi3.c.jinja", **names),
    }


def _variable(
    name: str, reference: int, port: PortView, at: int, start: list[str] | None, causality: str
) -> dict[str, Any]:
    values = start if start is not None else ["0"] * port.size
    state = causality == "output" and start is not None
    initial = "exact" if state or causality == "parameter" else "calculated" if causality == "output" else ""
    return {
        "name": name, "reference": reference, "causality": causality, "initial": initial, "shape": port.shape, "at": at,
        "variability": "tunable" if causality == "parameter" else "continuous", "description": port.said,
        "start": values if initial != "calculated" else None, "first": values, "computed": initial == "calculated",
    }  # fmt: skip


def packed_fmu(tree: Mapping[str, str], namespace: str, compilers: Sequence[Sequence[str]]) -> bytes:
    """The unit <namespace>.fmu of a package with the files of `fmu_files`: description, sources, and the library for this machine where
    there is a compiler.

    Raises:
        CompileError: the compiler's own words.
    """
    file = io.BytesIO()
    sources = {Path(path).name: tree[path] for path in ("fmu/fmi3.c", *c_sources(tree))}
    headers = {Path(path).name: tree[path] for path in sorted(tree) if path.startswith("include/")}
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as packed:

        def add(place: str, content: str | bytes) -> None:
            # a fixed date: the same package is the same file
            packed.writestr(zipfile.ZipInfo(place, (1980, 1, 1, 0, 0, 0)), content)

        add("modelDescription.xml", tree["fmu/modelDescription.xml"])
        add("sources/buildDescription.xml", tree["fmu/buildDescription.xml"])
        for name, text in sources.items():
            add(f"sources/{name}", text)
        for name, text in headers.items():
            add(f"sources/include/{name}", text)
        if compilers:
            place, ending = _platform()
            add(f"binaries/{place}/{namespace}{ending}", _library(sources, headers, compilers[0]))
    return file.getvalue()


def _library(sources: Mapping[str, str], headers: Mapping[str, str], compiler: Sequence[str]) -> bytes:
    with compile_folder() as folder:
        put_files(folder, {**sources, **{f"include/{each}": text for each, text in headers.items()}})
        library = folder / "library"
        maths = [] if os.name == "nt" else ["-lm"]
        run_compiler(
            [
                *compiler, "-O2", "-std=c99", "-shared", "-fPIC", f"-I{folder / 'include'}",
                *(str(folder / each) for each in sources), "-o", str(library), *maths,
            ]
        )  # fmt: skip
        return library.read_bytes()


def _platform() -> tuple[str, str]:
    """The name of this machine in FMI 3.0, and the ending of its libraries."""
    machine = sysconfig.get_platform().rsplit("-", 1)[-1].lower()
    word = {"amd64": "x86_64", "arm64": "aarch64"}.get(machine, machine)
    if sys.platform.startswith("win"):
        return f"{word}-windows", ".dll"
    return (f"{word}-darwin", ".dylib") if sys.platform == "darwin" else (f"{word}-linux", ".so")
