"""The program of a structure as a compiled library, that CasADi's solvers load."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from lie_codegen.on_demand import casadi as ca
from lie_codegen.runtime.sources import build_source
from lie_codegen.steering.transcription.nlp_source import Condition, Layout, render_nlp
from lie_codegen.steering.transcription.path import path
from lie_codegen.steering.transcription.stage import interval
from lie_codegen.steering.transcription.stage_functions import StageFunctions
from lie_codegen.steering.transcription.structure import KINDS, Structure


def compiled(structure: Structure, solver: str) -> Path | None:
    """The library; None where there is no C compiler."""
    name = f"{structure.group.name}_nlp"
    shape = {key: value for key, value in vars(structure).items() if isinstance(value, int | tuple | bool)}
    definition = f"{structure.group.definition_text}\n{solver} {sorted(shape.items())}"
    return build_source(
        lambda: {f"{name}.c": source(structure, solver)}, f"{name}.c", namespace=name, definition=definition
    )


def source(structure: Structure, solver: str) -> str:
    """The C text."""
    step = interval(structure)
    paths = {kind: path(structure, kind) for kind in KINDS}
    pattern = step.curve.sparsity_out(1)
    for each in paths.values():
        pattern = pattern + each.curve.sparsity_out(1)
    pattern = pattern if solver == "fatrop" else ca.triu(pattern)
    functions = [
        step.cost,
        step.steepness,
        _dense(step.value),
        _dense(step.slope),
        _curve(step, pattern, interval=True),
    ]
    kinds = []
    for number, (kind, piece) in enumerate(paths.items()):
        if piece.rows:
            functions += [_dense(piece.value), _dense(piece.slope), _curve(piece, pattern, interval=False)]
        slope = piece.slope.sparsity_out(1)
        own = _own_curve(piece, pattern)
        places = pattern.get_nz([r + c * structure.width for r, c in zip(*own.get_triplet(), strict=True)])
        if (
            kind == "last"
        ):  # no interval begins at the last node: its second derivatives are those of its conditions alone
            places = list(range(own.nnz()))
        kinds.append(Condition(kind, number, piece.rows, *_compressed(slope), tuple(places)))
    slope = step.slope.sparsity_out(1)
    nodes = range(structure.intervals + 1)
    layout = Layout(
        title=structure.group.name,
        solver=solver,
        intervals=structure.intervals,
        stage=structure.stage,
        width=structure.width,
        parameters=structure.parameters,
        kind_of=tuple(KINDS.index(structure.kind(k)) for k in nodes),
        goal_of=tuple(structure.goal(k) for k in nodes),
        columns=_compressed(slope)[0],
        row_indices=_compressed(slope)[1],
        curve=_compressed(pattern),
        last_curve=_compressed(_own_curve(paths["last"], pattern)),
        kinds=tuple(kinds),
    )
    return render_nlp(layout, functions)


def _compressed(pattern: Any) -> tuple[tuple[int, ...], tuple[int, ...]]:
    return tuple(pattern.colind()), tuple(pattern.row())


def _dense(function: Any) -> Any:
    """The same with the nonzeros of every output as a dense column."""
    inputs = [ca.SX.sym(function.name_in(i), function.sparsity_in(i)) for i in range(function.n_in())]
    outputs = [ca.vertcat(*each.nonzeros()) for each in function.call(inputs)]
    names = [function.name_in(i) for i in range(function.n_in())]
    return ca.Function(function.name(), inputs, outputs, names, [f"out{i}" for i in range(len(outputs))], {"cse": True})


def _own_curve(piece: StageFunctions, pattern: Any) -> Any:
    return piece.curve.sparsity_out(1) * pattern


def _curve(piece: StageFunctions, pattern: Any, *, interval: bool) -> Any:
    """The gradient, and the nonzeros of the Hessian in the stage's pattern, or its own."""
    function = piece.curve
    inputs = [ca.SX.sym(function.name_in(i), function.sparsity_in(i)) for i in range(function.n_in())]
    gradient, H = function.call(inputs)
    projected = ca.project(H, pattern if interval else _own_curve(piece, pattern))
    outputs = [gradient] + ([ca.vertcat(*projected.nonzeros())] if projected.nnz() else [])
    names = [function.name_in(i) for i in range(function.n_in())]
    return ca.Function(function.name(), inputs, outputs, names, ["gradient", "curve"][: len(outputs)], {"cse": True})
