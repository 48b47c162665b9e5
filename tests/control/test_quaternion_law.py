"""The law with the quaternion in memory: home from everywhere, no unwinding, V falls at each jump; noise cannot hold it."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import lie_codegen as lc
from lie_codegen.errors import InputError

INERTIA = np.array([[2, 0.3, -0.2], [0.3, 1.5, 0.1], [-0.2, 0.1, 1]])
K_D = np.diag([3.0, 4, 5])


def law(**numbers):
    return lc.quaternion_law(**{"inertia": INERTIA, "k_p": 4, "K_d": K_D, **numbers})


def function(made):
    compiled = lc.build(made)[made.name]

    def at(X, q, xi=(0, 0, 0)):
        force, after = compiled(X, xi, np.eye(3), np.zeros(3), np.zeros(3), q)
        return np.asarray(force), np.asarray(after)

    return at


def test_the_torque_and_the_memory():
    """f = -k s_v at rest; the nearer quaternion is kept to 240 degrees, and beyond it the sign changes."""
    at = function(law())
    axis = np.array([0.6, 0, 0.8])
    last = np.array([1.0, 0, 0, 0])
    for angle in np.radians([10, 100, 170, 200, 239]):
        force, last = at(Rotation.from_rotvec(angle * axis).as_matrix(), last)
        np.testing.assert_allclose(last, [np.cos(angle / 2), *(np.sin(angle / 2) * axis)], atol=1e-14)
        np.testing.assert_allclose(force, -4 * np.sin(angle / 2) * axis, atol=1e-13)
    angle = np.radians(241)
    force, last = at(Rotation.from_rotvec(angle * axis).as_matrix(), last)
    np.testing.assert_allclose(last, [-np.cos(angle / 2), *(-np.sin(angle / 2) * axis)], atol=1e-14)
    np.testing.assert_allclose(force, 4 * np.sin(angle / 2) * axis, atol=1e-13)
    # nothing remembered: the shorter way
    np.testing.assert_allclose(
        at(Rotation.from_rotvec(angle * axis).as_matrix(), np.zeros(4))[1][0], -np.cos(angle / 2)
    )


def test_home_from_every_attitude_and_V_never_rises():
    """60 starts, half of them at exactly half a turn, at random speeds: V falls along the loop and ends at zero."""
    rng = np.random.default_rng(3)
    X0 = Rotation.random(60, random_state=4).as_matrix()
    axes = rng.normal(size=(30, 3))
    axes /= np.linalg.norm(axes, axis=1, keepdims=True)
    X0[:30] = 2 * axes[:, :, None] * axes[:, None, :] - np.eye(3)
    xi0 = rng.normal(size=(60, 3)) * 2
    run = lc.closed_loop("so3", law=law(), inertia=INERTIA, reference=np.eye(3), X0=X0, xi0=xi0, t=np.linspace(0, 30, 601), step=0.005)  # fmt: skip
    s = run.outputs["q_next"]
    V = 8 * (1 - s[..., 0]) + np.einsum("...i,ij,...j->...", run.xi, INERTIA, run.xi) / 2
    assert np.all(np.diff(V, axis=0) <= 1e-7)
    assert run.error[-1].max() < 1e-4
    assert s[-1, :, 0].min() > 1 - 1e-8
    jumps = np.sum(np.abs(np.diff(s, axis=0)).max(axis=2) > 0.9, axis=0)
    assert np.all(jumps <= V[0] / 8)  # 4 k delta = 8


def test_noise_does_not_hold_it_at_half_a_turn():
    """0.1 rad of noise on the attitude at half a turn: the sign stays, and the body comes home."""
    run = lc.closed_loop(
        "so3", law=law(), inertia=INERTIA, reference=np.eye(3), X0=np.diag([1.0, -1, -1]), t=np.linspace(0, 30, 61),
        sample=0.05, noise={"X": 0.1}, runs=20, seed=1,
    )  # fmt: skip
    assert run.error[-1].max() < 0.5


def test_a_turning_reference_is_followed_and_numbers_may_be_inputs():
    given = {
        "inertia": INERTIA,
        "reference": ["t", "0.4*sin(t)", "0"],
        "X0": np.diag([-1.0, -1, 1]),
        "t": [0, 25, 50],
        "step": 0.01,
    }
    run = lc.closed_loop("so3", law=law(feedforward="basic"), **given)
    assert run.error[-1] < 1e-5
    free = law(feedforward="basic", k_p="input", hysteresis="input")
    again = lc.closed_loop("so3", law=free, gains={"k_p": 4, "hysteresis": 0.5}, **given)
    np.testing.assert_allclose(again.X, run.X, atol=1e-8)


def test_refusals():
    for numbers, why in (({"hysteresis": 1}, "between 0 and 1"), ({"hysteresis": 0}, "hysteresis"), ({"k_p": -1}, "k_p"),
                         ({"group": "se3"}, "SO"), ({"feedforward": "none"}, "feedforward")):  # fmt: skip
        with pytest.raises(InputError, match=why):
            law(**numbers)
    with pytest.raises(InputError, match="certificate covers"):
        lc.certificate("so3", law=law())
