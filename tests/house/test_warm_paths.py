"""What has been made before is found by its definition: a fresh process with a warm cache derives nothing, and imports nothing to derive with."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from lie_codegen.runtime.compiler import find_compilers

pytestmark = pytest.mark.skipif(not find_compilers(), reason="no C compiler")

START = (
    "import sys, numpy as np, lie_codegen as lc; TARGET = [[0, -1, 0], [1, 0, 0], [0, 0, 1]]; T = np.linspace(0, 1, 5)"
)
LAW = "lc.attitude_law('pd', inertia=(1, 2, 3), k_p=4, k_d=3)"
POTENTIAL = (
    "lc.tracking_law('so3', inertia=(1, 2, 3), gains={'K_d': 6}, "
    "error=lc.error_function('so3', 'tr(K*(1 - Xd^-1*X))/2', parameters={'K': np.diag([1, 2, 3]).tolist()}))"
)
HEAVY = ("casadi", "jinja2", "scipy", "sympy")
#: What a user asks for first -> what it may still import of HEAVY.
PATHS = {
    "import lie_codegen.control.closed_loop, lie_codegen.steering.front, lie_codegen.flow.simulate": (),
    "lc.build('so3').exp([0.1, 0.2, 0.3])": (),
    "lc.generate('so3', 'so3')": (),
    "lc.group('se3').hat([1, 2, 3, 4, 5, 6])": (),
    f"lc.build({LAW})": (),
    f"lc.generate({LAW}, 'law')": (),
    "lc.build(lc.tracking_law('so3', inertia=(1, 2, 3), error='so3_right', gains={'K_p': (4, 5, 6), 'K_d': 6}))": (),
    "lc.build(lc.hybrid_law(inertia=(1, 2, 3), K_p=(4, 5, 6), K_d=6))": (),
    "lc.build(lc.observer('so3', directions=[[1, 0, 0], [0, 1, 0]], k_p=1, k_i=1))": (),
    "lc.build(lc.sphere_law(k_p=4, k_d=6))": (),
    "lc.build(lc.quadrotor_law(mass=1, inertia=(1, 2, 3), gains={'k_x': 4, 'k_v': 3, 'k_R': 8, 'k_W': 2}))": (),
    f"lc.closed_loop('so3', law={LAW}, inertia=(1, 2, 3), X0=TARGET, t=T, step=0.01)": (),
    "lc.steer('so3', TARGET, controls=[0, 1], duration=1.0)": (),
    "lc.simulate('so3', ['sin(t)', 'cos(t)', '1'], t=T)": (),
    "lc.simulate('so3', ['t', 'exp(-t)', '1'], t=T)": (),
    "lc.simulate('so3', ['-X[0][1]', 'cos(t)', '1'], t=T)": (),
    "lc.simulate('so3', np.ones((5, 3)), t=T)": (),
    "lc.simulate('su4', np.ones((5, 15)), t=T)": (),
    "lc.simulate('so3', lc.PeriodicInput.from_fourier([[1, 0, 0.1]], [[0, 1, 0]]), t=T)": (),
    "lc.simulate('so3', lc.PeriodicInput.from_samples(np.eye(5)[:, :3], 2), t=T)": (),
    "lc.simulate('so3', lc.PeriodicInput.from_pieces([('1', ['t', '1', '0']), (2, ['2-t', '0', '0'])]), t=T)": (),
    "lc.PeriodicInput(['exp(sin(t))', 'cos(t)'], '2*pi')(T)": (),
    "lc.reference('so3', ['sin(t)', '0', '1'])": (),
    f"lc.build({POTENTIAL})": (),
    f"lc.closed_loop(law={POTENTIAL}, inertia=(1, 2, 3), reference=['sin(t)', '0', 't/2'], X0=TARGET, t=T)": (),
}


#: A fork of a process that has done START alone is as fresh as a process of its own.
EACH = """
import os
for code in {paths!r}:
    if os.fork() == 0:
        exec(code)
        print(code, *sorted(set({heavy!r}) & set(sys.modules)), sep="|", flush=True)
        os._exit(0)
    assert os.wait()[1] == 0, code
"""


def run(folder: Path, code: str) -> str:
    """In a folder with a cache of its own: that of the whole run evicts."""
    environment = {**os.environ, "LIE_CODEGEN_CACHE": str(folder / "cache")}
    command = [sys.executable, "-c", f"{START}\n{code}"]
    return subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=True).stdout


@pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork here")
def test_nothing_heavy_is_imported_where_the_cache_has_it(tmp_path: Path) -> None:
    run(tmp_path, "\n".join(PATHS))  # everything has been asked for once
    imported = dict(
        line.split("|", 1) if "|" in line else (line, "")
        for line in run(tmp_path, EACH.format(paths=list(PATHS), heavy=HEAVY)).splitlines()
    )
    assert list(imported) == list(PATHS)
    too_much = {code: set(found.split("|")) - {"", *PATHS[code]} for code, found in imported.items()}
    assert not {code: found for code, found in too_much.items() if found}
