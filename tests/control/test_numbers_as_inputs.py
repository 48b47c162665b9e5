"""Every law of the front door: each of its numbers may be "input", or the error says why not; the same law in C either way."""

from __future__ import annotations

import inspect
import random
from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import lie_codegen as lc
from lie_codegen.control.attitude_lyapunov import attitude_lyapunov
from lie_codegen.control.force_limits import with_limits
from lie_codegen.kernel.arithmetic import FloatArithmetic
from lie_codegen.kernel.kernel import Kernel

J = ((1.5, 0.1, 0), (0.1, 1.25, 0.2), (0, 0.2, 1.75))
D = ((2.5, 0.2, 0.1), (0.2, 2.25, 0), (0.1, 0, 3))
SIX = (1.5, 1.25, 1.75, 3, 4, 5)
SO3 = {"inertia": J, "error": "so3_right"}
PATH = ["0.3*sin(t)", "t/10", "0"]
TEXT = ("k*tr(1 - Xd^-1*X)/2 + c*norm2(log(Xd^-1*X))/2", "right")


def vehicle(**numbers: Any) -> Any:
    water = {
        "added": SIX,
        "linear_damping": 1.5,
        "quadratic_damping": 0.5,
        "weight": 10,
        "buoyancy": 9.5,
        "r_G": (0, 0.1, 0.2),
        "r_B": (0.1, 0, 0),
    }
    return lc.underwater_vehicle("se3", **{"inertia": SIX, **water, "current": (0.3, -0.2, 0.1), **numbers})  # fmt: skip


def water_law(**numbers: Any) -> Kernel:
    law = lc.tracking_law("se3", inertia=SIX, error="se3_1", gains={"K_1": 4, "K_2": 5, "K_d": 6})
    return lc.compensated(law, vehicle(**({"inertia": "input"} if "added" in numbers else {}), **numbers))


def gained(make: Callable[..., Any], gains: dict[str, Any], *args: Any, **fixed: Any) -> Callable[..., Kernel]:
    """The law of numbers: those among the gains there, the others as keywords."""

    def law(**numbers: Any) -> Kernel:
        own = {key: value for key, value in numbers.items() if key not in gains}
        inside = {key: numbers.get(key, value) for key, value in gains.items()}
        return make(*args, **{**fixed, **own}, gains=inside)

    return law


