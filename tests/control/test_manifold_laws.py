"""Theorem 4.2 on manifolds: the published run, the identity of dW/dt to rounding, spheres and manipulators as instances, refusals."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm

import lie_codegen as lc
from lie_codegen.errors import IncompatibleError, InputError
from lie_codegen.kernel.arithmetic import FloatArithmetic
from lie_codegen.kernel.casadi_arithmetic import function_of
from lie_codegen.kernel.dual import DualArithmetic, tangent_of

B = [".3*q1", ".2*q5", ".4*sin(q4)", ".5*q2", "0.1", ".2*q6*q3"]
D = [2, 3, 4, 1.5, 1.2, 1.1]
DOT = "(q1*r1 + q2*r2 + q3*r3)"
ONE = [[int(i == j) for j in range(6)] for i in range(6)]


def text(value: str) -> str:
    return value.replace(".", "0.", 1) if value.startswith(".") else value


def inertia(size: int = 6) -> list[list[str]]:
    return [
        [f"({text(B[i])})*({text(B[j])})" + (f" + {D[i]}" if i == j else "") for j in range(size)] for i in range(size)
    ]


def transport(size: int) -> list[list[str]]:
    """(q.r) 1 - r q^T on the sphere, the identity behind it."""
    sphere = [[(DOT if i == j else "0") + f" - r{i + 1}*q{j + 1}" for j in range(3)] for i in range(3)]
    rows = [[*row, *["0"] * (size - 3)] for row in sphere]
    return rows + [["0"] * 3 + [str(int(i == j)) for j in range(size - 3)] for i in range(size - 3)]


def product(size: int = 6) -> Any:
    return lc.manifold(size, constraints=["q1^2 + q2^2 + q3^2 - 1"], inertia=inertia(size), name="product")


def law_of(Q: Any, size: int = 6, **options: Any) -> Any:
    rest = " + ".join(f"(q{k} - r{k})^2" for k in range(4, size + 1))
    K_d = [4, 4, 4, 3, 3, 3][:size]
    return lc.manifold_law(Q, phi=f"5*(1 - {DOT}) + 3/2*({rest})", transport=transport(size), K_d=K_d, **options)


REFERENCE = [
    "cos(0.6*t)*sin(0.5*sin(t) + 1.3)", "sin(0.6*t)*sin(0.5*sin(t) + 1.3)", "cos(0.5*sin(t) + 1.3)", "sin(t)", "cos(t/2)", "t/5",
]  # fmt: skip


def test_the_published_run() -> None:
    Q = product()
    run = lc.closed_loop(
        Q,
        law=law_of(Q),
        reference=lc.reference(Q, REFERENCE),
        X0=[0.6, -0.64, 0.48, 1, -1, 0.5],
        t=np.linspace(0, 10, 11),
        step=0.01,
    )
    assert run.outputs["W"][0] == pytest.approx(10.8633496296, rel=1e-10)
    assert run.outputs["W"][-1] == pytest.approx(3.23842e-5, rel=1e-5)
    wanted = [0.8234887867, -0.2404637068, 0.5138515582, -0.5439624921, 0.2836353872, 2.0000824765]
    assert run.X[-1] == pytest.approx(wanted, abs=1e-6)
    assert np.max(np.abs(np.linalg.norm(run.X[:, :3], axis=1) - 1)) < 1e-12


def moving(Q: Any, rng: np.random.Generator) -> tuple[np.ndarray, ...]:
    """q, v, r, w and r'' with its part across the manifold."""
    q, r = Q.places(2, rng)
    v, w = Q.along(q, rng.normal(size=Q.size)), Q.along(r, rng.normal(size=Q.size))
    bend = np.zeros(Q.size)
    if Q.constraints:  # |r|^2 = 1 in the first three
        bend[:3] = -(w[:3] @ w[:3]) * r[:3]
    return q, v, r, w, Q.along(r, rng.normal(size=Q.size)) + bend


@pytest.mark.parametrize("size", [5, 6])
def test_energy_identity_to_rounding(size: int) -> None:
    """dW/dt by a dual number in time, along the dynamics, is -e.K_d e to 1e-12; with an operator S of one's own too."""
    Q, ops = product(size), DualArithmetic(FloatArithmetic())
    S = [[f"{i - j}*v1*w2" if i != j else "0" for j in range(size)] for i in range(size)]
    for law in (law_of(Q, size), law_of(Q, size, S=S)):
        rng = np.random.default_rng(size)
        for _ in range(5):
            q, v, r, w, a = moving(Q, rng)
            force, _, W, W_dot = law.evaluate(
                FloatArithmetic(), q.tolist(), v.tolist(), r.tolist(), w.tolist(), a.tolist()
            )
            accel = Q.at(FloatArithmetic(), q.tolist()).acceleration(v.tolist(), force)

            def pair(x: Any, y: Any) -> list:
                return [ops.variable(float(s), {0: float(t)}) for s, t in zip(x, y, strict=True)]

            _, _, energy, _ = law.evaluate(ops, pair(q, v), pair(v, accel), pair(r, w), pair(w, a), a.tolist())
            assert tangent_of(energy, 0) == pytest.approx(W_dot, abs=1e-12 * (1 + abs(W_dot) + abs(W)))
            assert np.array(accel)[:3] @ q[:3] + v[:3] @ v[:3] == pytest.approx(0, abs=1e-12)


