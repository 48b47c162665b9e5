"""Kernels are values: equal where their definitions are, made again from them, and named by every number in them."""

from __future__ import annotations

import copy
import json
import pickle
import random
import subprocess
import sys
from collections.abc import Callable
from dataclasses import replace
from fractions import Fraction
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import lie_codegen as lc
from lie_codegen.control.attitude_lyapunov import attitude_lyapunov
from lie_codegen.control.force_limits import with_limits
from lie_codegen.control.reference_kernels import reference_kernel
from lie_codegen.control.second_order_step import held_force_step, second_order_step
from lie_codegen.kernel.arithmetic import FloatArithmetic
from lie_codegen.kernel.definition import doubles, plain
from lie_codegen.kernel.plain_data import Definition, made_from
from lie_codegen.mechanics.variational_step import variational_step
from lie_codegen.vehicles.quadrotor import flat_reference, quadrotor_law
from lie_codegen.vehicles.sphere import sphere_law
from lie_codegen.vehicles.underwater import compensated, underwater_kernel, underwater_vehicle

GAINS = {"K_p": 4, "K_d": 6}


def tracking(**changed: Any) -> lc.Kernel:
    options = {"inertia": (1, 2, 3), "error": "so3_right", "gains": GAINS, **changed}
    return lc.tracking_law(lc.group("so3"), **options)


def waypoints() -> Any:
    turn = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])
    return lc.reference(lc.group("so3"), times=[0, 1.1], waypoints=[np.eye(3), turn])


def vehicle() -> Any:
    return underwater_vehicle(lc.group("se3"), inertia=[1, 2, 3, 4, 5, 6], weight=1.5, current=[0.1, 0, 0])


MADE: dict[str, Callable[[], lc.Kernel]] = {
    "attitude_p": lambda: lc.attitude_law(k_p=4),
    "attitude_pd": lambda: lc.attitude_law("pd", inertia=np.diag([1.0, 2, 2.5]), k_p=0.1, k_d=6),
    "reduced": lambda: lc.attitude_law("reduced", k_p="sqrt(2)", z=(0.6, 0, "4/5")),
    "lyapunov": lambda: attitude_lyapunov(inertia=[1, 2, 2], k_p=1, k_d=2, epsilon="1/10"),
    "tracking": tracking,
    "own error": lambda: tracking(
        error=lc.error_function(lc.group("so3"), "tr(K*(1 - Xd^-1*X))/2", parameters={"K": np.diag([1, 2, 3])})
    ),
    "pair": lambda: tracking(error=("k*tr(1 - Xd^-1*X)", "right"), gains={"k": 2, "K_d": 1}),
    "limits": lambda: with_limits(tracking(), [1, 0.5, 0.1]),
    "integral": lambda: lc.integral_law(
        lc.group("so3"), inertia=2, error="so3_right", gains={**GAINS, "K_i": 1}, limits=2
    ),
    "formulas": lambda: reference_kernel(lc.reference(lc.group("so3"), ["0.3*sin(2*t)", "t/10", 0])),
    "waypoints": lambda: reference_kernel(waypoints()),
    "step": lambda: second_order_step(lc.group("so3"), [1, 2, 2], law=tracking()),
    "held": lambda: held_force_step(lc.group("se2"), [1, 2, 2]),
    "variational": lambda: variational_step(lc.group("so3"), [1, 2, 2]),
    "sphere": lambda: sphere_law(3, k_p=1, k_d=2),
    "quadrotor": lambda: quadrotor_law(
        mass=1.2, inertia=[1, 2, 2], gains=dict.fromkeys(("k_x", "k_v", "k_R", "k_W"), 3)
    ),
    "flat": lambda: flat_reference(["sin(t)", "t", "0"]),
    "underwater": lambda: underwater_kernel(vehicle()),
    "compensated": lambda: compensated(
        lc.tracking_law(lc.group("se3"), inertia=1, error="se3_4", gains={"K_1": 1, "K_2": 1, "K_d": 1}), vehicle()
    ),
    "log": lambda: lc.group_kernels(lc.group("su2"))[4],
    "elliptic": lambda: lc.elliptic_kernels()[0],
}


@pytest.mark.parametrize("name", MADE)
def test_a_kernel_is_made_again_from_its_definition(name: str) -> None:
    kernel = MADE[name]()
    again = pickle.loads(pickle.dumps(kernel))
    assert kernel.definition is not None
    assert again == kernel == MADE[name]()
    assert hash(again) == hash(kernel)
    assert made_from(json.loads(kernel.definition.text)) == kernel
    assert copy.deepcopy(kernel) == kernel
    point = kernel.sample(random.Random(3))
    for one, other in zip(
        kernel.evaluate(FloatArithmetic(), *point), again.evaluate(FloatArithmetic(), *point), strict=True
    ):
        np.testing.assert_array_equal(numbers(one), numbers(other))


def numbers(value: Any) -> Any:
    if isinstance(value, list):
        return np.array([numbers(each) for each in value])
    return complex(value.re, value.im) if hasattr(value, "re") else value


