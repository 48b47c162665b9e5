"""The nonlinear program of direct multiple shooting on the group, built once for its structure, solved for any numbers.

Times are in units of the task's duration. A stage holds X, the controls v and, where it is free, the duration s; over an
interval the controls are linear, v_{k+1} = v_k + r_k, and the state steps by the fourth-order Magnus method for
X' = X hat(drift + v):
    X_{k+1} = X_k exp(Theta),   Theta = h (a + b) / 2 + h^2 / 12 [a, b],   h = s / N.
To second order v is a wrench on the actuated components, the state is (X, xi) and steps by RKMK4 (`driven_step`):
    X' = X hat(xi),   J xi' = ad*_xi J xi + v.
With a C compiler the program and its derivatives are compiled for the structure, once; else CasADi evaluates them.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.on_demand import casadi as ca
from lie_codegen.runtime.compiler import find_compilers
from lie_codegen.steering.transcription.listener import Listener
from lie_codegen.steering.transcription.path import path
from lie_codegen.steering.transcription.source import compiled
from lie_codegen.steering.transcription.stage import interval
from lie_codegen.steering.transcription.structure import KINDS, Structure
from lie_codegen.steering.transcription.watched_solver import WatchedSolver

#: The violation is asked for below what the check of the true system wants, so that one solve is enough.
_FATROP = {"print_level": 0, "tol": 1e-8, "constr_viol_tol": 1e-10, "mu_init": 1e-2, "max_iter": 300}
_IPOPT = {
    "print_level": 0,
    "sb": "yes",
    "max_iter": 500,
    "tol": 1e-10,
    "mu_init": 1e-3,
    "bound_relax_factor": 0.0,
}
_COMMON = {
    "print_time": False,
    "error_on_fail": False,
    "show_eval_warnings": False,
    "calc_lam_x": False,
    "calc_lam_p": False,
}


@dataclass(frozen=True)
class Program:
    """A solver.

    Attributes:
        solver: the casadi function, or a `WatchedSolver`, which is called like one.
        name: "fatrop" or "ipopt".
        lower, upper: (rows,) limits of the constraints: zeros, and zeros or infinity.
        gap_rows: (N,) the row at which each interval's gap begins.
        listener: what hears of iterations, if anything does.
    """

    solver: Any
    name: str
    lower: Array
    upper: Array
    gap_rows: Array
    listener: Listener | None


@lru_cache(maxsize=64)
def program(structure: Structure, solver: str, *, listening: bool = False) -> Program:
    """The program of a structure for a solver; variables and parameters are laid out as the structure says.

    A listening one tells of ipopt's iterations; fatrop has no way to.
    """
    equality: list[bool] = []
    gap_rows = []
    for k in range(structure.intervals + 1):
        kind = structure.kind(k)
        gap_rows.append(len(equality))
        equality += [True] * (structure.stage if k < structure.intervals else 0)
        rows = {"via": structure.group.dim, "last": structure.group.dim}.get(kind, 0)
        clear = structure.cones + structure.balls + structure.solids if structure.watched(kind) else 0
        limits = 2 * len(structure.controls) if structure.free_time and kind != "last" else 0
        half_space = 1 if structure.guarded and rows else 0
        equality += [True] * rows + [False] * (half_space + clear + limits)
    if structure.periodic:
        equality += [True] * len(structure.controls)
    own: dict[str, Any] = {"ipopt": _IPOPT}
    if solver == "fatrop":
        own = {"structure_detection": "auto", "equality": equality, "fatrop": _FATROP}
    listener = (
        Listener(structure.variables, len(equality), structure.parameters) if listening and solver == "ipopt" else None
    )
    if listener is not None:
        own["iteration_callback"] = listener
    library = None if structure.periodic else compiled(structure, solver)
    if library is not None and solver == "fatrop":
        made: Any = WatchedSolver(solver, str(library), {**_COMMON, **own})
    else:
        oracle: Any = _symbolic(structure) if library is None else str(library)
        made = ca.nlpsol("steer", solver, oracle, {**_COMMON, **own})
    return Program(
        made,
        solver,
        np.zeros(len(equality)),
        np.where(equality, 0.0, np.inf),
        np.array(gap_rows[:-1]),
        listener,
    )


@lru_cache(maxsize=64)
def endable(structure: Structure) -> bool:
    """Whether fatrop can be ended on its program, a compiled one; found out once, as `program` is."""
    return bool(find_compilers())


def _symbolic(structure: Structure) -> dict[str, Any]:
    """The program for CasADi to differentiate: f, and g interval by interval, the order in which fatrop finds the structure."""
    step = interval(structure)
    paths = {kind: path(structure, kind) for kind in KINDS}
    N, stage = structure.intervals, structure.stage
    p = ca.MX.sym("p", structure.parameters)
    z = [ca.MX.sym(f"z{k}", stage) for k in range(N + 1)]
    r = [ca.MX.sym(f"r{k}", structure.width - stage) for k in range(N)]
    objective: Any = 0
    constraints: list[Any] = []
    for k in range(N + 1):
        w = ca.vertcat(z[k], r[k] if k < N else ca.MX(structure.width - stage, 1))
        if k < N:
            constraints.append(z[k + 1] - step.value(w, p))
            objective += step.cost(w, p)
        goal = structure.goal(k)
        constraints.append(paths[structure.kind(k)].value(w, p, p[goal : goal + structure.size]))
    if structure.periodic:
        first, last = structure.variable_ranges["v"]
        constraints.append(z[N][first:last] - z[0][first:last])
    x = ca.vertcat(*(each for pair in zip(z, r, strict=False) for each in pair), z[N])
    return {"x": x, "p": p, "f": objective, "g": ca.vertcat(*constraints)}
