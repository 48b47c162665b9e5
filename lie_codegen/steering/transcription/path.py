"""What holds at a node of the transcription: elements to meet, obstacles to keep away from, limits on rates."""

from __future__ import annotations

from typing import Any

from lie_codegen.groups.maps.element_pattern import pack, unpack
from lie_codegen.groups.maps.rkmk import times_taylor_exp
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernel.casadi_arithmetic import CasadiArithmetic
from lie_codegen.on_demand import casadi as ca
from lie_codegen.steering.transcription.stage_functions import StageFunctions, Symbols, named_function, symbols
from lie_codegen.steering.transcription.structure import Structure
from lie_codegen.steering.transcription.tangent import pushed

_WITHIN = 0.5
#: Under the roots of distances, so that they have a slope where they vanish.
_SMOOTH = 1e-12


def path(structure: Structure, kind: str) -> StageFunctions:
    """The conditions at a node: zero, X = goal; then not below zero: its half-space, clearances, and limits on rates where time is free.

    Args:
        structure: the structure.
        kind: "first", "inner", "via" or "last".
    """
    at = symbols(structure)
    rows = []
    if kind in ("via", "last"):
        here = _without_free_motion(structure, at) if kind == "last" and structure.free else at.parts["X"]
        rows.append(_miss(structure.group, at.goal, here))
        if structure.guarded:
            rows.append(ca.dot(at.goal, here - at.goal) + _WITHIN)
    if structure.watched(kind):
        rows += _clearances(structure, at)
    if kind != "last" and structure.free_time:
        reach = at.parts["rates"] * at.parts["s"] / structure.intervals
        rows += [reach - at.parts["r"], reach + at.parts["r"]]
    g = ca.densify(ca.vertcat(*rows))
    factor, multipliers = ca.SX.sym("factor"), ca.SX.sym("multipliers", g.numel())
    inputs = {"w": at.w, "p": at.p, "goal": at.goal}
    weighted = {**inputs, "factor": factor, "multipliers": multipliers}
    curve, slope = ca.hessian(ca.dot(multipliers, g), at.w)
    return StageFunctions(
        value=named_function(f"{kind}_value", inputs, [g]),
        slope=named_function(f"{kind}_slope", inputs, [g, ca.jacobian(g, at.w)]),
        curve=named_function(f"{kind}_curve", weighted, [ca.densify(slope), curve]),
        rows=g.numel(),
    )


def _miss(group: MatrixGroup, goal: Any, X: Any) -> Any:
    """q_k = <goal A_k, X - goal>, zero, near the goal, only there: n equations, of full rank."""
    return ca.vertcat(*[ca.dot(pushed(group, goal, A), X - goal) for A in group.basis])


def _without_free_motion(structure: Structure, at: Symbols) -> Any:
    """pack(X exp(-hat(F h))): what must be the goal. h is small: the caller moves the goal along, see `refined`."""
    group = structure.group
    turn = -ca.reshape(at.parts["free"], group.dim, structure.free) @ at.parts["h"]
    matrix = unpack(group, ca.vertsplit(at.parts["X"]))
    moved = times_taylor_exp(group, CasadiArithmetic(), matrix, ca.vertsplit(turn))
    return ca.vertcat(*[ca.SX(entry) for entry in pack(group, moved)])


def _clearances(structure: Structure, at: Symbols) -> list[Any]:
    d = structure.group.degree
    if not structure.cones + structure.balls + structure.solids:
        return []
    matrix = unpack(structure.group, ca.vertsplit(at.parts["X"]))
    cones, balls = ca.reshape(at.parts["cones"], 7, -1), ca.reshape(at.parts["balls"], d, -1)
    rows = []
    for number in range(structure.cones):
        pointing = sum(cones[3 + i, number] * matrix[i][j] * cones[j, number] for i in range(3) for j in range(3))
        rows.append(cones[6, number] - pointing)
    for number in range(structure.balls):
        square = sum((matrix[i][d - 1] - balls[i, number]) ** 2 for i in range(d - 1))
        rows.append(square - balls[d - 1, number] ** 2)
    solids = ca.reshape(at.parts["solids"], structure.solid, -1)
    rows += [
        _solid_gap(ca.vertcat(*[matrix[i][d - 1] for i in range(d - 1)]), solids[:, number])
        for number in range(structure.solids)
    ]
    return rows


def _solid_gap(p: Any, given: Any) -> Any:
    """Distance of p to the surface of a solid, as `obstacles.solids` has it; roots have a slope at zero, too."""
    q = p.numel()
    center, axes, halves = given[:q], ca.reshape(given[q : q + q * q], q, q), given[q + q * q : 2 * q + q * q]
    tube, rounding = given[-2], given[-1]
    own = axes.T @ (p - center)
    off = ca.sqrt(ca.sumsqr(own[:2]) + _SMOOTH)
    first = tube * off + (1 - tube) * ca.fabs(own[0])
    # the second coordinate of a cylinder is in the first
    second = ca.fabs(own[1]) if q == 2 else ca.fabs(own[1]) * (1 - tube) - tube / _SMOOTH
    e = ca.vertcat(first, second, *[ca.fabs(own[i]) for i in range(2, q)]) - halves
    beyond = ca.fmax(e, 0)
    return ca.sqrt(ca.sumsqr(beyond) + _SMOOTH) + ca.fmin(ca.mmax(e), 0) - rounding
