"""The package as an ES module: WebAssembly by ziglang, and the JavaScript and types around it."""

from __future__ import annotations

import base64
import sys
from collections.abc import Mapping, Sequence
from typing import Any

from lie_codegen.codegen.target_functions import (
    c_sources,
    compile_folder,
    crate_name,
    functions_of,
    put_files,
    run_compiler,
)
from lie_codegen.codegen.templates import render


def wasm_files(manifest: Mapping[str, Any], tree: Mapping[str, str], real: str) -> dict[str, str]:
    """The module, its types, an example and package.json."""
    functions = functions_of(manifest, tree)
    room = max(sum(p.size for p in (*each.inputs, *each.outputs)) for each in functions)
    wrapper = (
        f"static double space[{room}];\ndouble *lie_space(void);\ndouble *lie_space(void)\n{{\n    return space;\n}}\n"
    )
    binary = wasm_binary(tree, wrapper, ["lie_space", *(each.symbol for each in functions)])
    names = {
        "namespace": manifest["namespace"], "crate": crate_name(manifest["namespace"]), "version": manifest["version"],
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
        CompileError: the compiler's own words. SystemRefusalError: no temporary folder to compile in.
    """
    with compile_folder() as folder:
        put_files(
            folder, {**{path: tree[path] for path in tree if path.endswith((".c", ".h"))}, "src/space.c": wrapper}
        )
        sources = [str(folder / path) for path in (*c_sources(tree), "src/space.c")]
        out = folder / "out.wasm"
        command = [
            sys.executable, "-m", "ziglang", "cc", "-target", "wasm32-wasi", "-O2", "-s", "-mexec-model=reactor",
            f"-I{folder / 'include'}", *(f"-Wl,--export={each}" for each in exports), *sources, "-o", str(out),
        ]  # fmt: skip
        run_compiler(command)
        return out.read_bytes()
