"""lc.mpc: real-time iteration in a closed loop, fail-safe, and as a C package."""

from __future__ import annotations

import json
import pickle
import shutil
import subprocess
from collections.abc import Callable
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from ocp_systems import GRAVITY, QUADROTOR, SATELLITE, SE2, SE3, SO3, kernel, planar, quadrotor, rotation, satellite
from scipy.linalg import expm

import lie_codegen as lc
from lie_codegen.errors import InputError, OutputFolderError, ShapeError
from lie_codegen.steering.ocp.interpreted import InterpretedMachine
from lie_codegen.steering.ocp.model import ModelBuilder

COMPILER = shutil.which("gcc") or shutil.which("cc")
ARM, EMULATOR = "arm-linux-gnueabihf-gcc", "qemu-arm"
STRICT = ("-std=c99", "-pedantic", "-Wall", "-Wextra", "-Wconversion", "-Werror", "-O2")


def regulator(**options: Any) -> Any:
    settings = {"bounds": 1.2, "parameters": {"q": (), "Xd": (3, 3)}, "name": "turn", **options}
    return lc.ocp(
        SO3, controls=SO3.labels, duration=2.0, intervals=20, stage_cost=("sqrt(q)*(X - Xd)", "u"),
        terminal_cost=("2*(X - Xd)",), **settings,
    )  # fmt: skip


def windy(cylinders: int = 3) -> Any:
    """The quadrotor that is flown: drag in a wind, five per cent of thrust lost."""

    def velocity(_ops: Any, X: Any, v: Any, u: Any) -> Any:
        return [u[1], u[2], u[3], *(X[0][i] * v[0] + X[1][i] * v[1] + X[2][i] * v[2] for i in range(3))]

    def rate(_ops: Any, X: Any, v: Any, u: Any, wind: Any) -> Any:
        return [0.95 * X[i][2] * u[0] - 0.2 * (v[i] - wind[i]) - (GRAVITY if i == 2 else 0) for i in range(3)]

    ports = {"X": (4, 4), "v": (3,), "u": (4,)}
    return lc.ocp(
        SE3, inputs={"u": 4}, states={"v": 3}, velocity=kernel("velocity", ports, "xi", 6, velocity),
        rates={"v": kernel("rate", {**ports, "wind": (3,)}, "v_dot", 3, rate)}, stage_cost="norm2(u)",
        parameters={"wind": 3}, duration=1.5, intervals=30, name=f"windy{cylinders}",
    )  # fmt: skip


def test_an_undisturbed_loop_flies_its_plan() -> None:
    problem = regulator()
    Xd = rotation((0, 1.5, 0.3))
    plan = problem.solve(q=2.0, Xd=Xd)
    controller = lc.mpc(problem)
    controller.reset(plan)
    X = np.eye(3)
    for k in range(3):
        u = controller.step(X, q=2.0, Xd=Xd)
        assert controller.status == "ok"
        # the horizon moves on, so the optimum moves a little; the first control is the plan's own
        np.testing.assert_allclose(u, plan.u[k], atol=1e-7 if k == 0 else 0.05)
        X = X @ expm(SO3.hat(0.1 * u))
    assert np.all(np.abs(u) <= 1.2)
    assert controller.plan.X.shape == (21, 3, 3)
    np.testing.assert_allclose(controller.plan.u[0], u)


def test_one_iteration_with_multipliers_shifted_follows_the_optimum_within_two_per_cent() -> None:
    """Quadrotor among cylinders in gusts, against the loop that iterates to convergence."""
    compare(range(1), 40)


