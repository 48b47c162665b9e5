"""A function of t that takes arrays of times is asked for many at once, also where it is then rounded otherwise; one that does not, never."""

from __future__ import annotations

import numpy as np

import lie_codegen as lc


def test_a_function_that_is_rounded_otherwise_among_others_is_asked_for_many() -> None:
    asked = []

    def u(t: np.ndarray) -> np.ndarray:
        asked.append(np.ndim(t))
        one = np.stack([np.sin(t), np.cos(t), 0.3 * np.ones_like(t)], axis=-1)
        return one if np.ndim(t) == 0 else one * (1 + 3e-16)

    found = lc.simulate("so3", u, t=[0, 2], rtol=1e-10).X[-1]
    np.testing.assert_allclose(found, lc.simulate("so3", ["sin(t)", "cos(t)", "3/10"], t=[0, 2]).X[-1], atol=1e-9)
    assert asked.count(0) == 1
    assert len(asked) < 20


def test_a_function_that_misreads_arrays_is_asked_one_by_one() -> None:
    def u(t: float | np.ndarray) -> np.ndarray:
        # of three times this gives three rows, too: the first component of all is that of the last time
        return np.stack([np.full_like(t, np.sin(np.max(t))), np.cos(t), 0.3 * np.ones_like(t)], axis=-1)

    found = lc.simulate("so3", u, t=[0, 1, 2], rtol=1e-10).X[-1]
    np.testing.assert_allclose(found, lc.simulate("so3", ["sin(t)", "cos(t)", "3/10"], t=[0, 1, 2]).X[-1], atol=1e-9)


def test_the_controls_of_an_area_rule_are_read_together() -> None:
    plan = lc.steer("so3", (0.1, 0.2, 0.3), controls=[0, 1], duration=4.0, method="area_rule")
    moments = np.linspace(0, 4, 50)
    np.testing.assert_allclose(plan.u(moments), [plan.u(float(t)) for t in moments], rtol=0, atol=1e-13)
    asked = []

    def u(t: np.ndarray) -> np.ndarray:
        asked.append(np.ndim(t))
        return plan.u(t)

    np.testing.assert_allclose(lc.simulate("so3", u, t=[0, 4], rtol=1e-10).X[-1], plan.X_final, atol=1e-8)
    assert asked.count(0) == 1