ARM = [["m + 2*cos(q2)", "1 + cos(q2)/2"], ["1 + cos(q2)/2", "1"]]
#: name -> (law of numbers, the numbers that may be inputs with values, those that may not)
LAWS: dict[str, tuple[Callable[..., Kernel], dict[str, Any], dict[str, Any]]] = {
    "attitude p": (lambda **k: lc.attitude_law("p", **k), {"k_p": 2}, {}),
    "attitude p matrix": (lambda **k: lc.attitude_law("p", **k), {"k_p": 2}, {}),
    "attitude pd": (lambda **k: lc.attitude_law("pd", tracking=True, **k), {"inertia": J, "k_p": 2, "k_d": 3}, {}),
    "attitude reduced": (lambda **k: lc.attitude_law("reduced", **k), {"k_p": 2}, {}),
    "lyapunov": (attitude_lyapunov, {"inertia": J, "k_p": 2, "k_d": 3, "epsilon": 0.25}, {}),
    "pointing": (lambda **k: lc.pointing_law(**{"axis": (0, 3, 4), **k}, gyroscopic="double"), {"inertia": J, "k_p": 2, "K_d": D},
                 {"axis": "unit vector", "z": "unit vector"}),
    "pointing free": (lambda **k: lc.pointing_law(spin="free", **{"inertia": J, **k}), {"k_p": 2, "K_d": D}, {"inertia": "uses none"}),
    "tracking so3": (gained(lc.tracking_law, {"K_p": J, "K_d": D}, "so3", **SO3), {"inertia": J, "K_p": D, "K_d": J}, {}),
    "tracking so3 left": (gained(lc.tracking_law, {"K_p": J, "K_d": D}, "so3", inertia=J, error="so3_left"), {"K_p": D}, {}),
    "tracking geodesic": (gained(lc.tracking_law, {"K_p": J, "K_d": D}, "so3", inertia=J, error="geodesic"), {"K_p": D}, {}),
    **{f"tracking {row}": (gained(lc.tracking_law, {"K_1": J, "K_2": D, "K_d": 2}, "se3", inertia=SIX, error=row), {"K_1": D, "K_2": J, "K_d": SIX}, {})
       for row in ("se3_1", "se3_5")},
    "tracking frobenius": (gained(lc.tracking_law, {"k_p": 2, "K_d": 3}, "se2", inertia=1, error="frobenius"), {"k_p": 3}, {}),
    "tracking text": (gained(lc.tracking_law, {"k": 3, "c": 2, "K_d": 2}, "so3", inertia=J, error=TEXT), {"k": 2, "c": 1.5}, {}),
    "integral": (gained(lc.integral_law, {"K_p": 4, "K_d": D, "K_i": J, "c": 0.5, "w": 2}, "so3", **SO3, limits=(1, 0.5, 2)),
                 {"inertia": J, "K_p": D, "K_d": J, "K_i": D, "c": 0.25, "w": 1.5, "limits": (0.25, 1, 0.5)}, {}),
    "limits": (lambda **k: with_limits(lc.attitude_law("pd", inertia=J, k_p=2, k_d=3), **k), {"limits": (0.5, 1, 0.25)}, {}),
    "adaptive": (gained(lc.adaptive_law, {"K_p": J, "K_d": D}, "so3", error="so3_right", project=True, start=(2, 2, 2, 0, 0, 0)),
                 {"K_p": D, "K_d": J, "rate": (1, 2, 3, 4, 5, 6)}, {"start": "state", "basis": "feedforward"}),
    "hybrid": (lambda **k: lc.hybrid_law(**{"inertia": J, "K_p": (1, 2, 3), "K_d": D, **k}), {"inertia": D, "K_d": J},
               dict.fromkeys(("K_p", "kappa", "direction", "hysteresis"), "gap")),
    "quaternion": (lambda **k: lc.quaternion_law(**{"inertia": J, "k_p": 2, "K_d": D, **k}), {"inertia": D, "k_p": 3, "K_d": J, "hysteresis": 0.25}, {}),
    "manifold": (lambda **k: lc.manifold_law(lc.manifold(3, ["q1^2 + q2^2 + q3^2 - 1"]), phi="a*(1 - q1*r1 - q2*r2 - q3*r3)", transport=sphere(),
                 K_d=k.get("K_d", 2), parameters={"a": k.get("a", 3)}), {"K_d": D, "a": 2}, {}),
    "manipulator": (lambda **k: lc.manipulator_law(ARM, K_p=k.get("K_p", 2), K_d=k.get("K_d", 3), potential="m*g*sin(q1)",
                    parameters={"m": k.get("m", 4), "g": k.get("g", 9.75)}), {"K_p": (1, 2), "K_d": (3, 4), "m": 5, "g": 9.5}, {}),
    "computed torque": (lambda **k: lc.manipulator_law(ARM, **{"K_p": 2, "K_d": 3, **k}, kind="computed_torque", parameters={"m": 4}),
                        {"K_p": ((1, 0.25), (0.25, 2)), "K_d": (3, 4)}, {}),
    "observer": (lambda **k: lc.observer("so3", directions=np.eye(3)[:2], **{"k_p": 2, "k_i": 0.5, **k}), {"weights": (1, 3), "k_p": 1.5, "k_i": 0.25}, {}),
    "output feedback": (lambda **k: lc.output_feedback_law(directions=np.eye(3)[:2], target=np.eye(3), **k), {"r": (1, 2), "g": (3, 1.5), "G": D}, {}),
    "quadrotor": (lambda **k: quadrotor(**k), {"mass": 2, "gravity": 9.75, "inertia": J, "k_x": 1, "k_v": 2, "k_R": 3, "k_W": 4}, {}),
    "sphere": (lambda **k: lc.sphere_law(2, **{"k_p": 2, "k_d": 3, **k}), {"k_p": 3, "k_d": 2}, {}),
    "water": (lambda **k: lc.underwater_kernel(vehicle(**({"inertia": "input"} if "added" in k else {}), **k)),
              {"added": (2, 1, 1.5, 1, 2, 3), "linear_damping": (1, 2, 3, 4, 5, 6), "quadratic_damping": (1, 0.5, 0, 1, 2, 3), "weight": 12, "buoyancy": 11,
               "r_G": (0.1, 0, -0.2), "r_B": (0, -0.1, 0), "current": (0.1, 0.2, -0.3)}, {}),
    "compensated": (water_law, {"weight": 12, "current": (0.1, 0.2, -0.3)}, {}),
    "allocation": (lambda **k: lc.allocation_kernel(lc.allocate(np.eye(3, 4) + 0.1, **{n: v for n, v in k.items() if n == "weights"}),
                   **{n: v for n, v in k.items() if n == "limits"}), {"limits": (0.5, 0.25, 1, 1)}, {"weights": "computed once"}),
    "vibration": (lambda **k: lc.vibration_feedback("so3", **{"inertia": (1, 2, 3), "controls": ("w1", "w2"), **k}), {},
                  {"inertia": "follow", "k_p": "slow", "k_d": "slow", "frequency": "slow"}),
}  # fmt: skip


