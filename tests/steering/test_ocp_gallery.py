"""The five open problems of the gallery: stated in under thirty lines, solved to their published optima, drawn."""

from __future__ import annotations

import inspect
from pathlib import Path

import pytest

from lie_codegen.gallery import open_control, open_problems


@pytest.mark.parametrize(
    ("name", "cost"),
    [
        pytest.param("quadrotor", 6.119001823, marks=pytest.mark.slow),
        pytest.param("satellite", None, marks=pytest.mark.slow),
        ("parking", 1.422607742),
        pytest.param("underwater", None, marks=pytest.mark.slow),
        ("qubit", None),
    ],
)
def test_an_open_problem_is_solved_and_drawn(name: str, cost: float | None, tmp_path: Path) -> None:
    lines = inspect.getsource(getattr(open_problems, name)).splitlines()
    assert len(lines) < 35
    result = getattr(open_control, f"open_{name}")(tmp_path)
    assert result.picture.stat().st_size > 10_000
    assert result.numbers["status"] == "SOLVED"
    if cost is not None:
        assert result.numbers["cost"] == pytest.approx(cost, rel=2e-8)
    if name == "quadrotor":
        assert result.numbers["deepest_in_the_cylinder_m"] < 0.02
        assert result.numbers["samples_held"] <= 2
    if name == "satellite":
        assert result.numbers["cost"] == pytest.approx(1.871532414, rel=1e-6)  # the wheels' own bounds do not act
        assert result.numbers["smallest_angle_to_the_sun_rad"] > 0.3 - 1e-7
        assert result.numbers["attitude_error_rad"] < 1e-7
    if name == "qubit":
        assert result.numbers["fidelity"] > 1 - 1e-12
    if name == "underwater":
        assert all(value < 0.2 for key, value in result.numbers.items() if key.startswith("misses"))
