"""Write lie_codegen/prebuilt: the C sources of the catalogue's kernels. From the root: python -m tests.tools.prebuild"""

from __future__ import annotations

import ast
import hashlib
import json
import lzma
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import lie_codegen as lc
from lie_codegen.codegen.package import render_library
from lie_codegen.groups.build import object_definition, source_definition
from lie_codegen.groups.catalogue_names import definition_source
from lie_codegen.groups.kernels import group_kernels
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.groups.prebuilt import SHARED, SHARED_STORE, prebuilt_folder, source_digest
from lie_codegen.runtime.digests import digest, versions

#: What turns a group into C text; everything they import counts.
ROOTS = ("groups/catalogue_load.py", "groups/kernels.py", "codegen/package.py", "codegen/library_sources.py")
TEMPLATES = ("binding.c.jinja", "header.h.jinja", "lanes.h.jinja", "macros.jinja", "source.c.jinja")
PACKAGE = Path(lc.__file__).parent


def source_files() -> list[str]:
    """The files of the package, and the templates, that determine the C text of a group's kernels."""
    found: set[str] = set()
    waiting = list(ROOTS)
    while waiting:
        name = waiting.pop()
        if name not in found:
            found.add(name)
            waiting.extend(_imported(PACKAGE / name))
    return sorted(found) + [f"templates/{name}" for name in TEMPLATES]


def _imported(path: Path) -> Iterator[str]:
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module and node.module.split(".")[0] == "lie_codegen":
            stem = "/".join(node.module.split(".")[1:])
            for candidate in (f"{stem}.py", *(f"{stem}/{alias.name}.py" for alias in node.names)):
                if (PACKAGE / candidate).is_file():
                    yield candidate


def store_of(group: MatrixGroup) -> tuple[dict[str, Any], dict[str, str]]:
    """What is kept of a group, and the file that all kernels include."""
    kernels: dict[str, Any] = {}
    shared: dict[str, str] = {}
    for kernel in group_kernels(group):
        data = json.loads(json.dumps(render_library(group.name, [kernel]).to_json()))
        shared = {SHARED: data["files"].pop(SHARED)}
        kernels[kernel.name] = data
    return {"namespace": group.name, "kernels": kernels}, shared


def definitions_of(name: str) -> list[str]:
    """The definitions by which a group of the catalogue is asked for: by its name, and as an object."""
    return [source_definition(definition_source(name)), object_definition(lc.group(name))]


def main() -> None:
    """Write what is not current."""
    folder = prebuilt_folder()
    folder.mkdir(exist_ok=True)
    stores: dict[str, str] = {}
    definitions: dict[str, str] = {}
    shared: dict[str, str] = {}
    for name in lc.group_names():
        data, shared = store_of(lc.group(name))
        stores[name] = _write(folder / f"{name}.json.xz", data)
        definitions.update({digest(definition): name for definition in definitions_of(name)})
    stores[SHARED_STORE] = _write(folder / f"{SHARED_STORE}.json.xz", shared)
    for path in folder.glob("*.json.xz"):
        if path.name.removesuffix(".json.xz") not in stores:
            path.unlink()
    files = source_files()
    index = {
        "written_with": versions(),
        "files": files,
        "sha256": source_digest(files),
        "stores": stores,
        "definitions": definitions,
    }
    (folder / "index.json").write_text(json.dumps(index, indent=1, sort_keys=True) + "\n", encoding="utf-8")
    size = sum(path.stat().st_size for path in folder.iterdir())
    sys.stdout.write(f"{folder}: {len(stores) - 1} groups, {size / 1e3:.0f} kB\n")


def _write(path: Path, data: Mapping[str, Any]) -> str:
    """Write unless it holds the same already: the compressed bytes may differ from one liblzma to the next."""
    if not path.is_file() or unpack(path) != data:
        text = json.dumps(data, separators=(",", ":"))
        path.write_bytes(lzma.compress(text.encode(), preset=9 | lzma.PRESET_EXTREME))
    return hashlib.sha256(path.read_bytes()).hexdigest()


def unpack(path: Path) -> Any:
    """The content of a store; None if it is damaged."""
    try:
        return json.loads(lzma.decompress(path.read_bytes()))
    except (lzma.LZMAError, ValueError):
        return None


if __name__ == "__main__":
    main()
