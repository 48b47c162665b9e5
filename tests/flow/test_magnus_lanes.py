"""Magnus steps on vectors of every width that is built: the same results, within the workspace that the C asks for."""

from __future__ import annotations

import ctypes
import subprocess
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path

import numpy as np
import pytest

import lie_codegen as lc
from lie_codegen.flow.inputs import as_drive, as_signal
from lie_codegen.flow.magnus import library, reverse, run
from lie_codegen.flow.magnus.norms import norms_of
from lie_codegen.flow.magnus.steps import plan_steps
from lie_codegen.runtime.backend import load_library
from lie_codegen.runtime.compiler import find_compilers
from lie_codegen.runtime.sources import SOLVER_FLAGS

pytestmark = pytest.mark.skipif(not find_compilers(), reason="needs a C compiler")

#: Doubles behind and before every workspace.
MARGIN, MARK = 64, 1.25e30
#: su2 moves a quaternion and brackets by structure constants, su5 takes matrices of which half is kept, in blocks;
#: so7 (skew) and gl4 are real, in tiles.
GROUPS = ("su2", "su5", "so7", "gl4")
WIDTHS = (2, 4, 8)
#: Relative to the largest entry of each result.
ROUNDING = {"one": 2e-14, "many": 2e-14, "series": 2e-14, "single": 2e-6, "X": 2e-14, "dX": 1e-13, "slopes": 1e-13}


@pytest.fixture(scope="module")
def opened(tmp_path_factory: pytest.TempPathFactory) -> Callable[[lc.MatrixGroup, str, int], ctypes.CDLL]:
    """The C of a group, compiled with vectors of so many doubles whatever the processor has."""

    @lru_cache
    def build(group: lc.MatrixGroup, stem: str, lanes: int) -> ctypes.CDLL:
        folder: Path = tmp_path_factory.mktemp(f"{group.name}_{stem}_{lanes}")
        for name, text in library.magnus_files(group, stem).items():
            (folder / name).write_text(text)
        width = f"-DLANES={lanes * (2 if stem == 'magnus_single' else 1)}"
        command = [*find_compilers()[0].command, *SOLVER_FLAGS, "-O1", width]
        subprocess.run([*command, "-o", "forced.so", f"{stem}.c", "-lm"], cwd=folder, check=True)
        return load_library(folder / "forced.so")

    return build


@pytest.mark.parametrize("lanes", WIDTHS)
@pytest.mark.parametrize("name", GROUPS)
def test_every_width_gives_the_same_within_its_workspace(
    name: str, lanes: int, opened: Callable[[lc.MatrixGroup, str, int], ctypes.CDLL], monkeypatch: pytest.MonkeyPatch
) -> None:
    group = lc.group(name)
    wanted = results(library.magnus_library.__wrapped__(group), group)
    spaces = []

    def space(size: int, kind: type = np.float64) -> np.ndarray:
        """At an address that no vector is aligned to, between marks."""
        whole = np.full(size + 2 * MARGIN + 1, MARK, kind)
        spaces.append((whole, size))
        return whole[MARGIN + 1 : MARGIN + 1 + size]

    monkeypatch.setattr(library, "_space", space)
    monkeypatch.setattr(library, "_opened", lambda group, stem: opened(group, stem, lanes))
    forced = library.MagnusLibrary(group, opened(group, "magnus", lanes))
    found = results(forced, group)
    assert forced.lane_products(*steps_of(group)[:2], reverse.PROJECTION).shape[0] == lanes
    for key, rounding in ROUNDING.items():
        atol = rounding * np.max(np.abs(wanted[key]))
        np.testing.assert_allclose(found[key], wanted[key], rtol=0, atol=atol, err_msg=key)
    assert len(spaces) == 5
    for whole, size in spaces:
        outside = np.concatenate([whole[: MARGIN + 1], whole[MARGIN + 1 + size :]])
        np.testing.assert_array_equal(outside, np.full(2 * MARGIN + 1, MARK, whole.dtype))


def results(lib: library.MagnusLibrary, group: lc.MatrixGroup) -> dict[str, np.ndarray]:
    """Everything the libraries of a group do, of inputs with waves, series and values at nodes; 11 trajectories fill no vector."""
    rng = np.random.default_rng(5)
    t, eps = np.array([0.0, 0.7, 2.0, 3.0]), rng.uniform(0.2, 1, 11)
    start = np.eye(group.degree, dtype=complex if group.is_complex else float)
    texts = tuple(f"{a:.3f}*cos({b:.3f}*t)" for a, b in rng.uniform(0.2, 0.8, (group.dim, 2)))
    waves = as_signal(group, lc.PeriodicInput(texts), t)
    curved = as_signal(group, lambda s: np.exp(-((s - 1) ** 2)) * np.ones(group.dim) / 3, t)
    out = {}
    one, many = (as_drive(group, waves, each, t, rtol=1e-12, resolution=None) for each in (np.array(1.0), eps))
    steps = plan_steps(one, norms_of(group), t, run.MOST_STEPS)
    assert steps is not None
    out["one"] = lib.one(one, steps.times(3), 8, start, 0, 3 * steps.count)[0]
    out["many"] = lib.many(many, steps.times(3), 6, start, 0, len(eps))
    single = start.astype(np.complex64 if group.is_complex else np.float32)
    out["single"] = lib.many_single(many, steps.times(3), 8, single, 0, len(eps))
    series = as_drive(group, curved, np.array(1.0), t, rtol=1e-12, resolution=None)
    pieces = plan_steps(series, norms_of(group), t, run.MOST_STEPS)
    assert pieces is not None
    out["series"] = lib.one(series, pieces, 8, start, 0, pieces.count)[0]
    values, lengths, slopes = steps_of(group)
    out["X"], out["dX"] = lib.tangents(values, slopes, reverse.PROJECTION, float(lengths.sum()))
    out["slopes"], _ = reverse._by_lanes(lib, values, lengths, reverse._skew_part(group, start + 1))
    return out


def steps_of(group: lc.MatrixGroup) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """u at the nodes of 13 equal steps, their lengths, and derivatives of u in three parameters."""
    rng = np.random.default_rng(6)
    values = rng.normal(size=(13, 6, group.dim)) / np.sqrt(group.dim)
    return values, np.full(13, 0.15), rng.normal(size=(13, 6, 3, group.dim))
