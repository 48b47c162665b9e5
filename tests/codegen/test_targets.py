"""The same C for other worlds: each target runs the package's own vectors, or drives the unit step by step."""

from __future__ import annotations

import ctypes
import importlib.util
import json
import random
import re
import shutil
import subprocess
import xml.etree.ElementTree as ElementTree
import zipfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm

import lie_codegen as lc

COMPILER = shutil.which("cc")


def run(command: list[str], folder: Path) -> str:
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=500, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def law() -> lc.Kernel:
    return lc.attitude_law("pd", tunable=True)


@pytest.mark.parametrize("target", ["rust", "ros2", "fmu"])
def test_the_c_is_the_same_and_a_second_call_writes_nothing(law: lc.Kernel, tmp_path: Path, target: str) -> None:
    plain, other = lc.generate(law, tmp_path / "c"), lc.generate(law, tmp_path / target, target=target)
    for path in ("src/so3.c", "include/so3.h", "CMakeLists.txt", "test_vectors.csv"):
        assert (plain / path).read_bytes() == (other / path).read_bytes()
    stamp = (other / "manifest.json").stat().st_mtime_ns
    assert lc.generate(law, tmp_path / target, target=target) == other
    assert (other / "manifest.json").stat().st_mtime_ns == stamp
    # another target in its place: the folder is ours, and is replaced
    lc.generate(law, tmp_path / target)
    assert not list((tmp_path / target).glob("*.fmu"))


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("cargo") is None, reason="no cargo")
@pytest.mark.parametrize("real", ["double", "float"])
def test_a_crate_runs_its_vectors(law: lc.Kernel, tmp_path: Path, real: str) -> None:
    for what, name in ((law, "law"), ("so3", "so3")):
        folder = lc.generate(what, tmp_path / name, target="rust", real=real)
        said = run(["cargo", "test", "--offline", "--test", "vectors"], folder)
        assert re.search(r"test result: ok\. [1-9]", said)


@pytest.mark.slow
@pytest.mark.skipif(
    importlib.util.find_spec("ziglang") is None or shutil.which("node") is None, reason="no ziglang or node"
)
def test_a_module_runs_its_vectors(law: lc.Kernel, tmp_path: Path) -> None:
    for what, name in ((law, "law"), ("su2", "su2")):
        folder = lc.generate(what, tmp_path / name, target="wasm")
        assert "vectors, largest error" in run(["node", "example.mjs"], folder)
        assert "export function" in next(folder.glob("*.d.ts")).read_text()


#: Reads [function, inputs ...] in lines, calls the module of a package, and prints what comes out.
ASKED = """
import { readFileSync } from "node:fs";
const kernels = await import(process.argv[1]);
for (const line of readFileSync(0, "utf8").trim().split("\\n")) {
  const [name, ...given] = JSON.parse(line);
  console.log(JSON.stringify(Object.values(kernels[name](...given)).map(each => Array.from(each, String))));
}
"""


def asked(folder: Path, calls: list[tuple[str, list[np.ndarray]]]) -> list[list[np.ndarray]]:
    """The outputs of each call of a package's module, by node."""
    module = next(path for path in folder.glob("*.mjs") if path.name != "example.mjs")
    given = "\n".join(json.dumps([name, *(np.ravel(each).tolist() for each in inputs)]) for name, inputs in calls)
    command = ["node", "--input-type=module", "-e", ASKED, module.as_uri()]
    done = subprocess.run(command, input=given, capture_output=True, text=True, timeout=500, check=False)
    assert done.returncode == 0, done.stderr
    return [[np.array(each, float) for each in json.loads(line)] for line in done.stdout.splitlines()]


@pytest.mark.slow
@pytest.mark.skipif(
    importlib.util.find_spec("ziglang") is None or shutil.which("node") is None, reason="no ziglang or node"
)
def test_a_module_gives_scipys_exponential_and_the_numbers_of_python(law: lc.Kernel, tmp_path: Path) -> None:
    """Another compiler's mathematics (musl's sine) for another machine: equal to rounding, and no number where there is none."""
    rng = np.random.default_rng(5)
    se2, folder = lc.group("se2"), lc.generate("se2", tmp_path / "se2", target="wasm")
    x = rng.uniform(-2, 2, (40, 3))
    x[0] *= 1e-9  # where the closed form divides by an angle that is nearly none
    *X, nothing = [
        found[0].reshape(3, 3) for found in asked(folder, [("exp", [each]) for each in (*x, np.full(3, 1e308))])
    ]
    np.testing.assert_allclose(X, [expm(se2.hat(each)) for each in x], rtol=0, atol=4e-15)
    back = [found[0] for found in asked(folder, [("log", [each]) for each in X])]
    np.testing.assert_allclose(back, x, rtol=0, atol=1e-14)
    assert not np.isfinite(nothing).all()

    built, folder = lc.build(law).attitude_pd, lc.generate(law, tmp_path / "law", target="wasm")
    inputs = [law.sample(random.Random(seed)) for seed in range(25)]
    for found, given in zip(asked(folder, [(built.name, list(each)) for each in inputs]), inputs, strict=True):
        for ours, theirs in zip(found, built(*given), strict=True):
            np.testing.assert_allclose(ours, np.ravel(theirs), rtol=1e-13, atol=1e-13)


