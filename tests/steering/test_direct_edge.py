"""Targets at the edge of what bounded controls can reach: bang-bang controls made them, and next to no others reach them."""

from __future__ import annotations

from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from scipy.linalg import expm

import lie_codegen as lc


@pytest.mark.parametrize(
    ("name", "controls", "drift"),
    [("se2", ("omega",), (0, 1, 0)), ("su2", ("sx",), (0, 0, 1)), ("h3", ("x", "y"), None)],
)
def test_targets_of_bang_bang_controls_are_reached(name: str, controls: tuple[str, ...], drift: Any) -> None:
    group, rng = lc.group(name), np.random.default_rng(7)
    free = np.zeros(3) if drift is None else np.array(drift, dtype=float)
    columns = np.eye(3)[[group.labels.index(label) for label in controls]]
    options = {} if drift is None else {"drift": drift}
    winners = []
    for _ in range(3):
        signs = np.ones((2, len(controls)))
        signs[1, 0] = -1.0  # one of them switches once
        lengths = 5.0 * rng.dirichlet(np.ones(2))
        X = np.eye(group.degree, dtype=group.basis.dtype)
        for u, length in zip(signs, lengths, strict=True):
            X = X @ expm(group.hat(length * (free + u @ columns)))
        plan = lc.steer(group, X, controls, 5.0, bounds=1, **options)
        winners.append(plan.details["winner"])
        knots = np.concatenate([[0.0], plan.u.breakpoints, [5.0]])
        end = np.eye(group.degree, dtype=group.basis.dtype)
        steady = plan.details["pieces"]
        if winners[-1] == "direct, arcs with free ends":
            for a, b in pairwise(knots):
                end = end @ expm(group.hat((b - a) * (free + steady((a + b) / 2) @ columns)))
            np.testing.assert_allclose(end, X, atol=1e-8)
        assert plan.error < 1e-6
        assert np.max(np.abs(plan.inputs(np.linspace(0, 5, 501)))) <= 1 + 1e-9
    assert "direct, arcs with free ends" in winners


def test_beyond_the_edge_nothing_is_found() -> None:
    """A car that cannot stop is back one metre ahead after one second, or after a whole turn: not after three."""
    X = np.eye(3)
    X[0, 2] = 1.0
    with pytest.raises(lc.errors.SteeringError, match="proves nothing"):
        lc.steer("se2", X, ("omega",), 3.0, drift=(0, 1, 0), bounds=1, rounds=1)


@pytest.mark.parametrize(
    ("name", "control", "drift", "word", "lengths"),
    [
        ("se2", "omega", (0, 1, 0), (0, -1), (3.15643284, 1.84356716)),
        ("se2", "omega", (0, 1, 0), (1, 0, 1), (1.8, 1.96, 1.24)),
        ("se2", "omega", (0, 1, 0), (1, 0, -1), (2.4, 2.55, 0.05)),
        ("se2", "omega", (0, 1, 0), (0, 1), (0.049, 4.951)),
        ("so3", "w1", (0, 0, 1), (0, 1, 0), (0.9, 2.57, 1.53)),
    ],
)
def test_shortest_ways_with_straight_arcs_are_reached_in_just_their_time(
    name: str, control: str, drift: tuple[float, ...], word: tuple[int, ...], lengths: tuple[float, ...]
) -> None:
    """On a straight arc the end changes with the square of what the control does: equal pieces come near and no nearer."""
    group = lc.group(name)
    column = np.eye(3)[group.labels.index(control)]
    X = np.eye(3)
    for u, length in zip(word, lengths, strict=True):
        X = X @ expm(group.hat(length * (np.array(drift) + u * column)))
    plan = lc.steer(group, X, (control,), float(np.sum(lengths)), drift=drift, bounds=1)
    assert plan.error < 1e-8
    turned = sum(length for u, length in zip(word, lengths, strict=True) if u)
    assert plan.cost <= turned * (1 + 1e-6)
    assert np.max(np.abs(plan.inputs(np.linspace(0, plan.duration, 501)))) <= 1 + 1e-9


@pytest.mark.parametrize(
    ("name", "controls", "drift", "word", "lengths"),
    [
        ("sl2", ("e", "f"), None, ((1, -1), (1, 1), (1, -1)), (0.068702770, 0.024446284, 1.406850946)),
        ("se2", ("omega",), (0, 1, 0), ((1,), (-1,), (1,)), (0.749071963, 0.044601187, 4.20632685)),
        (
            "su3",
            ("l1", "l4", "l6"),
            None,
            ((-1, 1, 1), (-1, -1, -1), (1, -1, -1), (-1, -1, 1)),
            (0.069033935, 1.963180075, 0.022570190, 0.9452158),
        ),
        # what happens within one piece: a moment at the other bound; after another control has switched; and three controls there
        (
            "su3",
            ("l1", "l4", "l6"),
            None,
            ((1, -1, -1), (1, -1, 1), (-1, -1, 1), (1, -1, 1)),
            (1.908564, 1.227635, 0.007615, 0.879904),
        ),
        ("su3", ("l1", "l4", "l6"), None, ((1, -1, 1), (1, 1, -1), (1, 1, 1)), (3.232103, 0.009158, 0.653891)),
        (
            "su3",
            ("l1", "l4", "l6"),
            None,
            ((-1, 1, 1), (1, 1, -1), (-1, 1, -1), (1, -1, -1)),
            (0.396283, 1.543887, 0.01736, 1.048657),
        ),
    ],
)
def test_arcs_shorter_than_a_piece_are_found_by_narrowing_the_bounds(
    name: str, controls: tuple[str, ...], drift: Any, word: tuple[tuple[int, ...], ...], lengths: tuple[float, ...]
) -> None:
    """No equal pieces have such an arc, and its mean over a piece hides it."""
    group = lc.group(name)
    columns = np.eye(group.dim)[[group.labels.index(label) for label in controls]]
    free = np.zeros(group.dim) if drift is None else np.array(drift, dtype=float)
    X = np.eye(group.degree, dtype=group.basis.dtype)
    for u, length in zip(word, lengths, strict=True):
        X = X @ expm(group.hat(length * (free + np.array(u) @ columns)))
    options = {} if drift is None else {"drift": drift}
    plan = lc.steer(group, X, controls, float(np.sum(lengths)), bounds=1, **options)
    assert plan.error < 1e-8
    assert np.max(np.abs(plan.inputs(np.linspace(0, plan.duration, 2001)))) <= 1 + 1e-9
    if plan.details["winner"] == "direct, arcs with free ends":
        knots = np.concatenate([[0.0], plan.u.breakpoints, [plan.duration]])
        end = np.eye(group.degree, dtype=group.basis.dtype)
        for a, b in pairwise(knots):
            end = end @ expm(group.hat((b - a) * (free + plan.inputs((a + b) / 2) @ columns)))
        np.testing.assert_allclose(end, X, atol=1e-8)
