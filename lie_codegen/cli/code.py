"""Commands about code: generate, build, cache."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated

import typer

from lie_codegen.cli.groups import GroupName, Json
from lie_codegen.cli.output import emit


def generate(
    group: GroupName,
    out: Annotated[Path | None, typer.Option(help="Folder to write; ./GROUP by default.")] = None,
    real: Annotated[str, typer.Option(help="double, or float for processors without double.")] = "double",
    json: Json = False,
) -> None:
    """Generate the C package of a group: header, source, CMake, example, test vectors."""
    from lie_codegen.groups.build import generate as write
    from lie_codegen.groups.catalogue_load import group as load

    started = time.perf_counter()
    g = load(group)
    folder = write(g, out or Path(g.name), real=real)
    seconds = time.perf_counter() - started
    files = sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file())
    text = f"wrote {folder} in {seconds:.2f} s: {', '.join(files)}"
    emit(text, {"folder": folder, "files": files, "seconds": seconds}, json)


def build(group: GroupName, json: Json = False) -> None:
    """Generate, compile, cache and load a group's kernels."""
    from lie_codegen.groups.build import build as build_library

    started = time.perf_counter()
    library = build_library(group, kernels="all")
    seconds = time.perf_counter() - started
    how = f"compiled: {library.path}" if library.compiled else "interpreted: no C compiler"
    text = f"{library.namespace} in {seconds:.2f} s, {how}\n  " + ", ".join(library.kernels)
    data = {
        "namespace": library.namespace,
        "compiled": library.compiled,
        "path": library.path,
        "kernels": library.kernels,
        "seconds": seconds,
    }
    emit(text, data, json)


def cache(
    clear: Annotated[bool, typer.Option("--clear", help="Remove every entry of ours.")] = False, json: Json = False
) -> None:
    """Show the cache of compiled libraries, or clear it."""
    from lie_codegen.runtime.cache_upkeep import cache_info, clear_cache

    removed = clear_cache() if clear else 0
    info = cache_info()
    text = f"{info.folder}: {info.entries} libraries, {info.bytes / 1e6:.1f} of {info.limit / 1e6:.0f} MB"
    if clear:
        text += f"; {removed} removed"
    if info.problem:
        text += f"\ncannot be used: {info.problem}"
    data = {
        "folder": info.folder,
        "problem": info.problem,
        "entries": info.entries,
        "bytes": info.bytes,
        "limit": info.limit,
        "removed": removed,
    }
    emit(text, data, json)


commands = (generate, build, cache)
