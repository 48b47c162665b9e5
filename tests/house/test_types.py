"""What mypy --strict says in a user's file, and what help and inspect show of a library and of the options."""

from __future__ import annotations

import inspect
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import lie_codegen as lc

USER = """
import numpy as np
import lie_codegen as lc

so3 = lc.group("so3")
lib = lc.build("so3")
x = np.array([0.1, 0.2, 0.3])
plan = lc.steer("so3", x, ("w1", "w2"), 1.0)
reveal_type(so3)
reveal_type(lib.exp(x))
reveal_type(plan)
reveal_type(plan.cost)
reveal_type(lc.control.attitude_law("p"))
reveal_type(lc.simulate("so3", x, t=[0, 1]))
plan.costt
lc.steer("so3", x, ("w1", "w2"), 1.0, intervalls=3)
lc.nothing
"""


def test_mypy_knows_the_front_door(repository: Path, tmp_path: Path) -> None:
    pytest.importorskip("mypy")
    (tmp_path / "user.py").write_text(USER)
    command = [sys.executable, "-m", "mypy", "--strict", "--follow-imports=silent", "--config-file=", "user.py"]
    environment = {"MYPYPATH": str(repository), "MYPY_CACHE_DIR": str(tmp_path / "cache"), "PATH": "/usr/bin:/bin"}
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, env=environment)
    said = dict(re.findall(r"user\.py:(\d+): (.*)", done.stdout))
    revealed = [said.get(str(line), "").partition("Revealed type is ")[2].strip('"') for line in range(9, 15)]
    assert revealed[0] == "lie_codegen.groups.matrix_group.MatrixGroup", done.stdout + done.stderr
    assert revealed[1].startswith("numpy.ndarray[")
    assert revealed[2] == "lie_codegen.steering.plan.Plan"
    assert revealed[3] in ("float", "builtins.float")
    assert revealed[4] == "lie_codegen.kernel.kernel.Kernel"
    assert revealed[5] == "lie_codegen.flow.trajectory.Trajectory"
    assert '"Plan" has no attribute "costt"' in said["15"]
    assert "error" in said["16"]
    assert 'has no attribute "nothing"' in said["17"]
    assert set(said) == {str(line) for line in range(9, 18)}, done.stdout


def test_a_compiled_kernel_has_a_signature_and_a_docstring() -> None:
    lib = lc.build("so3")
    signature = inspect.signature(lib.exp)
    assert list(signature.parameters) == ["x", "out"]
    assert list(inspect.signature(lib.compose).parameters) == ["X", "Y", "out"]
    assert "exp" in (lib.exp.__doc__ or "")
    np.testing.assert_array_equal(lib.exp(x=[0.0, 0.0, 0.0]), np.eye(3))


def test_the_kernels_of_a_group_library_are_those_that_its_type_names() -> None:
    from lie_codegen.groups.group_library import GroupLibrary

    assert set(GroupLibrary.__annotations__) == set(lc.build("so3").kernels)


@pytest.mark.parametrize("function", [lc.steer, lc.simulate, lc.closed_loop, lc.ocp], ids=lambda each: each.__name__)
def test_every_option_is_a_keyword_that_help_explains(function: object) -> None:
    assert callable(function)
    parameters = inspect.signature(function).parameters
    text = inspect.getdoc(function) or ""
    for name, parameter in parameters.items():
        if parameter.kind is inspect.Parameter.VAR_KEYWORD:
            assert name == "unknown"
        else:
            assert re.search(rf"\b{name}\b.*:", text), name


@pytest.mark.parametrize(
    ("call", "near"),
    [
        (lambda: lc.steer("so3", [0.1, 0.2, 0.3], ("w1", "w2"), 1.0, intervalls=3), "intervals"),
        (lambda: lc.closed_loop("so3", inertia=[1, 2, 3], tolerence=1e-3, t=[0, 1]), "tolerance"),
    ],
)
def test_an_unknown_keyword_names_the_nearest(call: object, near: str) -> None:
    assert callable(call)
    with pytest.raises(lc.errors.InputError, match=f"did you mean {near}"):
        call()
