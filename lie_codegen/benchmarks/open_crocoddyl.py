"""A rigid body on four rotors to a place: by lc.ocp, and by crocoddyl's box-FDDP, all of it in C++ (free-flyer dynamics of pinocchio).

The same inertia, rotors, bounds and cost, the cost and the motion of fourth order in a step for both; crocoddyl's Runge-Kutta steps
are in its own chart, ours Lie-group steps, so that the optimal costs agree to 1e-3. There are no conditions but the bounds: box-FDDP
has no others.
"""

from __future__ import annotations

import subprocess
import sys
from typing import Any

import numpy as np

from lie_codegen.groups.catalogue_load import group
from lie_codegen.runtime.child import child_environment
from lie_codegen.steering.ocp.front import ocp
from lie_codegen.steering.ocp.problem import OptimalControlProblem

INTERVALS, STEP = 33, 0.03
MASS, INERTIA = 1.5, (0.03, 0.035, 0.05)
#: Distance of the rotors from the centre; torque about the thrust's axis a unit of thrust.
_ARM, _TORQUE = 0.16, 0.015
LOW, HIGH = 0.5, 8.0
HOVER = MASS * 9.81 / 4
TARGET = (1.0, 0.5, 0.8)
#: Weights of |p - target|^2 / 2, |xi|^2 / 2, |u - hover|^2 / 2, a second; and at the end.
_STAGE, _END = (4.0, 0.3, 0.1), (200.0, 20.0)


def rotors() -> OptimalControlProblem:
    """For lc.ocp: the state xi, four thrusts u."""
    a, c = _ARM, _TORQUE
    turning = [[0, a, 0, -a], [-a, 0, a, 0], [-c, c, -c, c]]
    weight = [f"{-MASS * 9.81}*X3{i}" for i in (1, 2, 3)]
    miss = [f"(X{i + 1}4 - {TARGET[i]})" for i in range(3)]
    place, speed, thrust = (float(np.sqrt(w)) for w in _STAGE)
    return ocp(
        group("se3"),
        dynamics="second_order",
        inertia=np.array([*INERTIA, MASS, MASS, MASS]),
        inputs={"u": 4},
        allocation=np.array([*turning, [0] * 4, [0] * 4, [1] * 4], dtype=float),
        force=("0", "0", "0", *weight),
        stage_cost=(
            *(f"{place}*{each}" for each in miss), f"{speed}*xi", *(f"{thrust}*(u{i} - {HOVER})" for i in (1, 2, 3, 4)),
        ),
        terminal_cost=(*(f"{float(np.sqrt(_END[0]))}*{each}" for each in miss), f"{float(np.sqrt(_END[1]))}*xi"),
        bounds={"u": (LOW, HIGH)},
        duration=INTERVALS * STEP,
        intervals=INTERVALS,
        quadrature="simpson",
        name="bench_rotors",
    )  # fmt: skip


def crocoddyl_solver() -> Any:
    """A function that solves it once, from hovering, and gives the solver: `.cost`, `.iter`.

    Raises:
        ImportError: crocoddyl or pinocchio is not installed, or their libraries do not fit each other.
    """
    import crocoddyl  # type: ignore[import-not-found]
    import pinocchio  # type: ignore[import-not-found]

    model = pinocchio.Model()
    still = pinocchio.SE3.Identity()
    joint = model.addJoint(0, pinocchio.JointModelFreeFlyer(), still, "root_joint")
    model.appendBodyToJoint(joint, pinocchio.Inertia(MASS, np.zeros(3), np.diag(INERTIA)), still)
    frame = model.addFrame(pinocchio.Frame("body", joint, 0, still, pinocchio.FrameType.OP_FRAME))
    state = crocoddyl.StateMultibody(model)
    spins = (crocoddyl.ThrusterType.CCW, crocoddyl.ThrusterType.CW) * 2
    places = ((_ARM, 0.0), (0.0, _ARM), (-_ARM, 0.0), (0.0, -_ARM))
    thrusters = [
        crocoddyl.Thruster(pinocchio.SE3(np.eye(3), np.array([x, y, 0.0])), _TORQUE, spin, LOW, HIGH)
        for (x, y), spin in zip(places, spins, strict=True)
    ]
    actuation = crocoddyl.ActuationModelFloatingBaseThrusters(state, thrusters)
    rest = np.concatenate([np.zeros(6), [1.0], np.zeros(6)])

    def body(weights: tuple[float, ...]) -> Any:
        costs = crocoddyl.CostModelSum(state, actuation.nu)
        place = crocoddyl.ResidualModelFrameTranslation(state, frame, np.array(TARGET), actuation.nu)
        costs.addCost("place", crocoddyl.CostModelResidual(state, place), weights[0])
        speeds = crocoddyl.ActivationModelWeightedQuad(np.repeat([0.0, 1.0], 6))
        moved = crocoddyl.ResidualModelState(state, rest, actuation.nu)
        costs.addCost("speed", crocoddyl.CostModelResidual(state, speeds, moved), weights[1])
        if len(weights) > 2:
            thrust = crocoddyl.ResidualModelControl(state, np.full(4, HOVER))
            costs.addCost("thrust", crocoddyl.CostModelResidual(state, thrust), weights[2])
        return crocoddyl.DifferentialActionModelFreeFwdDynamics(state, actuation, costs)

    held = crocoddyl.ControlParametrizationModelPolyZero(4)
    running = crocoddyl.IntegratedActionModelRK(body(_STAGE), held, crocoddyl.RKType.four, STEP)
    running.u_lb, running.u_ub = np.full(4, LOW), np.full(4, HIGH)
    ending = crocoddyl.IntegratedActionModelEuler(body(_END), 0.0)
    problem = crocoddyl.ShootingProblem(rest, [running] * INTERVALS, ending)

    def solve() -> Any:
        solver = crocoddyl.SolverBoxFDDP(problem)
        solver.th_stop = 1e-10
        solver.solve([rest] * (INTERVALS + 1), [np.full(4, HOVER)] * INTERVALS, 200, False)
        return solver

    return solve


def survives() -> None:
    """Solves it once in a process of its own: wheels of crocoddyl and pinocchio that do not fit each other have ended ours.

    Raises:
        RuntimeError: the process died, and of what.
    """
    command = [sys.executable, "-c", f"from {__name__} import crocoddyl_solver; crocoddyl_solver()()"]
    done = subprocess.run(command, env=child_environment(), capture_output=True, text=True, check=False)
    if done.returncode:
        said = done.stderr.strip().splitlines()
        raise RuntimeError(said[-1] if done.returncode > 0 and said else f"it died of signal {-done.returncode}")
