"""lc.generate(plan): the C function of the controls against the plan, and a program that flies it, compiled strictly."""

from __future__ import annotations

import ctypes
import itertools
import shutil
import subprocess
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.interpolate import CubicSpline
from scipy.linalg import expm

import lie_codegen as lc
from lie_codegen.errors import InputError

pytestmark = pytest.mark.skipif(shutil.which("gcc") is None, reason="needs gcc")
STRICT = ["gcc", "-std=c99", "-pedantic", "-Wall", "-Wextra", "-Wconversion", "-Werror", "-O2", "-Iinclude"]

CASES: dict[str, tuple[Any, ...]] = {
    "four_phase": ("so3", (0.1, 0.05, np.pi / 40), ("w1", "w2"), 24.0, {}),
    "optimal": ("se3", (0.1, 0.2, 0.3, 0.1, 0.2, 0.3), ("w1", "w2", "v3"), 3.0, {}),
    "area_rule": ("se2", (0.5, 0.4, 0.5), ("omega", "vx"), 3.0, {}),
    "direct": ("su2", (0.5, 0.4, 0.5), ("sx", "sy"), 3.0, {"drift": [0, 0, 1]}),
}


def plan_of(method: str) -> lc.Plan:
    group, target, controls, duration, options = CASES[method]
    return lc.steer(group, target, controls, duration, method=method, **options)


def controls_in_c(folder: Path, name: str, size: int, t: np.ndarray) -> tuple[np.ndarray, list[int]]:
    subprocess.run([*STRICT, "-shared", "-fPIC", f"src/{name}_plan.c", "-lm", "-o", "plan.so"], cwd=folder, check=True)
    function = getattr(ctypes.CDLL(str(folder / "plan.so")), f"{name}_plan_controls")
    function.argtypes = [ctypes.c_double, ctypes.POINTER(ctypes.c_double)]
    values, codes = np.empty((len(t), size)), []
    for time, row in zip(t, values, strict=True):
        codes.append(function(time, row.ctypes.data_as(ctypes.POINTER(ctypes.c_double))))
    (folder / "plan.so").unlink()
    return values, codes


def replay(folder: Path, name: str) -> subprocess.CompletedProcess[str]:
    sources = [f"{name}_plan_replay.c", f"src/{name}.c", f"src/{name}_plan.c"]
    subprocess.run([*STRICT, *sources, "-lm", "-o", "replay"], cwd=folder, check=True)
    return subprocess.run(["./replay"], cwd=folder, capture_output=True, text=True, check=False)


@pytest.mark.parametrize("method", CASES)
def test_controls_and_path(method: str, tmp_path: Path) -> None:
    plan = plan_of(method)
    folder = lc.generate(plan, tmp_path / "plan")
    readme = (folder / "README.md").read_text(encoding="utf-8")
    for own in ("controls", "edge", "piece"):
        assert f"{plan.group.name}_plan_{own}(" in readme  # listed beside the functions of the group
    name, n = plan.group.name, plan.group.dim
    t = np.sort(np.random.default_rng(0).uniform(0, plan.duration, 500))
    t = t[np.min(np.abs(t[:, None] - np.append(plan.u.breakpoints, -1.0)), axis=1) > 1e-9]
    values, codes = controls_in_c(folder, name, n, t)
    np.testing.assert_allclose(values, plan.u(t), rtol=0, atol=1e-10 * np.max(np.abs(values)))
    assert not any(codes)
    outside, codes = controls_in_c(folder, name, n, np.array([-0.1, plan.duration * 1.01, np.nan]))
    assert codes == [1, 1, 1]
    assert not np.any(outside)
    done = replay(folder, name)
    assert done.returncode == 0, done.stdout


def test_the_replay_notices_a_wrong_number(tmp_path: Path) -> None:
    folder = lc.generate(plan_of("area_rule"), tmp_path / "plan")
    source = folder / "src" / "se2_plan.c"
    text = source.read_text()
    row = text.index("{ {", text.index("coefficient[")) + 3
    source.write_text(text[:row] + "1.0 + " + text[row:])
    assert replay(folder, "se2").returncode == 1


def test_the_c_controls_steer_the_body_of_scipy(tmp_path: Path) -> None:
    """X' = X hat(u) by scipy with what the C function returns: at the target, in float too."""
    plan = plan_of("area_rule")
    folder = lc.generate(plan, tmp_path / "plan", name="tug")
    grid = np.linspace(0, plan.duration, 4001)
    values, _ = controls_in_c(folder, "tug", 3, grid)

    def rate(t: float, x: np.ndarray) -> np.ndarray:
        u = np.array([np.interp(t, grid, values[:, i]) for i in range(3)])
        return (x.reshape(3, 3) @ plan.group.hat(u)).ravel()

    X = solve_ivp(rate, (0, plan.duration), np.eye(3).ravel(), rtol=1e-9, atol=1e-9).y[:, -1].reshape(3, 3)
    np.testing.assert_allclose(X, plan.target, rtol=0, atol=1e-6)
    single = lc.generate(plan, tmp_path / "single", real="float")
    assert replay(single, "se2").returncode == 0


