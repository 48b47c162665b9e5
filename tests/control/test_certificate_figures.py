"""The figures' numbers: no loop above its bound, rates below the limit; half turns; an observer as noisy as it says."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from lie_codegen.gallery.tracking_certificates import tracking_certificates, tracking_global


@pytest.mark.slow
def test_promised_and_seen(tmp_path: Path) -> None:
    made = tracking_certificates(tmp_path)
    assert made.numbers["above_the_bound"] <= 1
    assert np.all(np.diff(made.numbers["rates"]) > 0)
    for row in range(1, 7):
        found = made.numbers[f"row_{row}"]
        assert 0 < found["promised"] < found["seen"]
        assert found["promised"] < found["limit"]
        assert found["inside"] > 5
    assert made.picture.is_file()


@pytest.mark.slow
def test_from_half_turns_and_an_observer_in_the_loop(tmp_path: Path) -> None:
    made = tracking_global(tmp_path)
    assert np.min(made.numbers["smooth_end"]) > np.pi - 1e-9
    assert np.max(made.numbers["hybrid_end"]) < 1e-4
    assert made.numbers["deviation_over_theory"] == pytest.approx([1, 1, 1], abs=0.05)
