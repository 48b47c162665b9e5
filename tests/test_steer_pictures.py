"""Pictures of plans: one call, every kind of group."""

from __future__ import annotations

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