def test_forms(tmp_path: Path) -> None:
    """A Fourier series is stored as one; where there are pieces it cannot be."""
    plan = plan_of("area_rule")
    short = (lc.generate(plan, tmp_path / "auto") / "include/se2_plan.h").read_text()
    long = (lc.generate(plan, tmp_path / "table", form="table") / "include/se2_plan.h").read_text()
    assert "Stored as a Fourier series" in short
    assert "Stored as polynomials" in long
    assert replay(tmp_path / "table", "se2").returncode == 0
    with pytest.raises(InputError, match="no Fourier series"):
        lc.generate(plan_of("four_phase"), tmp_path / "no", form="fourier")
    with pytest.raises(InputError, match="form is one of"):
        lc.generate(plan, tmp_path / "no", form="splines")
    with pytest.raises(InputError, match="no plan is given"):
        lc.generate("so3", tmp_path / "no", form="table")
    loop = lc.closed_loop("so3", law=lc.attitude_law("p"), t=[0, 1])
    with pytest.raises(InputError, match="a closed loop and wheels have none"):
        lc.generate(loop, tmp_path / "no", form="table")
    assert not (tmp_path / "no").exists()


@pytest.mark.skipif(shutil.which("cmake") is None, reason="needs cmake")
def test_a_group_two_laws_and_a_plan_in_one_package(tmp_path: Path) -> None:
    plan = plan_of("four_phase")
    pd = lc.attitude_law("pd", inertia=(1, 2, 3), k_p=4, k_d=6)
    track = lc.tracking_law("so3", inertia=(1, 2, 3), error="so3_right", gains={"K_p": 4, "K_d": 6})
    step = lc.rkmk4_step("se2")
    folder = lc.generate(["so3", pd, track, plan, step], tmp_path / "craft", name="craft", steering=("w1", "w2"))
    header = (folder / "include" / "craft.h").read_text()
    assert all(
        f"void {symbol}(" in header for symbol in ("so3_exp", "so3_attitude_pd", "so3_tracking_law", "se2_rkmk4_step")
    )
    build = tmp_path / "build"
    subprocess.run(["cmake", "-S", folder, "-B", build], check=True, capture_output=True)
    assert "CMAKE_BUILD_TYPE:STRING=Release" in (build / "CMakeCache.txt").read_text()
    subprocess.run(["cmake", "--build", build], check=True, capture_output=True)
    done = subprocess.run(["ctest", "--test-dir", build], check=True, capture_output=True, text=True)
    assert "out of 2" in done.stdout
    debug = tmp_path / "debug"
    subprocess.run(["cmake", "-S", folder, "-B", debug, "-DCMAKE_BUILD_TYPE=Debug"], check=True, capture_output=True)
    assert "CMAKE_BUILD_TYPE:STRING=Debug" in (debug / "CMakeCache.txt").read_text()
    outer = tmp_path / "outer"
    outer.mkdir()
    (outer / "CMakeLists.txt").write_text(
        f"cmake_minimum_required(VERSION 3.14)\nproject(outer C)\nadd_subdirectory({folder} craft)\n"
    )
    subprocess.run(["cmake", "-S", outer, "-B", tmp_path / "inner"], check=True, capture_output=True)
    assert "CMAKE_BUILD_TYPE:STRING=\n" in (tmp_path / "inner" / "CMakeCache.txt").read_text()


