"""Every class that a public function returns: found by its annotations, and held to the demands of a value."""

from __future__ import annotations

import copy
import inspect
import pickle
import re
import sys
import typing
from collections.abc import Callable, Iterator
from dataclasses import is_dataclass, replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import lie_codegen as lc

pytestmark = pytest.mark.filterwarnings("ignore:::lie_codegen")
WAVE = ["cos(t)", "sin(t)", "0"]
GAINS = {"K_p": [4, 5, 6], "K_d": 5}


def halves(uniform: Any) -> Any:
    return uniform[:, :1], uniform[:, 1:]


def so3_error() -> Any:
    return lc.error_function("so3", "(3 - tr(Xd^-1*X))/2", "right")


def wave() -> Any:
    return lc.PeriodicInput(WAVE)


@cache
def pendulum() -> Any:
    return lc.lagrangian_system(coordinates=["x"], lagrangian="x_dot^2/2 + cos(x)", forces={"x": "f"}, inputs=["f"])


def spring() -> Any:
    lagrangian = "m*(r_dot^2 + r^2*theta_dot^2)/2 - k*(r - l)^2/2"
    return lc.lagrangian_system(coordinates=["r", "theta"], lagrangian=lagrangian, parameters={"m": 1, "k": 1, "l": 1})


def reduced() -> Any:
    return lc.routh_reduce(spring(), momentum={"theta": "1/2"})


def designed() -> Any:
    system = lc.lagrangian_system(
        coordinates=["x"], lagrangian="x_dot^2/2 - cos(x)", forces={"x": "f*sin(x - 1)"}, inputs=["f"]
    )
    fields = lc.vibrational_fields(system, lc.PeriodicInput(["(3 + alpha)*cos(t)"], parameters=["alpha"]))
    return lc.design_feedback(fields, amplitudes=["alpha"], eps=0.01, guess=[1.0, 0.0], poles=[-2.0, -5.0])


def euler() -> Any:
    return lc.euler_average(lc.free_rigid_body([1, 2, 3]), ["-w1", "-w2", "-w3"])


def regulated() -> Any:
    hold = "0.1*(1 - w1^2 - w2^2 - w3^2)"
    gains = zip(("-1.35614", "1.26209", "-0.187738"), ("w1", "w2", "w3"), strict=True)
    return lc.euler_average(lc.free_rigid_body((3, 4, 5)), [f"({gain} + {hold})*{w}" for gain, w in gains])


def walker() -> Any:
    return lc.connection("se2", shape=("r1", "r2"), A=[["r2", "0"], ["r1", "0"], ["0", "1"]])


def wheels() -> Any:
    return lc.momentum_wheels(axes=np.eye(3), inertia=[1, 2, 3], wheel_inertia="1/10")


def body() -> Any:
    return lc.mechanical_system("so3", inertia=(3, 2, 1), inputs=["w1"], advected={"down": ("direction", (0, 0, 1))})


def feedback() -> Any:
    return lc.feedback_average("so3", ["-2*g1", "cos(t)*g2 - g2", "-g3"])


def vehicle() -> Any:
    return lc.underwater_vehicle("se3", inertia=[1, 2, 3, 4, 5, 6], weight=2)


