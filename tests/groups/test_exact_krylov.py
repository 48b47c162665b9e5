"""Vectors A^power (A^2 + q)^s e_j in exact factors, against numbers."""

from __future__ import annotations

import numpy as np
import pytest

import lie_codegen as lc
from lie_codegen.codegen.tape import tape_of
from lie_codegen.groups.derivation import GroupDerivation
from lie_codegen.groups.maps.exact_krylov import ExactKrylov
from lie_codegen.groups.maps.linear_family import LinearFamily
from lie_codegen.kernel.arithmetic import FloatArithmetic


@pytest.mark.parametrize("name", ["so3", "se3", "se_2_3", "sgal3"])
def test_the_vectors_are_those_of_numbers(name: str) -> None:
    data = GroupDerivation(lc.group(name))
    x = np.random.default_rng(0).normal(size=data.group.dim)
    ads = np.array([np.array(each.tolist(), float) for each in data.ads])
    A = np.tensordot(x, ads, 1)
    family = LinearFamily(FloatArithmetic(), data.ads, x.tolist())
    checked = 0
    for j, pattern in enumerate(data.adjoint_pattern):
        if pattern.form is None:
            continue
        q = family.form(pattern.form)
        for (power, s), rows in pattern.supports:
            found = family.factored(pattern.form, j, power, s) if s else None
            if found is None:
                continue
            wanted = np.linalg.matrix_power(A, power) @ np.linalg.matrix_power(A @ A + q * np.eye(len(A)), s)[:, j]
            vector = np.zeros(len(A))
            for row, (sign, value) in found.items():
                vector[row] = sign * value
            np.testing.assert_allclose(vector, wanted, atol=1e-12 * (1 + np.abs(A).sum()) ** 4)
            assert set(found) <= set(rows)
            checked += 1
    assert checked or name == "so3"


def test_the_translations_of_rigid_motions_are_one_product() -> None:
    """A (A^2 + q) e_4 of ad se3 vanishes on translations; of rotations the lower half is 2 (w . v) times the entries of w^."""
    data = GroupDerivation(lc.group("se3"))
    columns = [
        {r: {i: entry for i, a in enumerate(data.ads) if (entry := a[r, c]) != 0} for r in range(6)} for c in range(6)
    ]
    krylov = ExactKrylov(columns, {(0, 0): 1, (1, 1): 1, (2, 2): 1}, 0)
    dot = (((0, 3), 1), ((1, 4), 1), ((2, 5), 1))
    entries = krylov.factors(1, 1)
    assert entries is not None
    assert {row: factors for row, (_, factors) in entries.items()} == {4: (dot, (((2,), 1),)), 5: (dot, (((1,), 1),))}
    assert {row: abs(scale) for row, (scale, _) in entries.items()} == {4: 2, 5: 2}


def test_jacobians_of_rigid_motions_take_two_thirds() -> None:
    kernels = {kernel.name: kernel for kernel in lc.group_kernels("se3")}
    assert len(tape_of(kernels["ljac_inv"]).statements) < 230  # 331 as sums of numbers
    assert len(tape_of(kernels["ljac"]).statements) < 245  # 357