def test_law_files(tmp_path: Path) -> None:
    file = tmp_path / "law.toml"
    file.write_text(
        'law = "tracking"\ninertia = [1, 2.5, "10/3"]\nerror = "so3_right"\nname = "point"\n'
        "gains = { K_p = [4, 5, 6], K_d = 0.1 }\n"
    )
    assert tomllib.loads(file.read_text())["law"] == "tracking"
    gains = {"K_p": [4, 5, 6], "K_d": "1/10"}
    expected = lc.tracking_law("so3", inertia=[1, "5/2", "10/3"], error="so3_right", gains=gains, name="point")
    assert lc.read_law(file, "so3") == expected
    with pytest.raises(InputError, match="add group"):
        lc.read_law(file)
    file.write_text('law = "attitude"\nkind = "pd"\ninertia = [1, 2, 3]\nk_p = 4\nk_d = 6\n')
    assert lc.read_law(file) == lc.attitude_law("pd", inertia=(1, 2, 3), k_p=4, k_d=6)
    with pytest.raises(InputError, match="laws on so3"):
        lc.read_law(file, "se3")
    file.write_text('law = "pointing"\naxis = [0, 0, 1]\ninertia = [1, 2, 3]\nk_p = 4\nK_d = 6\n')
    assert lc.read_law(file) == lc.pointing_law([0, 0, 1], inertia=[1, 2, 3], k_p=4, K_d=6)
    for text, words in (
        ('law = "pid"', "not known"),
        ('law = "manifold"\nmanifold = 2', "law.toml: "),
        ('law = "attitude"\ngroup = "se3"', "laws on so3"),
        ('law = "attitude"\nkp = 4', "takes no kp"),
        ("law = ", "not a TOML file"),
        (
            'law = "tracking"\ngroup = "so3"\ninertia = [1, 2, -3]\nerror = "so3_right"\ngains = { K_p = 1, K_d = 1 }',
            "law.toml: ",
        ),
        ('law = "tracking"\ngroup = "so3"', "law.toml: "),
    ):
        file.write_text(text)
        with pytest.raises(InputError, match=words):
            lc.read_law(file)
    with pytest.raises(InputError, match="cannot be read"):
        lc.read_law(tmp_path / "none.toml")


def other_systems() -> dict[str, tuple[lc.Plan, Callable[[float, np.ndarray, np.ndarray], np.ndarray]]]:
    """Plans of systems that are not X' = X hat(u + drift), each with its own right-hand side."""
    so3, su2 = lc.group("so3"), lc.group("su2")
    R = expm(so3.hat([0.4, 0.3, -0.8]))
    U = expm(np.einsum("a,aij->ij", [0.4, 0.3, -0.8], su2.basis))
    J = np.diag([1.0, 2, 3])

    def moving(t: float, y: np.ndarray, u: np.ndarray) -> np.ndarray:
        return (y.reshape(3, 3) @ so3.hat(u + 0.3 * np.cos(t) * np.eye(3)[2])).ravel()

    def right(_: float, y: np.ndarray, u: np.ndarray) -> np.ndarray:
        A = np.einsum("a,aij->ij", u + 0.3 * np.eye(3)[2], su2.basis)
        return (A @ y.view(complex).reshape(2, 2)).ravel().view(float)

    def torques(_: float, y: np.ndarray, u: np.ndarray) -> np.ndarray:
        w = y[9:]
        turning = np.linalg.solve(J, np.cross(J @ w, w) + u)
        return np.append((y[:9].reshape(3, 3) @ so3.hat(w)).ravel(), turning)

    options = {"bounds": 2, "method": "direct"}
    return {
        "moving": (lc.steer(so3, R, ["w1", "w2"], 3.0, drift={"w3": "0.3*cos(t)"}, **options), moving),
        "right": (lc.steer(su2, U, ["sx", "sy"], 3.0, drift=[0, 0, 0.3], equation="right", **options), right),
        "torques": (
            lc.steer(so3, R, ["w1", "w2", "w3"], 3.0, dynamics="second_order", inertia=[1, 2, 3], bounds=5),
            torques,
        ),
    }


def test_plans_of_other_systems_become_their_controls(tmp_path: Path) -> None:
    """The header says what the system is, and SciPy on that system with what C returns ends at the target."""
    said = {"moving": "u(t) + drift(t)", "right": "X' = hat(u(t) + drift) X", "torques": "ad*_xi I xi + u(t)"}
    for kind, (plan, slope) in other_systems().items():
        name = plan.group.name
        folder = lc.generate(plan, tmp_path / kind)
        header = (folder / f"include/{name}_plan.h").read_text()
        assert said[kind] in header
        assert "compares u with test vectors" in header
        done = replay(folder, name)
        assert done.returncode == 0, done.stdout
        assert "path" not in done.stdout
        size = plan.group.degree**2 * (2 if plan.group.is_complex else 1)
        y = np.zeros(size + (3 if kind == "torques" else 0))
        y[:size] = np.eye(plan.group.degree, dtype=complex if plan.group.is_complex else float).ravel().view(float)
        marks = np.unique([0, *plan.u.breakpoints, plan.duration])
        grids = [np.linspace(a + 1e-9, b - 1e-9, 13) for a, b in itertools.pairwise(marks)]
        values, _ = controls_in_c(folder, name, 3, np.concatenate(grids))
        for grid, part in zip(grids, np.split(values, len(grids)), strict=True):
            ends = (grid[0] - 1e-9, grid[-1] + 1e-9)
            u = CubicSpline(grid, part)
            y = solve_ivp(lambda t, y, u=u, slope=slope: slope(t, y, u(t)), ends, y, rtol=1e-7, atol=1e-8).y[:, -1]
        X = y[:size].view(complex if plan.group.is_complex else float).reshape(plan.target.shape)
        np.testing.assert_allclose(X, plan.target, rtol=0, atol=1e-5)