def sphere() -> list[list[str]]:
    inner = "(q1*r1 + q2*r2 + q3*r3)"
    return [[(inner if i == j else "0") + f" - r{i + 1}*q{j + 1}" for j in range(3)] for i in range(3)]


def quadrotor(**numbers: Any) -> Kernel:
    gains = {"k_x": 1, "k_v": 2, "k_R": 3, "k_W": 4}
    inside = {key: numbers.pop(key, value) for key, value in gains.items()}
    return lc.quadrotor_law(**{"mass": 2, "inertia": J, **numbers}, gains=inside)


def as_port(value: Any, shape: tuple[int, ...]) -> np.ndarray:
    array = np.asarray(value, dtype=float)
    return (
        np.diag(np.broadcast_to(array, shape[:1]))
        if len(shape) == 2 and array.ndim < 2
        else np.broadcast_to(array, shape)
    )


@pytest.fixture(scope="module")
def laws() -> dict[str, tuple[Kernel, Kernel]]:
    """Each with its numbers fixed, and with all of them as inputs."""
    return {
        name: (make(**numbers), make(**dict.fromkeys(numbers, "input")))
        for name, (make, numbers, _) in LAWS.items()
        if numbers
    }


def points_of(name: str, fixed: Kernel, tunable: Kernel, count: int) -> tuple[list[Any], list[Any]]:
    """Random states, (count, *shape) an input of the law, and the numbers as its other inputs."""
    _, numbers, _ = LAWS[name]
    extra, rng = tunable.inputs[len(fixed.inputs) :], random.Random(name)
    assert sorted(port.name for port in extra) == sorted(numbers), name
    assert tunable.inputs[: len(fixed.inputs)] == fixed.inputs
    assert tunable.definition is not None
    assert tunable != fixed
    points = [fixed.sample(rng) for _ in range(count)]
    given = [np.array([point[k] for point in points]) for k in range(len(fixed.inputs))]
    return given, [np.broadcast_to(as_port(numbers[port.name], port.shape), (count, *port.shape)) for port in extra]


def test_a_law_with_its_numbers_as_inputs_is_that_law(laws: dict[str, tuple[Kernel, Kernel]]) -> None:
    for name, (fixed, tunable) in laws.items():
        given, values = points_of(name, fixed, tunable, 1)
        point = [each[0].tolist() for each in (*given, *values)]
        want = fixed.evaluate(FloatArithmetic(), *point[: len(given)])
        got = tunable.evaluate(FloatArithmetic(), *point)
        for a, b in zip(got, want, strict=True):
            np.testing.assert_allclose(np.array(a, float), np.array(b, float), rtol=1e-11, atol=1e-11, err_msg=name)
        assert len(tunable.sample(random.Random(0))) == len(tunable.inputs)


