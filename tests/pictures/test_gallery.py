"""Every figure of the gallery: on white and on the dark page its words stand inside the picture and can be read."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from command_line import run

from lie_codegen.errors import InputError

matplotlib = pytest.importorskip("matplotlib")

from matplotlib.backends.backend_agg import FigureCanvasAgg  # noqa: E402

from lie_codegen.gallery.registry import TARGETS, reproduce  # noqa: E402
from lie_codegen.pictures.dark import dark, dark_colour  # noqa: E402

QUICK = ("momentum_wheels",)


def luminance(colour: Any) -> float:
    """Relative luminance of WCAG 2."""
    rgb = np.array(matplotlib.colors.to_rgb(colour))
    return float(np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4) @ [0.2126, 0.7152, 0.0722])


def contrast(one: Any, other: Any) -> float:
    """Ratio of contrast of WCAG 2."""
    low, high = sorted((luminance(one), luminance(other)))
    return (high + 0.05) / (low + 0.05)


def examine(figure: Any) -> None:
    """No word is cut off at the edge of the picture, and each stands out from its page."""
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    edge, renderer = figure.bbox, canvas.get_renderer()
    caption = figure.legends[-1].get_title() if figure.legends else figure._supxlabel
    titles = [text for text in (figure._suptitle, caption) if text is not None and text.get_text()]
    assert len(titles) == 2, "a title and a caption"
    for text in titles:
        box = text.get_window_extent(renderer)
        assert edge.x0 <= box.x0, text.get_text()
        assert box.x1 <= edge.x1, text.get_text()
    for axes in figure.axes:
        box = axes.get_tightbbox(renderer)
        assert box is None or (box.x0 >= edge.x0 - 1 and box.x1 <= edge.x1 + 1), axes.get_title()
        assert box is None or (box.y0 >= edge.y0 - 1 and box.y1 <= edge.y1 + 1), axes.get_title()
    page = figure.get_facecolor()
    for text in [*titles, *(each for axes in figure.axes for each in (axes.title, axes.xaxis.label, axes.yaxis.label))]:
        if text.get_text():
            assert contrast(text.get_color(), page) > 4.5, text.get_text()


@pytest.mark.parametrize(
    "name",
    [each.name if each.name in QUICK else pytest.param(each.name, marks=pytest.mark.slow) for each in TARGETS],
)
def test_words_are_whole_and_can_be_read(tmp_path: Path, name: str) -> None:
    result = reproduce(name, tmp_path, lambda line: None, ("png",), ("light", "dark"))
    assert {path.name for path in tmp_path.iterdir()} >= {f"{name}{end}" for end in (".png", "-dark.png", ".json")}
    examine(result.figure)
    examine(dark(result.figure))


def test_colours_keep_their_hue_and_contrast() -> None:
    shown = dark_colour([[1, 1, 1, 1], [0, 0, 0, 0.5], [0.92, 0.92, 0.92, 1]])
    page, ink, grid = shown
    assert np.ptp(shown[:, :3], axis=1).max() < 1e-6  # grey stays grey
    assert contrast(page[:3], ink[:3]) > 12
    assert ink[3] == 0.5
    assert 1.02 < contrast(page[:3], grid[:3]) < 1.5
    for colour in ("#1f5aa6", "#c8442f", "#2e8b57", "#d98c1f", "#7a4fa3", "#8a8f98"):
        before = np.array(matplotlib.colors.to_rgb(colour))
        after = dark_colour([*before, 1.0])[:3]
        assert contrast(after, page[:3]) > 4.5
        assert np.argmax(after) == np.argmax(before)


def test_a_theme_that_there_is_not(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="light, dark"):
        reproduce("satellite", tmp_path / "none", lambda line: None, themes=("dusk",))
    assert not (tmp_path / "none").exists()
    done = run("reproduce", "momentum_wheels", "--theme", "dark,dusk", "--out", "none", cwd=tmp_path)
    assert done.returncode == 2
    assert "dusk" in done.stderr
