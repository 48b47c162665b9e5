"""The lane mathematics in units in the last place, against mpmath, for every kind of vector this machine can run."""

from __future__ import annotations

import ctypes
import platform
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import mpmath as mp
import numpy as np
import pytest

from lie_codegen.codegen.lane_coefficients import POLYNOMIALS
from lie_codegen.codegen.lane_forms import LANE_FORMS
from lie_codegen.codegen.lane_headers import lanes_header
from lie_codegen.runtime.compiler import FLAGS, find_compilers

HERE = Path(__file__).resolve().parent
COUNT = 250
#: Machine option -> lanes it must give.
MACHINES = (
    {"native": None, "haswell": 4, "x86-64": 2} if platform.machine() in ("x86_64", "AMD64") else {"native": None}
)
#: The documented bound, and what is left to it.
ULPS = {
    "sin": 1.5, "cos": 1.5, "tan": 2.5, "exp": 1.0, "expm1": 1.2, "log": 1.0, "atan": 2.0, "atan2": 2.0, "asin": 1.0,
    "acos": 1.0, "sinh": 2.5, "cosh": 2.5, "tanh": 2.5,
}  # fmt: skip

pytestmark = pytest.mark.skipif(not find_compilers(), reason="needs a C compiler")


@pytest.fixture(scope="module", params=list(MACHINES))
def library(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    folder = tmp_path_factory.mktemp("math")
    (folder / "lie_codegen_lanes.h").write_text(lanes_header())
    source, command = HERE / "vector_math_driver.c", find_compilers()[0].command
    flags = ["-O2", f"-march={request.param}", *FLAGS, f"-I{folder}", "-Wall", "-Wextra", "-Werror"]
    subprocess.run([*command, *flags, "-o", str(folder / "math.so"), str(source), "-lm"], check=True)
    loaded = ctypes.CDLL(str(folder / "math.so"))
    assert MACHINES[request.param] in (None, loaded.lanes())
    if loaded.lanes() == 1:
        pytest.skip("no vectors on this machine")
    try:
        flags_of_cpu = Path("/proc/cpuinfo").read_text()
    except OSError:
        flags_of_cpu = ""
    if request.param == "haswell" and "avx2" not in flags_of_cpu:
        pytest.skip("no AVX2 here")
    return loaded


def run(library: ctypes.CDLL, name: str, *arguments: Any) -> np.ndarray[Any, Any]:
    count = len(arguments[0])
    padded = [np.concatenate([np.asarray(x, float), np.zeros(-count % 8)]) for x in arguments]
    result = np.zeros(len(padded[0]))
    pointers = [ctypes.c_void_p(x.ctypes.data) for x in (*padded, result)]
    library[f"do_{name}"](ctypes.c_ssize_t(len(result)), *pointers)
    return result[:count]


def ulps(got: float, exact: Any) -> float:
    nearest = float(exact)
    if not np.isfinite(got) or not np.isfinite(nearest):
        return 0.0 if got == nearest else float("inf")
    return float(abs(mp.mpf(got) - exact) / mp.mpf(max(float(np.spacing(abs(nearest))), 5e-324)))


def signed(x: Any) -> np.ndarray[Any, Any]:
    return np.concatenate([x, -x])


def powers(low: float, high: float) -> np.ndarray[Any, Any]:
    return signed(np.exp2(np.random.default_rng(0).uniform(low, high, COUNT)))


def uniform(low: float, high: float) -> np.ndarray[Any, Any]:
    return np.random.default_rng(1).uniform(low, high, COUNT)


def near_quarters() -> np.ndarray[Any, Any]:
    """The doubles next to multiples of pi/2, where little of the argument is left."""
    turns = [*range(1, 40), *(int(v) for v in np.exp2(np.random.default_rng(2).uniform(1, 60, 80)))]
    with mp.workprec(400):
        return np.array([float(turn * mp.pi / 2) for turn in turns])


RANGES: dict[str, Callable[[], list[np.ndarray[Any, Any]]]] = {
    **dict.fromkeys(
        ("sin", "cos", "tan"), lambda: [uniform(-30, 30), near_quarters(), powers(-60, 31), powers(-1074, 1023.9)]
    ),
    **dict.fromkeys(
        ("exp", "expm1"),
        lambda: [uniform(-746, 710), uniform(-2, 2), uniform(-745.2, -707), uniform(709, 710), powers(-1074, 3)],
    ),
    "log": lambda: [np.abs(powers(-1074, 1023.9)), 1 + powers(-52, -1), uniform(0.4, 3)],
    "atan": lambda: [powers(-1074, 1023.9), powers(-5, 5), uniform(-3, 3)],
    **dict.fromkeys(("asin", "acos"), lambda: [uniform(-1, 1), signed(1 - np.abs(powers(-53, -1))), powers(-1074, 0)]),
    **dict.fromkeys(("sinh", "cosh"), lambda: [uniform(-3, 3), uniform(-709, 709), powers(-1074, 3)]),
    "tanh": lambda: [uniform(-3, 3), uniform(-40, 40), powers(-1074, 3)],
}


@pytest.mark.parametrize("name", RANGES)
def test_functions_of_one_argument(library: ctypes.CDLL, name: str) -> None:
    x = np.concatenate(RANGES[name]())
    got = run(library, name, x)
    with mp.workprec(1300):
        worst = max(
            (ulps(value, getattr(mp, name)(mp.mpf(at))), at) for value, at in zip(got.tolist(), x.tolist(), strict=True)
        )
    assert worst[0] < ULPS[name], worst


def test_atan2(library: ctypes.CDLL) -> None:
    y = np.concatenate([powers(-1074, 1023), uniform(-1, 1), uniform(-1, 1)])
    x = np.concatenate([np.roll(powers(-1074, 1023), 7), uniform(-1, 1)[::-1], uniform(-1, 1)[::-1] * 1e-3])
    got = run(library, "atan2", y, x)
    with mp.workprec(1300):
        worst = max(
            ulps(v, mp.atan2(mp.mpf(a), mp.mpf(b)))
            for v, a, b in zip(got.tolist(), y.tolist(), x.tolist(), strict=True)
        )
    assert worst < ULPS["atan2"]


SPECIAL = np.array([np.inf, -np.inf, np.nan, 0.0, -0.0, 1e308, -1e308, 5e-324, -5e-324, 1, -1, 2, -2, 0.5, 1.5, -2.5])
NUMPYS = {"atan": "arctan", "asin": "arcsin", "acos": "arccos", "fabs": "abs", "atan2": "arctan2"}
#: A zero may have the other sign.
UNSIGNED = ("sin", "tan", "sign", "fmin", "fmax")


def expected(name: str, *x: Any) -> Any:
    with np.errstate(all="ignore"):
        return getattr(np, NUMPYS.get(name, name))(*x)


def assert_same(name: str, got: Any, want: Any) -> None:
    np.testing.assert_allclose(got, want, rtol=1e-15, atol=0, err_msg=name)
    if name not in UNSIGNED:
        known = ~np.isnan(want)
        np.testing.assert_array_equal(np.signbit(got[known]), np.signbit(want[known]), err_msg=name)


@pytest.mark.parametrize("name", [*RANGES, "floor", "ceil", "fabs", "sqrt", "sign"])
def test_infinities_nan_zeros_and_ends(library: ctypes.CDLL, name: str) -> None:
    assert_same(name, run(library, name, SPECIAL), expected(name, SPECIAL))


@pytest.mark.parametrize("name", ["atan2", "fmin", "fmax", "copysign"])
def test_pairs_of_special_numbers(library: ctypes.CDLL, name: str) -> None:
    y, x = (grid.ravel() for grid in np.meshgrid(SPECIAL, SPECIAL))
    assert_same(name, run(library, name, y, x), expected(name, y, x))


def test_a_far_argument_in_one_lane_leaves_the_others_alone(library: ctypes.CDLL) -> None:
    x = np.array([0.1, 1e300, -0.3, np.nan, 0.5, np.inf, 1.0, 2.0])
    near = np.isfinite(x) & (np.abs(x) < 1e3)
    alone = run(library, "sin", np.where(near, x, 0.0))
    np.testing.assert_array_equal(run(library, "sin", x)[near], alone[near])


def test_records_go_to_lanes_and_back(library: ctypes.CDLL) -> None:
    assert library.records() == 0


def test_every_function_of_the_forms_is_tested() -> None:
    called = {form[4:].split("(")[0] for form in LANE_FORMS.values() if form.startswith("lcg_")}
    assert called <= {*RANGES, "atan2", "fmin", "fmax", "copysign", "floor", "ceil", "fabs", "sqrt", "sign"}


def test_the_polynomials_are_as_good_as_they_say() -> None:
    assert all(error < -57.5 for _, _, error in POLYNOMIALS.values())
    _, coefficients, _ = POLYNOMIALS["SIN"]
    with mp.workprec(200):
        for r in np.linspace(0.01, float(mp.pi) / 4, 50).tolist():
            z = mp.mpf(r) ** 2
            value = r + r * z * mp.polyval([mp.mpf(c) for c in coefficients[::-1]], z)
            assert abs(value / mp.sin(r) - 1) < mp.mpf(2) ** -57.5


@pytest.mark.slow
def test_the_coefficients_are_those_of_the_fit() -> None:
    script = HERE.parent / "tools" / "fit_lane_polynomials.py"
    subprocess.run([sys.executable, str(script), "--check"], check=True)
