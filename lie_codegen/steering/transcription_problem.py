"""The nonlinear program of direct multiple shooting on the group, built once for its structure, solved for any numbers.

Times are in units of the task's duration. A stage holds X, the controls v and the duration s; over an interval the controls
are linear, v_{k+1} = v_k + r_k, and the state steps by the fourth-order Magnus method for X' = X hat(drift + v):
    X_{k+1} = X_k exp(Theta),   Theta = h (a + b) / 2 + h^2 / 12 [a, b],   h = s / N.
To second order v is a wrench on the actuated components, the state is (X, xi) and steps by RKMK4 (`driven_step`):
    X' = X hat(xi),   J xi' = ad*_xi J xi + v.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import casadi as ca
import numpy as np
from numpy.typing import NDArray

from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernels.driven_step import driven_step
from lie_codegen.kernels.element_pattern import pack, packed_size, unpack
from lie_codegen.kernels.kernel import Kernel, Port
from lie_codegen.kernels.rkmk import bracket_body, times_taylor_exp
from lie_codegen.lowering.casadi_arithmetic import function_of

Array = NDArray[Any]

_EXPONENTIAL_DEGREE = 9


@dataclass(frozen=True)
class Structure:
    """All that the shape of the program depends on.

    Attributes:
        group, controls: the system.
        intervals: N.
        cones, balls: how many of each.
        via: nodes at which X is given.
        free_time: whether the duration is a variable, and the objective.
        solver: "ipopt" or "fatrop".
        second_order: whether the controls are torques, the state (X, xi).
        periodic: whether the controls end as they begin.
    """

    group: MatrixGroup
    controls: tuple[int, ...]
    intervals: int
    cones: int = 0
    balls: int = 0
    via: tuple[int, ...] = ()
    free_time: bool = False
    solver: str = "ipopt"
    second_order: bool = False
    periodic: bool = False

    @property
    def size(self) -> int:
        """Doubles of a packed element."""
        return packed_size(self.group)

    @property
    def state(self) -> int:
        """Doubles of the state: X, and xi to second order."""
        return self.size + (self.group.dim if self.second_order else 0)

    @property
    def stage(self) -> int:
        """Variables of a stage without its rates."""
        return self.state + len(self.controls) + 1


@dataclass(frozen=True)
class Program:
    """A solver with the layout of its variables.

    Attributes:
        solver: the casadi function.
        equality: (rows,) True where a constraint is an equality; the others are >= 0.
    """

    solver: Any
    equality: Array


@lru_cache(maxsize=32)
def program(structure: Structure) -> Program:
    """The program of a structure. Parameters: target, drift, weights, cones, balls, via elements, rate limits (m), and to
    second order the inertia and its inverse."""
    group, m, N = structure.group, len(structure.controls), structure.intervals
    size, state, d = structure.size, structure.state, group.degree
    target: Any = ca.SX.sym("target", size)
    drift: Any = ca.SX.sym("drift", group.dim)
    weights: Any = ca.SX.sym("weights", m)
    cones: Any = ca.SX.sym("cones", 7, structure.cones)
    balls: Any = ca.SX.sym("balls", d, structure.balls)
    via: Any = ca.SX.sym("via", size, len(structure.via))
    rates: Any = ca.SX.sym("rates", m)
    masses: Any = ca.SX.sym("masses", 2 * group.dim**2 if structure.second_order else 0)
    parameters = ca.vertcat(target, drift, weights, ca.vec(cones), ca.vec(balls), ca.vec(via), rates, masses)
    step, miss = _step(structure), function_of(_miss_kernel(structure))
    p = ca.MX.sym("p", parameters.numel())
    split = ca.Function("split", [parameters], [target, drift, weights, cones, balls, via, rates, masses])
    target, drift, weights, cones, balls, via, rates, masses = split(p)
    clear = _clearance(structure)
    variables: list[Any] = []
    constraints: list[Any] = []
    equality: list[bool] = []
    paths: list[list[tuple[Any, bool]]] = []
    objective: Any = 0
    before = None
    for k in range(N + 1):
        z = ca.MX.sym(f"z{k}", structure.stage)
        S, X, v, s = z[:state], z[:size], z[state : state + m], z[state + m]
        variables.append(z)
        if before is not None:
            S0, v0, s0, r = before
            moved = step(S0, v0, v0 + r, masses if structure.second_order else drift, s0 / N)
            constraints.append(ca.vertcat(S - moved, v - v0 - r, s - s0))
            equality += [True] * structure.stage
            _append(constraints, equality, paths[-1])
        path: list[tuple[Any, bool]] = []
        if k in structure.via:
            path.append((miss(via[:, structure.via.index(k)], X), True))
        if 0 < k < N and structure.cones + structure.balls:
            path.append((clear(X, cones, balls), False))
        if k == N:
            path.append((miss(target, X), True))
            if structure.periodic:
                path.append((v - variables[0][state : state + m], True))
        else:
            r = ca.MX.sym(f"r{k}", m)
            variables.append(r)
            before = (S, v, s, r)
            b = v + r
            energy = ca.dot(weights, v * v + v * b + b * b) * s / (3 * N)
            objective += s / N + 1e-6 * energy if structure.free_time else energy
            if structure.free_time:
                path.append((ca.vertcat(rates * s / N - r, rates * s / N + r), False))
        paths.append(path)
    _append(constraints, equality, paths[-1])
    problem = {"x": ca.vertcat(*variables), "p": p, "f": objective, "g": ca.vertcat(*constraints)}
    return Program(_nlpsol(structure, problem, equality), np.array(equality))


def _append(constraints: list[Any], equality: list[bool], path: list[tuple[Any, bool]]) -> None:
    """The path constraints of a stage, after its gap: the order in which fatrop finds the structure."""
    for rows, is_equality in path:
        constraints.append(rows)
        equality += [is_equality] * rows.numel()


def _nlpsol(structure: Structure, problem: dict[str, Any], equality: list[bool]) -> Any:
    common: dict[str, Any] = {"print_time": False, "error_on_fail": False, "show_eval_warnings": False}
    if structure.solver == "fatrop":
        options: dict[str, Any] = {"print_level": 0, "tol": 1e-8, "max_iter": 500}
        own: dict[str, Any] = {"structure_detection": "auto", "equality": equality, "fatrop": options}
        return ca.nlpsol("steer", "fatrop", problem, {**common, **own})
    settings: dict[str, Any] = {
        "print_level": 0,
        "sb": "yes",
        "max_iter": 500,
        "tol": 1e-10,
        "mu_init": 1e-3,
        "max_wall_time": 30.0,
        "bound_relax_factor": 0.0,
    }
    return ca.nlpsol("steer", "ipopt", problem, {**common, "ipopt": settings})


def _step(structure: Structure) -> Any:
    """(state, v0, v1, drift or masses, h) -> the next state."""
    if not structure.second_order:
        return function_of(_step_kernel(structure))
    group, m, n = structure.group, len(structure.controls), structure.group.dim
    S, a, b = (ca.SX.sym(name, size) for name, size in (("S", structure.state), ("a", m), ("b", m)))
    masses, h = ca.SX.sym("masses", 2 * n * n), ca.SX.sym("h")
    spread = ca.DM.zeros(n, m)
    for number, position in enumerate(structure.controls):
        spread[position, number] = 1
    forces = [spread @ each for each in (a, (a + b) / 2, b)]
    moved = function_of(driven_step(group, _EXPONENTIAL_DEGREE))(S, masses[: n * n], masses[n * n :], *forces, h)
    return ca.Function("driven", [S, a, b, masses, h], [moved])


def _step_kernel(structure: Structure) -> Kernel:
    group, m, size = structure.group, len(structure.controls), structure.size

    def body(ops: Any, X: Any, a: Any, b: Any, drift: Any, h: Any) -> tuple[Any, ...]:
        first, last = list(drift), list(drift)
        for position, left, right in zip(structure.controls, a, b, strict=True):
            first[position], last[position] = first[position] + left, last[position] + right
        turn = bracket_body(group, ops, first, last)
        theta = [h * (p + q) / 2 + h * h * r / 12 for p, q, r in zip(first, last, turn, strict=True)]
        return (pack(group, times_taylor_exp(group, ops, unpack(group, X), theta, _EXPONENTIAL_DEGREE)),)

    ports = (Port("X", (size,)), Port("a", (m,)), Port("b", (m,)), Port("drift", (group.dim,)), Port("h", ()))
    return Kernel("magnus_step", group.name, ports, (Port("X_next", (size,)),), body)


def _miss_kernel(structure: Structure) -> Kernel:
    """q_k = <target A_k, X - target>, zero, near the target, only there: n equations, of full rank."""
    group, size = structure.group, structure.size

    def body(ops: Any, target: Any, X: Any) -> tuple[Any, ...]:
        from lie_codegen.kernels.lie_poisson import right_moves

        r = [x - goal for x, goal in zip(X, target, strict=True)]
        moves = right_moves(group, ops, target)
        return ([sum((a * b for a, b in zip(move, r, strict=True)), 0 * r[0]) for move in moves],)

    return Kernel("miss", group.name, (Port("target", (size,)), Port("X", (size,))), (Port("q", (group.dim,)),), body)


def _clearance(structure: Structure) -> Any:
    group, d = structure.group, structure.group.degree
    X = ca.SX.sym("X", structure.size)
    cones = ca.SX.sym("cones", 7, structure.cones)
    balls = ca.SX.sym("balls", d, structure.balls)
    rows = []
    if structure.cones + structure.balls:
        matrix = unpack(group, ca.vertsplit(X))
        for number in range(structure.cones):
            pointing = sum(cones[3 + i, number] * matrix[i][j] * cones[j, number] for i in range(3) for j in range(3))
            rows.append(cones[6, number] - pointing)
        for number in range(structure.balls):
            square = sum((matrix[i][d - 1] - balls[i, number]) ** 2 for i in range(d - 1))
            rows.append(square - balls[d - 1, number] ** 2)
    return ca.Function("clearance", [X, cones, balls], [ca.vertcat(*rows)])
