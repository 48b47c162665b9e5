"""The code of mechanics/vibration.md runs; two of its figures have the published numbers."""

from __future__ import annotations

import re
import subprocess
import sys

import numpy as np
import pytest
from tools import front_door

from lie_codegen.gallery.inverted_body import floquet_size, threshold
from lie_codegen.gallery.registry import reproduce


def test_the_code_of_the_guide_runs():
    text = (front_door.PACKAGE / "mechanics" / "vibration.md").read_text(encoding="utf-8")
    blocks = re.findall(r"^```python\n(.*?)^```$", text, flags=re.DOTALL | re.MULTILINE)
    done = subprocess.run([sys.executable, "-c", "\n".join(blocks)], capture_output=True, text=True, check=False)
    assert blocks
    assert done.returncode == 0, done.stderr


def test_threshold_of_the_inverted_body_is_that_of_floquet_for_small_eps():
    assert threshold() == pytest.approx(5.45974019666, abs=1e-10)
    assert floquet_size(threshold() * 0.99, 0.005) > 1 + 1e-4
    assert floquet_size(threshold() * 1.01, 0.005) == pytest.approx(1, abs=1e-7)


def test_the_falling_cat_is_drawn(tmp_path):
    result = reproduce("falling_cat", tmp_path, lambda line: None)
    np.testing.assert_allclose(result.numbers["log_at_radius_1"], (0, 1.17272252, -2.12770023), atol=6e-9)
    assert result.picture.exists()
