"""Inputs, averages, runs, loops, bodies, references, libraries and kernels are values: every one by the same demands."""

from __future__ import annotations

import copy
import multiprocessing
import pickle
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import lie_codegen as lc


def wave(t: Any) -> Any:
    return np.stack([np.sin(t) ** 3, np.exp(np.cos(t)), 0 * t], -1)


def circles() -> Any:
    return lc.PeriodicInput(["sin(t)", "cos(t)", "0"])


def sampled() -> Any:
    return lc.SampledInput([0.0, 1.0, 2.0], [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])


def pieces() -> Any:
    return lc.PeriodicInput.from_pieces([("1", ["1", "0", "t"]), ("2", ["-1", "1", "2-t"])])


def vibration() -> Any:
    system = lc.lagrangian_system(coordinates=["x"], lagrangian="x_dot^2/2 + cos(x)", forces={"x": "f"}, inputs=["f"])
    return lc.vibrational_average(system, lc.PeriodicInput(["cos(t)"]))


def loop() -> Any:
    law = lc.attitude_law("pd", inertia=(1, 2, 3), k_d=2)
    return lc.closed_loop("so3", inertia=(1, 2, 3), law=law, t=[0, 0.5, 1], xi0=[0.1, 0.2, 0.3])


def propagator() -> Any:
    u = lc.ParametricInput(["a*cos(t)", "0", "1"], parameters=["a"], period="2*pi")
    return lc.propagator("so3", u, duration="period")


def certificate() -> Any:
    gains = {"K_p": [4, 5, 6], "K_d": 5}
    return lc.certificate("so3", inertia=[1, 2, 3], error="so3_right", gains=gains, level=4, epsilon=0.1, prove=False)


SAVED: dict[str, Callable[[], Any]] = {
    "formulas": circles,
    "parameters": lambda: lc.PeriodicInput(["a*sin(t)", "cos(t)", "0"], parameters=["a"]),
    "at": lambda: lc.PeriodicInput(["a*sin(t)", "cos(t)", "0"], parameters=["a"]).at(a=2),
    "no series": lambda: lc.PeriodicInput(["exp(sin(t))", "cos(t)", "0"], period="2*pi"),
    "pieces": pieces,
    "function": lambda: lc.PeriodicInput.from_callable(wave, "2*pi"),
    "fourier": lambda: lc.PeriodicInput.from_fourier([["1", "0", "1/3"]], [[0, 1, 0]], mean=[0, 0, 1]),
    "linear": lambda: circles().linear([["1/3", 2, 0], [0, 1, 1], [1, 0, 0]]),
    "linear, no series": lambda: lc.PeriodicInput.from_callable(wave, "2*pi").linear(2 * np.eye(3)),
    "samples": lambda: lc.PeriodicInput.from_samples(np.random.default_rng(0).normal(size=(5, 3)), "2*pi"),
    "sampled": sampled,
    "run": lambda: lc.simulate("so3", circles(), t=[0, 1, 2]),
    "events": lambda: lc.simulate("so3", [1.0, 0, 0], t=[0, 2], events=[lc.Event("X[2][2] - 3/10")]).events[0],
    "event": lambda: lc.Event("X[2][2] - 3/10", direction=1),
    "propagator": propagator,
    "propagation": lambda: propagator()(a=0.7),
    "propagations": lambda: propagator().batch(a=[0.7, 0.8]),
    "propagation of samples": lambda: lc.propagator("so3", sampled(), duration=2.0)(),
    "power": lambda: propagator().power(5, a=0.7),
    "run of a function": lambda: lc.simulate("so3", lambda t: np.array([np.sin(t), 0, 1]), t=[0, 1, 2]),
    "average": lambda: lc.average(lc.group("so3"), circles(), 3),
    "order": lambda: lc.order_check(lc.group("so3"), circles(), 2, eps=(0.2, 0.1)),
    "reference": lambda: lc.reference(lc.group("so3"), ["0.3*sin(t)", "0", "t"]),
    "loop": loop,
    "certificate": certificate,
    "critical points": lambda: lc.critical_points("so3_right", group="so3", gains={"K_p": [4, 5, 6]}),
    "margins": lambda: lc.loop_margins(inertia=[1, 2, 3], stiffness=4, damping=5),
    "first-order margins": lambda: lc.loop_margins(rate=2),
    "masses": lambda: lc.inertia_from_masses([1, 2, 3], [[0, 0, 0], [1, 0, 0], [0, 2, 1]]),
    "manifold": lambda: lc.manifold(3, constraints=["q1^2 + q2^2 + q3^2 - 1"], inertia=["2", "2 + q1^2", "3"]),
}
OTHERS: dict[str, Callable[[], Any]] = {
    "mechanical average": lambda: lc.vibrational_average(
        lc.mechanical_system("so3", inertia=(3, 2, 1), inputs=["w1"]), lc.PeriodicInput(["cos(t)"])
    ),
    "connection": lambda: lc.connection("se2", shape=("r1",), A=[["1"], ["r1"], ["0"]]),
    "body": lambda: lc.free_rigid_body([1, 2, 3]),
    "euler": lambda: lc.euler_average(lc.free_rigid_body([1, 2, 3]), ["-w1", "-w2", "-w3"]),
    "vibration": vibration,
    "law": lambda: lc.attitude_law(),
    "hybrid law": lambda: lc.hybrid_law("so3", inertia=[1, 2, 3], K_p=[4, 5, 6], K_d=2),
    "observer": lambda: lc.observer("so3", directions=[[0, 0, 1], [0.6, 0, 0.8]], k_p=1.2, k_i=0.3),
    "output feedback": lambda: lc.output_feedback_law("so3", directions=[[0, 0, 1]], target_directions=[[0, 0.6, 0.8]]),
    "adaptive law": lambda: lc.adaptive_law("so3", error="so3_right", gains={"K_p": 4, "K_d": 5}, rate=2),
    "library": lambda: lc.build("so3"),
    "library of a law": lambda: lc.build(lc.attitude_law()),
    "kernel": lambda: lc.build("so3").exp,
    "kernel of a law": lambda: lc.build(lc.attitude_law()).attitude_p,
}


