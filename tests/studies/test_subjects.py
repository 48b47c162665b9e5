"""Studies of what the front door runs: loops, flows, plans, averages, kernels, propagators; the file and the commands."""

from __future__ import annotations

import functools
import json
from pathlib import Path

import command_line
import numpy as np
import pytest

import lie_codegen as lc

pytest.importorskip("zarr")


def test_closed_loops_are_those_of_the_front_door(tmp_path: Path) -> None:
    law = lc.attitude_law("pd", tunable=True)
    space = {
        "inertia": lc.Normal([1, 2, 3], 0.05), "k_p": lc.Uniform(3, 5), "k_d": 3.0, "X0": lc.OnGroup("so3"),
        "xi0": lc.Normal(np.zeros(3), 0.1),
    }  # fmt: skip
    what = functools.partial(lc.closed_loop, "so3", law=law, t=np.linspace(0, 4, 9), step=0.05)
    study = lc.study(what, space, n=60, chunk=25, store=tmp_path / "s.zarr", progress=False)
    for i in (0, 31, 59):
        alone = lc.closed_loop(
            "so3", law=law, t=np.linspace(0, 4, 9), step=0.05, inertia=np.diag(study["inertia"][i]), X0=study["X0"][i],
            xi0=study["xi0"][i], gains={"k_p": study["k_p"][i], "k_d": 3.0},
        )  # fmt: skip
        end = alone.X[-1]
        angle = 2 * np.arcsin(np.linalg.norm(end - np.eye(3)) / np.sqrt(8))
        assert study["error_final"][i] == pytest.approx(angle, rel=1e-9)
        assert study["speed_final"][i] == pytest.approx(np.linalg.norm(alone.xi[-1]), rel=1e-9)
        assert study["u_max"][i] == pytest.approx(np.max(np.abs(alone.outputs["torque"])), rel=1e-12)
        torque2 = np.sum(alone.outputs["torque"] ** 2, axis=1)
        assert study["effort"][i] == pytest.approx(np.sum(torque2[1:] + torque2[:-1]) / 4, rel=1e-12)
    worst = study.worst(2)
    assert worst[0].index == np.argmax(study["error_final"])
    assert worst[0].result.X.shape == (9, 3, 3)
    assert np.array_equal(worst[0].inputs["X0"], study["X0"][worst[0].index])


def test_noise_belongs_to_the_sample(tmp_path: Path) -> None:
    """The same numbers whatever the chunks, another sequence for each sample, and a replay meets its own again."""
    law = lc.attitude_law("pd", inertia=[1, 2, 3], k_p=4, k_d=6)
    what = functools.partial(
        lc.closed_loop, "so3", law=law, inertia=[1, 2, 3], t=np.linspace(0, 4, 5), step=0.05, sample=0.1,
        noise={"X": 0.01, "xi": 0.02},
    )  # fmt: skip
    space = {"xi0": lc.Uniform([0, 0, 0], [1e-12, 0, 0])}
    runs = [lc.study(what, space, n=24, seed=3, chunk=chunk, store=None, progress=False) for chunk in (24, 7)]
    assert runs[0].digest() == runs[1].digest()
    assert len(set(runs[0]["error_final"].tolist())) == 24
    assert 0.001 < np.mean(runs[0]["error_final"]) < 0.1
    again = runs[0].replay(11).result
    angle = 2 * np.arcsin(np.linalg.norm(again.X[-1] - np.eye(3)) / np.sqrt(8))
    assert angle == pytest.approx(runs[0]["error_final"][11], rel=1e-9)


def test_a_steering_study(tmp_path: Path) -> None:
    what = lc.Run(lc.steer, "so3", controls=("w1", "w2"), duration=1.0)
    study = lc.study(what, {"target": lc.OnGroup("so3")}, n=20, store=tmp_path / "s.zarr", progress=False)
    assert np.all(study["solved"])
    assert np.max(study["error"]) < 1e-6
    plan = lc.steer("so3", study["target"][3], ("w1", "w2"), 1.0)
    assert study["cost"][3] == pytest.approx(plan.cost, rel=1e-12)
    assert study.replay(3).result == plan


