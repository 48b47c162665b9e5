"""The commands about studies: study run | status | export | worst | plot."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from lie_codegen.cli.groups import Json
from lie_codegen.cli.output import emit
from lie_codegen.errors import InputError

app = typer.Typer(
    name="study",
    help="Monte Carlo studies and sweeps in a store that survives a kill; see lie_codegen/studies/README.md for the file.",
    no_args_is_help=True,
    context_settings={"help_option_names": ["-h", "--help"]},
)

_File = Annotated[Path, typer.Argument(metavar="FILE", help="TOML file that says what is run.")]
_Store = Annotated[Path, typer.Argument(metavar="STORE", help="Folder of the study.")]


@app.command()
def run(
    file: _File,
    store: Annotated[Path | None, typer.Option(help="Folder, instead of the file's.")] = None,
    n: Annotated[int | None, typer.Option("-n", "--samples", help="Samples, instead of the file's.")] = None,
    on: Annotated[
        str | None, typer.Option(help="pool, a number of processes, or the address of a dask scheduler.")
    ] = None,
    json: Json = False,
) -> None:
    """Run a study, or go on with it."""
    from lie_codegen.studies.study_file import study_from_file

    engine: Any = int(on) if on is not None and on.isdigit() else on
    _say(study_from_file(file, store=store, n=n, on=engine), json)


@app.command()
def status(store: _Store, json: Json = False) -> None:
    """What is done, what failed and why, and the quantiles of the outputs."""
    from lie_codegen.studies.study import open_study

    _say(open_study(store), json)


@app.command()
def export(store: _Store, out: Annotated[Path, typer.Argument(metavar="OUT.parquet")], json: Json = False) -> None:
    """Write a table with a row a sample."""
    from lie_codegen.studies.study import open_study

    if out.suffix != ".parquet":
        raise InputError(f"study export: {out} must end in .parquet")
    study = open_study(store)
    emit(f"wrote {study.to_parquet(out)}: {study.n} rows", {"path": str(out), "rows": study.n}, json)


@app.command()
def worst(
    store: _Store,
    k: Annotated[int, typer.Option("-k", help="How many.")] = 5,
    by: Annotated[str | None, typer.Option(help="Output, the first number a sample if not given.")] = None,
    json: Json = False,
) -> None:
    """The samples with the largest output, with their inputs and outputs."""
    from lie_codegen.studies.study import open_study

    study = open_study(store)
    indices = study.worst_indices(k, by)
    names = [*study.inputs, *study.outputs, "status"]
    rows = [{"sample": int(i), **{name: study[name][i] for name in names}} for i in indices]
    lines = [f"sample {row['sample']}: " + ", ".join(f"{name} = {row[name]}" for name in names) for row in rows]
    emit("\n".join(lines), {"worst": rows}, json)


@app.command()
def plot(
    store: _Store,
    out: Annotated[Path, typer.Argument(metavar="OUT.png")],
    output: Annotated[str | None, typer.Option(help="What to draw, all outputs if not given.")] = None,
    over: Annotated[str | None, typer.Option(help="One or two inputs, as k_p,k_d.")] = None,
    json: Json = False,
) -> None:
    """Draw histograms, a scatter over one input or a map over two."""
    from lie_codegen.studies.study import open_study

    inputs = tuple(over.split(",")) if over else ()
    emit(f"wrote {open_study(store).plot(out, output, inputs=inputs)}", {"path": str(out)}, json)


def _say(study: Any, json: bool) -> None:
    counts, errors, quantiles = study.status, study.errors, study.quantiles()
    lines = [repr(study)]
    lines += [f"  chunk {k} failed: {message}" for k, message in list(errors.items())[:5]]
    lines += [
        f"  {name}: 5 % {low:.6g}, median {middle:.6g}, 95 % {high:.6g}"
        for name, (low, middle, high) in quantiles.items()
        if getattr(low, "ndim", 0) == 0
    ]
    data = {
        "store": str(study.place),
        "samples": study.n,
        "complete": study.complete,
        "status": counts,
        "errors": errors,
    }
    emit("\n".join(lines), {**data, "quantiles": quantiles}, json)
