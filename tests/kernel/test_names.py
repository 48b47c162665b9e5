"""Names of kernels: every factory takes one, and two things of one kind go into one program."""

from __future__ import annotations

import inspect
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import lie_codegen as lc
from lie_codegen.errors import IdentifierError, InputError

STRICT = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-O2"]


def free_body(moment: int) -> Any:
    return lc.free_rigid_body([2, 3, moment])


def walker(size: int) -> Any:
    return lc.connection("se2", shape=("r1", "r2"), A=[[f"{size}", "r2"], ["r1", "0"], ["0", "1"]])


def average(size: int) -> Any:
    return lc.average("so3", lc.PeriodicInput([f"{size}*cos(t)", "sin(t)", "0"]), 2)


def vibration(size: int) -> Any:
    system = lc.lagrangian_system(
        coordinates=["x"], lagrangian=f"x_dot^2/2 + {size}*cos(x)", forces={"x": "f"}, inputs=["f"]
    )
    return lc.vibrational_average(system, lc.PeriodicInput(["cos(t)"]))


def vibrated_body(moment: int) -> Any:
    system = lc.mechanical_system("so3", inertia=(3, 2, moment), inputs=["w1"])
    return lc.vibrational_average(system, lc.PeriodicInput(["cos(t)"]))


#: (number, name) -> kernels whose symbols begin with the name, and the kernel that is called.
SETS: dict[str, tuple[Callable[[int, str], Any], str]] = {
    "group": (lambda k, name: lc.group_kernels("so2" if k == 1 else "r3", name=name), "exp"),
    "covariance": (lambda k, name: lc.covariance_kernels("so2" if k == 1 else "r3", name=name), "inverse_covariance"),
    "average": (lambda k, name: lc.averaged_kernels(average(k), name=name), "averaged_rate"),
    "body": (lambda k, name: free_body(3 + k).kernels(name=name), "to_slow"),
    "tumbling": (lambda k, name: lc.tumbling_average([1, 2, 2 + k / 2], lc.torque.formula(["-w1", "0", "0"])).kernels(name=name), "shape"),
    "rotation": (lambda k, name: lc.free_rotation(np.diag([2.0, 3, 4]), np.eye(3), [1, 0.1, k]).kernels(name=name), "prepare"),
    "euler": (lambda k, name: lc.euler_average(lc.free_rigid_body([1, 2, 3]), [f"-{k}*w1", "-w2", "-w3"]).kernels(name=name), "variational"),
    "phase": (lambda k, name: lc.phase_average([f"-{k}*x1*cos(p)^2"], rate="1", variables=["x1"], phase="p", period="2*pi").kernels(name=name), "terms"),
    "time": (lambda k, name: lc.time_average([f"-{k}*x1*cos(t)^2"], variables=["x1"], period="2*pi").kernels(name=name), "terms"),
    "connection": (lambda k, name: walker(k).kernels(name=name), "connection"),
    "vibration": (lambda k, name: vibration(k).kernels(name=name), "rate"),
    "vibrated body": (lambda k, name: vibrated_body(k).kernels(name=name), "rate"),
}  # fmt: skip


@pytest.mark.parametrize("kind", SETS)
def test_two_sets_of_a_kind_go_into_one_library(kind: str) -> None:
    make, called = SETS[kind]
    one, two = make(1, "first"), make(2, "second")
    assert {kernel.namespace for kernel in one} == {"first"}
    picked = [next(kernel for kernel in each if kernel.name == called) for each in (one, two)]
    assert picked[0] != picked[1]
    library = lc.build(picked, name="both")
    for kernel, number in zip(picked, (1, 2), strict=True):
        plain = next(each for each in make(number, "alone") if each.name == called)
        rng = np.random.default_rng(3)
        point = [np.abs(rng.normal(size=port.shape)) + 0.1 for port in kernel.inputs]
        found, expected = library[kernel.symbol](*point), lc.build([plain])[called](*point)
        np.testing.assert_array_equal(np.hstack([np.ravel(each) for each in flat(found)]), np.hstack([np.ravel(each) for each in flat(expected)]))  # fmt: skip


def flat(value: Any) -> list[Any]:
    return list(value) if isinstance(value, tuple) else [value]


def test_every_factory_takes_a_name() -> None:
    found = []
    for name in dir(lc):
        thing = getattr(lc, name)
        if inspect.isfunction(thing) and "Kernel" in str(inspect.signature(thing).return_annotation):
            found.append(name)
            assert name == "read_law" or {"name", "namespace"} & set(inspect.signature(thing).parameters), name
    assert len(found) >= 30
    for result in (lc.build, lc.generate, lc.generate_closed_loop):
        assert "name" in inspect.signature(result).parameters


def test_a_name_that_is_no_identifier_is_refused() -> None:
    for call in (
        lambda: lc.group_kernels("so3", name="1st"),
        lambda: free_body(4).kernels(name="a b"),
        lambda: lc.with_quaternion(lc.attitude_law(), order="wxyz", name="a-b"),
    ):
        with pytest.raises(IdentifierError):
            call()


def test_two_closed_loops_in_one_program(tmp_path: Path) -> None:
    compiler = shutil.which("gcc") or shutil.which("cc") or shutil.which("clang")
    if compiler is None:
        pytest.skip("no C compiler")
    sources, includes = [], []
    for name, gain in (("port", 4), ("starboard", 9)):
        inertia, gains = [3, 2, gain / 3], {"K_p": gain, "K_d": 6}
        law = lc.tracking_law("so3", inertia=inertia, error="so3_right", gains=gains, name=f"law_{name}")
        reference = lc.reference(lc.group("so3"), ["sin(t)/9", "0", f"t/{gain}"])
        folder = lc.generate_closed_loop(
            "so3", tmp_path / name, inertia=inertia, law=law, reference=reference, X0=turned(0.8), name=name
        )
        sources.append(str(folder / "src" / f"{name}.c"))
        includes.append(f"-I{folder / 'include'}")
        program = [str(folder / "closed_loop.c"), sources[-1], includes[-1], "-lm", "-o", str(tmp_path / "loop")]
        subprocess.run([compiler, *STRICT, *program], check=True)
        done = subprocess.run([str(tmp_path / "loop")], capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stdout[-400:]
    (tmp_path / "main.c").write_text('#include "port.h"\n#include "starboard.h"\nint main(void) { return 0; }\n')
    both = [str(tmp_path / "main.c"), *sources, *includes, "-lm", "-o", str(tmp_path / "both")]
    subprocess.run([compiler, *STRICT, *both], check=True)


def turned(angle: float) -> Any:
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])


def test_the_ratio_of_time_scales_of_a_design_is_a_number() -> None:
    system = lc.lagrangian_system(coordinates=["x"], lagrangian="x_dot^2/2 + cos(x)", forces={"x": "f"}, inputs=["f"])
    fields = lc.vibrational_fields(system, lc.PeriodicInput(["(1 + alpha)*cos(t)"], parameters=["alpha"]))
    with pytest.raises(InputError, match='eps cannot be "input": the gains'):
        lc.design_feedback(fields, amplitudes=["alpha"], eps="input", guess=[0, 0])  # type: ignore[arg-type]