def test_a_trial_that_failed_makes_the_next_step_shorter_and_the_disc_is_kept_out_of() -> None:
    """A cart in a hurry round a disc, from anywhere. With the same step tried again sample after sample it drove 0.29 m into it."""
    cart = lc.ocp(
        "se2", inputs={"u": 2}, states={"s": ()}, velocity=("u2", "s", "0"), rates={"s": "u1"}, duration=2.0, intervals=20,
        stage_cost=("2*(X13 - 3)", "2*(X23 - 1)", "0.3*s", "0.2*u1", "0.2*u2"),
        terminal_cost=("5*(X13 - 3)", "5*(X23 - 1)", "2*s"), bounds=2.0, name="cart",
        constraints=("0.25 - (X13 - 1.5)*(X13 - 1.5) - (X23 - 0.4)*(X23 - 0.4)", "s <= 1.5", "-s <= 0.5"),
    )  # fmt: skip
    held, deepest, jumps = 0, 0.0, 0.0
    for seed in range(12):
        rng = np.random.default_rng(seed)
        X0 = planar(rng.uniform(-3, 3), rng.uniform(-1, 0.8), rng.uniform(-1.5, 1.5))
        controller = lc.mpc(cart)
        controller.reset(X0=X0, s=0.5)
        run = controller.simulate(X0, steps=60, values={"s": 0.5})
        held += sum(status == "held" for status in run.status)
        deepest = max(deepest, 0.5 - float(np.min(np.hypot(run.X[:, 0, 2] - 1.5, run.X[:, 1, 2] - 0.4))))
        jumps += float(np.sum(np.abs(np.diff(run.u[:, 0])))) / 12
    assert deepest < 0.02
    assert held < 0.12 * 720
    assert jumps < 12


def hurried(**options: Any) -> Any:
    return lc.ocp(
        "se2", controls=("omega", "vx"), duration=(0.4, 9.0), intervals=20, target="goal", bounds=2.0,
        **{"stage_cost": "1 + norm2(u)/2", "name": "hurried", **options},
    )  # fmt: skip


def test_a_free_duration_is_chosen_anew_at_every_sample() -> None:
    """Pushed about, one sweep a sample finds the duration that a whole solution finds."""
    problem, goal, rng = hurried(), planar(0.8, 2, 1), np.random.default_rng(1)
    near = problem.solve(goal=goal, starts=6)
    controller = lc.mpc(problem, sample=0.1)
    controller.reset(near)
    X, se2 = np.eye(3), lc.group("se2")
    for _ in range(8):
        u = controller.step(X, goal=goal)
        near = problem.solve(X, goal=goal, guess=near)
        assert controller.status == "ok"
        assert controller.duration == pytest.approx(near.duration, abs=2e-3)
        times = np.linspace(0, 0.1, 201)[:-1] + 0.00025  # what is handed out is the plan's mean over a sample
        np.testing.assert_allclose(u, np.mean(controller.plan.u(times), axis=0), atol=5e-3)
        X = X @ expm(se2.hat([0.1 * u[0], 0.1 * u[1], 0])) @ expm(se2.hat(0.01 * rng.normal(size=3)))


def test_the_loop_of_a_free_duration_counts_it_down_to_the_shortest_and_arrives() -> None:
    controller = lc.mpc(hurried(), sample=0.1)
    plan = controller.reset(goal=planar(0.8, 2, 1), starts=6)
    run = controller.simulate(steps=45, values={"goal": planar(0.8, 2, 1)})
    left = run.states["T"]
    np.testing.assert_allclose(left[:14], plan.duration - 0.1 * np.arange(14), atol=2e-3)
    np.testing.assert_allclose(left[15:], 0.4)
    np.testing.assert_allclose(
        run.X[-1], planar(0.8, 2, 1), atol=0.02
    )  # a unicycle cannot move sideways in 0.4 s for nothing
    assert lc.mpc(hurried()).sample == pytest.approx(0.02)
    with pytest.raises(InputError, match="formula of t"):
        lc.mpc(hurried(stage_cost="1 + norm2(u)/2 + 0.01*sin(t)"))
    for sample in (0, -1, np.nan, "x"):
        with pytest.raises(InputError, match="sample must be"):
            lc.mpc(hurried(), sample=sample)
    with pytest.raises(InputError, match=r"0\.1 s"):
        lc.mpc(regulator(), sample=0.2)


