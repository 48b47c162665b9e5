"""Commands about code: generate, build, cache."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated, Any

import typer

from lie_codegen.cli.groups import GroupName, Json
from lie_codegen.cli.output import emit
from lie_codegen.errors import InputError


def generate(
    group: GroupName,
    out: Annotated[Path | None, typer.Option(help="Folder to write; ./GROUP by default.")] = None,
    real: Annotated[str, typer.Option(help="double, or float for processors without double.")] = "double",
    steering: Annotated[
        str | None,
        typer.Option(help="Controls, comma-separated: a minimum-energy steering solver in the subfolder steering."),
    ] = None,
    law: Annotated[
        list[Path] | None,
        typer.Option(help="TOML file of a law (lie_codegen/control/README.md) that joins the package; repeatable."),
    ] = None,
    plan: Annotated[
        Path | None,
        typer.Option(
            help="Plan that plan.save() or steer --save wrote: its controls join, with a program that flies them."
        ),
    ] = None,
    name: Annotated[str | None, typer.Option(help="C identifier of the header, the source and the target.")] = None,
    target: Annotated[str, typer.Option(help="c, fmu, rust, wasm or ros2: what surrounds the C.")] = "c",
    json: Json = False,
) -> None:
    """Generate the C package of a group, of its laws and plans: header, source, CMake, example, test vectors."""
    from lie_codegen.groups.catalogue_load import group as load
    from lie_codegen.groups.generate import generate as write

    started = time.perf_counter()
    g = load(group)
    parts: list[Any] = [g]
    if law:
        from lie_codegen.control.law_file import read_law

        parts += [read_law(path, g) for path in law]
    if plan is not None:
        parts.append(_plan_of(plan, g))
    controls = None if steering is None else [label.strip() for label in steering.split(",")]
    folder = write(
        parts if len(parts) > 1 else g, out or Path(g.name), real=real, steering=controls, name=name, target=target
    )
    seconds = time.perf_counter() - started
    files = sorted(str(path.relative_to(folder)) for path in folder.rglob("*") if path.is_file())
    text = f"wrote {folder} in {seconds:.2f} s: {', '.join(files)}"
    emit(text, {"folder": folder, "files": files, "seconds": seconds}, json)


def _plan_of(path: Path, group: Any) -> Any:
    from lie_codegen.kernel.saved import load
    from lie_codegen.steering.plan import Plan

    plan = load(path)
    if not isinstance(plan, Plan):
        raise InputError(f"--plan {path} holds a {type(plan).__name__}, no plan of lc.steer")
    if plan.group != group:
        raise InputError(f"--plan {path} is a plan on {plan.group.name}, not on {group.name}")
    return plan


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
    text += "".join(f"\ndegraded: {line}" for line in info.degraded)
    if info.problem:
        text += f"\ncannot be used: {info.problem}"
    data = {
        "folder": info.folder,
        "problem": info.problem,
        "degraded": info.degraded,
        "entries": info.entries,
        "bytes": info.bytes,
        "limit": info.limit,
        "removed": removed,
    }
    emit(text, data, json)


commands = (generate, build, cache)
