"""Commands about motion: simulate, reproduce; steer has its own file."""

from __future__ import annotations

import time
from pathlib import Path
from typing import Annotated, Any

import typer

from lie_codegen.cli.groups import GroupName, Json
from lie_codegen.cli.output import emit, progress
from lie_codegen.cli.steering import steer
from lie_codegen.errors import ComputationError, InputError, write_refusal
from lie_codegen.whole_files import whole_file

_Optional = typer.Option
_MOST_SAMPLES = 10_000_000


def simulate(
    group: GroupName,
    u: Annotated[list[str], _Optional("--u", help='Formula of t, one for each basis element: --u "cos(t)" --u 0 ...')],
    end: Annotated[float, _Optional(help="Final time in seconds.")] = 10.0,
    eps: Annotated[float, _Optional(help="Scale of u.")] = 1.0,
    samples: Annotated[int, _Optional(help="Number of output times.")] = 101,
    out: Annotated[Path | None, _Optional(help="CSV file for t and the entries of X, row by row.")] = None,
    json: Json = False,
) -> None:
    """Simulate X' = X hat(eps u(t)) from the identity."""
    import numpy as np

    from lie_codegen.flow.formulas import formula_input
    from lie_codegen.flow.simulate import simulate as run_simulation
    from lie_codegen.groups.catalogue_load import group as load

    g = load(group)
    if not 2 <= samples <= _MOST_SAMPLES or not 0 < end < float("inf"):
        raise InputError(f"simulate: --samples must be from 2 to {_MOST_SAMPLES}, and --end positive and finite")
    started = time.perf_counter()
    run = run_simulation(g, formula_input(g, u), t=np.linspace(0, end, samples), eps=eps)
    seconds = time.perf_counter() - started
    if out is not None:
        _write_csv(out, run.t, run.X)
    data: dict[str, Any] = {
        "group": g.name,
        "steps": run.steps,
        "error_estimate": run.error_estimate,
        "X_final": run.X[-1],
        "seconds": seconds,
    }
    if out is None and json:
        data.update(t=run.t, X=run.X)
    text = (
        f"{g.name}: {run.steps} steps, error below {run.error_estimate:.1e}, {seconds:.2f} s\nX({end:g}) =\n{run.X[-1]}"
    )
    emit(text + (f"\nwrote {out}" if out else ""), data, json)


def _write_csv(path: Path, t: Any, X: Any) -> None:
    import numpy as np

    flat = X.reshape(len(t), -1)
    if np.iscomplexobj(flat):
        flat = flat.view(float)
    try:
        with whole_file(path) as fresh:
            np.savetxt(
                fresh, np.column_stack([t, flat]), delimiter=",", header="t, entries of X row by row", fmt="%.17g"
            )
    except OSError as error:
        raise write_refusal(f"{path} cannot be written", error) from None


def reproduce(
    figure: Annotated[
        str, typer.Argument(help="Name of the figure; 'list' names them, 'all' makes every one.")
    ] = "satellite",
    out: Annotated[Path, _Optional(help="Folder for the picture and its numbers.")] = Path("results"),
    formats: Annotated[
        str, _Optional("--format", help="Formats beside the PNG, by commas: svg, pdf.", metavar="FORMATS")
    ] = "png",
    themes: Annotated[
        str, _Optional("--theme", help="Pages they are drawn for, by commas: light, dark.", metavar="THEMES")
    ] = "light",
    json: Json = False,
) -> None:
    """Reproduce a figure of the papers: one picture, one JSON of numbers."""
    from lie_codegen.gallery.registry import TARGETS
    from lie_codegen.gallery.registry import reproduce as run_target
    from lie_codegen.pictures.result import file_ending

    if figure == "list":
        names = {each.name: each.about for each in TARGETS}
        emit("\n".join(f"{name:24} {about}" for name, about in names.items()), {"figures": names}, json)
        return
    kinds = list(dict.fromkeys(["png", *_words(formats)]))
    shades = _words(themes)
    endings = list(dict.fromkeys([".png", *(file_ending(kind, shade) for shade in shades for kind in kinds)]))
    done, failed = [], {}
    for name in [each.name for each in TARGETS] if figure == "all" else [figure]:
        try:
            with progress(f"reproduce {name}") as report:
                done.append(run_target(name, out, report, kinds, shades))
        except ComputationError as error:
            if figure != "all":
                raise
            failed[name] = str(error)  # the others are made all the same
    files = {each.name: [out.resolve() / f"{each.name}{ending}" for ending in endings] for each in done}
    if figure == "all":
        text = "\n".join(f"{name:28} {path}" for name, paths in files.items() for path in paths)
        emit(text, {"pictures": {name: paths[0] for name, paths in files.items()}, "files": files}, json)
        if failed:
            told = "; ".join(f"{name}: {why}" for name, why in failed.items())
            raise ComputationError(f"reproduce: {len(failed)} of {len(TARGETS)} figures failed: {told}")
        return
    [result] = done
    lines = [f"  {name:28} {value}" for name, value in result.numbers.items()]
    paths = files[result.name]
    text = "\n".join([*lines, *(f"picture: {path}" for path in paths)])
    emit(text, {"figure": result.name, "picture": paths[0], "files": paths, "numbers": result.numbers}, json)


def _words(text: str) -> list[str]:
    """The words of a list by commas."""
    return [word for each in text.split(",") if (word := each.strip().lower())]


commands = (simulate, steer, reproduce)
