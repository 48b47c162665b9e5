"""Docstrings of the door: every public function and method names its parameters and says which of our errors it raises, and does raise them.

A record that only our functions make is described where it is made; what a user writes down says what it refuses.
"""

from __future__ import annotations

import ast
import inspect
import re
import textwrap
from collections.abc import Callable, Iterator
from typing import Any

import numpy as np
import pytest
from tools import front_door

import lie_codegen as lc
from lie_codegen import errors

#: Made by our functions, or classes of names alone: nobody's constructor is called by hand.
MADE_BY_US = {
    "Certificate", "ClosedLoop", "Distribution", "Engine", "MatrixGroup", "Plan", "Propagator", "Status", "Study", "Trajectory",
    "UnderwaterVehicle", "torque",
}  # fmt: skip

#: What takes what our own code gives, and refuses nothing.
REFUSES_NOTHING = {
    "Choice.draw", "Engine.submit", "Kernel.defined_by", "Kernel.evaluate", "Kernel.sample", "LatinHypercube.draw", "LogUniform.draw",
    "Normal.draw", "OnGroup.draw", "ParametricInput.as_formula", "PeriodicInput.as_formula", "PeriodicInput.breakpoints_between",
    "Potential.energy", "Quantile.interval", "Quantile.met", "SampledInput.as_formula", "Sobol.draw", "Uniform.draw", "kernel_factory",
}  # fmt: skip

#: The keyword that stands for every misspelt one, and those of Python's own classes.
UNSAID = {"self", "cls", "unknown"}
#: Names of our errors.
OURS = {name for name, value in vars(errors).items() if isinstance(value, type) and name.endswith("Error")}


def public() -> Iterator[tuple[str, Any]]:
    """(name, function, class or method) of the whole door."""
    for subject in front_door.subjects():
        for name in front_door.names(subject):
            value = getattr(lc, name)
            if not callable(value):
                continue
            yield name, value
            for method, found in inspect.getmembers(value) if inspect.isclass(value) else ():
                if not method.startswith("_") and (inspect.isfunction(found) or inspect.ismethod(found)):
                    yield f"{name}.{method}", found


EVERY = dict(public())


def raises(doc: str) -> str:
    """The section of a docstring that names errors."""
    return doc.partition("Raises:")[2]


@pytest.mark.parametrize("name", [name for name in EVERY if name not in MADE_BY_US])
def test_parameters_are_named_and_errors_are_said(name: str) -> None:
    function = EVERY[name]
    doc = inspect.getdoc(function) or ""
    parameters = set(inspect.signature(function).parameters) - UNSAID
    unnamed = sorted(each for each in parameters if not re.search(rf"\b{each}\b", doc))
    assert not unnamed, f"{name}: say what {', '.join(unnamed)} is, with its shape and unit"
    if parameters and name not in REFUSES_NOTHING:
        assert "Raises:" in doc, f"{name}: say which errors it raises, and when"
    named = set(re.findall(r"\b[A-Z]\w+Error\b", raises(doc)))
    assert named <= OURS, f"{name}: {named - OURS} is no error of ours"


@pytest.mark.parametrize("name", [name for name in EVERY if name not in MADE_BY_US])
def test_what_the_own_lines_raise_is_said(name: str) -> None:
    """Of the function's own body, and of a class its constructor: an error of ours, or one that it is a kind of, stands under Raises."""
    tree = ast.parse(textwrap.dedent(inspect.getsource(inspect.unwrap(EVERY[name]))))
    whole = tree.body[0]
    lines: list[ast.stmt] = [whole]
    if isinstance(whole, ast.ClassDef):
        made_by = ("__init__", "__post_init__")
        lines = [each for each in whole.body if isinstance(each, ast.FunctionDef) and each.name in made_by]
    said = raises(inspect.getdoc(EVERY[name]) or "")
    for node in (node for line in lines for node in ast.walk(line)):
        raised = node.exc.func if isinstance(node, ast.Raise) and isinstance(node.exc, ast.Call) else None
        if isinstance(raised, ast.Name) and raised.id in OURS:
            kinds = [each.__name__ for each in getattr(errors, raised.id).__mro__ if each.__name__ in OURS]
            assert any(re.search(rf"\b{each}\b", said) for each in kinds), f"{name} raises {kinds[0]}"