def test_spheres_are_an_instance() -> None:
    Q = lc.manifold(3, constraints=["q1^2 + q2^2 + q3^2 - 1"], name="ball")
    law = lc.manifold_law(Q, phi=f"4*(1 - {DOT})", transport=[row[:3] for row in transport(3)], K_d=2)
    ours, theirs = function_of(law), function_of(lc.sphere_law(2, k_p=4, k_d=2))
    rng = np.random.default_rng(1)
    for _ in range(3):
        state = moving(Q, rng)
        for a, b in zip(ours(*state), theirs(*state), strict=True):
            assert np.array(a) == pytest.approx(np.array(b), abs=1e-12)


def test_manipulators_are_an_instance() -> None:
    arm = [["3 + 2*cos(q2)", "1 + cos(q2)"], ["1 + cos(q2)", "1"]]
    Q = lc.manifold(2, inertia=arm, potential="2*cos(q1) + cos(q1 + q2)", name="arm")
    law = lc.manifold_law(Q, phi="2*((q1 - r1)^2 + (q2 - r2)^2)", transport=[[1, 0], [0, 1]], K_d=[3, 2])
    other = lc.manipulator_law(arm, K_p=4, K_d=[3, 2], potential="2*cos(q1) + cos(q1 + q2)")
    state = np.random.default_rng(2).normal(size=(5, 2))
    mine, theirs = function_of(law)(*state), function_of(other)(*state)
    assert np.array(mine[0]) == pytest.approx(np.array(theirs[0]), abs=1e-12)
    assert np.array(mine[2:]) == pytest.approx(np.array(theirs[1:]), abs=1e-12)


def test_an_inertia_that_is_singular_across_the_manifold() -> None:
    """M = 1 - q q^T on the sphere: the same body as M = 1."""
    rows = [[f"{int(i == j)} - q{i + 1}*q{j + 1}" for j in range(3)] for i in range(3)]
    plain = lc.manifold(3, constraints=["q1^2 + q2^2 + q3^2 - 1"], name="ball")
    flat = lc.manifold(3, constraints=["q1^2 + q2^2 + q3^2 - 1"], inertia=rows, name="ball")
    assert (plain.singular, flat.singular) == (False, True)
    laws = [
        function_of(lc.manifold_law(Q, phi=f"4*(1 - {DOT})", transport=[row[:3] for row in transport(3)], K_d=2))
        for Q in (plain, flat)
    ]
    rng, ops = np.random.default_rng(3), FloatArithmetic()
    state = moving(plain, rng)
    forces = [np.array(law(*state)[0]).ravel() for law in laws]
    assert forces[0] == pytest.approx(forces[1], abs=1e-10)
    accelerations = [
        Q.at(ops, state[0].tolist()).acceleration(state[1].tolist(), forces[0].tolist()) for Q in (plain, flat)
    ]
    assert accelerations[0] == pytest.approx(accelerations[1], abs=1e-10)