#: Class -> what makes one: those that can be kept in a file ...
SAVED: dict[str, Callable[[], Any]] = {
    "Advected": lambda: body().advected[0],
    "Allocation": lambda: lc.allocate(np.eye(3, 4) + 0.1),
    "AttitudeRegion": lambda: lc.attitude_region([0.4, 0, 0.1], [0.1, 0.2, 0.3], inertia=[1, 2, 3], k_p=2),
    "Ball": lambda: lc.Ball([0, 0, 1], 0.5),
    "Box": lambda: lc.Box([0, 0, 1], [0.5, 0.2, 0.1]),
    "Cylinder": lambda: lc.Cylinder([0, 0, 0], [0, 0, 1], 0.1, rounded=True),
    "BoundCheck": lambda: lc.corollary_check("so3", wave(), 1, eps=(0.2, 0.1), horizon=0.5),
    "BracketTerm": lambda: lc.bracket_table(lc.PeriodicInput(["cos(t)"]))[0],
    "CartanInvolution": lambda: lc.cartan_involution("sl2"),
    "ChartDomain": lambda: lc.chart_domain("so3"),
    "Choice": lambda: lc.Choice([1.0, 2.0]),
    "Compatibility": lambda: lc.check_compatibility(so3_error()),
    "Cone": lambda: lc.Cone([0, 0, 1], [0, 1, 0], "pi/6"),
    "Convergence": lambda: lc.convergence("so3", wave(), 0.1),
    "Coset": lambda: lc.Coset(np.eye(3), ["w3"]),
    "DirectionObservability": lambda: lc.direction_observability([1, 2, 3], [0, "3/5", "4/5"], [1, "1/2", "1/3"]),
    "Driven": lambda: lc.simulate_driven("so3", lambda t: np.array([np.sin(t), 0, 1]), np.diag([1.0, 2, 3]), t=[0, 1]),
    "ErrorFunction": so3_error,
    "EulerPerturbation": lambda: euler().perturbation,
    "EulerAverage": euler,
    "ExplicitSolution": lambda: lc.explicit_inertia_change(lc.free_rigid_body([1, 2, 3], rates=[0.1, 0.1, 0.1]).model, 1.0, 0.3, [0, 1]),
    "FreeRigidBody": lambda: lc.free_rigid_body([1, 2, 3]),
    "Gait": lambda: lc.gait(walker(), harmonics=1, steps=16),
    "GaitAverage": lambda: walker().average(lc.PeriodicInput(["cos(t)", "sin(t)"])),
    "Grid": lambda: lc.Grid([1.0, 2.0]),
    "KineticMetric": lambda: lc.kinetic_energy_metric("so3", [1, 2, 3]),
    "LagrangianSystem": pendulum,
    "LatinHypercube": lambda: lc.LatinHypercube([0.0], [1.0]),
    "LimitCycle": lambda: lc.limit_cycles(lc.euler_average(lc.free_rigid_body([1, 2, 3]), ["w1 - w1^3", "w2 - w2^3", "-w3/5"]))[0],
    "LinearControllability": lambda: lc.linear_controllability(lc.relative_equilibria(pendulum(), [0.1])[0]),
    "LinearLoop": lambda: lc.linear_loop("so3", inertia=[1, 2, 3], error="so3_right", gains=GAINS),
    "LogUniform": lambda: lc.LogUniform(1.0, 2.0),
    "Magnus": lambda: lc.magnus("so3", wave(), 3),
    "Mean": lambda: lc.mean("so3", np.stack([np.eye(3)] * 3)),
    "MechanicalAverage": lambda: lc.vibrational_average(body(), lc.PeriodicInput(["cos(t)"])),
    "MechanicalSystem": body,
    "MomentumWheels": lambda: lc.MomentumWheels([1, 2, 3], np.eye(3, dtype=int).tolist(), [1, 1, 1], [0, 0, 0]),
    "Nearest": lambda: lc.nearest("so3", np.eye(3) + 0.1),
    "Normal": lambda: lc.Normal(0.0, 1.0),
    "OnGroup": lambda: lc.OnGroup("so3"),
    "OscillatorAverage": lambda: lc.oscillator_average("so3", lc.PointMassOscillator(2, 1, [1, 2, 3]), wave()),
    "PointMassOscillator": lambda: lc.PointMassOscillator(2, 1, [1, 2, 3]),
    "Pointing": lambda: lc.Pointing([0, 0, 1], [0, 0.6, 0.8]),
    "Position": lambda: lc.Position([0, 0, 1]),
    "QuadraticConstants": lambda: lc.attitude_constants([4, 5, 6], [1, 2, 3], 0.1),
    "PrincipalBody": lambda: lc.free_rigid_body([1, 2, 3]).model,
    "Quantile": lambda: lc.Quantile("error", 0.9, width=0.1),
    "RelativeEquilibrium": lambda: lc.relative_equilibria(pendulum(), [0.1])[0],
    "ResponseGains": lambda: lc.gains_for_response([1, 2, 3], bandwidth=2),
    "RouthReduction": reduced,
    "SecondOrderControllability": lambda: lc.second_order_controllability("so3", [1, 2, 3], ["w1"]),
    "ShapeConnection": walker,
    "SlowEquilibrium": lambda: lc.slow_equilibria(regulated(), (0.3, 2.0))[0],
    "Sobol": lambda: lc.Sobol([0.0], [1.0]),
    "Stability": lambda: feedback().linearise([0, 0, 0]),
    "TrackingRegion": lambda: lc.tracking_region("so3", inertia=[1, 2, 3], error="so3_right", gains=GAINS, X=np.eye(3), xi=[0, 0, 0.1], X_d=np.eye(3), xi_d=[0, 0, 0]),
    "Uncertain": lambda: lc.Uncertain("so3", np.eye(3), np.eye(3)),
    "UnderwaterVehicle": vehicle,
    "Uniform": lambda: lc.Uniform(0.0, 1.0),
    "UpToPhase": lambda: lc.UpToPhase(np.eye(2)),
    "VibrationLine": lambda: lc.VibrationLine(1.0, [1, 0, 0], [0, 1, 0]),
    "VibrationalAverage": lambda: lc.vibrational_average(pendulum(), lc.PeriodicInput(["cos(t)"])),
    "VibrationalFeedback": designed,
    "VibrationalFields": lambda: lc.vibrational_fields(pendulum(), lc.PeriodicInput(["cos(t)"])),
    "WeiNorman": lambda: lc.wei_norman("so3"),
    "WeiNormanOrder": lambda: lc.wei_norman_order("se2"),
    "WheelPlan": lambda: wheels().steer([0.1, 0.2, 0.3], 2.0),
    "WheelRun": lambda: wheels().simulate(wave(), t=[0, 1]),
    "WheelSystem": wheels,
}  # fmt: skip
#: ... and those that can not.
OTHERS: dict[str, Callable[[], Any]] = {
    "Joint": lambda: lc.Joint(halves, 2),
    "Controllability": lambda: lc.controllability("so3", ["w1", "w2"]),
    "Structure": lambda: lc.structure("so3"),
}


