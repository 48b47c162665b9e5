"""A loop from a file or a pickle is run from its definitions: other times and C, bit for bit those of its own process."""

from __future__ import annotations

import pickle
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import lie_codegen as lc
from lie_codegen.errors import InputError
from lie_codegen.kernel.kernel import Kernel, Port

TIMES = np.linspace(0, 4, 9)
WITHIN = np.array([0.0, 0.37, 1.999, 4.0])


def loop(name: str) -> lc.ClosedLoop:
    start = {"xi0": [1.0, 0.5, -0.2], "t": TIMES, "rtol": 1e-9}
    gains = {"K_p": 4, "K_d": 5}
    cases: dict[str, dict[str, Any]] = {
        "free": {"inertia": (1, 2, 3)},
        "attitude": {"law": lc.attitude_law("pd", inertia=(1, 2, 3), k_p=4, k_d=6), "inertia": (1, 2, 3)},
        "numbers": {
            "law": lc.attitude_law("pd", tunable=True), "inertia": (1, 2, 3), "gains": {"k_p": 4, "k_d": 6}, "limits": 2.0,
        },
        "states": {
            "law": lc.integral_law("so3", inertia=(1, 2, 3), error="so3_right", gains={**gains, "K_i": 1}), "inertia": (1, 2, 3),
            "disturbance": ["3/10", "sin(t)/5", "0"], "reference": lc.reference("so3", ["sin(t)/5", "0", "0"]),
        },
    }  # fmt: skip
    return lc.closed_loop("so3", **cases[name], **start)


@pytest.mark.parametrize("name", ["free", "attitude", "numbers", "states"])
def test_other_times_of_a_loop_that_was_kept(name: str, tmp_path: Path) -> None:
    run = loop(name)
    wanted = run.at(WITHIN)
    np.testing.assert_allclose(wanted[0][-1], run.X[-1], rtol=0, atol=1e-12)
    for kept in (pickle.loads(pickle.dumps(run)), lc.load(run.save(tmp_path / "run.npz")), replace(run)):
        assert kept == run
        for one, other in zip(kept.at(WITHIN), wanted, strict=True):
            np.testing.assert_array_equal(one, other)


def test_other_times_in_a_process_that_ran_nothing(tmp_path: Path) -> None:
    run = loop("states")
    file = run.save(tmp_path / "run.npz")
    code = f"import lie_codegen as lc; print(lc.load({str(file)!r}).at(1.234)[0].tobytes().hex())"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == run.at(1.234)[0].tobytes().hex()


def by_hand() -> Kernel:
    ports = (Port("X", (3, 3)), Port("xi", (3,)))
    return Kernel("brake", "so3", ports, (Port("force", (3,)),), lambda ops, X, xi: ([-2 * x for x in xi],))


def test_a_law_written_by_hand_stays_in_its_process(tmp_path: Path) -> None:
    run = lc.closed_loop("so3", law=by_hand(), inertia=(1, 2, 3), xi0=[1, 0.5, 0.2], t=TIMES)
    assert run.origin is None
    assert run.at(0.3)[1].shape == (3,)
    for kept in (pickle.loads(pickle.dumps(run)), lc.load(run.save(tmp_path / "run.npz"))):
        assert kept == run
        with pytest.raises(InputError, match="has a definition"):
            kept.at(0.3)
        with pytest.raises(InputError, match="run closed_loop again"):
            lc.generate(kept, tmp_path / "no")


def test_a_file_makes_nothing_but_what_this_package_makes() -> None:
    run = loop("free")
    text = run.origin.loop.replace("lie_codegen.control.plants:group_plant", "os:system")
    with pytest.raises(InputError, match="no value of this package"):
        replace(run, origin=replace(run.origin, loop=text)).at(0.3)


def test_a_law_flies_the_body_it_was_made_for_unless_told_otherwise() -> None:
    """Its own inertia beside the same given by hand: the same loop to the last bit; a number that is an input has to be given."""
    inertia = [[2, 0.1, 0], [0.1, 3, 0], [0, 0, 1.5]]
    law = lc.attitude_law("pd", inertia=inertia, k_p=4, k_d=6)
    start = {"X0": lc.build("so3").exp([0.2, -0.1, 0.3]), "t": np.linspace(0, 3, 4)}
    np.testing.assert_array_equal(
        lc.closed_loop(law=law, **start).X, lc.closed_loop("so3", law=law, inertia=inertia, **start).X
    )
    assert np.abs(lc.closed_loop(law=law, inertia=1, **start).X - lc.closed_loop(law=law, **start).X).max() > 1e-3
    with pytest.raises(InputError, match="inertia"):
        lc.closed_loop(law=lc.attitude_law("pd", inertia="input", k_p=4, k_d=6), **start)
