"""Everything about a problem that can be found wrong before anything is built."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from lie_codegen.door import warn_caller
from lie_codegen.errors import AssumptionWarning, InputError, ShapeError
from lie_codegen.groups.maps.element_pattern import packed_size, unpack
from lie_codegen.kernel.casadi_arithmetic import CasadiArithmetic
from lie_codegen.on_demand import casadi as ca
from lie_codegen.steering.ocp.layout import entry_names
from lie_codegen.steering.ocp.problem_data import ProblemData, SecondOrder, total_square
from lie_codegen.steering.ocp.terms import Point, Term


def check_problem(data: ProblemData, where: str) -> None:
    """Every formula has a meaning, its shape fits, and every control is seen by the cost or bounded.

    Raises:
        ExpressionError, InputError, ShapeError: naming the culprit.
    """
    at = _symbolic_point(data)
    n = data.group.dim
    if isinstance(data.velocity, tuple):
        _require(data, at, data.velocity, n, f"{where}: velocity")
    if isinstance(data.velocity, SecondOrder) and data.velocity.force:
        _require(data, at, data.velocity.force, n, f"{where}: force")
    shapes = dict(data.states.shapes)
    for name, terms in data.rates:
        _require(data, at, terms, len(entry_names(name, shapes[name])), f"{where}: rates of {name}")
    value, residual = data.cost(data.stage_cost, at, f"{where}: stage_cost")
    end = Point(at.ops, at.X, {key: each for key, each in at.values.items() if key != "input"}, at.t)
    data.cost(data.terminal_cost, end, f"{where}: terminal_cost")
    path = data.rows(data.constraints, at, f"{where}: constraints: ")
    data.rows(data.terminal, end, f"{where}: terminal: ")
    _check_controls(data, at, ca.SX(value) + ca.SX(total_square(residual)), path, where)


def _symbolic_point(data: ProblemData) -> Point:
    X = unpack(data.group, ca.vertsplit(ca.SX.sym("X", packed_size(data.group))))
    layouts = {"input": data.inputs, "state": data.states, "parameter": data.parameters}
    values = {what: ca.vertsplit(ca.SX.sym(what, each.size)) if each.size else [] for what, each in layouts.items()}
    return Point(CasadiArithmetic(), X, values, ca.SX.sym("t"))


def _require(data: ProblemData, at: Point, terms: Sequence[Term], count: int, where: str) -> None:
    entries = [entry for term in terms for entry in data.scope.evaluate(term, at, "any", where)]
    if len(entries) != count:
        raise ShapeError(f"{where}: {len(entries)} entries; {count} are needed")


def _check_controls(data: ProblemData, at: Point, cost: Any, path: Sequence[Any], where: str) -> None:
    """A control without a cost has no stationary value: unbounded it is refused, bounded it sits on its bounds."""
    symbols = at.values["input"]
    moved = data.xi(at) + data.rate(at)
    moves = ca.vertcat(*[ca.SX(entry) for entry in moved])
    rows = ca.vertcat(*[ca.SX(entry) for entry in path]) if path else ca.SX(0, 1)
    for i, (name, symbol) in enumerate(zip(data.inputs.entry_names(), symbols, strict=True)):
        if ca.depends_on(cost, symbol):
            continue
        bounded = bool(np.isfinite(data.lower[i]) and np.isfinite(data.upper[i]))
        if not bounded and not (path and ca.depends_on(rows, symbol)):
            raise InputError(
                f"{where}: neither the stage cost nor bounds see the control {name}, so no value of it is best; add a "
                f"term of it to stage_cost, or bounds"
            )
        if not ca.depends_on(moves, symbol):
            raise InputError(f"{where}: the control {name} moves nothing and costs nothing; remove it")
        warn_caller(
            f"{where}: the control {name} costs nothing: its best values lie on its bounds and jump (bang-bang); a small "
            f"cost of it makes the problem regular",
            AssumptionWarning,
        )
