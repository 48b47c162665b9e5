"""Pictures of plans: one call, every kind of group."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

import lie_codegen as lc

pytest.importorskip("matplotlib")

CASES = {
    "so3": ((0, 1), (0.3, 0.2, 0.4)),
    "se2": ((0, 1), (0.3, 0.2, 0.4)),
    "se3": ((0, 1, 2, 3), (0.1, 0.2, 0.3, 0.1, 0.2, 0.3)),
    "su2": ((0, 1), (0.3, 0.2, 0.4)),
}


@pytest.mark.parametrize("name", CASES)
def test_a_plan_is_drawn(name: str, tmp_path: Path) -> None:
    controls, g = CASES[name]
    plan = lc.steer(lc.group(name), g, controls, 1.0)
    picture = lc.plot_plan(plan, tmp_path / "deep" / "plan.png")
    assert picture.stat().st_size > 20_000


@pytest.mark.parametrize(
    ("name", "controls", "method"),
    [
        ("so3", (0, 1), "circle"),
        ("so3", (0, 1), "four_phase"),
        ("se3", (0, 1, 3), "loops"),
        ("engel", (0, 1), "loops"),
        ("sl2", (1, 2), "feedback"),
    ],
)
def test_closed_forms_are_drawn(name: str, controls: tuple[int, ...], method: str, tmp_path: Path) -> None:
    group = lc.group(name)
    plan = lc.steer(group, [0.2 if k % 2 else 0.3 for k in range(group.dim)], controls, 2.0, method=method)
    assert lc.plot_plan(plan, tmp_path / "plan.png", compare=False).stat().st_size > 20_000


def test_the_trailer_is_moved_sideways(tmp_path: Path) -> None:
    """Chained form is the Engel group: the true vehicle, by SciPy, ends where the plan says; Z = -(pi/2) alpha^2 beta = 1."""
    from lie_codegen.gallery.steering_trailer import steering_trailer

    numbers = steering_trailer(tmp_path).numbers
    assert numbers["vehicle_misses_by"] < 1e-9
    assert numbers["vehicle_misses_by_least_energy"] < 1e-8
    assert numbers["moment"] == pytest.approx(1, rel=1e-12)
    assert numbers["energy"] * 20 == pytest.approx(24 * math.pi**2 / (4 * math.pi) ** (2 / 3), rel=1e-12)
    assert numbers["least_energy"] < numbers["energy"]


def test_loops_of_a_picture_are_labelled_with_their_areas() -> None:
    """The area of the optimal loop of a pure bracket, closed by its chord, and the moment of a figure of eight."""
    from lie_codegen.pictures.steering_picture import draw_plan

    h3 = lc.group("h3")
    figure = draw_plan(lc.steer(h3, (0, 0, 0.7), (0, 1), 1.0, method="circle"))
    assert "x, y: area 0.7" in [text.get_text() for text in figure.axes[1].get_legend().get_texts()]
    plan = lc.steer(lc.group("engel"), (0, 0, 0, 0.5), (0, 1), 1.0, method="loops")
    labels = [text.get_text() for text in draw_plan(plan).axes[1].get_legend().get_texts()]
    [moment] = plan.details["moments"].values()
    assert any(f"moment {moment:.4g}, $[a, [a, b]]$" in label for label in labels)


def test_a_picture_that_cannot_be_written_is_an_output_error(tmp_path: Path) -> None:
    plan = lc.steer(lc.group("so3"), (0.1, 0.1, 0.1), (0, 1), 1.0)
    (tmp_path / "file").write_text("")
    with pytest.raises(lc.errors.OutputFolderError):
        lc.plot_plan(plan, tmp_path / "file" / "plan.png")


def test_the_star_tracker_keeps_out_of_the_sun(tmp_path: Path) -> None:
    from lie_codegen.gallery.steering_star_tracker import steering_star_tracker

    numbers = steering_star_tracker(tmp_path).numbers
    assert numbers["attitude_error_by_scipy"] < 1e-8
    assert numbers["smallest_angle_to_the_sun_rad"] >= numbers["angle_to_keep_rad"] - 1e-7
    assert numbers["largest_rate_rad_s"] <= numbers["bound_rad_s"] + 1e-9
