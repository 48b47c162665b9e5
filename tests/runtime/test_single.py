"""Batches and loops in floats, for screening: float32 in and out on twice as many lanes, against the same kernels in doubles."""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np
import pytest

import lie_codegen as lc
from lie_codegen.errors import CodegenError, InputError, ShapeError
from lie_codegen.runtime.compiler import find_compilers


def relative(found: Any, wanted: Any) -> float:
    """The largest error of a sample, relative to its largest entry or 1."""
    count = len(wanted)
    error = np.abs(found - wanted).reshape(count, -1).max(1)
    return float(np.max(error / np.maximum(1, np.abs(wanted).reshape(count, -1).max(1))))


@pytest.mark.parametrize(
    ("group", "kernels"),
    [
        ("so3", ("exp", "ljac_inv", "log")),
        ("su2", ("exp", "log")),
        pytest.param("se3", ("exp", "ljac_inv", "log", "Ad"), marks=pytest.mark.slow),
        pytest.param("su3", ("exp", "ljac_inv", "log", "Ad"), marks=pytest.mark.slow),
        pytest.param("h5", ("exp", "ljac_inv", "log", "Ad"), marks=pytest.mark.slow),
    ],
)
def test_kernels_of_groups_to_the_accuracy_of_floats(group: str, kernels: tuple[str, ...]) -> None:
    lib = lc.build(group)
    x = np.random.default_rng(0).normal(size=(203, lc.group(group).dim)) * 0.7
    X = lib.exp.batch(x)
    for kernel in kernels:
        given, f = X if kernel in ("log", "Ad") else x, lib[kernel]
        wanted, found = f.batch(given), f.batch(given, real="float")
        assert found.dtype == (np.complex64 if np.iscomplexobj(wanted) else np.float32)
        assert found.shape == wanted.shape
        assert relative(found, wanted) < 2e-6
        near = f.batch(given.astype(np.complex64 if np.iscomplexobj(given) else np.float32), real="float")
        np.testing.assert_array_equal(near, found)


def test_any_count_and_place_threads_out_and_the_varying_entries() -> None:
    exp = lc.build("se3").exp
    x = np.random.default_rng(1).normal(size=(4_099, 6)).astype(np.float32)
    whole = exp.batch(x, real="float")
    for count in (1, 5, 16, 17, 31, 33, 70):
        np.testing.assert_array_equal(exp.batch(x[:count], real="float"), whole[:count])
    out = np.full((4_099, 4, 4), np.nan, np.float32)
    assert exp.batch(x, out=out, threads=2, real="float") is out
    np.testing.assert_array_equal(out, whole)
    varying = exp.batch(x, layout="varying", real="float")
    assert varying.dtype == np.float32
    np.testing.assert_array_equal(varying, whole[:, :3].reshape(-1, 12))
    with pytest.raises(ShapeError, match="float32"):
        exp.batch(x, out=np.empty((4_099, 4, 4)), real="float")


@pytest.mark.skipif(not find_compilers(), reason="lanes need a C compiler")
def test_lanes_are_twice_as_many() -> None:
    lib = lc.build("so3")
    lib.exp.batch(np.zeros((2, 3)), real="float")
    doubles = next(line for line in lib.build_log if line.startswith("batches"))
    single = lib.exp.batch.__wrapped__.__self__._single  # type: ignore[attr-defined]
    assert single._library is None
    assert single.backend._open_lanes()["so3_lie_codegen_lanes"]() == 2 * int(doubles.split()[1])


def test_a_loop_in_floats_follows_the_loop_in_doubles() -> None:
    step = lc.build(lc.rkmk4_step("so3")).rkmk4_step
    u = np.random.default_rng(2).normal(size=(40, 3))
    common = {"u0": u, "um": u, "u1": u, "h": 0.01}
    wanted = step.scan_batch(np.eye(3), **common, n=100, every=20)
    found = step.scan_batch(np.eye(3), **common, n=100, every=20, real="float")
    assert found.dtype == np.float32
    assert found.shape == wanted.shape
    assert relative(found, wanted) < 5e-6


def test_what_is_refused() -> None:
    exp = lc.build("so3").exp
    with pytest.raises(InputError, match="real is one of double, float, given 'half'"):
        exp.batch(np.zeros((3, 3)), real="half")
    with pytest.raises(InputError, match=r"x has a number beyond 3\.4e38"):
        exp.batch(np.full((3, 3), 1e39), real="float")
    large = lc.Kernel("large", "toy", (lc.Port("x", ()),), (lc.Port("y", ()),), lambda ops, x: (x * 1e39,))
    f = lc.build(large).large
    assert f.batch(np.ones(2))[0] == 1e39
    with pytest.raises(CodegenError, match="no number in single precision"):
        f.batch(np.ones(2), real="float")


def test_without_a_compiler(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("LIE_CODEGEN_CC", "none")
    third = lc.Kernel("third", "toy", (lc.Port("x", (2,)),), (lc.Port("y", (2,)),), lambda ops, x: ([x[0] / 3, x[1]],))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # said once a process
        f = lc.build(third).third
    x = np.random.default_rng(3).normal(size=(5, 2))
    found = f.batch(x, real="float")
    assert found.dtype == np.float32
    np.testing.assert_allclose(found, x / [3, 1], rtol=1e-6)
