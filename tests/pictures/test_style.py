"""Figures of the gallery: one style that leaves the caller's settings alone, three formats, frames evenly along a path."""

from __future__ import annotations

import json
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import numpy as np
import pytest
from command_line import run

import lie_codegen as lc

matplotlib = pytest.importorskip("matplotlib")


def test_a_figure_in_every_format_and_again_the_same(tmp_path: Path) -> None:
    from lie_codegen.gallery.registry import reproduce

    before = dict(matplotlib.rcParams)
    results = [reproduce("tracking_sphere", tmp_path / k, lambda line: None, ("png", "svg", "pdf")) for k in "ab"]
    assert dict(matplotlib.rcParams) == before
    for ending in ("png", "svg", "pdf", "json"):
        first, second = (result.picture.with_suffix(f".{ending}").read_bytes() for result in results)
        assert first == second, ending
    assert ElementTree.parse(results[0].picture.with_suffix(".svg")).getroot().tag.endswith("svg")
    assert results[0].picture.with_suffix(".pdf").read_bytes().startswith(b"%PDF")
    assert results[0].write("svg").name == "tracking_sphere.svg"
    with pytest.raises(lc.errors.InputError, match="png, svg, pdf"):
        results[0].write("bmp")


def test_the_command_writes_the_formats_asked(tmp_path: Path) -> None:
    done = run("reproduce", "tracking_sphere", "--format", "svg, pdf", "--out", "shown", "--json", cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    assert [Path(path).suffix for path in found["files"]] == [".png", ".svg", ".pdf"]
    assert all(Path(path).stat().st_size > 10_000 for path in found["files"])
    assert found["picture"] == found["files"][0]
    done = run("reproduce", "tracking_sphere", "--format", "jpeg", "--out", "none", cwd=tmp_path)
    assert done.returncode == 2
    assert "jpeg" in done.stderr
    assert not (tmp_path / "none").exists()


def test_panels_have_the_grid_and_no_frame_above_and_right() -> None:
    from lie_codegen.pictures.result import new_figure
    from lie_codegen.pictures.style import caption, style

    with style():
        figure = new_figure(4, 3)
        axes = figure.subplots()
        caption(figure, "what is seen")
    assert [side for side, spine in axes.spines.items() if not spine.get_visible()] == ["right", "top"]
    assert all(line.get_visible() for line in axes.get_xgridlines())
    assert figure.get_supxlabel() == "what is seen"


def test_frames_lie_evenly_along_a_path_however_it_is_run_through() -> None:
    """A straight way of 1.5 m run through as exp(-5 t): places 0.35 m apart, none nearer than 0.35 m to the goal."""
    from lie_codegen.gallery.tracking_planar_flows import _evenly

    path = np.repeat(np.eye(3)[None], 20_001, 0)
    path[:, 0, 2] = 1.5 * np.exp(-5 * np.linspace(0, 4, 20_001))
    places = path[_evenly(path), 0, 2]
    np.testing.assert_allclose(places, [1.5, 1.15, 0.8, 0.45], atol=2e-3)


def test_a_cone_is_seen_open() -> None:
    """The line of sight is within 35 degrees of any cone that is not behind the poles' limit; no cone, the usual view."""
    from lie_codegen.pictures.steering_path import _facing

    rng = np.random.default_rng(3)
    for direction in rng.normal(size=(50, 3)):
        direction = direction / np.linalg.norm(direction)
        elevation, azimuth = np.radians(_facing(direction))
        sight = [np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)]
        assert direction @ sight > np.cos(np.radians(35))
    assert _facing(np.zeros(3)) == (25.0, 35.0)


@pytest.mark.parametrize(("label", "shown"), [("w1", "$w_{1}$"), ("x_12", "$x_{12}$"), ("x", "x"), ("vx", "vx")])
def test_labels_are_typeset(label: str, shown: str) -> None:
    from lie_codegen.pictures.style import symbol

    assert symbol(label) == shown