@pytest.mark.skipif(shutil.which("cmake") is None, reason="no cmake")
def test_a_package_of_a_workspace(law: lc.Kernel, tmp_path: Path) -> None:
    folder = lc.generate(law, tmp_path / "ros", target="ros2")
    root = ElementTree.parse(folder / "package.xml").getroot()
    assert root.findtext("export/build_type") == "cmake"
    run(["cmake", "-S", ".", "-B", "../build", "-DCMAKE_INSTALL_PREFIX=../install"], folder)
    run(["cmake", "--build", "../build", "--target", "install"], folder)
    assert list((tmp_path / "install").rglob("so3.h"))


class Unit:
    """A unit of FMI 3.0 by ctypes alone, as any simulator would load it."""

    def __init__(self, path: Path, folder: Path) -> None:
        zipfile.ZipFile(path).extractall(folder)
        root = ElementTree.parse(folder / "modelDescription.xml").getroot()
        self.variables = {each.attrib["name"]: each for each in root.iter("Float64")}
        library = ctypes.CDLL(str(next((folder / "binaries").rglob("*.so"))))
        make = library.fmi3InstantiateCoSimulation
        make.restype = ctypes.c_void_p
        assert make(b"u", b"{wrong}", None, 0, 0, 0, 0, None, ctypes.c_size_t(0), None, None, None) is None
        token = root.attrib["instantiationToken"].encode()
        self.unit = ctypes.c_void_p(make(b"u", token, None, 0, 0, 0, 0, None, ctypes.c_size_t(0), None, None, None))
        assert self.unit.value
        self.library = library
        zero = ctypes.c_double(0)
        assert library.fmi3EnterInitializationMode(self.unit, 0, zero, zero, 0, zero) == 0
        assert library.fmi3ExitInitializationMode(self.unit) == 0

    def _place(self, name: str) -> tuple[Any, int]:
        each = self.variables[name]
        size = int(np.prod([int(d.attrib["start"]) for d in each.iter("Dimension")]))
        return (ctypes.c_uint32 * 1)(int(each.attrib["valueReference"])), size

    def get(self, name: str) -> np.ndarray:
        reference, size = self._place(name)
        values = (ctypes.c_double * size)()
        assert self.library.fmi3GetFloat64(self.unit, reference, ctypes.c_size_t(1), values, ctypes.c_size_t(size)) == 0
        return np.array(values)

    def set(self, name: str, given: Any) -> int:
        reference, size = self._place(name)
        values = (ctypes.c_double * size)(*np.ravel(given))
        return int(self.library.fmi3SetFloat64(self.unit, reference, ctypes.c_size_t(1), values, ctypes.c_size_t(size)))

    def step(self, t: float, h: float) -> None:
        flags, last = [(ctypes.c_int * 1)() for _ in range(3)], (ctypes.c_double * 1)()
        assert self.library.fmi3DoStep(self.unit, ctypes.c_double(t), ctypes.c_double(h), 0, *flags, last) == 0
        assert last[0] == t + h


@pytest.mark.skipif(COMPILER is None, reason="no compiler")
def test_a_law_as_a_unit(law: lc.Kernel, tmp_path: Path) -> None:
    folder = lc.generate(law, tmp_path / "law", target="fmu")
    unit = Unit(folder / "so3.fmu", tmp_path / "unit")
    assert unit.variables["k_p"].attrib["causality"] == "parameter"
    assert unit.variables["k_p"].attrib["variability"] == "tunable"
    assert unit.variables["inertia"].attrib["variability"] == "tunable"
    lib = lc.build(law)
    X, w, inertia = lc.build("so3").exp([0.5, -0.2, 0.3]), np.array([0.1, 0.2, -0.4]), np.diag([1.0, 2.0, 3.0])
    for name, value in (("X", X), ("omega", w), ("inertia", inertia), ("k_p", 4.0), ("k_d", 3.0)):
        assert unit.set(name, value) == 0
    expected = lib.attitude_pd(X, w, inertia, 4.0, 3.0)
    assert np.array_equal(unit.get("torque"), expected.torque)
    assert unit.set("k_p", 5.0) == 0
    assert np.array_equal(unit.get("torque"), lib.attitude_pd(X, w, inertia, 5.0, 3.0).torque)
    assert unit.set("torque", [1, 2, 3]) != 0  # an output cannot be set


@pytest.mark.skipif(COMPILER is None, reason="no compiler")
def test_a_closed_loop_as_a_unit(tmp_path: Path) -> None:
    law = lc.attitude_law("pd", inertia=[1, 2, 3], k_p=4, k_d=6)
    start = lc.build("so3").exp([1, 0.5, 0.2])
    loop = lc.closed_loop(
        "so3", law=law, inertia=[1, 2, 3], X0=start, xi0=[0.1, 0, 0.2], t=np.linspace(0, 2, 11), step=0.05
    )
    folder = lc.generate(loop, tmp_path / "loop", target="fmu")
    unit = Unit(folder / "so3.fmu", tmp_path / "unit")
    # a simulator that sets nothing runs the loop as it was run
    assert np.array_equal(unit.get("state"), [*start.ravel(), 0.1, 0, 0.2])
    for k in range(40):
        unit.step(0.05 * k, 0.05)
    assert np.max(np.abs(unit.get("state") - [*loop.X[-1].ravel(), *loop.xi[-1]])) < 1e-13