@pytest.mark.slow  # it compiles sixty laws
def test_the_same_in_c_at_random_states(laws: dict[str, tuple[Kernel, Kernel]]) -> None:
    one_name = [
        replace(kernel, name=f"law_{i}_{j}", namespace="all")
        for i, pair in enumerate(laws.values())
        for j, kernel in enumerate(pair)
    ]
    library = lc.build(one_name)
    for i, (name, (fixed, tunable)) in enumerate(laws.items()):
        given, values = points_of(name, fixed, tunable, 5)
        want = getattr(library, f"law_{i}_0").batch(*given)
        got = getattr(library, f"law_{i}_1").batch(*given, *values)
        for port in fixed.outputs:
            # a kernel of one output gives the array itself
            a, b = (np.asarray(getattr(each, port.name, each)) for each in (got, want))
            np.testing.assert_allclose(a, b, rtol=1e-11, atol=1e-11, err_msg=f"{name}: {port.name}")


@pytest.mark.parametrize(
    ("name", "number", "why"), [(n, k, why) for n, (_, _, refused) in LAWS.items() for k, why in refused.items()]
)
def test_what_cannot_be_an_input_says_why(name: str, number: str, why: str) -> None:
    with pytest.raises(lc.errors.InputError, match=f'(?s){number}.* cannot be "input".*{why}'):
        LAWS[name][0](**{number: "input"})


def test_every_law_of_the_front_door_is_here() -> None:
    """By its name: a new law adds its line above."""
    said = inspect.getsource(inspect.getmodule(test_every_law_of_the_front_door_is_here))  # type: ignore[arg-type]
    doors = [name for name in dir(lc) if name.endswith("_law") and name != "read_law"]
    assert len(doors) >= 10
    assert [name for name in doors if f"lc.{name}" not in said] == []


@pytest.mark.slow
def test_many_loops_of_gains_of_an_error_function_and_of_a_text() -> None:
    """One library; each loop is the loop of its own numbers."""
    so3, t = lc.group("so3"), [0, 0.5, 1]
    reference = lc.reference(so3, PATH)
    stiffness = np.array([np.diag([1.0, 2, 3]), np.diag([4.0, 2, 1])])
    options: dict[str, Any] = {"inertia": J, "reference": reference, "xi0": [0.1, 0, 0.2], "t": t, "step": 0.05}
    law = lc.tracking_law(so3, **SO3, gains={"K_p": "input", "K_d": 2})
    many = lc.closed_loop(so3, law=law, gains={"K_p": stiffness}, **options)
    for i, K in enumerate(stiffness):
        one = lc.closed_loop(so3, law=lc.tracking_law(so3, **SO3, gains={"K_p": K, "K_d": 2}), **options)
        np.testing.assert_allclose(many.X[:, i], one.X, atol=1e-12)
    text = lc.error_function(so3, *TEXT, parameters={"k": "input", "c": "input"})
    law = lc.tracking_law(so3, inertia=J, error=text, gains={"K_d": 2})
    run = lc.closed_loop(so3, law=law, gains={"k": [3.0, 3.0], "c": [0.0, -0.5]}, **options)  # of any sign
    assert np.all(np.isfinite(run.X))
    assert not np.allclose(run.X[:, 0], run.X[:, 1])


def test_what_needs_the_number_refuses_the_input() -> None:
    gains = {"K_p": "input", "K_d": 2}
    for call in (lc.certificate, lc.linear_loop):
        with pytest.raises(lc.errors.InputError, match='K_p of the error function so3_right cannot be "input"'):
            call("so3", **SO3, gains=gains)
    with pytest.raises(lc.errors.InputError, match="leave constant away"):
        lc.error_function("so3", *TEXT, parameters={"k": "input", "c": 1}, constant=2)
    with pytest.raises(lc.errors.IncompatibleError, match="not compatible"):
        lc.tracking_law(
            "so3", inertia=J, error=("k*tr(K*(1 - X*Xd^-1))/2", "right"), gains={"k": "input", "K": J, "K_d": 2}
        )
    with pytest.raises(lc.errors.InputError, match=r"give inertia=.input. too"):
        vehicle(added="input")
    with pytest.raises(lc.errors.InputError, match="weights, k_p or k_i of this one are inputs"):
        _ = lc.observer("so3", directions=np.eye(3)[:2], k_p="input").poles
