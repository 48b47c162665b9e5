"""Numbers of a law as inputs: the same law, one library for every body and gain, many loops at once."""

from __future__ import annotations

import pickle
import random
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

import lie_codegen as lc
from lie_codegen.kernel.arithmetic import FloatArithmetic
from lie_codegen.vehicles.quadrotor import quadrotor_law
from lie_codegen.vehicles.sphere import sphere_law

J = ((1.5, 0.1, 0), (0.1, 1.25, 0.2), (0, 0.2, 1.75))


def flat(values: Any) -> np.ndarray:
    return np.concatenate([np.ravel(np.asarray(value, dtype=float)) for value in values])


PAIRS: dict[str, Any] = {
    "p": (lambda **k: lc.attitude_law("p", **{"k_p": 2, **k}), [2.0]),
    "pd": (lambda **k: lc.attitude_law("pd", **{"inertia": J, "k_p": 2, "k_d": 3, **k}), [J, 2.0, 3.0]),
    "reduced": (lambda **k: lc.attitude_law("reduced", z=(0, 3, 4), **{"k_p": 2, **k}), [2.0]),
    "sphere": (lambda **k: sphere_law(2, **{"k_p": 2, "k_d": 3, **k}), [2.0, 3.0]),
    "quadrotor": (
        lambda **k: quadrotor_law(mass=2, inertia=J, gains={"k_x": 1, "k_v": 2, "k_R": 3, "k_W": 4}, gravity=9.75, **k),
        [2.0, 9.75, J, 1.0, 2.0, 3.0, 4.0],
    ),
    "tracking": (
        lambda **k: lc.tracking_law(
            lc.group("so3"), inertia=J, error="so3_right", gains={"K_p": 4, "K_d": J}, feedforward="levi_civita", **k
        ),
        [J, J],
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", PAIRS)
def test_the_same_law_with_its_numbers_as_inputs(name: str) -> None:
    make, numbers = PAIRS[name]
    fixed, tunable = make(), make(tunable=True)
    assert len(tunable.inputs) == len(fixed.inputs) + len(numbers)
    assert tunable != fixed
    assert pickle.loads(pickle.dumps(tunable)) == tunable
    point = fixed.sample(random.Random(1))
    given = [[list(row) for row in value] if isinstance(value, tuple) else value for value in numbers]
    want = flat(fixed.evaluate(FloatArithmetic(), *point))
    np.testing.assert_allclose(flat(tunable.evaluate(FloatArithmetic(), *point, *given)), want, rtol=1e-12, atol=1e-12)
    assert len(tunable.sample(random.Random(2))) == len(tunable.inputs)


def test_one_number_is_an_input_and_the_others_stay() -> None:
    law = lc.attitude_law("pd", inertia=J, k_p="input", k_d=3)
    assert [port.name for port in law.inputs] == ["X", "omega", "k_p"]
    assert law.inputs[2].units == "N m/rad"
    lib = lc.build(law)
    turn = Rotation.from_rotvec([0.1, 0.2, 0.3]).as_matrix()
    torque = lib.attitude_pd.batch(turn, [0, 0, 0], k_p=[1.0, 2, 4]).torque
    np.testing.assert_allclose(torque, -np.outer([1, 2, 4], [0.1, 0.2, 0.3]), rtol=1e-12)


def test_many_loops_each_with_its_own_body_and_gains() -> None:
    so3, count, rng = lc.group("so3"), 200, np.random.default_rng(0)
    law = lc.attitude_law("pd", inertia="input", k_p="input", k_d="input")
    bodies = np.array([np.diag(rng.uniform(1, 1.9, 3)) for _ in range(count)])
    k_p, k_d = rng.uniform(1, 4, count), rng.uniform(1, 4, count)
    X0 = Rotation.from_rotvec(rng.uniform(-1, 1, (count, 3))).as_matrix()
    xi0 = rng.normal(size=(count, 3)) / 2
    run = lc.closed_loop(
        so3,
        inertia=bodies,
        law=law,
        gains={"k_p": k_p, "k_d": k_d},
        X0=X0,
        xi0=xi0,
        t=[0, 2.5, 5],
        step=0.01,
        threads=2,
    )
    assert run.steps == 500
    assert run.X.shape == (3, count, 3, 3)
    assert run.outputs["V"].shape == (3, count)
    for i in range(10):

        def rate(_: float, y: np.ndarray, i: int = i) -> np.ndarray:
            X, w = y[:9].reshape(3, 3), y[9:]
            cross = np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])
            force = -k_p[i] * Rotation.from_matrix(X).as_rotvec() - k_d[i] * w
            return np.concatenate([(X @ cross).ravel(), np.linalg.solve(bodies[i], force)])

        start = np.concatenate([X0[i].ravel(), xi0[i]])
        want = solve_ivp(rate, (0, 5), start, method="DOP853", rtol=1e-11, atol=1e-12).y[:, -1]
        np.testing.assert_allclose(run.X[-1, i], want[:9].reshape(3, 3), atol=1e-8)
        np.testing.assert_allclose(run.xi[-1, i], want[9:], atol=1e-8)