def test_the_lists_of_exceptions_are_no_longer_than_needed() -> None:
    assert set(EVERY) >= MADE_BY_US | REFUSES_NOTHING
    for name in REFUSES_NOTHING:
        assert "Raises:" not in (inspect.getdoc(EVERY[name]) or "")


def _turn() -> Any:
    return lc.PeriodicInput(["cos(t)", "sin(t)", "0"])


def _body() -> Any:
    return lc.free_rigid_body([3, 2, 1])


def _wheels() -> Any:
    return lc.MomentumWheels(inertia=[3, 2, 1], axes=[[1, 0, 0], [0, 1, 0]], axial=[0.1, 0.1], transverse=[0.05, 0.05])


def _gain() -> Any:
    return lc.ParametricInput(parameters=("k",), components=("k*cos(t)", "0", "0"))


#: (name, error that its docstring states, what raises it).
STATED: list[tuple[str, str, Callable[[], Any]]] = [
    ("areas", "InputError", lambda: lc.areas("x")),
    ("moments", "InputError", lambda: lc.moments("x")),
    ("corollary_bound", "ArgumentError", lambda: lc.corollary_bound("x")),  # type: ignore[arg-type]
    ("corollary_check", "AssumptionError", lambda: lc.corollary_check("so3", lc.PeriodicInput(["1+cos(t)", "0", "0"]), 2)),
    ("convergence", "InputError", lambda: lc.convergence("so3", _turn(), -1)),
    ("VibrationLine", "ShapeError", lambda: lc.VibrationLine(1.0, (1.0,), (1.0, 2.0))),
    ("VibrationLine", "NotFiniteError", lambda: lc.VibrationLine(1.0, (np.nan,), (1.0,))),
    ("chart_domain", "UnknownGroupError", lambda: lc.chart_domain("nope")),
    ("wei_norman_determinant", "IdentifierError", lambda: lc.wei_norman_determinant("so3", "a b")),
    ("wei_norman_step", "IdentifierError", lambda: lc.wei_norman_step("so3", "a b")),
    ("commutator_free_step", "IdentifierError", lambda: lc.commutator_free_step("so3", "a b")),
    ("MatrixGroup.project", "ArgumentError", lambda: lc.group("so3").project(np.eye(4))),
    ("from_brackets", "InputError", lambda: lc.from_brackets("a", ["a", "b"], 3)),  # type: ignore[arg-type]
    ("Kernel", "InputError", lambda: lc.Kernel("a", "x", (), (), lambda ops: (1,))),
    ("Port", "ShapeError", lambda: lc.Port("a", (1, 2, 3))),
    ("distance", "ShapeError", lambda: lc.distance("so3", np.ones(3), np.eye(3))),
    ("second_kind", "ShapeError", lambda: lc.second_kind("so3", np.eye(2))),
    ("MomentumWheels", "ShapeError", lambda: lc.MomentumWheels(1.0, [[1, 0, 0]], [1], [1])),
    ("MomentumWheels.body_rate", "ShapeError", lambda: _wheels().body_rate(np.ones(3))),
    ("MomentumWheels.body_areas", "ShapeError", lambda: _wheels().body_areas(np.eye(3))),
    ("simulate_driven", "ShapeError", lambda: lc.simulate_driven("so3", abs, np.ones(3), t=[0, 1])),
    ("accessibility_rank", "ShapeError", lambda: lc.accessibility_rank("so3", 1, 1.0)),  # type: ignore[arg-type]
    ("accessibility_rank", "ShapeError", lambda: lc.accessibility_rank("so3", 1, ["w1"], xi=[1, 2])),
    ("direction_observability", "ShapeError", lambda: lc.direction_observability(1, 0, [0, 0, 1])),  # type: ignore[arg-type]
    ("principal_body", "ShapeError", lambda: lc.principal_body([1, 2, 2.5], rates=1)),
    ("coning_angles", "ShapeError", lambda: lc.coning_angles(_body(), [1, 2])),
    ("coning_bounds", "InputError", lambda: lc.coning_bounds(_body(), 2.0)),
    ("elliptic_kernels", "IdentifierError", lambda: lc.elliptic_kernels("a b")),
    ("moving_parts", "ShapeError", lambda: lc.moving_parts(_body().model, gains=[[0]])),
    ("moving_parts", "ExpressionError", lambda: lc.moving_parts(_body().model, torques=("q", 0, 0))),
    ("torque.eddy_current", "ShapeError", lambda: lc.torque.eddy_current([1, 2], [0, 0, 1])),
    ("torque.gravity_gradient", "InputError", lambda: lc.torque.gravity_gradient([0, 0, 0], 1.0)),
    ("ParametricInput.derivatives", "InputError", lambda: _gain().derivatives([0.0])),
    ("ParametricInput.derivatives", "NotFiniteError", lambda: _gain().derivatives([0.0], k=np.nan)),
    ("PeriodicInput.integral", "ArgumentError", lambda: _turn().integral("x")),
    ("PeriodicInput.from_samples", "ShapeError", lambda: lc.PeriodicInput.from_samples([1, 2], 1)),
    ("Cone.clearance", "SteeringInputError", lambda: lc.Cone((0, 0, 0), (1, 0, 0), 1.0).clearance(np.eye(3)[None])),
    ("Coset", "SteeringInputError", lambda: lc.Coset(np.eye(3), ["w3"], "up")),
    ("Choice", "InputError", lambda: lc.Choice([1, 2], [1, 1])),
    ("Normal", "ShapeError", lambda: lc.Normal([1, 2], [1, 2, 3])),
    ("LogUniform", "InputError", lambda: lc.LogUniform(0, 1)),
    ("OnGroup", "InputError", lambda: lc.OnGroup("se3")),
    ("Quantile", "InputError", lambda: lc.Quantile("a", 2, 1)),
    ("Run", "InputError", lambda: lc.Run(3)),
    ("compensated", "ArgumentError", lambda: lc.compensated(3, None)),  # type: ignore[arg-type]
    ("MatrixGroup.save", "OutputFolderError", lambda: lc.group("so3").save("/proc/none/x.npz")),
    ("Kernel.save", "OutputFolderError", lambda: lc.rkmk4_step("so3").save("/proc/none/x.npz")),
    ("closed_loop", "ShapeError", lambda: lc.closed_loop("so3", inertia=np.ones((5, 3)), t=[0, 1])),
]  # fmt: skip