def test_refusals() -> None:
    with pytest.raises(InputError, match='m cannot be "input"'):
        lc.manifold(1, inertia=["m"], parameters={"m": "input"})
    Q = product()
    with pytest.raises(IncompatibleError, match="not compatible"):
        lc.manifold_law(Q, phi=f"5*(1 - {DOT})", transport=ONE, K_d=1)
    with pytest.raises(InputError, match="give transport="):
        lc.manifold_law(Q, phi=f"5*(1 - {DOT})", K_d=1)
    with pytest.raises(InputError, match=r"phi = -"):
        lc.manifold_law(Q, phi=f"{DOT} - 1", transport=transport(6), K_d=1)
    with pytest.raises(InputError, match="K_d is not"):
        lc.manifold_law(Q, phi=f"1 - {DOT}", transport=transport(6), K_d=[1, 1, 1, 1, 1, -1])
    with pytest.raises(InputError, match="antisymmetric"):
        law_of(Q, S=ONE)
    with pytest.raises(InputError, match="inertia is not positive"):
        lc.manifold(2, inertia=["q1", "1"])
    with pytest.raises(InputError, match=r"leaves the manifold product: c\(r\)"):
        lc.reference(Q, ["cos(t)", "sin(t)", "t", "0", "0", "0"])
    with pytest.raises(InputError, match="is not on the manifold"):
        Q.loop_plant().starts([1, 1, 0, 0, 0, 0], None)


def test_rotations_times_vectors_against_the_group_and_a_linear_equation() -> None:
    """SO(3) x R^3 in R^12. The rotation is the loop of `lc.tracking_law` on so3, |R hat(w)|^2 = 2 |w|^2; the position's error is
    that of 3 e'' = -3 e - 3 e'."""
    q = [f"q{k}" for k in range(1, 13)]
    R, R_d = (np.array([f"{letter}{k}" for k in range(1, 10)], dtype=object).reshape(3, 3) for letter in "qr")
    constraints = [
        " + ".join(f"{R[k, i]}*{R[k, j]}" for k in range(3)) + (" - 1" if i == j else "")
        for i in range(3)
        for j in range(i, 3)
    ]
    Q = lc.manifold(12, constraints=constraints, inertia=[2] * 9 + [3] * 3)
    trace = " + ".join(f"{a}*{b}" for a, b in zip(R.ravel(), R_d.ravel(), strict=True))
    far = " + ".join(f"({a} - r{a[1:]})^2" for a in q[9:])
    T = [["0"] * 12 for _ in range(12)]
    for i, j, k in np.ndindex(3, 3, 3):
        T[3 * i + j][3 * k + j] = " + ".join(
            f"{R[i, m]}*{R_d[k, m]}" for m in range(3)
        )  # R R_d^T R_d', the transport xi_d of so3_left
    for i in range(9, 12):
        T[i][i] = "1"
    law = lc.manifold_law(Q, phi=f"2*(3 - ({trace})) + 3/2*({far})", transport=T, K_d=3)
    turning = ["cos(t)", "-sin(t)", "0", "sin(t)", "cos(t)", "0", "0", "0", "1"]
    moving = lc.reference(Q, [*turning, "t/5", "sin(t)", "1"])
    start = expm(lc.group("so3").hat([0.4, 0.3, -0.5]))
    t, e = np.linspace(0, 6, 13), np.array([0.4, 0.3, -1.2])
    run = lc.closed_loop(
        Q, law=law, reference=moving, X0=[*np.ravel(start), *(e + np.eye(3)[2])], xi0=np.zeros(12), t=t, tolerance=1e-9
    )
    alone = lc.closed_loop(
        "so3",
        inertia=4,
        law=lc.tracking_law("so3", inertia=4, error="so3_left", gains={"K_p": 4, "K_d": 6}, feedforward="levi_civita"),
        reference=lc.reference("so3", ["0", "0", "t"]),
        X0=start,
        xi0=[0, 0, 0],
        t=t,
        tolerance=1e-9,
    )
    np.testing.assert_allclose(run.X[:, :9].reshape(-1, 3, 3), alone.X, atol=1e-7)
    # Both roots -1/2 +- i sqrt(3)/2; the reference starts at velocity (1/5, 1, 0), the body at rest.
    rate = -np.array([0.2, 1, 0])
    w = np.sqrt(3) / 2
    decay = np.exp(-t / 2)[:, None]
    error = decay * (np.cos(w * t)[:, None] * e + np.sin(w * t)[:, None] * (rate + e / 2) / w)
    reference = np.stack([t / 5, np.sin(t), np.ones_like(t)], axis=1)
    np.testing.assert_allclose(run.X[:, 9:] - reference, error, atol=1e-7)
