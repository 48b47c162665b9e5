"""A study as a TOML file: what is run, with what, over which distributions. Data; nothing in it is run as code.

[study]
n = 100000
seed = 0
store = "study.zarr"

[run]
function = "closed_loop"                # closed_loop, simulate, steer, order_check
group = "so3"
t = {start = 0, stop = 60, count = 2}   # numpy.linspace; a list is taken as it is
step = 0.1
law = {make = "attitude_law", kind = "pd", tunable = true}

[space.inertia]
distribution = "Normal"                 # a name of lc.studies
mean = [1, 2, 3]
std = 0.05

[space.X0]
distribution = "OnGroup"
group = "so3"

[until]                                 # optional
output = "error_final"
q = 0.99
width = 0.01
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from lie_codegen import averaging, control, flow, signals, steering, studies
from lie_codegen.errors import InputError
from lie_codegen.studies.result import Study
from lie_codegen.studies.stopping import Quantile
from lie_codegen.studies.study import open_study, study
from lie_codegen.studies.tasks import Run

_FUNCTIONS = {
    "closed_loop": (control, "closed_loop"),
    "simulate": (flow, "simulate"),
    "steer": (steering, "steer"),
    "order_check": (averaging, "order_check"),
}
#: Where what `make` may name is public: factories of laws, error functions and references, and inputs.
_MAKERS = (control, signals)
_DISTRIBUTIONS = ("Normal", "Uniform", "LogUniform", "Choice", "Grid", "Sobol", "LatinHypercube", "OnGroup")
_LIMIT = 1_000_000


def read_study_file(path: str | Path) -> tuple[Run, dict[str, Any], dict[str, Any]]:
    """What is run, its space, and the options of `lc.study`.

    Raises:
        InputError: the file cannot be read or says something else than a study, naming the place.
    """
    place = Path(path)
    try:
        if place.stat().st_size > _LIMIT:
            raise InputError(f"{path}: larger than {_LIMIT} bytes; a study file holds a few numbers")
        text = place.read_text(encoding="utf-8")
        data = tomllib.loads(text)
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path} cannot be read: {error}") from None
    except tomllib.TOMLDecodeError as error:
        raise InputError(f"{path}: {error}") from None
    _only(f"{path}", data, {"study", "run", "space", "until"})
    for name in ("run", "space"):
        if not isinstance(data.get(name), dict) or not data[name]:
            raise InputError(f"{path}: the table [{name}] is missing")
    return _run(f"{path}: run", dict(data["run"])), _space(f"{path}: space", data["space"]), _options(f"{path}", data)


def study_from_file(path: str | Path, **options: Any) -> Study:
    """Run the study of a TOML file (see the module); options of `lc.study` given here count instead of the file's.

    Args:
        path: of the file.
        options: of `lc.study`.

    Raises:
        InputError: as `read_study_file` and `study`.
    """
    run, space, written = read_study_file(path)
    return study(run, space, **{**written, **{name: value for name, value in options.items() if value is not None}})


def study_of_file(path: str | Path, store: str | Path | None = None) -> Study:
    """The study of a TOML file as it stands in its store, without running more of it."""
    run, space, written = read_study_file(path)
    return open_study(store or written.get("store", "study.zarr"), run, space)


def _options(where: str, data: Mapping[str, Any]) -> dict[str, Any]:
    options = dict(data.get("study", {}))
    _only(f"{where}: study", options, {"n", "seed", "store", "chunk", "on"})
    if "until" in data:
        until = data["until"]
        _only(f"{where}: until", until, {"output", "q", "width", "confidence"})
        options["until"] = _called(f"{where}: until", Quantile, until)
    return options


def _run(where: str, table: dict[str, Any]) -> Run:
    name = table.pop("function", None)
    if name not in _FUNCTIONS:
        raise InputError(f"{where}: function is one of {', '.join(_FUNCTIONS)}; given {name!r}")
    room, attribute = _FUNCTIONS[name]
    return Run(getattr(room, attribute), **{key: _value(f"{where}.{key}", value) for key, value in table.items()})


def _value(where: str, value: Any) -> Any:
    if isinstance(value, list):
        return [_value(where, each) for each in value]
    if not isinstance(value, dict):
        return value
    if {"start", "stop", "count"} == value.keys():
        if not isinstance(value["count"], int) or not 2 <= value["count"] <= 10**6:
            raise InputError(f"{where}: count lies between 2 and 10^6")
        return np.linspace(value["start"], value["stop"], value["count"])
    if "make" not in value:
        return {key: _value(f"{where}.{key}", each) for key, each in value.items()}
    name = value["make"]
    make = _maker(where, name)
    arguments = {key: _value(f"{where}.{key}", each) for key, each in value.items() if key != "make"}
    return _called(where, make, arguments)


def _maker(where: str, name: Any) -> Callable[..., Any]:
    for room in _MAKERS:
        if name in room.__all__:
            made: Callable[..., Any] = getattr(room, name)
            # what follows from plain data alone; `lc.read_law`, which opens a file, does not
            if room is signals or getattr(made, "__makes_defined__", False):
                return made
    raise InputError(f"{where}: make is one of a law, an error function, a reference or an input; given {name!r}")


def _space(where: str, table: Mapping[str, Any]) -> dict[str, Any]:
    found = {}
    for name, value in table.items():
        if not isinstance(value, dict):
            found[name] = value
            continue
        kind = value.get("distribution")
        if kind not in _DISTRIBUTIONS:
            raise InputError(f"{where}.{name}: distribution is one of {', '.join(_DISTRIBUTIONS)}; given {kind!r}")
        arguments = {key: each for key, each in value.items() if key != "distribution"}
        if kind in ("Sobol", "LatinHypercube") and "low" in arguments:
            arguments["of"] = arguments.pop("low")
        found[name] = _called(f"{where}.{name}", getattr(studies, kind), arguments)
    return found


def _called(where: str, make: Any, arguments: Mapping[str, Any]) -> Any:
    try:
        return make(**arguments)
    except TypeError as error:
        raise InputError(f"{where}: {error}") from None


def _only(where: str, table: Any, known: set[str]) -> None:
    if not isinstance(table, dict):
        raise InputError(f"{where} is no table")
    unknown = sorted(table.keys() - known)
    if unknown:
        raise InputError(f"{where}: {', '.join(unknown)} is not known; there are {', '.join(sorted(known))}")
