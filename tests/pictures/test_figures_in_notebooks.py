"""Figures without a path are values that a notebook's own display machinery shows as pictures."""

from __future__ import annotations

import pickle
from pathlib import Path

import numpy as np
import pytest

import lie_codegen as lc

pytest.importorskip("matplotlib")


def test_figures_are_shown_by_a_notebook_and_written_as_before(tmp_path: Path) -> None:
    plan = lc.steer("so3", (0.5, -0.3, 0.9), ("w1", "w2"), 4.0)
    run = lc.closed_loop(
        law=lc.attitude_law("pd", inertia=[1.0, 2.0, 2.5], k_p=4, k_d=6),
        X0=plan.X(1.0),
        t=np.linspace(0, 4, 21),
    )
    figures = {"plan": lc.plot_plan(plan, compare=False), "loops": lc.plot_loops(run)}
    for name, figure in figures.items():
        shown = pickle.loads(pickle.dumps(figure))._repr_png_()
        assert shown.startswith(b"\x89PNG"), name
        assert len(shown) > 5000, name
    written = lc.plot_loops(run, tmp_path / "new" / "loops.PNG")
    assert written.read_bytes().startswith(b"\x89PNG")


def test_a_notebook_finds_the_picture_without_pyplot() -> None:
    """IPython's own formatter, which knows nothing of matplotlib until pyplot is imported."""
    formatters = pytest.importorskip("IPython.core.formatters")
    figure = lc.plot_plan(lc.steer("so3", (0.5, -0.3, 0.9), ("w1", "w2"), 4.0), compare=False)
    data, _ = formatters.DisplayFormatter().format(figure)
    assert data["image/png"].startswith(b"\x89PNG")
