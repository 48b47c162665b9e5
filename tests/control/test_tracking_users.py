"""From definition to a converging loop: a user's group file, a user's pair, the front door; families of groups; linearisation."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.linalg import expm

import lie_codegen as lc
from lie_codegen.control.closed_loop import closed_loop
from lie_codegen.control.compatibility import compatibility
from lie_codegen.control.linearisation import linear_loop, rigid_gains
from lie_codegen.errors import IncompatibleError, InputError
from lie_codegen.mechanics.states import initial_states, split_states
from lie_codegen.mechanics.variational_step import variational_step
from lie_codegen.runtime.build import build_kernels
from lie_codegen.vehicles.potential import Potential, damping_force

#: Rotations and dilations of the plane with translations: SIM(2), which is in no catalogue.
SIM2 = """
name = "sim2"
description = "similarities of the plane"
labels = ["w", "s", "x", "y"]
units = ["rad", "", "m", "m"]

[matrices]
w = [[0, -1, 0], [1, 0, 0], [0, 0, 0]]
s = [[1, 0, 0], [0, 1, 0], [0, 0, 0]]
x = [[0, 0, 1], [0, 0, 0], [0, 0, 0]]
y = [[0, 0, 0], [0, 0, 1], [0, 0, 0]]
"""


def test_a_pair_of_ones_own_on_a_group_file_is_checked_compiled_and_converges(tmp_path: Path) -> None:
    path = tmp_path / "sim2.toml"
    path.write_text(SIM2)
    sim2 = lc.group(path)
    pair = lc.error_function(sim2, "norm2(Xd^-1*X - 1)/2 + norm2(X^-1*Xd - 1)*k/2", "right", parameters={"k": "1/4"})
    found = compatibility(pair)
    assert (found.compatible, found.exact, found.residual) == (True, True, 0.0)
    law = lc.tracking_law(sim2, inertia=[2, 1, 3, 4], error=pair, gains={"K_d": 3}, feedforward="levi_civita")
    lib = lc.build(law)
    eye, zero = np.eye(3), np.zeros(4)
    assert lib.tracking_law(eye, zero, eye, zero, zero).W == 0
    reference = lc.reference(sim2, ["t/2", "sin(t)/4", "cos(t)", "t/5"])
    run = lc.closed_loop(
        sim2, inertia=[2, 1, 3, 4], law=law, reference=reference, X0=expm(sim2.hat([0.8, -0.3, 2, -0.5])),
        t=np.linspace(0, 25, 51), tolerance=1e-8,
    )  # fmt: skip
    assert run.outputs["W"][-1] < 1e-5 * run.outputs["W"][0]
    assert np.all(np.diff(run.outputs["W"]) < 1e-12)
    with pytest.raises(IncompatibleError, match="are not compatible"):
        lc.tracking_law(sim2, inertia=1, error=("norm2(Xd^-1*X - 1)/2", "left"), gains={"K_d": 1})


@pytest.mark.parametrize("name", sorted(lc.group_names()))
def test_the_error_function_of_every_group_is_compatible(name: str) -> None:
    group = lc.group(name)
    if group.dim > 10:
        pytest.skip("large groups are checked by their smaller relatives")
    pair = lc.error_function(group, "norm2(Xd^-1*X - 1)/2", "right")
    found = compatibility(pair)
    assert found.compatible
    assert found.positive


def test_formulas_that_are_not_polynomial_are_checked_in_fifty_digits() -> None:
    so3 = lc.group("so3")
    found = compatibility(lc.error_function(so3, "exp(tr(1 - Xd'*X)) - 1", "right"))
    assert (found.compatible, found.exact) == (True, False)
    wrong = compatibility(
        lc.error_function(so3, "exp(tr(K*(1 - Xd'*X))) - 1", "left", parameters={"K": np.diag([1.0, 2, 3])})
    )
    assert not wrong.compatible


def test_what_was_found_of_a_pair_is_recalled_from_its_record(monkeypatch: pytest.MonkeyPatch) -> None:
    pairs = [
        lc.error_function("so3", f"exp(tr(1 - {product})) - 1", "right") for product in ("Xd'*X", "Xd'*X", "Xd^-1*X")
    ]
    found = compatibility(pairs[0], seed=7)
    monkeypatch.setattr("lie_codegen.control.compatibility._residual", None)
    assert compatibility(pairs[1], seed=7) == found
    for another, seed in ((pairs[1], 8), (pairs[2], 7)):
        with pytest.raises(TypeError):
            compatibility(another, seed)


def test_waypoints_through_the_front_door() -> None:
    se3 = lc.group("se3")
    points = [np.eye(4), expm(se3.hat([0.3, 0, 0.5, 1, 0, 0])), expm(se3.hat([0, 0.2, 1, 1, 1, 0.5]))]
    reference = lc.reference(se3, times=[0, 4, 8], waypoints=points)
    law = lc.tracking_law(
        se3, inertia=[2, 3, 4, 5, 6, 8], error="se3_1",
        gains=rigid_gains(se3, [2, 3, 4, 5, 6, 8], bandwidth=3, damping=1),
    )  # fmt: skip
    run = lc.closed_loop(
        se3, inertia=[2, 3, 4, 5, 6, 8], law=law, reference=reference, X0=expm(se3.hat([0.2, 0.1, 0, 0.3, 0, 0])),
        t=np.linspace(0, 10, 41), tolerance=1e-7,
    )  # fmt: skip
    np.testing.assert_allclose(run.X[-1], points[-1], atol=1e-3)
    with pytest.raises(InputError, match="by formulas, by a plan, or by times and waypoints"):
        lc.reference(se3)


@pytest.mark.parametrize("name", ["so3", "se3"])
def test_gains_place_every_mode_where_they_say(name: str) -> None:
    group = lc.group(name)
    inertia = [2, 3, 4, 5, 6, 8][: group.dim]
    gains = rigid_gains(group, inertia, bandwidth=2.5, damping=0.6)
    loop = linear_loop(group, inertia=inertia, error="so3_right" if name == "so3" else "se3_2", gains=gains)
    np.testing.assert_allclose(loop.frequencies, 2.5, rtol=1e-9)
    np.testing.assert_allclose(loop.damping, 0.6, rtol=1e-9)


def test_the_linearisation_is_that_of_the_law() -> None:
    """Eigenvalues against differences of the compiled law itself, row 4 with coupled inertia."""
    se3 = lc.group("se3")
    inertia = np.diag([2.0, 3, 4, 5, 6, 8]) + 0.2 * (np.eye(6, k=3) + np.eye(6, k=-3))
    gains = {"K_1": [4, 5, 6], "K_2": [3, 4, 5], "K_d": 2}
    law = build_kernels(
        lambda: [lc.tracking_law(se3, inertia=inertia, error="se3_4", gains=gains)], namespace="se3"
    ).tracking_law
    eye, zero, h = np.eye(4), np.zeros(6), 1e-5
    stiff = np.array(
        [
            law(expm(h * se3.hat(e)), zero, eye, zero, zero).force
            - law(expm(-h * se3.hat(e)), zero, eye, zero, zero).force
            for e in np.eye(6)
        ]
    ).T / (-2 * h)
    loop = linear_loop(se3, inertia=inertia, error="se3_4", gains=gains)
    np.testing.assert_allclose(loop.stiffness, stiff, atol=1e-7)


def test_a_potential_gives_its_force_and_energy_is_kept() -> None:
    so3 = lc.group("so3")
    heavy = Potential(so3, "m*X33", {"m": 3})
    inertia = np.diag([3.0, 2, 2])
    t = np.linspace(0, 5, 51)
    X0 = expm(so3.hat([0.3, 0.5, 0.1]))
    run = closed_loop(so3, inertia=inertia, external=heavy.force, X0=X0, xi0=[0.1, 0.2, 2.0], t=t, tolerance=1e-11)
    energy = np.einsum("ki,ij,kj->k", run.xi, inertia, run.xi) / 2 + 3 * run.X[:, 2, 2]
    assert np.ptp(energy) < 1e-9
    lib = build_kernels(lambda: [variational_step(so3, inertia, heavy)], namespace="so3")
    states = lib.variational_step.scan(
        initial_states(so3, X0, inertia @ [0.1, 0.2, 2.0])[0][0], n=10_000, every=10_000, h=5e-4
    )
    np.testing.assert_allclose(split_states(so3, states)[0][-1], run.X[-1], atol=1e-5)
    slowed = closed_loop(so3, inertia=inertia, external=damping_force(so3, 1), xi0=[0, 0, 1], t=t)
    np.testing.assert_allclose(slowed.xi[:, 2], np.exp(-t / 2), atol=1e-9)
    with pytest.raises(InputError, match="depends on X alone"):
        Potential(so3, "tr(Xd'*X)")
