"""The main job, with and without a C compiler, against the published numbers of TR 93-59, section 5.2."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from command_line import run
from scipy.linalg import expm

import lie_codegen as lc

PUBLISHED = (0.1039897509848151, 0.0500527635748268, 0.0755999303251700)


@pytest.mark.parametrize("compiler", ["with", "without"])
def test_the_main_job_reproduces_the_paper_with_and_without_a_compiler(compiler: str, tmp_path: Path) -> None:
    environment = {} if compiler == "with" else {"PATH": "", "CC": "", "LIE_CODEGEN_CC": "none"}
    done = run("reproduce", "--json", "--out", "a folder", cwd=tmp_path, **environment)
    assert done.returncode == 0, done.stderr
    assert done.stderr.count("warning") == (0 if compiler == "with" else 1)
    result = json.loads(done.stdout)
    numbers = result["numbers"]
    np.testing.assert_allclose(numbers["final_coordinates"], PUBLISHED, rtol=0, atol=1e-10)
    assert abs(numbers["attitude_error_rad"] - 0.00483639788402634) < 1e-10
    assert abs(numbers["energy_area_rule"] - 0.408663307232606) < 1e-12
    assert abs(numbers["energy_optimal"] - 0.80350066222184167 / 24) < 1e-8
    assert abs(numbers["largest_gap_to_average"] - 0.0231249492661848) < 1e-5
    assert Path(result["picture"]).read_bytes().startswith(b"\x89PNG")
    assert (tmp_path / "a folder" / "so3" / "src" / "so3.c").is_file()


def test_an_empty_path_alone_means_interpreted_with_one_warning(tmp_path: Path) -> None:
    (tmp_path / "bin").mkdir()
    done = run("build", "h3", "--json", cwd=tmp_path, PATH=str(tmp_path / "bin"), CC="")
    assert done.returncode == 0, done.stderr
    found = json.loads(done.stdout)
    if not found["compiled"]:
        assert done.stderr.count("warning") == 1


def test_the_four_phases_meet_their_exact_identities() -> None:
    so3 = lc.group("so3")
    plan = lc.steer(so3, (0.1, 0.05, np.pi / 40), ("w1", "w2"), 24.0, method="four_phase")
    assert plan.details["q"] == 5
    assert plan.details["switches"] == pytest.approx((1.0, 21.0, 22.0), abs=1e-12)
    X = lc.simulate(so3, plan.u, t=[0.0, 1.0, 21.0, 24.0]).X
    np.testing.assert_allclose(X[1], expm(so3.hat([0.1, 0.05, 0.0])), rtol=0, atol=1e-12)
    np.testing.assert_allclose(X[2], X[3], rtol=0, atol=1e-12)