def test_a_body_of_its_own_under_a_tracking_law() -> None:
    """The law knows one inertia, the bodies have others; the same as one loop compiled for each."""
    so3 = lc.group("so3")
    law = lc.tracking_law(so3, inertia=(1, 2, 2), error="so3_right", gains={"K_p": 4, "K_d": 6})
    reference = lc.reference(so3, ["0.3*sin(t)", "t/10", 0])
    bodies = np.array([np.diag(d) for d in ([1, 2, 2], [1.5, 2, 1.75])])
    options: dict[str, Any] = {"law": law, "reference": reference, "xi0": [0.1, 0, 0.2], "t": [0, 1], "step": 0.02}
    many = lc.closed_loop(so3, inertia=bodies, **options)
    for i, body in enumerate(bodies):
        one = lc.closed_loop(so3, inertia=body, **options)
        np.testing.assert_allclose(many.X[:, i], one.X, atol=1e-13)


def test_what_is_missing_or_wrong_is_named() -> None:
    so3 = lc.group("so3")
    law = lc.attitude_law("pd", tunable=True)

    def loop(inertia: Any = 1, **gains: Any) -> Any:
        return lc.closed_loop(so3, inertia=inertia, law=law, gains=gains, t=[0, 1], step=0.1)

    with pytest.raises(lc.errors.InputError, match="k_d is an input of the law"):
        loop(k_p=1)
    with pytest.raises(lc.errors.InputError, match="no input k_q"):
        loop(k_p=1, k_d=1, k_q=1)
    with pytest.raises(lc.errors.InputError, match="k_p of loop 1 is not positive"):
        loop(k_p=[1, -1], k_d=1)
    with pytest.raises(lc.errors.ShapeError, match="different numbers of loops"):
        loop(k_p=[1, 1], k_d=[1, 2, 3])
    with pytest.raises(lc.errors.InputError, match="inertia of loop 0 is not symmetric positive definite"):
        loop(inertia=-np.eye(3)[None], k_p=1, k_d=1)
    with pytest.raises(lc.errors.NotFiniteError, match="k_p"):
        loop(k_p=np.nan, k_d=1)


def test_a_repeated_loop_is_known_by_its_definition() -> None:
    from lie_codegen.control.loop_library import loop_library
    from lie_codegen.control.plants import group_plant

    so3 = lc.group("so3")

    def lib(k_p: Any) -> Any:
        law = lc.attitude_law("pd", inertia=(1, 2, 2), k_p=k_p, k_d=6)
        return loop_library({"plant": group_plant(so3, (1, 2, 2)), "law": law}, None, "continuous")[1]

    assert lib(4) is lib("4")
    assert lib(4) is not lib(5)
