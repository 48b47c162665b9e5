"""Arguments with which every name of the front door answers, made anew for each call: a hostile one among them reaches what it is for."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

import lie_codegen as lc

Makers = dict[str, Callable[[], Any]]
_GAINS = {"K_p": [4, 5, 6], "K_d": 4}
_INERTIA = [1, 2, 2.5]
_TRACKER = {"inertia": lambda: _INERTIA, "error": lambda: "so3_right", "gains": lambda: _GAINS}
_DRIFT = ["-0.2*w1", "0.1*w2", "-0.1*w3"]


def _law() -> Any:
    return lc.tracking_law("so3", inertia=[1, 2, 2], error="so3_right", gains={"K_p": [1, 1, 1], "K_d": 1})


def _cart() -> Any:
    return lc.lagrangian_system(coordinates=["x"], lagrangian="dx^2/2 - x^2/2", forces={"x": "u"})


def _body() -> Any:
    return lc.free_rigid_body([3, 2, 1])


def _flow() -> Any:
    return lc.euler_average(_body(), ["-0.2*w1", "0.1*w2", "-0.1*w3"])


#: Plausible arguments by the name of the parameter; what is not here is left to its default, or gets 1.0.
PLAUSIBLE: dict[str, Callable[[], Any]] = {
    "group": lambda: "so3",
    "name_or_path": lambda: "so3",
    "what": lambda: "so3",
    "a": lambda: "so3",
    "b": lambda: "r3",
    "u": lambda: lc.PeriodicInput(["cos(t)", "sin(t)", "0"]),
    "inertia": lambda: [1.0, 2.0, 2.5],
    "name": lambda: "thing",
    "namespace": lambda: "thing",
    "labels": lambda: ["a", "b"],
    "brackets": lambda: {("a", "b"): {"b": 1}},
    "matrices": lambda: [[[0, 1], [0, 0]], [[1, 0], [0, -1]]],
    "combinations": lambda: {"a": {"w1": 1}, "b": {"w2": 1}, "c": {"w3": 1}},
    "controls": lambda: ["w1", "w2"],
    "target": lambda: [0.1, 0.2, 0.3],
    "duration": lambda: 1.0,
    "eps": lambda: 0.1,
    "order": lambda: 2,
    "t": lambda: [0.0, 0.5, 1.0],
    "X": lambda: np.eye(3),
    "Y": lambda: np.eye(3),
    "X0": lambda: np.eye(3),
    "X_d": lambda: np.eye(3),
    "Xs": lambda: np.array([np.eye(3), np.eye(3)]),
    "R": lambda: np.eye(3),
    "q": lambda: [1.0, 0.0, 0.0, 0.0],
    "s": lambda: 0.5,
    "xi": lambda: [0.1, 0.2, 0.3],
    "xi0": lambda: [0.1, 0.2, 0.3],
    "xi_d": lambda: [0.0, 0.0, 0.0],
    "x": lambda: [0.1, 0.2, 0.3],
    "y": lambda: [0.1, 0.2, 0.3],
    "gains": lambda: {"K_p": [1, 1, 1], "K_d": 1},
    "error": lambda: "so3_right",
    "law": _law,
    "system": _cart,
    "flow": _flow,
    "body": _body,
    "kernel": lambda: lc.group_kernels("so3")[0],
    "port": lambda: "g",
    "components": lambda: ["cos(t)", "sin(t)", "0"],
    "coordinates": lambda: ["x"],
    "lagrangian": lambda: "dx^2/2 - x^2/2",
    "forces": lambda: {"x": "u"},
    "estimates": lambda: [lc.Uncertain("so3", np.eye(3), np.eye(3) * 1e-4)],
    "covariance": lambda: np.eye(3) * 1e-4,
    "times": lambda: [0.0, 0.5, 1.0],
    "values": lambda: [[0.0, 0.0, 0.0]] * 3,
    "library": lambda: "scipy",
    "qubits": lambda: 1,
    "path": lambda: "/no/such/file",
    "folder": lambda: "/proc/none",
    "center": lambda: [0.0, 0.0, 1.0],
    "radius": lambda: 0.1,
    "axis": lambda: [0.0, 0.0, 1.0],
    "direction": lambda: [0.0, 0.0, 1.0],
    "half_angle": lambda: 0.3,
    "point": lambda: [0.0, 0.0, 1.0],
    "element": lambda: np.eye(3),
    "formula": lambda: "X[0][0] - 1/2",
    "delta": lambda: 0.1,
    "directions": lambda: np.eye(3),
    "positions": lambda: np.eye(3),
    "weights": lambda: [1.0, 1.0],
    "position": lambda: ["cos(t)", "sin(t)", "0"],
    "perturbation": lambda: ["-0.2*w1", "0.1*w2", "-0.1*w3"],
    "vehicle": lambda: lc.underwater_vehicle("se3", inertia=1),
    "fields": lambda: lc.vibrational_fields(_cart(), lc.PeriodicInput(["cos(t)"])),
    "intervals": lambda: 4,
    "mass": lambda: 1,
    "B": lambda: np.eye(3),
    "omega": lambda: 1.0,
    "steps": lambda: 3,
    "parameters": lambda: None,
    "problem": lambda: lc.ocp("so3", duration=1.0, intervals=4, controls=["w1", "w2"], bounds={"u": 1.0}),
}


@cache
def _problem() -> Any:
    return lc.ocp("so3", duration=1.0, intervals=4, controls=["w1", "w2"], stage_cost=["u"], bounds=2.0)


@cache
def _plan() -> Any:
    return lc.steer("so3", (0.1, 0.05, 0.08), ("w1", "w2"), 24.0, method="four_phase")


@cache
def _loop() -> Any:
    turn = lc.reference("so3", ["sin(t)", "0", "0"])
    return lc.closed_loop("so3", law=_law(), inertia=_INERTIA, reference=turn, X0=np.eye(3), t=[0, 0.1, 0.2], step=0.05)


def _own() -> Any:
    return lc.error_function("so3", "tr(K*(1 - Xd^-1*X))/2", parameters={"K": np.diag([1, 2, 3])})


def _boom() -> Any:
    return lc.free_rigid_body(("10 + 0.04*tau^2", "11 + 0.04*tau^2", "20"))


@cache
def _pendulum() -> Any:
    return lc.lagrangian_system(coordinates=["x"], lagrangian="dx^2/2 + cos(x)", forces={"x": "u"})


def _sphere() -> Any:
    return lc.manifold(3, ["q1^2 + q2^2 + q3^2 - 1"])


def _swimmer() -> Any:
    return lc.connection("se2", shape=("r1", "r2"), A=[["1", "0"], ["r1", "r2"], ["0", "1"]])


def _wheels() -> Any:
    return lc.MomentumWheels(
        inertia=[[3, 0, 0], [0, 2, 0], [0, 0, 1]],
        axes=[[1, 0, 0], [0, 1, 0]],
        axial=["1/10", "1/10"],
        transverse=["1/20", "1/20"],
    )


#: Arguments of one name, where those of its parameters do not do, or where it wants some that have a default.
BY_NAME: dict[str, Makers] = {
    "Coset": {"free": lambda: ["w3"]},
    "Joint": {"function": lambda: lambda each: {"a": each[:, 0]}, "slots_each": lambda: 1},
    "LogUniform": {"low": lambda: 0.1},
    "MomentumWheels": {
        "inertia": lambda: [[3, 0, 0], [0, 2, 0], [0, 0, 1]],"axes": lambda: [[1, 0, 0], [0, 1, 0]], "axial": lambda: ["1/10", "1/10"], "transverse": lambda: ["1/20", "1/20"]},
    "ParametricInput": {"parameters": lambda: ("k",), "components": lambda: ("k*cos(t)", "0", "0")},
    "Port": {"shape": lambda: (3,)},
    "Potential": {"group": lambda: lc.group("so3"), "V": lambda: "X33"},
    "Quantile": {"output": lambda: "a", "q": lambda: 0.5, "width": lambda: 0.1},
    "Run": {"function": lambda: lc.steer},
    "SampledInput": {"values": lambda: np.ones((2, 3))},
    "VibrationLine": {"cosine": lambda: (1.0, 0.0, 0.0), "sine": lambda: (0.0, 1.0, 0.0)},
    "accessibility_rank": {"inertia": lambda: ["1", "2", "3"], "forces": lambda: [[1, 0, 0]]},
    "second_order_controllability": {"inertia": lambda: ["1", "2", "3"], "forces": lambda: [[1, 0, 0], [0, 1, 0]]},
    "symmetric_product": {"inertia": lambda: ["1", "2", "3"], "x": lambda: [1, 0, 0], "y": lambda: [0, 1, 0]},
    "attitude_region": {"theta": lambda: [0.1, 0.2, 0.3], "omega": lambda: [0.1, 0, 0], "k_p": lambda: 1.0},
    "averaged_kernels": {"averaged": lambda: lc.average("so3", lc.PeriodicInput(["cos(t)", "sin(t)", "0"]), 2)},
    "bracket_table": {"u": lambda: lc.PeriodicInput(["cos(t)", "sin(t)"])},
    "certificate": {**_TRACKER, "level": lambda: 1.0, "prove": lambda: False},
    "check_compatibility": {"error": lambda: _own()},
    "closed_loop": {
        "group": lambda: "so3", "law": _law, "inertia": lambda: _INERTIA, "reference": lambda: lc.reference("so3", ["sin(t)", "0", "0"]),
        "X0": lambda: np.eye(3), "xi0": lambda: [0.1, 0, 0], "step": lambda: 0.05, "t": lambda: [0, 0.1],
    },
    "coning_angles": {"omega": lambda: [1.0, 0.1, 0.2]},
    "coning_bounds": {"k": lambda: 0.5},
    "connection": {"group": lambda: "se2", "shape": lambda: ["r1", "r2"], "A": lambda: [["1", "0"], ["r1", "r2"], ["0", "1"]]},
    "critical_points": {"error": lambda: "so3_right", "group": lambda: "so3", "gains": lambda: {"K_p": [4, 5, 6]}},
    "direction_observability": {"y": lambda: [0, 0, 1], "omega": lambda: [1, 2, 3], "inertia": lambda: [1, 2, 3]},
    "error_function": {"phi": lambda: "tr(K*(1 - Xd^-1*X))/2", "parameters": lambda: {"K": np.diag([1, 2, 3])}},
    "euler_average": {"body": _body, "terms": lambda: _DRIFT},
    "euler_perturbation": {"body": _body, "terms": lambda: _DRIFT},
    "example_connection": {"name": lambda: "falling_cat"},
    "explicit_inertia_change": {"body": lambda: _boom().model, "L": lambda: 1.0, "k0": lambda: 0.5, "tau": lambda: [0.0, 0.1]},
    "feedback_average": {"u": lambda: ["-g1*sin(t)^2", "cos(t)", "0"]},
    "floquet": {"rates": lambda: ["v", "-x + 0.5*(1 - x^2)*v"], "variables": lambda: ("x", "v"), "guess": lambda: (2, 0)},
    "free_rotation": {"J": lambda: [1, 2, 3], "X": lambda: np.eye(3), "omega": lambda: [0.1, 0.2, 1.0]},
    "gait": {"connection": _swimmer, "steps": lambda: 16, "harmonics": lambda: 1},
    "gradient": {"kernel": lambda: lc.Kernel("square", "thing", (lc.Port("x", ()),), (lc.Port("y", ()),), lambda ops, x: (x * x,)),
                 "port": lambda: "x"},
    "hybrid_law": {"inertia": lambda: _INERTIA, "K_p": lambda: [4, 5, 6], "K_d": lambda: [3, 4, 5]},
    "inertia_from_masses": {"masses": lambda: [1, 2, 3], "points": lambda: [[0, 0, 0], [1, 0, 0], [0, 2, 1]]},
    "integral_law": {**_TRACKER, "gains": lambda: {**_GAINS, "K_i": 1}},
    "invariance": {"error": lambda: _own()},
    "line_drift": {"lines": lambda: [lc.VibrationLine(1.0, (1.0, 0.0, 0.0), (0.0, 1.0, 0.0))]},
    "loop_margins": {"group": lambda: "so3", **_TRACKER},
    "manifold": {"size": lambda: 3, "constraints": lambda: ["q1^2 + q2^2 + q3^2 - 1"]},
    "manifold_law": {
        "transport": lambda: [[("q1*r1 + q2*r2 + q3*r3" if i == j else "0") + f" - r{i}*q{j}" for j in (1, 2, 3)] for i in (1, 2, 3)],"manifold": _sphere, "phi": lambda: "4*(1 - q1*r1 - q2*r2 - q3*r3)"},
    "manipulator_law": {"inertia": lambda: [["2"]], "K_p": lambda: 1, "K_d": lambda: 1},
    "modulus_squared": {"inertia": lambda: [1.5]},
    "momentum_wheels": {"axes": lambda: [[1, 0.2, 0], [0, 1, 0.3]], "wheel_inertia": lambda: 0.05, "inertia": lambda: [2, 1.7, 1.2]},
    "observer": {"directions": lambda: [[0, 0, 1], [0.6, 0, 0.8]]},
    "ocp": {
        "controls": lambda: ["w1", "w2"],"duration": lambda: 1.0, "intervals": lambda: 4, "stage_cost": lambda: ["u"], "bounds": lambda: 2.0},
    "oscillator_average": {
        "oscillator": lambda: lc.PointMassOscillator(body_mass=10, point_mass=2, inertia=[[4, 0, 0], [0, 3, 0], [0, 0, 2]]),
        "x_dot": lambda: lc.PeriodicInput(["cos(t)", "sin(t)", "0"]),
    },
    "oscillator_areas": {"x_dot": lambda: lc.PeriodicInput(["cos(t)", "sin(t)", "0"])},
    "output_feedback_law": {"directions": lambda: [[0, 0, 1]], "target_directions": lambda: [[0, 0.6, 0.8]]},
    "phase_average": {"F": lambda: ["-x + cos(phi)"], "rate": lambda: "1 + x^2", "variables": lambda: ["x"], "period": lambda: "2*pi"},
    "plates": {"normals": lambda: [[1, 0, 0], [-1, 0, 0]], "centres": lambda: [[1, 0, 0], [-1, 0, 0]], "areas": lambda: [1, 1]},
    "point_mass_connection": {"body_mass": lambda: 1, "masses": lambda: [1], "inertia": lambda: 1, "group": lambda: "se2"},
    "propagator": {"group": lambda: "so3", "u": lambda: ["cos(t)", "sin(t)", "0"], "duration": lambda: 1.0},
    "quadrotor_law": {"gains": lambda: {"k_x": 1, "k_v": 1, "k_R": 1, "k_W": 1}},
    "quaternion_from_rotation": {"order": lambda: "wxyz"},
    "rotation_from_quaternion": {"order": lambda: "wxyz"},
    "qutip_evolution": {"plan": lambda: lc.steer("su2", [0.1, 0.2, 0.3], ["sx", "sy", "sz"], 1.0)},
    "reference": {"formulas": lambda: ["sin(t)", "0", "0"], "duration": lambda: None},
    "routh_reduce": {"system": lambda: lc.lagrangian_system(coordinates=["x", "y"], lagrangian="dx^2/2 + dy^2/2 - y^2/2", forces={"y": "u"}),
                     "momentum": lambda: {"x": "1/2"}},
    "simulate": {"u": lambda: ["cos(t)", "sin(t)", "0"], "t": lambda: [0.0, 0.5, 1.0]},
    "simulate_driven": {"force": lambda: [0.1, 0, 0], "inertia": lambda: np.diag([1.0, 2.0, 2.5]), "t": lambda: [0.0, 0.5]},
    "solve_actual": {"flow": _flow, "omega0": lambda: [1.0, 0.1, 0.2]},
    "solve_averaged": {"flow": _flow, "Omega0": lambda: 1.0, "k0": lambda: 0.5},
    "slow_equilibria": {"flow": _flow, "Omega_range": lambda: (0.5, 2.0)},
    "moving_parts": {"body": lambda: _boom().model},
    "spectral_drift": {"omega": lambda: [1.0, 2.0], "density": lambda: np.stack([np.eye(3)] * 2)},
    "sphere_gain_bound": {"q": lambda: [0, 0, 1.0], "q_dot": lambda: [0.1, 0, 0], "r": lambda: [0, 0, 1.0], "r_dot": lambda: [0, 0.1, 0]},
    "study": {"what": lambda: lc.studies.each(lambda a: {"b": a * a}), "space": lambda: {"a": lc.Uniform(0, 1)}, "n": lambda: 8, "store": lambda: None},
    "time_average": {"rates": lambda: ["-x + cos(t)"], "variables": lambda: ["x"]},
    "tracking_law": _TRACKER,
    "transition_step": {"step": lambda: lc.rkmk4_step("so3")},
    "tumbling_average": {"J": lambda: (5, 4, 2.5), "torques": lambda: [lc.torque.eddy_current(np.diag([0.001, 0.0025, 0.0045]), (0.3, 0.8, -0.5))]},
    "underwater_vehicle": {"group": lambda: "se3", "inertia": lambda: 1},
    "vibrational_average": {"system": _pendulum, "u": lambda: lc.PeriodicInput(["2*cos(t)"], period="2*pi")},
    "vibrational_fields": {"system": _pendulum, "u": lambda: lc.PeriodicInput(["2*cos(t)"], period="2*pi")},
    "view": {"what": _plan, "path": lambda: "/proc/none/page.html"},
    "wheel_input": {"wheels": _wheels, "wheel_rates": lambda: lc.PeriodicInput(["cos(t)", "sin(t)"])},
    "with_quaternion": {"law": _law, "order": lambda: "scalar_first"},
    "plot_loops": {"run": _loop, "path": lambda: "/proc/none/loops.png"},
    "attitude_law": {"kind": lambda: "pd", "inertia": lambda: [2, 2.5, 3], "k_p": lambda: 4, "k_d": lambda: 6},
    "adaptive_law": {"error": lambda: "so3_right", "gains": lambda: _GAINS},
    "Pointing": {"axis": lambda: [0, 0, 1], "direction": lambda: [1, 0, 1]},
    "each": {"function": lambda: lambda a: a},
    "mpc": {"problem": _problem},
    "UpToPhase": {"gate": lambda: np.eye(2)},
    "Position": {"point": lambda: [0.0, 1.0]},
}  # fmt: skip
#: Given though they have a default; weights of a mean have another length than those of a plan, and so on.
_OPTIONAL = {"controls", "duration", "t"}


def plausible_arguments(function: Any) -> Makers:
    """{parameter: maker} of a call that answers."""
    own = BY_NAME.get(function.__name__)
    chosen: Makers = dict(own or {})
    for name, parameter in inspect.signature(function).parameters.items():
        if parameter.kind in (parameter.VAR_POSITIONAL, parameter.VAR_KEYWORD) or name in chosen:
            continue
        if parameter.default is parameter.empty or (own is None and name in _OPTIONAL):
            chosen[name] = PLAUSIBLE.get(name, lambda: 1.0)
    return chosen
