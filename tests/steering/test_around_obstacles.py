"""method="direct" among balls and cones: ways around them, gaps that are kept; flights by scipy, quadratic programs by scipy."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.optimize import minimize

import lie_codegen as lc
from lie_codegen.steering.direct.clear_search import _proximal
from lie_codegen.steering.direct.numpy_search import Box
from lie_codegen.steering.obstacles.keep_out import KeepOut
from lie_codegen.steering.obstacles.roadmap import Space, drawn_into, ways


def flown(plan: Any, drift: Any = None) -> np.ndarray:
    """States of the plan by DOP853, piece by piece."""
    group, X, states = plan.group, np.eye(plan.group.degree), []
    d = group.degree
    for a, b in pairwise([0.0, *plan.u.breakpoints, plan.duration]):
        t = np.linspace(a, b, 9)
        run = solve_ivp(
            lambda s, x: (x.reshape(d, d) @ group.hat(plan.u(s) + (0 if drift is None else drift(s)))).ravel(),
            (a, b), X.ravel(), "DOP853", t, rtol=1e-10, atol=1e-12,
        )  # fmt: skip
        X = run.y[:, -1].reshape(d, d)
        states += [column.reshape(d, d) for column in run.y.T]
    return np.array(states)


def pierced() -> list[Any]:
    """A wall of balls at x = 2 with a hole at (0.2, 1)."""
    across = np.arange(-2.2, 2.7, 0.8)
    return [lc.Ball((2.0, y, z), 0.6) for y in across for z in across if np.hypot(y - 0.2, z - 1.0) > 1.2]


def test_gaps_change_as_their_matrices_say() -> None:
    se3, rng = lc.group("se3"), np.random.default_rng(0)
    axes = expm(lc.group("so3").hat(rng.normal(size=3)))
    keep_out = KeepOut.of(
        4,
        [
            lc.Cone((1, 2, 0), (0, 1, 1), 0.4),
            lc.Box((-1, 2, 0.5), (0.2, 0.5, 1), axes),
            lc.Ball((1, 0, 2), 0.3),
            lc.Cylinder((0, 0, 1), (1, 1, 3), 0.4),
        ],
    )
    X, eta, e = expm(se3.hat(rng.normal(size=6))), se3.hat(rng.normal(size=6)), 1e-6
    gap, N = keep_out.nearest(X, np.zeros(4), 4)
    change = (keep_out.gaps(expm(e * eta) @ X) - keep_out.gaps(expm(-e * eta) @ X)) / (2 * e)
    np.testing.assert_allclose(sorted(gap), sorted(keep_out.gaps(X)), atol=1e-14)
    np.testing.assert_allclose(sorted(np.einsum("oij,ij->o", N, eta)), sorted(change), atol=1e-8)


def test_distances_to_solids_are_those_to_points_of_their_surfaces() -> None:
    rng = np.random.default_rng(2)
    turn = expm(lc.group("so3").hat(rng.normal(size=3)))
    halves = np.array([0.3, 0.7, 1.1])
    faces = []
    for k in range(3):
        for sign in (-1, 1):
            q = rng.uniform(-halves, halves, (20_000, 3))
            q[:, k] = sign * halves[k]
            faces.append(q)
    around = rng.uniform(0, 2 * np.pi, 30_000)
    mantle = np.column_stack([0.4 * np.cos(around), 0.4 * np.sin(around), rng.uniform(-1, 1, 30_000)])
    lids = mantle * np.column_stack([np.sqrt(rng.uniform(0, 1, 30_000))] * 2 + [np.zeros(30_000)])
    lids[:, 2] = np.sign(mantle[:, 2])
    caps = rng.normal(size=(30_000, 3))
    caps *= 0.4 / np.linalg.norm(caps, axis=1)[:, None]
    caps[:, 2] += np.sign(caps[:, 2])
    center = np.array([1.0, -2.0, 0.5])
    ends = tuple(center - turn[:, 2]), tuple(center + turn[:, 2])
    X = np.tile(np.eye(4), (60, 1, 1))
    own = rng.uniform(-1.8, 1.8, (60, 3))
    X[:, :3, 3] = center + own @ turn.T
    off = np.linalg.norm(own[:, :2], axis=1)
    cases = [
        (lc.Box(center, halves, turn), np.concatenate(faces), np.all(np.abs(own) < halves, axis=1)),
        (lc.Cylinder(*ends, 0.4), np.concatenate([mantle, lids]), (off < 0.4) & (np.abs(own[:, 2]) < 1)),
        (
            lc.Cylinder(*ends, 0.4, rounded=True),
            np.concatenate([mantle, caps]),
            np.hypot(off, np.maximum(np.abs(own[:, 2]) - 1, 0)) < 0.4,
        ),
    ]
    for solid, surface, inside in cases:
        far = np.min(np.linalg.norm(own[:, None] - surface, axis=2), axis=1)
        np.testing.assert_allclose(solid.clearance(X), np.where(inside, -far, far), atol=0.03)
        assert 0 < np.sum(inside) < 60


def test_a_thin_wall_is_gone_around_and_not_jumped_through() -> None:
    goal = np.eye(3)
    goal[0, 2] = 4
    wall = lc.Box((2.0, 0.3), (0.1, 1.0))
    plan = lc.steer("se2", goal, ("omega", "vx"), 6.0, method="direct", obstacles=[wall])
    X = flown(plan)
    np.testing.assert_allclose(X[-1], goal, atol=1e-7)
    assert np.min(wall.clearance(X)) > -1e-7
    assert plan.cost < 4.1
    seen = lc.steer("se2", X[10], ("omega", "vx"), 0.5, start=X[0], obstacles=[wall])
    assert seen.error < 1e-6


def test_least_time_around_a_disc_is_little_more_than_the_shortest_way() -> None:
    """The way of a taut string: two tangents and an arc of the disc; a car of unit speed has to turn at both ends as well."""
    goal, disc = np.eye(3), lc.Ball((2.0, 0.1), 0.8)
    goal[0, 2] = 4
    plan = lc.steer(
        "se2", goal, ("omega",), 6.0, method="direct", objective="time", drift=(0, 1, 0), bounds=1, obstacles=[disc]
    )
    away = np.hypot(2, 0.1)
    string = 2 * np.sqrt(away**2 - 0.64) + 0.8 * (np.pi - 2 * np.arctan(0.05) - 2 * np.arccos(0.8 / away))
    assert string <= plan.duration <= 1.02 * string
    X = flown(plan, lambda s: np.array([0, 1.0, 0]))
    np.testing.assert_allclose(X[-1], goal, atol=1e-6)
    assert np.min(disc.clearance(X)) > -1e-6
    assert max(plan.details["control_peaks"]) <= 1


@pytest.mark.slow
def test_least_fuel_around_a_disc_takes_less_than_least_energy_does() -> None:
    goal, disc = np.eye(3), lc.Ball((2.0, 0.1), 0.8)
    goal[0, 2] = 4
    energy, fuel = (
        lc.steer("se2", goal, ("omega", "vx"), 6.0, method="direct", objective=what, bounds=1, obstacles=[disc])
        for what in ("energy", "fuel")
    )
    t = np.linspace(0, 6, 6001)
    assert fuel.cost < np.mean(np.sum(np.abs(energy.inputs(t)), axis=1)) * 6 - 0.01
    X = flown(fuel)
    np.testing.assert_allclose(X[-1], goal, atol=1e-6)
    assert np.min(disc.clearance(X)) > -1e-6


def test_a_step_is_that_of_the_quadratic_program() -> None:
    rng = np.random.default_rng(1)
    box = Box(-np.full(8, 0.7), np.full(8, 0.7), rng.uniform(0.5, 2, 8), np.ones(8))
    u, J, A = rng.uniform(-0.5, 0.5, 8), rng.normal(size=(2, 8)), rng.normal(size=(5, 8))
    r, gap, rho = 0.1 * rng.normal(size=2), rng.uniform(-0.1, 0.2, 5), 0.3
    v = _proximal(box, False, u, r, J, gap, A, rho)
    found = minimize(
        lambda v: 0.5 * np.sum(box.weight * v**2) + rho / 2 * np.sum((v - u) ** 2), u, method="SLSQP",
        bounds=[(-0.7, 0.7)] * 8, options={"ftol": 1e-14, "maxiter": 500},
        constraints=[{"type": "eq", "fun": lambda v: J @ (v - u) + r}, {"type": "ineq", "fun": lambda v: gap + A @ (v - u)}],
    )  # fmt: skip
    assert found.success
    np.testing.assert_allclose(v, found.x, atol=1e-5)


def test_ways_lead_through_a_hole_first_and_around_a_column_on_both_sides() -> None:
    goal = np.eye(4)
    goal[0, 3] = 4
    through = ways(Space.between(KeepOut.of(4, pierced()), np.eye(4), goal), 2)
    nearest = through[0].p[np.argmin(np.abs(through[0].p[:, 0] - 2))]
    assert np.linalg.norm(nearest[1:] - [0.2, 1.0]) < 1.1
    assert np.sum(np.linalg.norm(np.diff(through[0].p, axis=0), axis=1)) < 4.4
    column = [lc.Ball((2.0, 0.0, z), 0.5) for z in np.arange(-6, 6.1, 0.4)]
    space = Space.between(KeepOut.of(4, column), np.eye(4), goal)
    two = ways(space, 2)
    assert sorted(np.sign(way.p[64, 1]) for way in two) == [-1, 1]
    assert not drawn_into(space, *two)
    for way in two:
        assert np.min(KeepOut.of(4, column).gaps(space.states(way))) > 0


@pytest.mark.slow
def test_a_pointing_stays_out_of_a_cone_and_both_ways_around_it_are_told() -> None:
    so3 = lc.group("so3")
    target, cone = expm(so3.hat([0, 0, 2.5])), lc.Cone((1, 0, 0), (np.cos(1.2), np.sin(1.2), 0), 0.4)
    plan = lc.steer(so3, target, ("w1", "w2", "w3"), 2.0, method="direct", obstacles=[cone])
    assert (plan.method, plan.status.name) == ("direct", "LOCAL")
    X = flown(plan)
    np.testing.assert_allclose(X[-1], target, atol=1e-7)
    assert np.min(cone.clearance(X)) > -1e-7
    assert plan.cost == pytest.approx(3.40997, rel=1e-3)  # the transcription's on 64 intervals
    costs = [each["cost"] for each in plan.details["classes"]]
    assert len(costs) == 2
    assert costs[1] == pytest.approx(costs[0], rel=1e-3)  # mirror images


def test_vectors_as_controls_and_a_drift_of_time_go_around_a_disc() -> None:
    se2, goal = lc.group("se2"), np.eye(3)
    goal[0, 2] = 4
    disc = lc.Ball((2.0, 0.1), 0.8)
    options: dict[str, Any] = {"drift": ("0", "0", "0.1*sin(t)"), "bounds": 2, "obstacles": [disc]}
    plan = lc.steer(se2, goal, ((1, 0, 0), (0.2, 1, 0)), 10.0, classes=0, starts=2, **options)
    X = flown(plan, lambda s: np.array([0, 0, 0.1 * np.sin(s)]))
    np.testing.assert_allclose(X[-1], goal, atol=1e-7)
    assert np.min(disc.clearance(X)) > -1e-7
    assert max(plan.details["control_peaks"]) <= 2


def test_what_the_direct_method_has_not_among_obstacles_is_refused() -> None:
    se2 = lc.group("se2")
    given: dict[str, Any] = {"method": "direct", "obstacles": [lc.Ball((2.0, 0.0), 0.5)]}
    for more in ({"pieces": 20}, {"objective": "time"}):
        with pytest.raises(lc.errors.SteeringInputError, match="obstacles"):
            lc.steer(se2, (0, 4.0, 0), ("omega", "vx"), 4.0, **given, **more)
    with pytest.raises(lc.errors.InfeasibleError, match="target itself is inside obstacle 1") as refused:
        lc.steer(se2, (0, 2.1, 0), ("omega", "vx"), 4.0, **given)
    assert refused.value.certificate.place == "target"
    assert refused.value.certificate.clearance == pytest.approx(0.1**2 - 0.5**2)


@pytest.mark.slow
def test_a_hole_in_a_wall_of_balls_is_flown_through() -> None:
    se3, goal = lc.group("se3"), np.eye(4)
    goal[0, 3] = 4
    plan = lc.steer(se3, goal, ("w1", "w2", "w3", "v1"), 4.0, obstacles=pierced())
    X = flown(plan)
    np.testing.assert_allclose(X[-1], goal, atol=1e-7)
    assert min(np.min(each.clearance(X)) for each in pierced()) > -1e-6
    assert plan.cost < 5.5


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(6))
def test_scenes_that_random_controls_have_passed_are_passed(seed: int) -> None:
    rng = np.random.default_rng(seed)
    if seed % 2:
        group, controls = lc.group("se3"), ["w1", "w2", "w3", "v1"]
    else:
        group, controls = lc.group("so3"), ["w1", "w2"]
    places = [group.labels.index(label) for label in controls]
    X, states = np.eye(group.degree), []
    mean = rng.uniform(-1, 1, len(controls))
    for _ in range(4):
        u = np.zeros(group.dim)
        u[places] = mean + rng.uniform(-1, 1, len(controls))
        for _ in range(20):
            X = X @ expm(0.025 * group.hat(u))
            states.append(X)
    way = np.array([np.eye(group.degree), *states])
    obstacles: list[Any] = []
    while len(obstacles) < 5:
        middle = way[rng.integers(10, 70)]
        if seed % 2:
            size = rng.uniform(0.05, 0.2)
            made: Any = lc.Ball(tuple(middle[:3, 3] + rng.normal(size=3) * 0.25), size)
        else:
            made = lc.Cone((1, 0, 0), tuple(middle[:, 0] + rng.normal(size=3) * 0.5), rng.uniform(0.1, 0.4))
        if np.min(made.clearance(way)) > 0.01:
            obstacles.append(made)
    plan, again = (lc.steer(group, X, controls, 2.0, bounds=2.5, obstacles=obstacles) for _ in range(2))
    assert again.cost == plan.cost
    flight = flown(plan)
    np.testing.assert_allclose(flight[-1], X, atol=1e-6)
    assert min(np.min(each.clearance(flight)) for each in obstacles) > -1e-6
