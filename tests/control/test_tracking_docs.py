"""The tutorial runs as it stands; the quick gallery targets give the published numbers."""

from __future__ import annotations

import os
import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from lie_codegen.gallery.attitude_region import monte_carlo
from lie_codegen.gallery.attitude_trajectory import attitude_trajectory
from lie_codegen.gallery.tracking_rotations import tracking_rotations
from lie_codegen.gallery.tracking_sphere import tracking_sphere


def test_the_tutorial_runs_block_after_block(repository: Path, tmp_path: Path) -> None:
    text = (repository / "lie_codegen" / "control" / "README.md").read_text()
    program = "\n".join(re.findall(r"```python\n(.*?)```", text, re.DOTALL))
    (tmp_path / "tutorial.py").write_text(program)
    environment = {**os.environ, "PYTHONPATH": str(repository)}
    done = subprocess.run(
        [sys.executable, "tutorial.py"], cwd=tmp_path, env=environment, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr[-2000:]
    assert "not compatible (A2)" in done.stdout
    assert (tmp_path / "sim2_flight" / "closed_loop.c").is_file()


def test_sphere_figure(tmp_path: Path) -> None:
    numbers = tracking_sphere(tmp_path).numbers
    assert numbers["lengths"]["gradient of 1 - q.r"] == pytest.approx(numbers["angle_between_the_ends"], abs=1e-5)
    assert min(numbers["lengths"].values()) == numbers["lengths"]["gradient of 1 - q.r"]
    assert numbers["jump_across_the_pole_smooth"] < 1e-5 < 0.1 < numbers["jump_across_the_pole_chart"]


def test_trajectory_figure_has_the_published_numbers(tmp_path: Path) -> None:
    result = attitude_trajectory(tmp_path)
    assert result.numbers["theta_10_error"] < 1e-10
    assert result.numbers["V_10"] == pytest.approx(2.06713158951836e-4, abs=1e-11)
    assert result.picture.is_file()


def test_left_and_right_feedforward_are_the_closed_forms(tmp_path: Path) -> None:
    numbers = tracking_rotations(tmp_path).numbers
    assert numbers["left_gap_to_closed_form"] < 1e-9
    assert numbers["right_gap_to_closed_form"] < 1e-9


def test_every_state_of_the_proved_region_converges_without_passing_180_degrees() -> None:
    study = monte_carlo(6.0, 40.0, seed=3, samples=400)
    assert study["inside"] > 100
    assert study["inside_converged"] == study["inside"]
    assert study["inside_passed_180"] == 0
    assert np.sum(study["passed"]) > 0
