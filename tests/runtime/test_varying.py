"""Batches in the layout "varying": the entries that are not the same for all inputs, and nothing else."""

from __future__ import annotations

import numpy as np
import pytest

import lie_codegen as lc
from lie_codegen.errors import InputError, ShapeError


def test_the_entries_that_vary_of_a_rigid_motion() -> None:
    exp = lc.build("se3").exp
    x = np.random.default_rng(0).normal(size=(37, 6))
    whole, varying = exp.batch(x), exp.batch(x, layout="varying")
    rows, columns = exp.varying
    np.testing.assert_array_equal(rows * 4 + columns, np.arange(12))
    np.testing.assert_array_equal(varying, whole[:, :3].reshape(37, 12))
    np.testing.assert_array_equal(exp.whole(varying), whole)
    np.testing.assert_array_equal(exp.whole(varying[5]), whole[5])
    out = np.full((37, 12), np.nan)
    assert exp.batch(x, out=out, threads=2, layout="varying") is out
    np.testing.assert_array_equal(out, varying)


@pytest.mark.parametrize(("group", "kernel"), [("h3", "exp"), ("su2", "exp"), ("se2", "Ad"), ("osc4", "ljac_inv")])
def test_what_is_put_together_is_the_whole(group: str, kernel: str) -> None:
    lib = lc.build(group)
    x = np.random.default_rng(1).normal(size=(9, lc.group(group).dim))
    f = lib[kernel]
    given = lib.exp.batch(x) if kernel == "Ad" else x
    found = f.batch(given, layout="varying")
    np.testing.assert_array_equal(f.whole(found), f.batch(given))
    np.testing.assert_array_equal(f.batch(given)[(..., *f.varying)], found.reshape(9, -1))


def test_several_outputs_scalars_and_constants() -> None:
    def body(ops, x):
        return [[x[0], 2], [3, x[1]]], x[0] + x[1], [5, 6], [x[1], 7, x[0]]

    ports = (lc.Port("A", (2, 2)), lc.Port("s", ()), lc.Port("c", (2,)), lc.Port("v", (3,)))
    f = lc.build(lc.Kernel("some", "toy", (lc.Port("x", (2,)),), ports, body)).some
    x = np.random.default_rng(2).normal(size=(11, 2))
    whole, found = f.batch(x), f.batch(x, layout="varying")
    assert [each.shape for each in found] == [(11, 2), (11,), (11, 2), (11, 2)]  # what never varies is kept as it is
    assert found._fields == whole._fields == f.varying._fields
    for one, other in zip(f.whole(found), whole, strict=True):
        np.testing.assert_array_equal(one, other)


def test_a_wrong_layout_is_named() -> None:
    exp = lc.build("so3").exp
    with pytest.raises(InputError, match='layout is "whole" or "varying", given \'flat\''):
        exp.batch(np.zeros((3, 3)), layout="flat")
    with pytest.raises(ShapeError, match="the last axis holds the 12 entries"):
        lc.build("se3").exp.whole(np.zeros((3, 16)))