@pytest.mark.skipif(COMPILER is None, reason="no compiler")
@pytest.mark.parametrize("how", [{}, {"sample": 0.1}, {"sample": 0.1, "delay": 0.2, "noise": {"X": 1e-9}}])
def test_a_loop_that_follows_a_reference_is_one_unit(tmp_path: Path, how: dict[str, Any]) -> None:
    """The reference and the law are called inside, at their own times, whatever the steps of the simulator."""
    law = lc.tracking_law("se2", inertia=[2, 3, 4], error="se2_1", gains={"K_1": (4, 4), "K_2": 4, "K_d": (5, 5, 5)})
    loop = lc.closed_loop(
        "se2", law=law, inertia=[2, 3, 4], reference=lc.reference("se2", ["t/4", "1/2", "sin(t)/3"]),
        X0=lc.build("se2").exp([0.3, 0.5, -0.2]), t=np.linspace(0, 3, 31), step=0.02, seed=0, **how,
    )  # fmt: skip
    quiet = lc.closed_loop(
        "se2", law=law, inertia=[2, 3, 4], reference=lc.reference("se2", ["t/4", "1/2", "sin(t)/3"]),
        X0=lc.build("se2").exp([0.3, 0.5, -0.2]), t=np.linspace(0, 3, 31), step=0.02, **{k: v for k, v in how.items() if k != "noise"},
    )  # fmt: skip
    unit = Unit(lc.generate(loop, tmp_path / "loop", target="fmu") / "se2.fmu", tmp_path / "unit")
    if "noise" in how:
        assert unit.variables["sigma_X"].attrib["causality"] == "parameter"
        assert unit.set("sigma_X", 0.0) == 0
    assert {name for name, each in unit.variables.items() if each.attrib["causality"] == "input"} <= {"noise"}
    steps = [0.1] * 15 + [0.05, 0.25, 0.02, 0.08, 0.1] + [0.25] * 4
    t = 0.0
    for h in steps:
        unit.step(t, h)
        t = round(t + h, 9)
    assert t == 3.0
    # the simulator's steps cut those of the integration, whose fourth power remains
    assert np.max(np.abs(unit.get("state")[:6] - quiet.X[-1][:2].ravel())) < (1e-10 if "sample" in how else 1e-6)
    assert quiet.X_d is not None
    assert np.max(np.abs(unit.get("X_d") - quiet.X_d[-1].ravel())) < 1e-12


@pytest.mark.skipif(COMPILER is None, reason="no compiler")
def test_the_gains_of_a_loop_are_tuned_while_it_runs(tmp_path: Path) -> None:
    law = lc.attitude_law("pd", inertia="input", k_p="input", k_d="input")
    start = lc.build("so3").exp([1, 0.5, 0.2])
    given = {"law": law, "inertia": [1, 2, 3], "X0": start, "t": np.linspace(0, 2, 11), "sample": 0.05, "step": 0.05}
    loop = lc.closed_loop("so3", gains={"k_p": 4, "k_d": 6}, **given)
    unit = Unit(lc.generate(loop, tmp_path / "loop", target="fmu") / "so3.fmu", tmp_path / "unit")
    for name in ("inertia", "k_p", "k_d"):
        assert unit.variables[name].attrib["causality"] == "parameter"
        assert unit.variables[name].attrib["variability"] == "tunable"
    assert unit.set("k_p", 7.0) == 0
    for k in range(40):
        unit.step(0.05 * k, 0.05)
    other = lc.closed_loop("so3", gains={"k_p": 7, "k_d": 6}, **given)
    assert np.max(np.abs(unit.get("state")[:9] - other.X[-1].ravel())) < 1e-13


@pytest.mark.skipif(COMPILER is None, reason="no compiler")
def test_a_unit_is_valid_and_runs_in_a_simulator(law: lc.Kernel, tmp_path: Path) -> None:
    validation = pytest.importorskip("fmpy.validation")
    import fmpy

    unit = str(lc.generate(law, tmp_path / "law", target="fmu") / "so3.fmu")
    assert validation.validate_fmu(unit) == []
    run = fmpy.simulate_fmu(unit, stop_time=1.0, output_interval=0.5, start_values={"k_p": 2.0})
    assert len(run) == 3


@pytest.mark.parametrize(
    ("options", "said"),
    [({"target": "ada"}, "target is one of"), ({"target": "fmu", "real": "float"}, "takes doubles")],
)
def test_what_is_refused(law: lc.Kernel, tmp_path: Path, options: dict[str, Any], said: str) -> None:
    with pytest.raises(lc.errors.InputError, match=said):
        lc.generate(law, tmp_path / "no", **options)
    assert not (tmp_path / "no").exists()