@pytest.mark.filterwarnings("ignore::lie_codegen.errors.AssumptionWarning")
@pytest.mark.parametrize("name", [*SAVED, *OTHERS])
def test_a_result_is_a_value(name: str, tmp_path: Path, elsewhere: Callable[[Any], list[Any]]) -> None:
    make = {**SAVED, **OTHERS}[name]
    value = make()
    assert (value == make()) is True
    assert (value == 3) is False
    assert hash(value) == hash(make())
    assert len(repr(value).splitlines()) <= 10
    assert "array(" not in repr(value)
    assert len(repr(value)) <= 1200
    for twin in (pickle.loads(pickle.dumps(value)), copy.copy(value), copy.deepcopy(value), *elsewhere(value)):
        assert (twin == value) is True
    if name in SAVED:
        assert replace(value) == value
        back = lc.load(value.save(tmp_path / "value.npz"))
        assert (back == value) is True
        if callable(value) and not getattr(value, "parameters", ()):
            t = np.linspace(0.0, 1.9, 23)
            np.testing.assert_allclose(back(t), value(t), rtol=0, atol=1e-13)


def test_values_that_differ_are_unequal() -> None:
    assert (circles() == lc.PeriodicInput(["sin(t)", "cos(t)", "1"])) is False
    assert (sampled() == lc.SampledInput([0.0, 1.0, 2.5], [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])) is False
    assert (lc.build("so3") == lc.build("se2")) is False
    assert (lc.build("so3").exp == lc.build("so3").log) is False
    average = lc.average(lc.group("so3"), circles(), 2)
    assert (average == lc.average(lc.group("so3"), circles(), 3)) is False


def exponential(kernel: Any, x: Any) -> Any:
    return kernel(x)


@pytest.mark.parametrize("start", ["fork", "spawn", "forkserver"])
@pytest.mark.filterwarnings("ignore:.*multi-threaded:DeprecationWarning")
def test_a_kernel_goes_to_other_processes(start: str) -> None:
    kernel = lc.build("so3").exp
    rows = list(np.random.default_rng(1).normal(size=(6, 3)))
    with ProcessPoolExecutor(1, mp_context=multiprocessing.get_context(start)) as pool:
        found = list(pool.map(exponential, [kernel] * 6, rows))
    np.testing.assert_array_equal(found, [kernel(x) for x in rows])


def test_a_saved_input_drives_the_same_motion_in_a_fresh_process(tmp_path: Path) -> None:
    file = circles().save(tmp_path / "u.npz")
    code = (
        f"import lie_codegen as lc; u = lc.load({str(file)!r}); "
        "print(lc.simulate('so3', u, t=[0, 1, 2]).X[-1].tobytes().hex())"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == lc.simulate("so3", circles(), t=[0, 1, 2]).X[-1].tobytes().hex()
