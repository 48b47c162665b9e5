"""What a notebook shows of a plan and of an average."""

from __future__ import annotations

import re
from typing import Any
from xml.etree import ElementTree

import numpy as np
import pytest
import sympy as sp

import lie_codegen as lc


def plan() -> Any:
    return lc.steer("so3", lc.build("so3").exp([0.3, -0.2, 0.5]), controls=["w1", "w2"], duration=2.0)


def test_a_plan_draws_its_controls() -> None:
    made = plan()
    text = made._repr_html_()
    words, picture = re.fullmatch(r"<pre>(.*)</pre>(<svg.*</svg>)", text, re.DOTALL).groups()  # type: ignore[union-attr]
    assert words.splitlines()[0].startswith("Plan(")
    svg = ElementTree.fromstring(picture)
    lines = svg.findall("{*}polyline")
    assert len(lines) == 2
    # the heights are the controls, up to one scale and the direction of the axis
    drawn = [[float(pair.split(",")[1]) for pair in line.attrib["points"].split()] for line in lines]
    expected = made.u(np.linspace(0, 2.0, len(drawn[0])))[:, :2]
    size = np.abs(expected).max()
    heights = np.array(drawn).T
    half = np.ptp(heights) / np.ptp(expected) * size
    np.testing.assert_allclose(65 - expected / size * half, heights, atol=0.1)
    assert f"max |u| {size:.4g}" in "".join(svg.itertext())
    assert len(text) < 20_000


@pytest.mark.parametrize("order", [1, 3])
def test_an_average_shows_its_formula(order: int) -> None:
    average = lc.average("so3", lc.PeriodicInput(["a*cos(t)", "sin(t)", "1/3"], parameters=["a"]), order)
    text = average._repr_latex_()
    assert text.startswith(r"$\displaystyle \bar u = \varepsilon")
    for q, F in enumerate(average.exact_F, start=1):
        assert sp.latex(sp.ImmutableMatrix(F)) in text
        assert (rf"\varepsilon^{{{q}}}" in text) == (q > 1)


def test_a_long_formula_stays_with_its_repr() -> None:
    names = [f"a{i}" for i in range(6)]
    u = lc.PeriodicInput([f"{name}*cos({i + 1}*t) + sin({i + 2}*t)" for i, name in enumerate(names)], parameters=names)
    assert lc.average("se3", u, 4)._repr_latex_() is None