def test_another_gain_is_another_law() -> None:
    assert lc.attitude_law(k_p=4) != lc.attitude_law(k_p=99)
    assert lc.attitude_law(k_p=4) == lc.attitude_law("p", k_p=4.0) == lc.attitude_law(k_p="4")
    assert lc.attitude_law(k_p=0.1) == lc.attitude_law(k_p="1/10") == lc.attitude_law(k_p=Fraction(1, 10))
    assert tracking() != tracking(inertia=(1, 2, 2))
    assert len({lc.attitude_law(k_p=k) for k in (1, 2, 1)}) == 2


def test_a_fresh_process_gets_an_equal_kernel(tmp_path: Path) -> None:
    kernels = [tracking(), lc.attitude_law(k_p=0.3)]
    (tmp_path / "kernels").write_bytes(pickle.dumps(kernels))
    code = (
        "import pickle, sys, lie_codegen as lc; a, b = pickle.load(open(sys.argv[1], 'rb')); "
        "print(b == lc.attitude_law(k_p=0.3), a.definition['parameters']['gains'] == {'K_p': 4, 'K_d': 6})"
    )
    done = subprocess.run(
        [sys.executable, "-c", code, str(tmp_path / "kernels")], capture_output=True, text=True, check=True
    )
    assert done.stdout.split() == ["True", "True"]


def test_a_kernel_written_by_hand_is_its_function() -> None:
    def twice(ops: Any, x: Any) -> tuple[Any, ...]:
        return (2 * x,)

    ports = (lc.Port("x", ()),), (lc.Port("y", ()),)
    one, other = (lc.Kernel("twice", "toy", *ports, twice) for _ in range(2))
    assert one == other
    assert one != lc.Kernel("twice", "toy", *ports, lambda ops, x: (3 * x,))
    assert one.definition is None
    with pytest.raises(lc.errors.InputError, match="cannot travel"):
        pickle.dumps(one)
    whole = lc.Kernel("numbers", "toy", *ports, numbers_body)
    assert pickle.loads(pickle.dumps(whole)) == whole
    assert replace(tracking(), name="other").definition is None


def numbers_body(ops: Any, x: Any) -> tuple[Any, ...]:
    return (x,)


def test_a_function_leaves_a_kernel_without_definition() -> None:
    free = second_order_step(lc.group("so3"), 1, lambda ops, t, X, xi: [0, 0, 0])
    assert free.definition is None
    assert free == free


@lc.kernel_factory(units={"factor": "m"})
def scaling(factor: Any, name: str = "scaling") -> lc.Kernel:
    number = float(Fraction(str(factor)))
    return lc.Kernel(
        name, "toy", (lc.Port("x", ()),), (lc.Port("y", ()),), lambda ops, x: (number * x,), "y = factor x"
    )


def test_a_user_makes_a_factory(tmp_path: Path) -> None:
    half = scaling(0.5)
    assert pickle.loads(pickle.dumps(half)) == half != scaling(2)
    header = (lc.generate(half, tmp_path / "toy") / "include" / "toy.h").read_text()
    assert "factor = 1/2 [m]" in header


def test_the_package_names_every_number(tmp_path: Path) -> None:
    texts = []
    for k_p in (4, 0.3):
        law = lc.attitude_law("pd", inertia=(1, 2, 2), k_p=k_p, k_d=6)
        home = lc.generate(law, tmp_path / f"law{k_p}")
        header, readme = ((home / path).read_text() for path in ("include/so3.h", "README.md"))
        for text in (header, readme):
            assert f"k_p = {plain(k_p)} [N m/rad]" in text
            assert "inertia = (1, 2, 2) [kg m^2]" in text
        manifest = json.loads((home / "manifest.json").read_text())
        assert manifest["functions"][0]["definition"] == json.loads(law.definition.text)  # type: ignore[union-attr]
        texts.append(header)
    assert texts[0] != texts[1]


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        (0.1, "1/10"), ("0.50", "1/2"), (np.float64(2), 2), (np.eye(2, dtype=int), ((1, 0), (0, 1))), (True, True),
        (1e-300, "1/" + "1" + "0" * 300), ("sqrt(2)", "sqrt(2)"), (None, None), (float("inf"), "inf"),
    ],
)  # fmt: skip
def test_plain_data(value: Any, expected: Any) -> None:
    assert plain(value) == expected


def test_doubles_come_back_to_the_last_bit() -> None:
    rng = np.random.default_rng(5)
    values = rng.normal(size=(4, 3)) * 10.0 ** rng.integers(-20, 20, size=(4, 3))
    np.testing.assert_array_equal(doubles(plain(values)), values)
    turned = values + 1j * values[::-1]
    np.testing.assert_array_equal(doubles(plain(turned)), turned)


def test_a_definition_cannot_be_changed() -> None:
    data = Definition({"k": 1})
    for change in (lambda: data.__setitem__("k", 2), lambda: data.update(k=2), data.clear, lambda: data.pop("k")):
        with pytest.raises(TypeError, match="cannot be changed"):
            change()
    assert pickle.loads(pickle.dumps(data)) == data == {"k": 1}
    assert hash(data) == hash(Definition({"k": 1}))


def test_only_factories_are_called() -> None:
    with pytest.raises(lc.errors.InputError, match="no factory"):
        made_from({"kind": "os:getcwd", "parameters": {}})
    with pytest.raises(lc.errors.InputError, match="nothing makes"):
        made_from({"kind": "lie_codegen.nowhere:law", "parameters": {}})