@pytest.mark.skipif(COMPILER is None, reason="no C compiler")
def test_the_package_of_a_free_duration_compiles_strictly_and_its_example_is_content(tmp_path: Path) -> None:
    controller = lc.mpc(hurried(), sample=0.1)
    controller.reset(goal=planar(0.8, 2, 1), starts=6)
    example(package(controller, tmp_path, "double"), "hurried", str(COMPILER))
    done = subprocess.run([tmp_path / "example"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
    assert "w.sample = 0.1;" in (tmp_path / "package" / "example.c").read_text()


@pytest.mark.slow
def test_twenty_disturbed_seeds() -> None:
    compare(range(20), 100)


def compare(seeds: range, steps: int) -> None:
    problem, plant = quadrotor(3), windy()
    cylinders = np.array([0.8, 0.15, 0.3, 1.2, -0.5, 0.2, 1.5, 0.6, 0.2])
    plan = problem.solve(target=(2.0, 0, 1), cyl=cylinders, starts=4)
    for seed in seeds:
        costs = []
        for iterations in (1, 12):
            controller = lc.mpc(problem, iterations=iterations)
            controller.reset(plan)
            run = controller.simulate(
                steps=steps,
                seed=seed,
                plant=plant,
                plant_values={"wind": lambda k, rng: np.array([1.5 * np.sin(0.1 * k), 0, 0]) + rng.normal(size=3)},
            )
            costs.append(run.cost)
            assert set(run.status) == {"ok"}
            assert np.all(run.u >= [2, -6, -6, -6])
            assert np.all(run.u <= [20, 6, 6, 6])
            for x, y, r in cylinders.reshape(3, 3):
                assert r - np.min(np.hypot(run.X[:, 0, 3] - x, run.X[:, 1, 3] - y)) < 0.01
        assert costs[0] < 1.02 * costs[1]


def test_numbers_that_are_none_give_the_plans_own_control_and_are_forgotten() -> None:
    controller = lc.mpc(regulator())
    plan = controller.reset(X0=np.eye(3), q=2.0, Xd=rotation((0, 1.5, 0)))
    np.testing.assert_allclose(controller.step(np.full((3, 3), np.nan)), plan.u[0])
    assert controller.status == "input"
    np.testing.assert_allclose(controller.step(np.eye(3), q=np.nan), plan.u[1])
    assert controller.status == "input"
    assert np.isfinite(controller.step(np.eye(3))).all()  # q is 2 again
    assert controller.status == "ok"
    controller.step(np.eye(3), t=np.nan)
    assert controller.status == "input"
    controller.step(np.eye(3))
    assert controller.status == "ok"
    for _ in range(50):
        u = controller.step(np.full((3, 3), np.inf))
        assert np.all(np.abs(u) <= 1.2)
        assert controller.status == "input"


def test_where_no_roll_out_is_finite_the_control_is_held_within_its_bounds() -> None:
    controller = lc.mpc(quadrotor())
    controller.reset(**QUADROTOR)
    u = controller.step(np.eye(4), v=[1e200, 0, 0])
    assert controller.status == "held"
    assert np.all(u >= [2, -6, -6, -6])
    assert np.all(u <= [20, 6, 6, 6])
    for _ in range(3):
        u = controller.step(np.eye(4), v=np.zeros(3))
        assert np.isfinite(u).all()


def test_parameters_may_move_along_the_horizon() -> None:
    """A turning reference is followed without lag where the controller knows its course."""
    problem = regulator(name="course", bounds=None)
    w = np.array([0.4, 0.1, -0.3])

    def course(k: int) -> Any:
        return np.array([expm(SO3.hat(0.1 * (k + i) * w)) for i in range(21)])

    controller = lc.mpc(problem, iterations=3)
    controller.reset(X0=np.eye(3), q=1000.0, Xd=course(0))
    X = np.eye(3)
    for k in range(25):
        u = controller.step(X, Xd=course(k))
        X = X @ expm(SO3.hat(0.1 * u))
    assert np.linalg.norm(X - course(25)[0]) < 5e-3
    stale = lc.mpc(problem, iterations=3)
    stale.reset(X0=np.eye(3), q=1000.0, Xd=course(0))
    X = np.eye(3)
    for k in range(25):
        X = X @ expm(SO3.hat(0.1 * stale.step(X, Xd=course(k)[0])))
    assert np.linalg.norm(X - course(25)[0]) > 2e-2


def test_what_is_missing_or_misshapen_is_refused_by_name() -> None:
    controller = lc.mpc(quadrotor())
    with pytest.raises(InputError, match="reset"):
        controller.step(np.eye(4), v=np.zeros(3))
    controller.reset(**QUADROTOR)
    with pytest.raises(InputError, match="state v"):
        controller.step(np.eye(4))
    with pytest.raises(InputError, match="'wind'"):
        controller.step(np.eye(4), v=np.zeros(3), wind=0.0)
    with pytest.raises(ShapeError, match="v has shape"):
        controller.step(np.eye(4), v=np.zeros(2))
    with pytest.raises(ShapeError, match="X has shape"):
        controller.step(np.eye(3), v=np.zeros(3))
    with pytest.raises(InputError, match="plan of this problem"):
        controller.reset(regulator().solve(q=1.0, Xd=np.eye(3)))
    for bad in (0, 1.5, True):
        with pytest.raises(InputError, match="iterations"):
            lc.mpc(quadrotor(), iterations=bad)  # type: ignore[arg-type]
    with pytest.raises(InputError, match="penalty"):
        lc.mpc(quadrotor(), penalty=0.0)
    with pytest.raises(InputError, match=r"lc\.ocp"):
        lc.mpc("quadrotor")  # type: ignore[arg-type]


def test_a_controller_is_copied_where_it_stands(elsewhere: Callable[[Any], list[Any]]) -> None:
    controller = lc.mpc(regulator())
    controller.reset(X0=np.eye(3), q=2.0, Xd=rotation((0, 1.5, 0)))
    controller.step(np.eye(3))
    twins = (pickle.loads(pickle.dumps(controller)), *elsewhere(controller))
    wanted = controller.step(rotation((0, 0.1, 0)))
    for twin in twins:
        np.testing.assert_array_equal(twin.step(rotation((0, 0.1, 0))), wanted)


def test_the_loop_of_the_front_door_with_noise_and_delay_is_reproducible() -> None:
    controller = lc.mpc(regulator())
    controller.reset(X0=np.eye(3), q=2.0, Xd=rotation((0, 1.0, 0)))
    t = np.linspace(0, 3, 31)
    options = {"noise": 0.01, "delay": 2}
    run = lc.closed_loop(mpc=controller, t=t, seed=3, **options)
    assert run == lc.closed_loop(mpc=controller, t=t, seed=3, **options)
    several = lc.closed_loop(mpc=controller, t=t, seed=2, runs=2, **options)
    assert several[1] == run
    assert several[0] != run
    assert run.u.shape == (30, 3)
    assert np.linalg.norm(run.X[-1] - rotation((0, 1.0, 0))) < 0.05
    # the true motion, by matrix exponentials
    X = np.eye(3)
    for u in run.u:
        X = X @ expm(SO3.hat(0.1 * u))
    np.testing.assert_allclose(run.X[-1], X, atol=1e-12)
    late = lc.closed_loop(mpc=controller, t=t, noise=0.0, delay=2, compensate=False)
    assert lc.closed_loop(mpc=controller, t=t, noise=0.0, delay=2).cost <= late.cost


@pytest.mark.parametrize(
    "stray",
    [
        {"group": "so3"}, {"law": lc.attitude_law("p")}, {"inertia": 1}, {"xi0": np.zeros(3)}, {"limits": 1}, {"rtol": 1e-6},
        {"step": 0.1}, {"sample": 0.1}, {"method": "gauss"}, {"first": 2}, {"threads": 2}, {"disturbance": (1, 0, 0)},
    ],
    ids=lambda each: next(iter(each)),
)  # fmt: skip
def test_what_a_controller_brings_itself_is_refused_beside_it(stray: dict[str, Any]) -> None:
    controller = lc.mpc(regulator())
    controller.reset(X0=np.eye(3), q=2.0, Xd=np.eye(3))
    with pytest.raises(InputError, match=f"{next(iter(stray))} beside mpc="):
        lc.closed_loop(mpc=controller, t=[0, 1], **stray)


def test_a_plant_of_ones_own() -> None:
    controller = lc.mpc(regulator())
    controller.reset(X0=np.eye(3), q=2.0, Xd=rotation((0, 1.0, 0)))

    def weak(X: Any, _states: Any, u: Any, _t: float, h: float, _rng: Any) -> Any:
        return X @ expm(SO3.hat(0.8 * h * u)), {}

    run = controller.simulate(steps=40, plant=weak)
    assert np.linalg.norm(run.X[-1] - rotation((0, 1.0, 0))) < 0.02
    with pytest.raises(InputError, match="plant"):
        controller.simulate(steps=2, plant=windy())
    with pytest.raises(InputError, match="an interval later"):
        controller.simulate(steps=2, plant=lambda X, states, u, t, h, rng: X)
    with pytest.raises(InputError, match="noise"):
        controller.simulate(steps=2, noise={"w": 1.0})


def test_without_a_compiler_numpy_controls(monkeypatch: pytest.MonkeyPatch) -> None:
    problem = regulator(name="brief", constraints=("X33 <= 0.9",))
    compiled = lc.mpc(problem)
    plan = compiled.reset(X0=rotation((0.6, 0, 0)), q=2.0, Xd=rotation((0, 1.5, 0)))
    machine = InterpretedMachine(problem.data, ModelBuilder(problem.data).build(second_order=False))
    monkeypatch.setattr(import_module("lie_codegen.steering.ocp.controller"), "loop_machine", lambda data: machine)
    twin = lc.mpc(problem)
    twin.reset(plan)
    rng = np.random.default_rng(0)
    X = rotation((0.6, 0, 0))
    for _ in range(4):
        X = X @ rotation(0.05 * rng.normal(size=3))
        np.testing.assert_allclose(twin.step(X), compiled.step(X), atol=1e-8)
        assert twin.status == compiled.status
    np.testing.assert_allclose(twin.step(np.nan * X), compiled.step(np.nan * X), atol=1e-8)
    assert twin.violation == pytest.approx(compiled.violation, abs=1e-9)


def test_sweeps_go_on_where_one_found_nothing_better(monkeypatch: pytest.MonkeyPatch) -> None:
    """Gauss-Newton does not see how the ball of the controls bends: its step is too long, and the next one is damped."""
    problem = lc.ocp(
        SO3, controls=SO3.labels, duration=1.5, intervals=10, stage_cost="0.1*norm2(u) + norm2(X - Xd)",
        terminal_cost="5*norm2(X - Xd)", parameters={"Xd": "X"}, constraints="norm2(u) <= 1", name="so3_ball",
    )  # fmt: skip
    machine = InterpretedMachine(problem.data, ModelBuilder(problem.data).build(second_order=False))
    for seed in (1, 2, 3):
        rng = np.random.default_rng(seed)
        Xd, X = rotation(rng.normal(size=3)), rotation(0.2 * rng.normal(size=3))
        plan = problem.solve(Xd=Xd)
        best = problem.solve(X, Xd=Xd, guess=plan)
        errors = []
        for sweeps in (1, 100):
            controller = lc.mpc(problem, iterations=sweeps)
            controller.reset(plan)
            errors.append(float(np.abs(controller.step(X) - best.u[0]).max()))
        assert controller.status == "ok"
        assert controller.violation < 1e-3
        assert errors[0] > 0.1  # one sweep is stuck
        assert errors[1] < 1e-3  # of the order of 1 / penalty
    few = lc.mpc(problem, iterations=6)
    few.reset(plan)
    monkeypatch.setattr(import_module("lie_codegen.steering.ocp.controller"), "loop_machine", lambda data: machine)
    twin = lc.mpc(problem, iterations=6)
    twin.reset(plan)
    np.testing.assert_allclose(twin.step(X), few.step(X), atol=1e-8)
    assert twin.status == few.status


def package(controller: Any, folder: Path, real: str = "double") -> Path:
    return lc.generate(controller, folder / "package", real=real)


def example(path: Path, name: str, *command: str) -> None:
    subprocess.run(
        [*command, *STRICT, "-Iinclude", "example.c", f"src/{name}.c", "-lm", "-o", "../example"],
        cwd=path,
        check=True,
        capture_output=True,
    )


@pytest.mark.skipif(COMPILER is None, reason="no C compiler")
@pytest.mark.parametrize("real", ["double", "float"])
def test_the_package_compiles_strictly_and_its_example_is_content(real: str, tmp_path: Path) -> None:
    controller = lc.mpc(quadrotor())
    controller.reset(**QUADROTOR)
    path = package(controller, tmp_path, real)
    example(path, "quad1", str(COMPILER))
    done = subprocess.run([tmp_path / "example"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
    assert done.stdout.count(" ok\n") == 7
    manifest = json.loads((path / "manifest.json").read_text())
    assert manifest["workspace_bytes"] < (25_000 if real == "double" else 12_500)
    assert manifest["operations_usual"] < manifest["operations_worst"]
    assert str(manifest["operations_worst"]) in (path / "README.md").read_text()
    again = package(controller, tmp_path, real)
    assert json.loads((again / "manifest.json").read_text()) == manifest


@pytest.mark.skipif(COMPILER is None, reason="no C compiler")
def test_the_example_of_a_package_is_content_where_a_sample_is_held(tmp_path: Path) -> None:
    """A car whose trailer stands at an angle psi: near the end of its plan a Gauss-Newton step from the first sample betters nothing."""
    problem = lc.ocp(
        SE2,
        inputs={"v": (), "w": ()},
        states={"psi": ()},
        velocity=("w", "v", "0"),
        rates={"psi": "-v*sin(psi)/1.5 - w"},
        stage_cost=("v", "w", "0.3*psi"),
        constraints=("-1 <= psi <= 1",),
        terminal=("psi",),
        target="goal",
        bounds={"v": 1.5, "w": (-1.0, 1.2)},
        duration=5.0,
        intervals=40,
        name="trailer",
    )
    controller = lc.mpc(problem)
    controller.reset(problem.solve(goal=planar(0.5, 2.0, 0.8), starts=4))
    path = package(controller, tmp_path)
    statuses = [line.rsplit(",", 1)[1] for line in (path / "test_vectors.csv").read_text().splitlines()[1:]]
    assert set(statuses) == {"held", "ok"}
    example(path, "trailer", str(COMPILER))
    done = subprocess.run([tmp_path / "example"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
    assert done.stdout.count(" ok\n") == 7


@pytest.mark.skipif(COMPILER is None, reason="no C compiler")
def test_the_samples_of_a_float_package_are_not_decided_by_rounding(tmp_path: Path) -> None:
    """On Engel's group a few millionths of the plan decide whether the first sample of seed 0 is held; the package has others."""
    engel = lc.group("engel")
    problem = lc.ocp(
        engel,
        controls=engel.labels[:2],
        stage_cost="norm2(u)/2",
        target="goal",
        bounds=4.0,
        duration=2.0,
        intervals=30,
        name="engel",
    )
    controller = lc.mpc(problem)
    controller.reset(problem.solve(goal=expm(engel.hat([0.2, -0.1, 0.4, 0.3])), starts=6))
    path = package(controller, tmp_path, "float")
    example(path, "engel", str(COMPILER))
    done = subprocess.run([tmp_path / "example"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
    assert done.stdout.count(" ok\n") == len((path / "test_vectors.csv").read_text().splitlines())


@pytest.mark.slow
@pytest.mark.skipif(COMPILER is None or shutil.which("cmake") is None, reason="no C compiler or no cmake")
def test_the_satellites_package_builds_with_cmake(tmp_path: Path) -> None:
    controller = lc.mpc(satellite())
    controller.reset(**SATELLITE)
    path = package(controller, tmp_path)
    for command in (["cmake", "-S", path, "-B", tmp_path / "build"], ["cmake", "--build", tmp_path / "build"]):
        subprocess.run(command, check=True, capture_output=True)
    subprocess.run(["ctest", "--test-dir", tmp_path / "build"], check=True, capture_output=True)
    assert "Release" in (path / "CMakeLists.txt").read_text()


def test_packages_are_refused_where_they_cannot_be(tmp_path: Path) -> None:
    controller = lc.mpc(regulator())
    with pytest.raises(InputError, match="reset"):
        lc.generate(controller, tmp_path / "package")
    controller.reset(X0=np.eye(3), q=2.0, Xd=np.eye(3))
    with pytest.raises(InputError, match="real"):
        lc.generate(controller, tmp_path / "package", real="half")
    with pytest.raises(InputError, match="steering"):
        lc.generate(controller, tmp_path / "package", steering=True)
    with pytest.raises(InputError, match=r"name= to lc\.ocp"):
        lc.generate(controller, tmp_path / "package", name="mine")
    with pytest.raises(InputError, match="a controller has none"):
        lc.generate(controller, tmp_path / "package", form="table")
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "file").write_text("mine")
    with pytest.raises(OutputFolderError):
        lc.generate(controller, tmp_path / "mine")


@pytest.mark.slow
@pytest.mark.skipif(not (shutil.which(ARM) and shutil.which(EMULATOR)), reason=f"no {ARM} or {EMULATOR}")
def test_the_float_package_runs_on_an_arm_processor(tmp_path: Path) -> None:
    controller = lc.mpc(quadrotor())
    controller.reset(**QUADROTOR)
    example(package(controller, tmp_path, "float"), "quad1", ARM, "-static", "-mfpu=vfpv3-d16")
    done = subprocess.run([EMULATOR, tmp_path / "example"], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout
