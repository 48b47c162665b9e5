"""closed_loop.c: generated, compiled by a strict compiler, run, and equal to the same sampled loop in Python."""

from __future__ import annotations

import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import expm

from lie_codegen.control.attitude_law import attitude_law
from lie_codegen.control.closed_loop_package import generate_closed_loop
from lie_codegen.control.reference_kernels import reference_kernel
from lie_codegen.control.reference_motion import formula_reference
from lie_codegen.control.second_order_step import held_force_step
from lie_codegen.control.tracking_law import tracking_law
from lie_codegen.groups.catalogue_load import group as load
from lie_codegen.mechanics.states import initial_states, split_states
from lie_codegen.runtime.build import build_kernels

STRICT = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-O2"]


def run(folder: Path, namespace: str) -> np.ndarray:
    compiler = shutil.which("gcc") or shutil.which("cc") or shutil.which("clang")
    if compiler is None:
        pytest.skip("no C compiler")
    program = folder.parent / f"{folder.name}_loop"
    sources = ["closed_loop.c", f"src/{namespace}.c"]
    subprocess.run([compiler, *STRICT, "-Iinclude", *sources, "-lm", "-o", str(program)], cwd=folder, check=True)
    done = subprocess.run([str(program)], check=False, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout[-400:]
    return np.array([[float(x) for x in line.split()] for line in done.stdout.splitlines()])


def test_attitude_law_in_c_converges(tmp_path: Path) -> None:
    so3 = load("so3")
    law = attitude_law("pd", inertia=[3, 2, 2], k_p=4, k_d=6)
    folder = generate_closed_loop(
        so3, tmp_path / "so3", inertia=[3, 2, 2], law=law, X0=expm(so3.hat([1.2, -0.8, 1])), xi0=[0.3, -0.4, 0.5]
    )
    table = run(folder, "so3")
    assert table[-1, 1] < 1e-6 * table[0, 1]
    assert np.all(np.diff(table[:, 1]) < 0)


def test_tracking_law_in_c_is_the_loop_in_python(tmp_path: Path) -> None:
    se3 = load("se3")
    inertia = [2, 3, 4, 5, 6, 8]
    law = tracking_law(se3, inertia=inertia, error="se3_2", gains={"K_1": 8, "K_2": 8, "K_d": 9}, feedforward="right")
    reference = formula_reference(se3, ["0", "sin(t/2)/3", "t/5", "sin(t)", "t/10", "0"])
    X0 = expm(se3.hat([0.5, 0.2, -0.4, 1, -1, 0.5]))
    folder = generate_closed_loop(
        se3, tmp_path / "se3", inertia=inertia, law=law, reference=reference, X0=X0, duration=10
    )
    table = run(folder, "se3")
    kernels = [law, held_force_step(se3, inertia), reference_kernel(reference)]
    lib = build_kernels(lambda: kernels, namespace="se3")
    state = initial_states(se3, X0, None)[0][0]
    for k in range(1001):
        X, xi = split_states(se3, state)
        out = lib.tracking_law(X, xi, *lib.reference(k * 0.01))
        if k % 20 == 0:
            assert table[k // 20, 1] == pytest.approx(out.W, rel=1e-9, abs=1e-13)
        state = lib.held_force_step(state, out.force, 0.01)


def test_a_complex_group_too(tmp_path: Path) -> None:
    su2 = load("su2")
    law = tracking_law(su2, inertia=[2, 3, 4], error="frobenius", gains={"k_p": 4, "K_d": 6})
    reference = formula_reference(su2, ["sin(t)", "t/3", "cos(t)"])
    folder = generate_closed_loop(
        su2, tmp_path / "su2", inertia=[2, 3, 4], law=law, reference=reference, X0=expm(su2.hat([1, 0.5, -1]))
    )
    assert run(folder, "su2")[-1, 2] < 1e-2
