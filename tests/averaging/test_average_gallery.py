"""The averaging figures of TR 93-59: a picture and numbers each."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from lie_codegen.gallery.registry import TARGETS, reproduce

QUICK = ("periodic_controls", "momentum_wheels", "point_mass_oscillator", "averaging_orders")


@pytest.fixture(scope="module")
def results(tmp_path_factory: pytest.TempPathFactory) -> dict[str, dict]:
    folder: Path = tmp_path_factory.mktemp("gallery")
    found = {}
    for name in QUICK:
        result = reproduce(name, folder, lambda line: None)
        assert result.picture.stat().st_size > 20_000
        found[name] = json.loads((folder / f"{name}.json").read_text())
    return found


def test_the_registry_names_them() -> None:
    assert {*QUICK, "averaging_growth"} <= {target.name for target in TARGETS}


def test_figure_1(results: dict[str, dict]) -> None:
    """The Heisenberg group moves by eps^2 area exactly; SO(3) up to third order."""
    numbers = results["periodic_controls"]
    assert numbers["area_pulses"] == "1"
    assert max(numbers["h3_pulses_difference"] + numbers["h3_smooth_difference"]) < 1e-14
    for label in ("pulses", "smooth"):
        rest = numbers[f"so3_{label}_difference"]
        assert np.log2(rest[-2] / rest[-1]) == pytest.approx(3, abs=0.05)


def test_figure_4(results: dict[str, dict]) -> None:
    numbers = results["momentum_wheels"]
    np.testing.assert_allclose(numbers["body_areas"], numbers["body_areas_by_cofactors"], atol=1e-14)
    assert numbers["order_slopes"][-1] == pytest.approx(2, abs=0.02)


def test_figure_5(results: dict[str, dict]) -> None:
    first, second = np.array(results["point_mass_oscillator"]["slopes"])[-1]
    assert first == pytest.approx(4, abs=0.25)
    assert second == pytest.approx(6, abs=0.25)


def test_orders(results: dict[str, dict]) -> None:
    numbers = results["averaging_orders"]
    for row in numbers["floquet_so3"] + numbers["area_rules_so3"] + numbers["order_3_by_group"]:
        assert row["passed"], row
    assert [row["exact"] for row in numbers["order_3_by_group"] if row["group"] == "h3"] == [True]
    assert numbers["lemma_4_as_printed"]["slopes"][-1] < 1
    assert numbers["lemma_4_corrected"]["slopes"][-1] > 1.98
