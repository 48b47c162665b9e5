"""A part of the program that repeats: conditions of one stage, with their derivatives, as CasADi functions."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from lie_codegen.on_demand import casadi as ca
from lie_codegen.steering.transcription.structure import Structure


@dataclass(frozen=True)
class StageFunctions:
    """A vector of functions of a stage, and a part of the objective, in SX.

    Attributes:
        value: (w, p, goal) -> rows; an interval takes no goal.
        slope: (w, p, goal) -> (rows, Jacobian of the rows (sparse)).
        curve: (w, p, goal, factor, multipliers) -> (gradient, Hessian (sparse, symmetric)) of factor cost + multipliers . rows.
        cost: (w, p) -> cost, None where there is none; steepness: (w, p) -> its gradient.
        rows: how many.
    """

    value: Any
    slope: Any
    curve: Any
    rows: int
    cost: Any = None
    steepness: Any = None


@dataclass(frozen=True)
class Symbols:
    """The variables of a stage and the parameters of the program."""

    w: Any
    p: Any
    goal: Any
    parts: dict[str, Any]


def symbols(structure: Structure) -> Symbols:
    """The symbols; `parts` names pieces of w and p."""
    w, p = ca.SX.sym("w", structure.width), ca.SX.sym("p", structure.parameters)
    parts = {name: w[start:end] for name, (start, end) in structure.variable_ranges.items()}
    parts |= {name: p[start:end] for name, (start, end) in structure.parameter_ranges.items()}
    return Symbols(w, p, ca.SX.sym("goal", structure.size), parts)


def named_function(name: str, inputs: dict[str, Any], outputs: list[Any]) -> Any:
    """A CasADi function of named inputs, common subexpressions shared."""
    results = [f"out{i}" for i in range(len(outputs))]
    return ca.Function(name, list(inputs.values()), outputs, list(inputs), results, {"cse": True})
