"""lie-codegen bench: ours against the peers that are installed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import TYPE_CHECKING, Annotated, Any

import typer

from lie_codegen.cli.groups import Json
from lie_codegen.cli.output import emit, progress
from lie_codegen.errors import InputError

if TYPE_CHECKING:
    from lie_codegen.benchmarks.run import Bench


def bench(
    what: Annotated[
        str,
        typer.Argument(
            help='Nothing for calls, batches, loops and cold starts; or "neighbours", "propagate", "steering", "control", "engines", "published".'
        ),
    ] = "",
    rounds: Annotated[int, typer.Option(min=3, help="Rounds of each comparison.")] = 15,
    only: Annotated[str, typer.Option(help="Only sections, systems or kinds with this text in their names.")] = "",
    against: Annotated[
        str,
        typer.Option(
            help="Another commit, or a folder with a checkout: timed in turn with this one; status 1 if a row is slower or a plan dearer."
        ),
    ] = "",
    json: Json = False,
) -> None:
    """Time calls, batches, loops and cold starts against numba, jax, SymForce, CasADi, ...; ratios to ours."""
    if against:
        if what:
            raise InputError("bench: --against compares two commits over rows of its own; give it no other benchmark")
        _commits(against, rounds, only, json)
        return
    if what == "steering":
        _steering(only, json)
        return
    if what == "control":
        _control(json)
        return
    if what == "engines":
        _engines(only, json)
        return
    if what == "propagate":
        _propagate(only, json)
        return
    if what == "neighbours":
        _neighbours(rounds, json)
        return
    if what == "published":
        _published(only, json)
        return
    if what:
        raise InputError(
            f'bench: nothing is called {what!r}; there are "neighbours", "propagate", "steering", "control", "engines", "published", or nothing for the rest'
        )
    from lie_codegen.benchmarks.run import bench as measure

    with progress("bench") as report:
        result = measure(rounds, report, only)
    emit(_text(result), asdict(result), json)
    if result.failed:
        raise typer.Exit(1)


def _commits(against: str, rounds: int, only: str, json: bool) -> None:
    from lie_codegen.benchmarks.commits import bench_commits, table, worse

    with progress("bench --against") as report:
        rows = bench_commits(against, rounds, only, report)
    misses = worse(rows)
    _told(table(rows, misses), rows, misses, json)


def _steering(only: str, json: bool) -> None:
    from lie_codegen.benchmarks.bounded import bench_bounded, missed, table

    with progress("bench steering") as report:
        rows = bench_bounded(only=only, say=report)
    misses = missed(rows)
    _told(table(rows, misses), rows, misses, json)


def _control(json: bool) -> None:
    from lie_codegen.benchmarks.open_claims import table
    from lie_codegen.benchmarks.open_control import bench_control

    with progress("bench control") as report:
        rows, missed = bench_control(say=report)
    _told(table(rows, missed), rows, missed, json)


def _engines(only: str, json: bool) -> None:
    from lie_codegen.benchmarks.engines import bench_engines, missed, table

    with progress("bench engines") as report:
        rows = bench_engines(only=only, say=report)
    misses = missed(rows)
    _told(table(rows, misses), rows, misses, json)


def _propagate(only: str, json: bool) -> None:
    from lie_codegen.benchmarks.limits import machine
    from lie_codegen.benchmarks.propagate import bench_propagate, table, versions

    with progress("bench propagate") as report:
        rows, missed = bench_propagate(report, only=only)
    where, tools = machine(), versions()
    heading = f"{where}, {', '.join(f'{name} {version}' for name, version in tools.items())}\n"
    _told(heading + table(rows, missed), rows, missed, json, machine=where, versions=tools)


def _neighbours(rounds: int, json: bool) -> None:
    from lie_codegen.benchmarks.neighbours import bench_neighbours, table

    with progress("bench neighbours") as report:
        rows = bench_neighbours(rounds, report)
    _told(table(rows), rows, [], json)


def _published(only: str, json: bool) -> None:
    from lie_codegen.benchmarks.published import bench_published, table

    with progress("bench published") as report:
        rows, missed = bench_published(only, report)
    _told(table(rows, missed), rows, missed, json)


def _told(text: str, rows: Sequence[Any], missed: Sequence[str], json: bool, **about: Any) -> None:
    """The rows as a text or JSON; exit status 1 where a stated figure is missed."""
    emit(text, {**about, "rows": [asdict(row) for row in rows], "missed": missed}, json)
    if missed:
        raise typer.Exit(1)


def _text(result: Bench) -> str:
    lines = [
        result.machine,
        f"one core reads {result.limits.read / 1e9:.1f} GB/s, writes {result.limits.written / 1e9:.1f} GB/s and does "
        f"{result.limits.operations / 1e9:.1f} GFLOP/s",
        "median, and ratio to lie_codegen within a round: min / median / max",
    ]
    for row in result.rows:
        lines += ["", f"{row.area}: {row.what}, {row.unit}" + (f" ({row.note})" if row.note else "")]
        for name, timing in row.timings.items():
            ratio = timing.ratio
            lines.append(
                f"  {name:32} {timing.nanoseconds.middle:14.1f}   {ratio.low:9.2f} /{ratio.middle:9.2f} /{ratio.high:9.2f}"
            )
        lines += [f"  {name:32} -  {reason}" for name, reason in row.skipped.items()]
    lines += [f"\n{title}: {reason}" for title, reason in result.failed.items()]
    return "\n".join(lines)


commands = (bench,)
