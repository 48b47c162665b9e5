"""The law of motion as it is given: controlled basis elements, velocities of one's own, or forces of the second order."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.errors import InputError, ShapeError
from lie_codegen.exact.positive_matrix import positive_matrix
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.steering.ocp.layout import Shape, layout
from lie_codegen.steering.ocp.problem_data import Affine, Rows, SecondOrder
from lie_codegen.steering.ocp.terms import Term
from lie_codegen.steering.ocp.written_terms import Terms, sequence_of


def dynamics_of(
    group: MatrixGroup,
    where: str,
    dynamics: str,
    controls: Sequence[Any] | None,
    inputs: Mapping[str, Any] | None,
    states: Mapping[str, Any] | None,
    velocity: Terms | None,
    rates: Mapping[str, Terms] | None,
    drift: ArrayLike | None,
    inertia: ArrayLike | None,
    force: Terms | None,
    drag: ArrayLike | None,
    allocation: ArrayLike | None,
) -> tuple[dict[str, Any], Any, dict[str, Any], dict[str, tuple[Term, ...]]]:
    """Inputs, the law of xi, states and their rates."""
    if dynamics not in ("first_order", "second_order"):
        raise InputError(f"{where}: no dynamics {dynamics!r}; there are first_order, second_order")
    second = dynamics == "second_order"
    own_states = dict(states or {})
    own_rates = {key: sequence_of(value) for key, value in dict(rates or {}).items()}
    if sorted(own_rates) != sorted(own_states):
        raise InputError(f"{where}: states are {_listed(own_states)}, rates are given of {_listed(own_rates)}")
    only_second = {"inertia": inertia, "force": force, "drag": drag, "allocation": allocation}
    misplaced = [key for key, value in only_second.items() if value is not None and not second]
    if second and velocity is not None:
        misplaced = ["velocity"]
    if second and drift is not None:
        misplaced = ["drift"]
    if misplaced:
        raise InputError(f"{where}: {_listed(misplaced)} has no meaning with dynamics={dynamics!r}")
    if not second and velocity is not None:
        if controls is not None or drift is not None or inputs is None:
            raise InputError(f"{where}: velocity= goes with inputs=, not with controls= or drift=")
        return dict(inputs), sequence_of(velocity), own_states, own_rates
    columns = _columns(group, where, controls, inputs, allocation if second else None)
    own_inputs = dict(inputs) if inputs is not None else {"u": columns.shape[1]}
    if not second:
        constant = np.zeros(group.dim) if drift is None else _array(drift, (group.dim,), "drift", where)
        return own_inputs, Affine(_rows(columns), tuple(map(float, constant))), own_states, own_rates
    if inertia is None:
        raise InputError(f"{where}: dynamics='second_order' needs inertia=")
    metric = np.array(positive_matrix(inertia, group.dim, "inertia").tolist(), dtype=float)
    resistance = np.zeros((group.dim, group.dim)) if drag is None else _matrix(drag, group.dim, "drag", where)
    law = SecondOrder(
        _rows(metric), _rows(np.linalg.inv(metric)), _rows(resistance), _rows(columns), sequence_of(force or ())
    )
    return own_inputs, law, {"xi": group.dim, **own_states}, own_rates


def _columns(
    group: MatrixGroup,
    where: str,
    controls: Sequence[Any] | None,
    inputs: Mapping[str, Any] | None,
    allocation: ArrayLike | None,
) -> Array:
    """(n, m) which velocity, or force, each control is."""
    if allocation is not None:
        B = np.asarray(allocation, dtype=float)
        if B.ndim != 2 or B.shape[0] != group.dim or not np.isfinite(B).all():
            raise ShapeError(f"{where}: allocation has shape {B.shape}; it is ({group.dim}, m), finite")
        if controls is not None:
            raise InputError(f"{where}: give controls= or allocation=, not both")
        if inputs is not None and layout("input", inputs).size != B.shape[1]:
            raise ShapeError(f"{where}: allocation has {B.shape[1]} columns, inputs {layout('input', inputs).size}")
        return B
    if controls is None:
        raise InputError(f"{where}: say which basis elements are controlled, controls=; or give inputs= with velocity=")
    if inputs is not None:
        raise InputError(f"{where}: controls= names its input u itself; give inputs= with velocity= or allocation=")
    chosen = [controls] if isinstance(controls, str | int) else list(controls)
    eye = np.eye(group.dim)
    rows, places = [], []
    for each in chosen:
        if isinstance(each, str) or np.ndim(each) == 0:
            places.append(group.algebra.index(each))
            rows.append(eye[places[-1]])
        else:
            rows.append(_array(each, (group.dim,), "a control", where))
    if len(set(places)) != len(places) or not rows:
        raise InputError(f"{where}: controls {chosen} are none or repeat one")
    return np.array(rows).T


def _listed(names: Any) -> str:
    return ", ".join(names) or "none"


def _array(value: ArrayLike, shape: Shape, what: str, where: str) -> Array:
    try:
        array = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        raise InputError(
            f"{where}: {what} takes numbers; what depends on t, X, u or parameters goes into velocity=, force= or rates="
        ) from None
    if array.shape != shape or not np.isfinite(array).all():
        raise ShapeError(f"{where}: {what} has shape {array.shape}; it is {shape}, finite")
    return array


def _matrix(value: ArrayLike, n: int, what: str, where: str) -> Array:
    if isinstance(value, str) or np.ndim(value) == 0:
        return np.eye(n) * _array(value, (), what, where)
    return np.diag(_array(value, (n,), what, where)) if np.ndim(value) == 1 else _array(value, (n, n), what, where)


def _rows(matrix: Array) -> Rows:
    return tuple(tuple(float(value) for value in row) for row in matrix)
