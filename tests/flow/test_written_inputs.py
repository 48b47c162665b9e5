"""Formulas of t are taken wherever inputs are: as texts, beside numbers, in an array of texts."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import lie_codegen as lc
from lie_codegen.errors import ExpressionError, InputError, ShapeError

SO3 = lc.group("so3")
WRITTEN: tuple[Any, ...] = (
    ["sin(t)", "0", "1/2"],
    ["sin(t)", 0, 0.5],
    ("sin(t)", np.int64(0), np.float64(0.5)),
    np.array(["sin(t)", "0", "0.5"]),
    np.array(["sin(t)", 0, 0.5], dtype=object),
)


def end(duration: float) -> np.ndarray:
    def rate(t: float, y: np.ndarray) -> np.ndarray:
        return np.asarray((y.reshape(3, 3) @ SO3.hat([np.sin(t), 0, 0.5])).ravel())

    run = solve_ivp(rate, (0, duration), np.eye(3).ravel(), method="DOP853", rtol=1e-12, atol=1e-13)
    return np.asarray(run.y[:, -1].reshape(3, 3))


@pytest.mark.parametrize("u", WRITTEN, ids=range(len(WRITTEN)))
def test_texts_and_numbers_are_formulas(u: Any) -> None:
    assert np.max(np.abs(lc.simulate(SO3, u, t=[0, 1.5]).X[-1] - end(1.5))) < 1e-11
    made = lc.propagator(SO3, u, duration=1.5)
    assert np.max(np.abs(made().X - end(1.5))) < 1e-11
    assert made.parameters == ()


def test_a_propagator_refuses_what_is_no_input_before_it_is_run() -> None:
    for u, error, words in (
        (["a*t", 0, 0], ExpressionError, "no name 'a'"),
        (["t", 0], ShapeError, "2 components"),
        (lambda t: [np.sin(t), 0], ShapeError, "must be"),
        (np.ones((4, 3)), ShapeError, "shape"),
        (object(), InputError, "must be real numbers, formulas of t or a function"),
    ):
        with pytest.raises(error, match=words):
            lc.propagator(SO3, u, duration=1.0)


def test_averages_take_a_list_of_formulas() -> None:
    texts = ["sin(t)", 0, "cos(t)"]
    u = lc.PeriodicInput(texts)
    assert lc.average(SO3, texts, order=3) == lc.average(SO3, u, order=3)
    assert lc.areas(texts) == lc.areas(u)
    assert lc.moments(texts) == lc.moments(u)
    assert lc.magnus(SO3, texts, 3) == lc.magnus(SO3, u, 3)
    assert lc.convergence(SO3, texts, 0.1) == lc.convergence(SO3, u, 0.1)
    assert lc.bracket_table(["cos(t)", "sin(t)"]) == lc.bracket_table(lc.PeriodicInput(["cos(t)", "sin(t)"]))
    with pytest.raises(InputError, match="give a PeriodicInput, or a list of formulas"):
        lc.average(SO3, "sin(t)")
