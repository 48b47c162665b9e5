"""The lane mathematics in floats, in units in the last place of a float, against the same in doubles by NumPy."""

from __future__ import annotations

import ctypes
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from codegen.test_vector_math import MACHINES, NUMPYS, UNSIGNED

from lie_codegen.codegen.lane_coefficients import FLOAT_POLYNOMIALS
from lie_codegen.codegen.lane_headers import in_floats, lanes_float_header, lanes_header
from lie_codegen.runtime.compiler import FLAGS, find_compilers

HERE = Path(__file__).resolve().parent
#: Sine and cosine are the floats' own; the others come rounded from the lanes of doubles.
ULPS = {"sin": 1.5, "cos": 1.5}
ROUNDED = 0.5001

pytestmark = pytest.mark.skipif(not find_compilers(), reason="needs a C compiler")


@pytest.fixture(scope="module", params=list(MACHINES))
def library(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> ctypes.CDLL:
    folder = tmp_path_factory.mktemp("math")
    (folder / "lie_codegen_lanes.h").write_text(lanes_header())
    (folder / "lie_codegen_lanes_float.h").write_text(lanes_float_header())
    text = in_floats((HERE / "vector_math_driver.c").read_text())
    (folder / "driver.c").write_text(text.replace("lie_codegen_lanes.h", "lie_codegen_lanes_float.h"))
    flags = ["-O2", f"-march={request.param}", *FLAGS, f"-I{folder}", "-Wall", "-Wextra", "-Werror"]
    command = [*find_compilers()[0].command, *flags, "-o", str(folder / "math.so"), str(folder / "driver.c"), "-lm"]
    subprocess.run(command, check=True)
    loaded = ctypes.CDLL(str(folder / "math.so"))
    lanes = MACHINES[request.param]
    assert lanes is None or loaded.lanes() == 2 * lanes
    if loaded.lanes() == 1:
        pytest.skip("no vectors on this machine")
    if request.param == "haswell" and "avx2" not in Path("/proc/cpuinfo").read_text():
        pytest.skip("no AVX2 here")
    return loaded


def run(library: ctypes.CDLL, name: str, *arguments: Any) -> np.ndarray[Any, Any]:
    count = len(arguments[0])
    padded = [np.concatenate([x, np.zeros(-count % 16)]).astype(np.float32) for x in arguments]
    result = np.zeros(len(padded[0]), np.float32)
    pointers = [ctypes.c_void_p(x.ctypes.data) for x in (*padded, result)]
    library[f"do_{name}"](ctypes.c_ssize_t(len(result)), *pointers)
    return result[:count]


def expected(name: str, *x: Any) -> Any:
    with np.errstate(all="ignore"):
        return getattr(np, NUMPYS.get(name, name))(*[np.asarray(each, np.float32).astype(np.float64) for each in x])


def worst(got: Any, wanted: Any) -> float:
    with np.errstate(all="ignore"):
        nearest = wanted.astype(np.float32)
        error = np.abs(got.astype(np.float64) - wanted) / np.spacing(np.abs(nearest)).astype(np.float64)
    return float(np.max(np.where(np.isfinite(nearest), error, np.where(got == nearest, 0.0, np.inf))))


def powers(low: float, high: float) -> Any:
    size = np.exp2(np.random.default_rng(0).uniform(low, high, 2_000))
    return np.concatenate([size, -size])


def uniform(low: float, high: float) -> Any:
    return np.random.default_rng(1).uniform(low, high, 20_000)


def near_quarters() -> Any:
    """The floats next to multiples of pi/2, where little of the argument is left; 12,732 is the last one with its own reduction."""
    return (np.arange(1, 40_000) * (np.pi / 2)).astype(np.float32)


RANGES: dict[str, Callable[[], list[Any]]] = {
    **dict.fromkeys(("sin", "cos"), lambda: [uniform(-30, 30), uniform(-2e4, 2e4), near_quarters(), powers(-120, 100)]),
    "tan": lambda: [uniform(-30, 30), near_quarters()],
    **dict.fromkeys(("exp", "expm1"), lambda: [uniform(-100, 88), powers(-120, 3)]),
    "log": lambda: [np.abs(powers(-120, 120)), uniform(0.4, 3)],
    "atan": lambda: [powers(-120, 120)],
    **dict.fromkeys(("asin", "acos"), lambda: [uniform(-1, 1), powers(-120, 0)]),
    **dict.fromkeys(("sinh", "cosh", "tanh"), lambda: [uniform(-88, 88), powers(-120, 3)]),
}


@pytest.mark.parametrize("name", RANGES)
def test_functions_of_one_argument(library: ctypes.CDLL, name: str) -> None:
    x = np.concatenate(RANGES[name]())
    assert worst(run(library, name, x), expected(name, x)) < ULPS.get(name, ROUNDED)


def test_atan2(library: ctypes.CDLL) -> None:
    y, x = powers(-100, 100), np.roll(powers(-90, 90), 7)
    assert worst(run(library, "atan2", y, x), expected("atan2", y, x)) < ROUNDED


SPECIAL = np.array(
    [np.inf, -np.inf, np.nan, 0.0, -0.0, 3e38, -3e38, 1e-45, -1e-45, 1, -1, 2, -2, 0.5, 1.5, -2.5], np.float32
)


def assert_same(name: str, got: Any, wanted: Any) -> None:
    with np.errstate(all="ignore"):
        nearest = wanted.astype(np.float32)
    np.testing.assert_allclose(got, nearest, rtol=2e-7, atol=0, err_msg=name)
    if name not in UNSIGNED:
        known = ~np.isnan(nearest)
        np.testing.assert_array_equal(np.signbit(got[known]), np.signbit(nearest[known]), err_msg=name)


@pytest.mark.parametrize("name", [*RANGES, "floor", "ceil", "fabs", "sqrt", "sign"])
def test_infinities_nan_zeros_and_ends(library: ctypes.CDLL, name: str) -> None:
    assert_same(name, run(library, name, SPECIAL), expected(name, SPECIAL))


@pytest.mark.parametrize("name", ["atan2", "fmin", "fmax", "copysign"])
def test_pairs_of_special_numbers(library: ctypes.CDLL, name: str) -> None:
    y, x = (grid.ravel() for grid in np.meshgrid(SPECIAL, SPECIAL))
    assert_same(name, run(library, name, y, x), expected(name, y, x))


def test_records_go_to_lanes_and_back(library: ctypes.CDLL) -> None:
    assert library.records() == 0


def test_the_polynomials_are_better_than_floats() -> None:
    assert all(error < -27.5 for _, _, error in FLOAT_POLYNOMIALS.values())