@pytest.mark.parametrize(
    ("name", "error", "call"), STATED, ids=[f"{name}-{error}-{k}" for k, (name, error, _) in enumerate(STATED)]
)
def test_what_is_stated_is_raised(name: str, error: str, call: Callable[[], Any]) -> None:
    assert re.search(rf"\b{error}\b", raises(inspect.getdoc(EVERY[name]) or "")), f"{name} does not state {error}"
    with pytest.raises(errors.LieCodegenError) as raised:
        call()
    assert type(raised.value).__name__ == error


def test_a_refused_shape_names_those_that_are_taken() -> None:
    with pytest.raises(errors.ShapeError, match=r"shape \(5, 3\); give a number, \(3,\), \(3, 3\), .*\(N, 3, 3\)"):
        lc.closed_loop("so3", inertia=np.ones((5, 3)), t=[0, 1])
    with pytest.raises(errors.ShapeError, match=r"give \(3, 3\) and \(3,\), or N of either: \(N, 3, 3\), \(N, 3\)"):
        lc.closed_loop("so3", inertia=1, xi0=np.ones(2), t=[0, 1])
    with pytest.raises(errors.ShapeError, match="5 X0 and 4 xi0"):
        lc.closed_loop("so3", inertia=1, X0=np.tile(np.eye(3), (5, 1, 1)), xi0=np.ones((4, 3)), t=[0, 1])