def test_an_order_map() -> None:
    def run(a: float, b: float) -> lc.OrderCheck:
        u = lc.PeriodicInput([f"{a}*cos(t)", f"{b}*sin(t)", "0"])
        return lc.order_check("so3", u, order=2, eps=(0.1, 0.05), horizon=1)

    study = lc.study(lc.each(run), {"a": [1, 2], "b": [1, 2]}, store=None, progress=False)
    assert study.n == 4
    assert np.all(study["passed"])
    assert np.all(np.abs(study["slope"] - 2) < 0.3)


def test_a_robust_pulse() -> None:
    """A pi pulse about x under a detuning and an error of amplitude: infidelity in closed form, Rabi's formula."""
    amplitude, detuning = np.pi, lc.Normal(0.0, 0.3)
    u = lc.ParametricInput(["(1 + e)*a", "0", "d"], parameters=("a", "e", "d"))
    propagator = lc.propagator("su2", u, duration=1.0)

    def infidelity(result: object) -> dict[str, np.ndarray]:
        X = np.asarray(result.result)  # type: ignore[attr-defined]
        return {"infidelity": 1 - np.abs(X[:, 0, 1]) ** 2}

    study = lc.study(
        propagator,
        {"a": amplitude, "e": lc.Normal(0, 0.02), "d": detuning},
        n=50,
        store=None,
        reduce=infidelity,
        progress=False,
    )
    w, d = np.pi * (1 + study["e"]), study["d"]
    rabi = np.hypot(w, d)
    assert np.allclose(study["infidelity"], 1 - (w / rabi) ** 2 * np.sin(rabi / 2) ** 2, atol=1e-12)


def test_kernels_and_flows() -> None:
    study = lc.study(
        lc.attitude_law("p", k_p=2),
        {"X": lc.OnGroup("so3")},
        n=40,
        store=None,
        progress=False,
    )
    assert study.complete
    flow = functools.partial(lc.simulate, "so3", ["cos(t)", "sin(t)", "0"], t=[0.0, 2.0])
    eps = lc.study(flow, {"eps": lc.Uniform(0, 1)}, n=12, store=None, progress=False)
    alone = lc.simulate("so3", ["cos(t)", "sin(t)", "0"], t=[0.0, 2.0], eps=eps["eps"][5])
    assert np.max(np.abs(eps["X_final"][5] - alone.X[-1])) < 1e-10


TEXT = """
[study]
n = 40
seed = 1
[run]
function = "closed_loop"
group = "so3"
t = {start = 0, stop = 5, count = 3}
step = 0.1
law = {make = "attitude_law", kind = "pd", tunable = true}
[space]
k_p = 4
k_d = 3
[space.inertia]
distribution = "Normal"
mean = [1, 2, 3]
std = 0.05
[space.X0]
distribution = "OnGroup"
group = "so3"
spread = 0.3
"""


def test_the_file_and_the_commands(tmp_path: Path) -> None:
    file, store = tmp_path / "s.toml", tmp_path / "s.zarr"
    file.write_text(TEXT)
    done = command_line.run("study", "run", str(file), "--store", str(store), "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert json.loads(done.stdout)["status"]["done"] == 40
    study = lc.study_from_file(file, store=tmp_path / "t.zarr")
    assert study.digest() == lc.open_study(store).digest()
    status = command_line.run("study", "status", str(store), cwd=tmp_path)
    assert "40 done" in status.stdout
    assert "error_final" in status.stdout
    worst = json.loads(command_line.run("study", "worst", str(store), "-k", "2", "--json", cwd=tmp_path).stdout)
    assert worst["worst"][0]["sample"] == int(np.argmax(study["error_final"]))


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ('function = "closed_loop"', 'function = "os.system"', "function is one of"),
        ('make = "attitude_law"', 'make = "exec"', "make is one of"),
        ('distribution = "Normal"', 'distribution = "Joint"', "distribution is one of"),
        ("seed = 1", "seed = 1\nsped = 2", "sped is not known"),
        ("std = 0.05", "sigma = 0.05", "sigma"),
        ("n = 40", "n = 40 40", "line 3"),
        ("count = 3", "count = 1", "count"),
    ],
)
def test_a_file_that_is_wrong(tmp_path: Path, old: str, new: str, said: str) -> None:
    file = tmp_path / "s.toml"
    file.write_text(TEXT.replace(old, new))
    with pytest.raises(lc.errors.InputError, match=said):
        lc.study_from_file(file, store=tmp_path / "s.zarr")
    assert not (tmp_path / "s.zarr").exists()
