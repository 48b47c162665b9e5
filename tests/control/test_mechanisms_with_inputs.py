"""Loops of a manipulator whose law takes numbers of the mechanism as inputs: the plant is that of the numbers given."""

from __future__ import annotations

import numpy as np
import pytest

import lie_codegen as lc
from lie_codegen.errors import InputError

ARM = [["m + 1", "cos(q1)/4"], ["cos(q1)/4", "m*q1^2 + 1"]]


def loop(parameters, K_p=2, **how):
    law = lc.manipulator_law(ARM, K_p=K_p, K_d=3, potential="m*g*sin(q1)", parameters=parameters)
    reference = lc.reference(lc.manifold(2), ["0.1*cos(t)", "0.2"])
    return lc.closed_loop(law=law, reference=reference, X0=[0.3, 0.2], xi0=[0, 0], t=np.linspace(0, 3, 4), **how)


def test_the_plant_is_that_of_the_numbers_given():
    known = loop({"m": 2, "g": 9.75})
    for parameters, how in (
        ({"m": "input", "g": 9.75}, {"gains": {"m": 2.0}}),
        ({"m": "input", "g": "input"}, {"gains": {"m": 2.0, "g": 9.75}}),
    ):
        run = loop(parameters, **how)
        np.testing.assert_allclose(run.X, known.X, atol=1e-9)
        np.testing.assert_allclose(run.xi, known.xi, atol=1e-9)
    both = loop({"m": "input", "g": 9.75}, "input", gains={"m": 2.0, "K_p": 2 * np.eye(2)})
    np.testing.assert_allclose(both.X, known.X, atol=1e-9)
    other = loop({"m": "input", "g": 9.75}, gains={"m": 3.0})
    assert np.abs(other.X - known.X).max() > 1e-4


def test_numbers_that_are_missing_or_many():
    for how in ({}, {"gains": {}}, {"gains": {"m": [2.0, 3.0]}}):
        with pytest.raises(InputError, match="m of the mechanism is an input of its law"):
            loop({"m": "input", "g": 9.75}, **how)
