"""Plans are values: they pickle, compare, print short, save and load, and travel to other processes."""

from __future__ import annotations

import copy
import json
import multiprocessing
import pickle
import subprocess
import sys
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm

import lie_codegen as lc
from lie_codegen.errors import InputError, NotFiniteError

G = (0.4, -0.3, 0.5)
METHODS = (
    "optimal",
    "four_phase",
    "circle",
    "swing_twist",
    "loops",
    "area_rule",
    "transcription",
    "feedback",
    "direct",
    "ocp",
    "sinusoids",
    "symmetric_product",
)


def planned(method: str, target=G):
    if method == "sinusoids":
        return lc.steer("h3", target, controls=(0, 1), duration=4.0, method=method)
    more = {"inertia": [1, 2, 3]} if method == "symmetric_product" else {}
    return lc.steer("so3", target, controls=("w1", "w2"), duration=4.0, method=method, **more)


@pytest.mark.parametrize("method", METHODS)
def test_plans_of_every_method_are_values(method: str, tmp_path: Path, elsewhere: Callable[[Any], list[Any]]) -> None:
    plan = planned(method)
    twins = (pickle.loads(pickle.dumps(plan)), copy.copy(plan), copy.deepcopy(plan), replace(plan))
    for twin in (*twins, *elsewhere(plan)):
        assert (twin == plan) is True
        assert hash(twin) == hash(plan)
    assert (plan == replace(plan, cost=plan.cost + 1)) is False
    assert len(repr(plan).splitlines()) <= 10
    assert "array" not in repr(plan)
    assert {"error", "status", "X_final", "details"} <= set(dir(plan))
    back = lc.load(plan.save(tmp_path / "plan.npz"))
    assert back == plan
    t = np.linspace(0, 4, 13)
    np.testing.assert_array_equal(back.u(t), plan.u(t))
    assert back.error == plan.error
    for outside in (-0.1, 4.1):
        with pytest.raises(InputError, match=r"\[0, 4\]"):
            plan.u(outside)
    with pytest.raises(NotFiniteError):
        plan.u(np.nan)


def test_the_true_system_is_where_the_plan_says(tmp_path: Path) -> None:
    plan = planned("optimal")
    path = plan.X([0.0, 2.0, 4.0])
    np.testing.assert_array_equal(path[0], np.eye(3))
    np.testing.assert_allclose(path[-1], plan.X_final, atol=1e-11)
    np.testing.assert_allclose(plan.X(2.0), path[1], atol=1e-11)
    with pytest.raises(InputError, match="outside"):
        plan.X(5.0)
    table = np.loadtxt(plan.to_csv(tmp_path / "u.csv", t=[0, 1, 4]).splitlines(), delimiter=",", skiprows=1)
    np.testing.assert_array_equal(table[:, 1:], plan.u([0.0, 1.0, 4.0]))
    assert (tmp_path / "u.csv").read_text().startswith("t,u_w1,u_w2,u_w3\n")
    told = json.loads(plan.to_json())
    assert told["cost"] == plan.cost
    assert told["status"] == "LOCAL"


def test_a_saved_plan_ends_at_the_same_bits_in_a_fresh_process(tmp_path: Path) -> None:
    plan = planned("optimal")
    file = plan.save(tmp_path / "p.npz")
    code = f"import lie_codegen as lc; print(lc.load({str(file)!r}).X_final.tobytes().hex())"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == plan.X_final.tobytes().hex()


@pytest.mark.parametrize("start", ["spawn", "forkserver"])
def test_a_pool_of_processes_gives_the_serial_plans(start: str) -> None:
    rng = np.random.default_rng(3)
    count = 100 if start == "spawn" else 4
    targets = [tuple(row) for row in rng.uniform(-0.6, 0.6, size=(count, 3))]
    serial = [planned("optimal", target) for target in targets]
    with ProcessPoolExecutor(2, mp_context=multiprocessing.get_context(start)) as pool:
        assert list(pool.map(partial(planned, "optimal"), targets, chunksize=25)) == serial


