"""lc.generate(closed loop): continuous, sampled, late, limited, of first order; compiled strictly, run against the loop's numbers."""

from __future__ import annotations

import pickle
import re
import shutil
import subprocess
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import lie_codegen as lc
from lie_codegen.errors import InputError

needs_gcc = pytest.mark.skipif(shutil.which("gcc") is None, reason="needs gcc")
STRICT = ["gcc", "-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-O2", "-Iinclude"]
T = np.linspace(0, 4, 41)
START = np.array([[0.0, -1, 0], [1, 0, 0], [0, 0, 1]])


def tracking() -> dict[str, Any]:
    law = lc.tracking_law("so3", inertia="input", error="so3_right", gains={"K_p": (4, 5, 6), "K_d": 4})
    reference = lc.reference("so3", ["0.2*sin(t)", "0.1*t", "0.1*cos(t)"])
    return {"law": law, "inertia": (1, 2, 3), "reference": reference, "X0": START}


def cases() -> dict[str, dict[str, Any]]:
    bodies = np.array([1.0, 1.2, 0.9])[:, None, None] * np.diag([1.0, 2, 3])
    return {
        "continuous": tracking(),
        "sampled": {**tracking(), "sample": 0.05, "noise": {"X": 1e-2, "xi": 1e-2, "u": 1e-2}, "runs": 5},
        "late": {**tracking(), "inertia": bodies, "sample": 0.05, "delay": 2, "limits": 0.5},
        "first": {"law": lc.attitude_law("p", k_p=2), "X0": START, "sample": 0.1},
        "integral": {
            "law": lc.integral_law("so3", inertia=(1, 2, 3), error="so3_right", gains={"K_p": (4, 4, 4), "K_d": 4, "K_i": 1}),
            "inertia": (1, 2, 3), "reference": tracking()["reference"], "X0": START, "sample": 0.05,
        },
    }  # fmt: skip


def run_in_c(folder: Path) -> subprocess.CompletedProcess[str]:
    subprocess.run([*STRICT, "sat_loop.c", "src/sat.c", "-lm", "-o", "loop"], cwd=folder, check=True)
    return subprocess.run(["./loop"], cwd=folder, capture_output=True, text=True)


@needs_gcc
@pytest.mark.parametrize("case", cases())
def test_the_same_numbers(case: str, tmp_path: Path) -> None:
    run = lc.closed_loop("so3", t=T, **cases()[case])
    folder = lc.generate(run, tmp_path / "double", name="sat")
    done = run_in_c(folder)
    assert done.returncode == 0, done.stdout
    if case not in ("sampled",):  # whose program is the loop without its noise
        rows = re.search(r"expected\[MARKS\]\[STATE\] = \{\n(.*?)\n\};", (folder / "sat_loop.c").read_text(), re.DOTALL)
        assert rows is not None
        last = [float(x) for x in re.sub(r"[(){} ]", "", rows.group(1).splitlines()[-1]).strip(",").split(",")]
        X = run.X[-1] if run.X.ndim == 3 else run.X[-1, 0]
        # A continuous run chooses its steps; its program takes equal ones that are as good, to the tolerance of both.
        np.testing.assert_allclose(last[:9], X.ravel(), rtol=0, atol=1e-10 if case == "continuous" else 1e-15)
    again = lc.generate(pickle.loads(pickle.dumps(run)), tmp_path / "again", name="sat")
    assert (again / "sat_loop.c").read_text() == (folder / "sat_loop.c").read_text()
    single = lc.generate(run, tmp_path / "single", name="sat", real="float")
    done = run_in_c(single)
    assert done.returncode == 0, done.stdout


@needs_gcc
def test_a_wrong_gain_is_noticed(tmp_path: Path) -> None:
    folder = lc.generate(lc.closed_loop("so3", t=T, **cases()["late"]), tmp_path / "loop", name="sat")
    program = folder / "sat_loop.c"
    text = program.read_text()
    program.write_text(text.replace("number_limits[3] = { 0.5", "number_limits[3] = { 0.4"))
    assert text != program.read_text()
    assert run_in_c(folder).returncode == 1


def test_a_law_a_loop_and_a_group_in_one_package(tmp_path: Path) -> None:
    run = lc.closed_loop("so3", t=T, **cases()["late"])
    folder = lc.generate(["se2", run], tmp_path / "all", name="all")
    header = (folder / "include" / "all.h").read_text()
    assert "se2_exp(" in header
    assert "so3_tracking_law(" in header


def test_what_is_refused(tmp_path: Path) -> None:
    free = lc.closed_loop("so3", inertia=(1, 2, 3), xi0=(0.1, 0.2, 0.3), t=T)
    with pytest.raises(InputError, match="nothing to take home"):
        lc.generate(free, tmp_path / "no")
    assert not (tmp_path / "no").exists()


def test_the_picture_of_loops(tmp_path: Path) -> None:
    run = lc.closed_loop("so3", t=T, **cases()["sampled"])
    assert lc.plot_loops(run, tmp_path / "deep" / "band.svg").read_text().count("<path") > 10
    assert lc.plot_loops(lc.closed_loop("so3", t=T, **cases()["first"]), tmp_path / "one.png").stat().st_size > 5_000
    with pytest.raises(InputError, match="takes a closed loop"):
        lc.plot_loops("run", tmp_path / "x.png")
    with pytest.raises(InputError, match="two percentiles"):
        lc.plot_loops(run, tmp_path / "x.png", band=(95, 5))
    with pytest.raises(InputError, match="ends in"):
        lc.plot_loops(run, tmp_path / "x.xyz")
