"""The benchmark of derivatives: ours is right to rounding on it, and it sees the errors it is made to see."""

from __future__ import annotations

import json
from pathlib import Path

import casadi as ca
import numpy as np
import pytest

from lie_codegen.gallery import derivative_errors as study
from lie_codegen.gallery.hessian_errors import hessian_errors


@pytest.mark.parametrize("function", study.FUNCTIONS)
def test_ours_is_right_to_rounding(function: str) -> None:
    derivatives = study.ours(function)
    for angle in (0.0, 1e-6, 1.0, 3.0):
        assert max(study.errors(derivatives, study.place(function, angle))) < 1e-15, angle


def test_a_wrong_third_term_of_the_series_shows_in_the_second_derivative_alone() -> None:
    """I + W + c W^2 with c = 0.45 for 1/2, at the identity."""
    w, u, v = (ca.SX.sym(letter, 3) for letter in "wuv")
    value = ca.vec((ca.DM.eye(3) + ca.skew(w) + 0.45 * ca.mpower(ca.skew(w), 2)).T)
    first = ca.jtimes(value, w, u)
    wrong = ca.Function("wrong", [w, u, v], [value, first, ca.jtimes(first, w, v)])
    f, Df, D2f = study.errors(lambda *x: [np.array(part) for part in wrong(*x)], study.place("exp of SO(3)", 0.0))
    assert max(f, Df) < 1e-15
    assert D2f == pytest.approx(0.1, rel=0.3)


def test_a_library_that_gives_nan_is_not_right() -> None:
    at = study.place("log of SO(3)", 0.5)
    row = study.errors(lambda x, u, v: [np.full(3, np.nan)] * 3, at)
    assert np.all(np.isnan(row))


def test_the_page_names_a_neighbour_that_is_missing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(function: str) -> study.Derivatives:
        raise ImportError("not there")

    monkeypatch.setattr(study, "ANGLES", (0.0, 1.0))
    monkeypatch.setattr(study, "jaxlie", missing)
    monkeypatch.setattr(study, "liecasadi", missing)
    result = hessian_errors(tmp_path)
    numbers = json.loads((tmp_path / "hessian_errors.json").read_text())
    assert numbers["libraries"]["jaxlie"] == numbers["libraries"]["liecasadi"] == "not installed"
    assert max(numbers["worst relative error"]["lie_codegen"]["exp of SE(3)"].values()) < 1e-15
    assert result.picture.stat().st_size > 10_000
