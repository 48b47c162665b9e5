"""What a study keeps of a result, one value a sample, unless it is told by `reduce`.

a closed loop   error_final, error_max: |log(X_d^-1 X)| at the last time and at its worst (the identity where there is no reference),
                in the units of the basis, on rotations the angle in rad; speed_final: |xi - xi_d|; u_max: the largest entry of
                the force or torque; effort: its integral of the square
a trajectory    X_final
a plan          cost, error, solved, plan_status (the place of the status in `Status`)
an order check  slope, constant, passed, errors
numbers         value; a dict stays as it is
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.groups.build import library_of
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.studies.results import Of, Single


def summary(result: Any) -> Mapping[str, Any]:
    """Columns of a result, the sample first; see the module."""
    if isinstance(result, Single):
        return {name: np.asarray(value)[None] for name, value in _one(result.result).items()}
    if isinstance(result, Of):
        kind = _kind(result.result)
        if kind == "ClosedLoop":
            return loop_summary(result.group, result.result)
        return (
            {"X_final": np.asarray(result.result.X)[-1]} if kind == "Trajectory" else {"X": np.asarray(result.result)}
        )
    if isinstance(result, Mapping):
        return result
    return {"value": np.asarray(result)}


def _kind(result: Any) -> str:
    """The class of a result of this package, by name: nothing is imported only to be compared with."""
    return type(result).__name__ if type(result).__module__.startswith("lie_codegen.") else ""


def _one(result: Any) -> Mapping[str, Any]:
    kind = _kind(result)
    if isinstance(result, Mapping):
        return result
    if kind == "Plan":
        places = [each.name for each in type(result.status)]
        return {
            "cost": result.cost,
            "error": result.error,
            "solved": result.status.name in _SOLVED,
            "plan_status": np.int8(places.index(result.status.name)),
        }
    if kind == "OrderCheck":
        return {
            "slope": result.slope,
            "constant": result.constant,
            "passed": result.passed,
            "errors": np.array(result.errors),
        }
    if kind == "Trajectory":
        return {"X_final": np.asarray(result.X)[-1]}
    if is_dataclass(result):
        values = {each.name: getattr(result, each.name) for each in fields(result)}
        return {
            name: value
            for name, value in values.items()
            if isinstance(value, bool | int | float | complex | np.ndarray)
        }
    return {"value": result}


_SOLVED = ("SOLVED", "APPROXIMATE", "LOCAL", "EXTREMAL", "ADMISSIBLE")


def loop_summary(group: MatrixGroup, run: Any) -> dict[str, Array]:
    """Of many loops: X (k, N, d, d), xi (k, N, n)."""
    X, xi = np.asarray(run.X), np.asarray(run.xi)
    if run.X_d is not None:
        X = np.linalg.solve(_beside(run.X_d, X), X)
    off = _size(group, X)
    speed = xi - _beside(run.xi_d, xi) if run.xi_d is not None else xi
    found = {
        "error_final": off[-1],
        "error_max": np.max(off, axis=0),
        "speed_final": np.linalg.norm(speed[-1], axis=-1),
    }
    control = next((run.outputs[name] for name in ("force", "torque", "u") if name in run.outputs), None)
    if control is not None:
        u = np.asarray(control)
        found["u_max"] = np.max(np.abs(u), axis=(0, 2))
        power = np.sum(u * u, axis=-1)
        spans = np.diff(np.asarray(run.t))[:, None] * (power[:-1] + power[1:]) / 2
        # One interval after another, as no matrix product is: the bits of a sample do not depend on how many are beside it.
        found["effort"] = np.add.accumulate(spans, axis=0)[-1]
    return found


def _beside(reference: Array, values: Array) -> Array:
    """A reference (k, ...) beside N runs (k, N, ...)."""
    given = np.asarray(reference)
    return given if given.ndim == values.ndim else given[:, None]


def _size(group: MatrixGroup, X: Array) -> Array:
    """|log X| of (k, N, d, d)."""
    x = library_of(group).log.batch(np.ascontiguousarray(X.reshape(-1, *X.shape[-2:])))
    return np.asarray(np.linalg.norm(x, axis=-1)).reshape(X.shape[:-2])
