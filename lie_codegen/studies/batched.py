"""How the functions of the front door take a whole chunk of samples in one call."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.control.closed_loop import closed_loop
from lie_codegen.errors import InputError
from lie_codegen.flow.propagator import Propagator
from lie_codegen.flow.simulate import simulate
from lie_codegen.groups.build import build
from lie_codegen.groups.catalogue_load import as_group
from lie_codegen.kernel.kernel import Kernel
from lie_codegen.studies.results import Each, Of

Call = Callable[[Mapping[str, Array], int, int], Any]


def batched_call(function: Any, arguments: tuple[Any, ...], options: Mapping[str, Any]) -> Call | None:
    """columns, first sample, seed of the noise -> result of all; None where the function takes one sample at a time."""
    if isinstance(function, Kernel):
        return _kernel(function, options)
    if isinstance(function, Propagator):
        return lambda columns, first, noise: Of(function.group, function.batch(**{**options, **columns}).X)
    if _is(function, closed_loop) and "mpc" not in options:
        return _loops(arguments, options)
    if _is(function, simulate):
        return _flows(arguments, options)
    if isinstance(function, Each) or getattr(function, "__module__", "").split(".")[0] == "lie_codegen":
        return None
    return lambda columns, first, noise: function(*arguments, **{**options, **columns})


def _is(function: Any, known: Callable[..., Any]) -> bool:
    """Whether they are one function, behind the guard of the front door or not."""
    return callable(function) and inspect.unwrap(function) is inspect.unwrap(known)


def _loops(arguments: tuple[Any, ...], options: Mapping[str, Any]) -> Call:
    parameters = set(inspect.signature(closed_loop).parameters)

    def call(columns: Mapping[str, Array], first: int, noise: int) -> Of:
        if any(column.dtype.kind == "U" for column in columns.values()):
            raise InputError(
                "study: a closed loop takes numbers; run `lc.studies.each` of your own function over names"
            )
        named = dict(options)
        gains = dict(named.pop("gains", None) or {})
        group = as_group(arguments[0] if arguments else named["group"], "study")
        for name, column in columns.items():
            if name == "inertia":
                named[name] = _inertias(column, group.dim)
            elif name in parameters:
                named[name] = column
            else:
                gains[name] = column
        if gains:
            named["gains"] = gains
        count = len(next(iter(columns.values())))
        if not {"X0", "xi0", "inertia"} & columns.keys():
            named["runs"] = count  # what tells the loop how many there are
        return Of(group, closed_loop(*arguments, **_noisy(named, first, noise)))

    return call


def _noisy(named: dict[str, Any], first: int, noise: int) -> dict[str, Any]:
    """The noise of a loop belongs to its sample, whichever chunk it is run in."""
    if named.get("noise") is None:
        return named
    return {"seed": noise, **named, "first": first}


def replayed_call(function: Any, arguments: tuple[Any, ...], options: Mapping[str, Any]) -> Call | None:
    """How one sample of a closed loop or a flow is called, without the axis of samples; None for other functions."""
    if not (_is(function, closed_loop) or _is(function, simulate)):
        return None
    parameters = set(inspect.signature(function).parameters)

    def call(columns: Mapping[str, Array], first: int, noise: int) -> Any:
        named = dict(options)
        gains = dict(named.pop("gains", None) or {})
        for name, column in columns.items():
            (named if name in parameters else gains)[name] = column[0]
        if gains:
            named["gains"] = gains
        return function(*arguments, **(_noisy(named, first, noise) if _is(function, closed_loop) else named))

    return call


def _inertias(column: Array, n: int) -> Array:
    """(N,), (N, n) or (N, n, n) -> (N, n, n)."""
    if column.ndim == 1:
        return column[:, None, None] * np.eye(n)
    return column[:, :, None] * np.eye(n) if column.ndim == 2 else column


def _flows(arguments: tuple[Any, ...], options: Mapping[str, Any]) -> Call | None:
    def call(columns: Mapping[str, Array], first: int, noise: int) -> Of:
        unknown = columns.keys() - {"eps", "X0"}
        if unknown:
            raise InputError(
                f"study: lc.simulate takes eps and X0 of each sample, not {', '.join(sorted(unknown))}; for parameters of an input "
                "study lc.propagator(group, lc.ParametricInput(...), duration)"
            )
        group = as_group(arguments[0] if arguments else options["group"], "study")
        run = simulate(*arguments, **{**options, **columns})
        return Of(group, run)

    return call


@lru_cache(maxsize=32)
def _built(kernel: Kernel) -> Any:
    return build(kernel)[kernel.name]


def _kernel(kernel: Kernel, options: Mapping[str, Any]) -> Call:
    names = [port.name for port in kernel.inputs]

    def call(columns: Mapping[str, Array], first: int, noise: int) -> dict[str, Array]:
        given = {**options, **columns}
        missing, unknown = [name for name in names if name not in given], sorted(given.keys() - {*names})
        if missing or unknown:
            raise InputError(
                f"study: {kernel.name} takes {', '.join(names)}; "
                + "; ".join(
                    filter(
                        None,
                        [
                            f"missing: {', '.join(missing)}" if missing else "",
                            f"unknown: {', '.join(unknown)}" if unknown else "",
                        ],
                    )
                )
            )
        count = len(next(iter(columns.values())))
        full = [
            _row(given[name], columns, name, count, port.shape) for name, port in zip(names, kernel.inputs, strict=True)
        ]
        values = _built(kernel).batch(*full)
        outputs = values if isinstance(values, tuple) else (values,)
        return {port.name: np.asarray(value) for port, value in zip(kernel.outputs, outputs, strict=True)}

    return call


def _row(value: Any, columns: Mapping[str, Array], name: str, count: int, shape: tuple[int, ...]) -> Array:
    array = np.asarray(value)
    return np.ascontiguousarray(array if name in columns else np.broadcast_to(array, (count, *shape)))