def test_files_that_are_not_ours_are_refused(tmp_path: Path) -> None:
    plan = planned("circle")
    good = plan.save(tmp_path / "p.npz")
    with np.load(good) as data:
        entries = {name: data[name] for name in data.files}
    header = json.loads(bytes(entries.pop("header")).decode())

    def written(changed: object) -> Path:
        text = json.dumps(changed).encode()
        np.savez(tmp_path / "q.npz", header=np.frombuffer(text, dtype=np.uint8), **entries)
        return tmp_path / "q.npz"

    with pytest.raises(InputError, match="version 7"):
        lc.load(written({**header, "version": 7}))
    evil = json.loads(json.dumps(header).replace("lie_codegen.steering.plan:Plan", "subprocess:Popen"))
    with pytest.raises(InputError, match="no value of this package"):
        lc.load(written(evil))
    evil = json.loads(json.dumps(header).replace("lie_codegen.groups.definition:defined_group", "os:system"))
    with pytest.raises(InputError, match="no value of this package"):
        lc.load(written(evil))
    (tmp_path / "r.npz").write_bytes(good.read_bytes()[:500])
    for path in (tmp_path / "r.npz", tmp_path / "none.npz"):
        with pytest.raises(InputError, match="no file that save"):
            lc.load(path)


def test_printed_targets_report_their_distance() -> None:
    from scipy.linalg import expm

    so3 = lc.group("so3")
    X = expm(so3.hat([0.3, -0.2, 0.6]))
    assert planned("optimal", X).projected == 0.0
    plan = planned("optimal", np.round(X, 7))
    assert 0 < plan.projected < 1e-6
    assert plan.projected == pytest.approx(lc.nearest(so3, np.round(X, 7)).distance, rel=1e-9)


@pytest.mark.parametrize(
    "options",
    [
        {"drift": (0, 0, 0.3)},
        {"drift": (0, 0, 0.3), "start": (0.1, 0.2, 0.3)},
        {"drift": ("0", "0", "0.3*sin(t)")},
        {"drift": (0, 0, 0.3), "start": (0.1, 0.2, 0.3), "equation": "right"},
        {"drift": (0, 0, 0.3), "start": (0.1, 0.2, 0.3), "method": "ocp"},
        {"inertia": (1, 2, 3), "dynamics": "second_order", "controls": ("w1", "w2", "w3")},
    ],
)
def test_the_path_of_a_plan_is_that_of_its_own_system(options: dict[str, Any]) -> None:
    """Drift, start, the side that the velocity acts on, inertia: X(t) of the plan begins where it says and ends at the target."""
    so3 = lc.group("so3")
    target = expm(so3.hat([0.4, -0.3, 0.7]))
    given = {"controls": ("w1", "w2"), **options}
    if "start" in given:
        given["start"] = expm(so3.hat(given["start"]))
    plan = lc.steer(so3, target, given.pop("controls"), 6.0, **given)
    path = plan.X([0.0, 3.0, 6.0])
    np.testing.assert_allclose(path[0], given.get("start", np.eye(3)), atol=1e-12)
    np.testing.assert_allclose(path[2], target, atol=1e-8)
    if given.get("equation") == "right":
        a, b = plan.X(3.0), plan.X(3.0 + 1e-5)
        rate = so3.hat(plan.u(3.0) + np.array([0, 0, 0.3]))
        np.testing.assert_allclose((b - a) / 1e-5, rate @ a, atol=1e-4)


def test_controls_that_were_changed_in_place_are_read_anew() -> None:
    """Controls of plain data are resolved once; who changes an array within has other controls."""
    plan = lc.steer("so3", G, controls=("w1", "w2"), duration=4.0, method="circle")
    before = plan.X(4.0)
    np.testing.assert_array_equal(plan.X(4.0), before)
    again = lc.simulate("so3", plan.u.scaled(np.full(3, 0.5)), t=[0.0, 4.0]).X[-1]
    factor = np.full(3, 0.5)
    scaled = plan.u.scaled(factor)
    np.testing.assert_array_equal(lc.simulate("so3", scaled, t=[0.0, 4.0]).X[-1], again)
    factor[:] = 1.0
    assert np.max(np.abs(lc.simulate("so3", scaled, t=[0.0, 4.0]).X[-1] - before)) < 1e-9
    factor[:] = 0.5
    np.testing.assert_array_equal(lc.simulate("so3", scaled, t=[0.0, 4.0]).X[-1], again)
