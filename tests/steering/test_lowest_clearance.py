"""The least clearance between looks, and plans that go by edges of boxes."""

from __future__ import annotations

import numpy as np

import lie_codegen as lc
from lie_codegen.arrays import Array
from lie_codegen.steering.obstacles.lowest import lowest


def straight(p: Array) -> Array:
    X = np.tile(np.eye(3), (len(p), 1, 1))
    X[:, :2, 2] = p
    return X


def test_an_edge_between_two_looks_is_seen_as_deep_as_it_is() -> None:
    """A straight way cuts the corner (0, 0) of a box at 45 degrees: in its middle c / 2 from both faces."""
    box, c = lc.Box((1.0, -1.0), (1.0, 1.0)), 0.01
    # the way x - y = c with p(s) = (s, s - c), looks 0.04 apart that straddle the corner: inside where s > 0 and s - c < 0
    for shift in np.linspace(0.0, 0.04, 9):
        s = np.arange(-0.4, 0.4, 0.04) + shift
        way = straight(np.column_stack([s, s - c]))
        assert abs(lowest(box.clearance, way) + c / 2) < 1e-8
    ball = lc.Ball((0.0, 0.0), 1.0)
    s = np.arange(-1.0, 1.0, 0.13)
    assert abs(lowest(ball.clearance, straight(np.column_stack([s, 1.02 + 0 * s]))) - (1.02**2 - 1)) < 1e-8


def test_an_edge_in_the_first_step_is_seen() -> None:
    box, c, s = lc.Box((1.0, -1.0), (1.0, 1.0)), 0.01, 0.04 * np.arange(5)
    assert abs(lowest(box.clearance, straight(np.column_stack([s - 1e-3, s - 1e-3 - c]))) + c / 2) < 1e-8


def test_two_looks_are_no_parabola() -> None:
    ball = lc.Ball((0.0, 0.0), 1.0)
    s = np.array([3.0, 2.0])
    assert lowest(ball.clearance, straight(np.column_stack([s, 0 * s]))) == 3.0