#: Seconds each.
LONG = ("BoundCheck", "Gait", "SlowEquilibrium", "WheelPlan")


@pytest.mark.parametrize(
    "name", [pytest.param(name, marks=[pytest.mark.slow] * (name in LONG)) for name in (*SAVED, *OTHERS)]
)
def test_a_result_is_a_value(name: str, tmp_path: Path, elsewhere: Callable[[Any], list[Any]]) -> None:
    value, twin = ({**SAVED, **OTHERS}[name]() for _ in range(2))
    assert type(value).__name__ == name
    assert (value == twin) is True
    assert (value == 3) is False
    assert hash(value) == hash(twin)
    assert len(repr(value).splitlines()) <= 10
    assert "array(" not in repr(value)
    assert len(repr(value)) <= 1200
    twins = (pickle.loads(pickle.dumps(value)), copy.copy(value), copy.deepcopy(value), replace(value))
    for again in (*twins, *elsewhere(value)):
        assert (again == value) is True
    if name in SAVED:
        assert (lc.load(value.save(tmp_path / "value.npz")) == value) is True


#: Classes whose values are made by tests of their own.
ELSEWHERE = """
Averaged Certificate ClosedLoop CriticalPoints FeedbackAverage FirstOrderMargins FormulaReference CurveReference PlanReference
WaypointReference SampledInput ParametricInput PeriodicInput Event FreeRotation Invariance LoopMargins Manifold MassInertia OptimalPlan OrderCheck PhaseAverage Plan Plates
Propagator SlowSolution TimeAverage TumblingAverage Trajectory Torque
""".split()
#: Records that are no results: the language of kernels, groups, laws (which are kernels) and what is compiled or running.
MACHINES = """
Kernel AdaptiveLaw HybridLaw Observer OutputFeedback MatrixGroup Library GroupLibrary LieAlgebra Shooter OptimalControlProblem
ModelPredictiveControl Study Run Port Budget CasadiFunctions BracketWord
""".split()


def returned() -> Iterator[str]:
    """Names of the classes of the package in what public functions say that they return."""
    for name in dir(lc):
        function = getattr(lc, name)
        if not inspect.isfunction(function):
            continue
        plain = inspect.unwrap(function)
        for each in (plain, *typing.get_overloads(plain)):
            yield from re.findall(r"\b[A-Z]\w+", str(inspect.signature(each).return_annotation))


def classes() -> dict[str, type]:
    modules = [module for name, module in sys.modules.items() if name.startswith("lie_codegen.")]
    own = (each for module in modules for each in vars(module).values() if inspect.isclass(each))
    return {each.__name__: each for each in own if each.__module__.startswith("lie_codegen.")}


def test_every_class_that_is_returned_is_tried() -> None:
    names = {*returned(), *(name for name in dir(lc) if inspect.isclass(getattr(lc, name)))}
    ours = {name: kind for name, kind in classes().items() if name in names and is_dataclass(kind)}
    assert len(ours) > 80
    assert set(ours) - {*SAVED, *OTHERS, *ELSEWHERE, *MACHINES} == set()
