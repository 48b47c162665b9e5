"""Logarithms of every kind of group on the elements that are rare: SciPy's exp of the answer against the element, and published values."""

from __future__ import annotations

import shutil
import subprocess
from functools import cache
from pathlib import Path

import casadi as ca
import generators
import numpy as np
import pytest
import scipy.linalg
from kernel_calls import call_group, function_of_group

import lie_codegen as lc
from lie_codegen.groups.kernels import group_kernel
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernel.arithmetic import FloatArithmetic
from lie_codegen.kernel.dual import DualArithmetic
from lie_codegen.runtime.call import Compiled


@cache
def compiled(group: MatrixGroup) -> Compiled:
    return lc.build(group, kernels=("log",)).log


def worst(group: MatrixGroup, elements: list[np.ndarray]) -> float:
    """NaN if any answer is."""
    log = compiled(group)
    answers = log.batch(np.array(elements))
    for X, x in zip(elements[:5], answers, strict=False):
        np.testing.assert_allclose(log(X), x, rtol=0, atol=1e-13 * max(1.0, np.max(np.abs(x))))
    return float(np.max([generators.residual(group, x, X) for x, X in zip(answers, elements, strict=True)]))


@pytest.mark.parametrize("name", ["su2", "su3", "su4", "so3", "so4", "so5", "so6"])
def test_haar_elements_of_compact_groups(name: str) -> None:
    rng = np.random.default_rng(1)
    group = lc.group(name)
    haar = generators.haar_special_unitary if name.startswith("su") else generators.haar_rotation
    assert worst(group, [haar(group.degree, rng) for _ in range(200)]) < 3e-14


@pytest.mark.slow
@pytest.mark.parametrize("name", ["su3", "su4", "su5", "so4", "so5", "so6", "so7", "so8"])
def test_ten_thousand_haar_elements(name: str) -> None:
    rng = np.random.default_rng(2)
    group = lc.group(name)
    haar = generators.haar_special_unitary if name.startswith("su") else generators.haar_rotation
    assert worst(group, [haar(group.degree, rng) for _ in range(10_000)]) < 1e-12


@pytest.mark.parametrize(
    "n", [3, 4, 5, 6, pytest.param(7, marks=pytest.mark.slow), pytest.param(8, marks=pytest.mark.slow)]
)
def test_rotations_near_the_cut_in_all_multiplicities(n: int) -> None:
    rng = np.random.default_rng(3)
    elements = [X for _ in range(3) for _, X in generators.rotations_near_the_cut(n, rng)]
    assert worst(lc.group(f"so{n}"), elements) < 1e-13


@pytest.mark.parametrize("n", [2, 3, 4, pytest.param(5, marks=pytest.mark.slow)])
def test_special_unitary_matrices_that_are_rare(n: int) -> None:
    rng = np.random.default_rng(4)
    elements = [X for _ in range(3) for _, X in generators.special_unitaries_that_are_rare(n, rng)]
    assert worst(lc.group(f"su{n}"), elements) < 1e-13


def test_published_angles() -> None:
    """Which turns are taken back: the greedy choice is the shortest."""
    rng = np.random.default_rng(5)
    cases = [
        ((2.8, 2.4, -5.2), (-3.483185307, 1.083185307, 2.4)),
        ((-2.6, -2.6, 5.2), (-2.6, -1.083185307, 3.683185307)),
        ((3, 2.9, 2.8, 4 * np.pi - 8.7), (-3.283185307, -2.416814693, 2.8, 2.9)),
    ]
    for theta, expected in cases:
        Q = generators.haar_unitary(len(theta), rng)
        X = (Q * np.exp(1j * np.array(theta))) @ Q.conj().T
        group = lc.group(f"su{len(theta)}")
        angles = np.sort(np.linalg.eigvals(group.hat(compiled(group)(X))).imag)
        np.testing.assert_allclose(angles, expected, atol=1e-8)


def test_the_special_unitary_logarithm_is_the_shortest_by_brute_force() -> None:
    rng = np.random.default_rng(6)
    group = lc.group("su3")
    turns = np.array(np.meshgrid(*[[-2, -1, 0, 1, 2]] * 3)).reshape(3, -1).T
    for _ in range(100):
        X = generators.haar_special_unitary(3, rng)
        theta = np.angle(np.linalg.eigvals(X)) + 2 * np.pi * turns
        shortest = np.min(np.sum(theta**2, axis=1)[np.abs(np.sum(theta, axis=1)) < 1e-6])
        np.testing.assert_allclose(np.linalg.norm(group.hat(compiled(group)(X))) ** 2, shortest, rtol=1e-11)


@pytest.mark.parametrize("name", ["sl2", "gl2", "gl3", "sl3", "sp4", "so31", "so_2_2", "sim3", "osc4", "sgal3"])
def test_noncompact_groups_find_a_logarithm_at_least_as_short(name: str) -> None:
    """exp of Gaussian x with eigenvalues turning up to 6 rad: kappa times rounding is what any method leaves."""
    rng = np.random.default_rng(7)
    group = lc.group(name)
    for _ in range(4):
        for text, x, X in generators.noncompact_elements(group, rng):
            found = compiled(group)(X)
            kappa = np.max(np.abs(X)) * np.max(np.abs(np.linalg.inv(X)))
            assert generators.residual(group, found, X) < 1e-13 * kappa, text
            turns = [np.sum(np.linalg.eigvals(group.hat(y)).imag ** 2) for y in (found, x)]
            assert turns[0] <= turns[1] * (1 + 1e-6) + 1e-6, text


#: Made when their test runs: at the level of the module every worker of every run would make them.
REPRESENTATIONS = {
    "spin3": lambda: generators.spin_group(2),
    "spin4": lambda: generators.spin_group(3),
    "su2_real": lambda: generators.real_double(lc.group("su2")),
    "u2": lambda: generators.unitary_group(2),
    "u3": lambda: generators.unitary_group(3),
    "sl2c": generators.special_linear_complex,
    "su2_adjoint": lambda: generators.adjoint_group(lc.group("su2"), "su2_adjoint"),
    "so4_generic": lambda: generators.generic_basis(lc.group("so4"), np.random.default_rng(8)),
    "su3_generic": lambda: generators.generic_basis(lc.group("su3"), np.random.default_rng(8)),
}


@pytest.mark.parametrize("name", REPRESENTATIONS)
def test_other_representations_and_bases(name: str) -> None:
    shortest_in_another_representation(REPRESENTATIONS[name]())


def shortest_in_another_representation(group: MatrixGroup) -> None:
    rng = np.random.default_rng(9)
    elements = []
    for size in (0.3, 2.0, 3.1, 5.0, 6.2):
        for _ in range(4):
            x = rng.normal(size=group.dim)
            elements.append(scipy.linalg.expm(group.hat(x * size / np.linalg.norm(x))))
    kappa = max(np.max(np.abs(X)) * np.max(np.abs(np.linalg.inv(X))) for X in elements)
    assert worst(group, elements) < 1e-12 * max(1.0, kappa)


@pytest.mark.slow
def test_the_spin_representation_of_dimension_seven() -> None:
    shortest_in_another_representation(generators.spin_group(6))


def test_phase_and_spin_take_the_shorter_pair() -> None:
    group = generators.unitary_group(2)
    X = scipy.linalg.expm(group.hat([0.4, 0, 0, 2 * np.pi - 1e-3]))
    found = compiled(group)(X)
    assert np.linalg.norm(group.hat(found)) < np.linalg.norm(group.hat([0.4, 0, 0, 2 * np.pi - 1e-3]))
    assert generators.residual(group, found, X) < 1e-14


@pytest.mark.parametrize(
    ("name", "X"),
    [
        ("sl2", -np.eye(2)),
        ("sl3", np.diag([1.0, -1, -1])),
        ("gl3", np.diag([-2.0, 3, -2])),
        ("sp4", -np.eye(4)),
        ("so31", np.diag([-1.0, -1, 1, 1])),
        ("so_2_2", np.diag([-1.0, -1, 1, 1])),
        ("so_2_2", -np.eye(4)),
        ("su2", -np.eye(2)),
        ("so4", -np.eye(4)),
    ],
)
def test_what_has_a_logarithm_on_the_cut_gets_one(name: str, X: np.ndarray) -> None:
    assert generators.residual(lc.group(name), compiled(lc.group(name))(X), X) < 2e-14


@pytest.mark.parametrize("name", ["sl2", "gl2", "gl3", "sl3", "so3", "so4", "so5", "so31", "se3", "h3"])
def test_what_has_none_gets_nan_in_every_component(name: str) -> None:
    for text, X in generators.without_logarithm(name, np.random.default_rng(10)):
        assert np.all(np.isnan(compiled(lc.group(name))(X))), text
        assert np.all(np.isnan(call_group(lc.group(name), "log", X))), text
    assert np.all(np.isnan(compiled(lc.group(name))(np.full_like(X, np.nan))))


@pytest.mark.parametrize("name", ["so3", "se3", "su2", "su3", "so4", "so5", "so31", "sp4", "sl3", "sim3", "se2", "h3"])
def test_off_the_group_it_is_the_logarithm_of_the_nearest_element(name: str) -> None:
    rng = np.random.default_rng(11)
    group = lc.group(name)
    x = rng.normal(size=group.dim)
    X = scipy.linalg.expm(group.hat(x / np.linalg.norm(x)))
    for size in (1e-13, 1e-9, 1e-7, 1e-6):
        Y = generators.off_the_group(group, X, size, rng)
        near = lc.nearest(group, Y).X
        weight = 1e-13 if name in ("so3", "su2", "su3", "so4", "so5") else 3 * size
        assert np.max(np.abs(compiled(group)(Y) - compiled(group)(near))) < weight + 1e-13
        # Whatever "nearest" means in the group, the answer is a logarithm of an element as near as the noise.
        assert np.linalg.norm(scipy.linalg.expm(group.hat(compiled(group)(Y))) - Y) < 3 * size + 1e-13
    far = generators.off_the_group(group, X, 3e-4 * max(1.0, np.linalg.norm(X) ** 2), rng)
    assert np.all(np.isnan(compiled(group)(far)))


@pytest.mark.parametrize("name", ["so3", "su3", "so5", "sp4", "sl3"])
def test_derivatives_are_the_inverse_jacobian_on_every_branch(name: str) -> None:
    """First and second, in CasADi and in dual numbers, against central differences of the kernel along the group."""
    rng = np.random.default_rng(12)
    group = lc.group(name)
    x = rng.normal(size=group.dim)
    x *= 1.5 / np.linalg.norm(group.hat(x), 2)
    X = scipy.linalg.expm(group.hat(x))
    if name == "su3":
        Q = generators.haar_unitary(3, rng)
        X = (Q * np.exp(1j * np.array([2.8, 2.4, -5.2]))) @ Q.conj().T
    v, w = rng.normal(size=(2, group.dim)) / np.sqrt(group.dim)
    A, B = group.hat(v), group.hat(w)

    def moved(s: float, t: float) -> np.ndarray:
        return compiled(group)(X @ scipy.linalg.expm(s * A) @ scipy.linalg.expm(t * B))

    step = 1e-3
    first = (moved(step, 0) - moved(-step, 0)) / (2 * step) * 4 / 3 - (moved(2 * step, 0) - moved(-2 * step, 0)) / (
        12 * step
    )
    second = (moved(step, step) - moved(step, -step) - moved(-step, step) + moved(-step, -step)) / (4 * step**2)
    flat = lambda M: np.ascontiguousarray(M).view(np.float64).ravel()  # noqa: E731
    s, t = ca.SX.sym("s"), ca.SX.sym("t")
    # X exp(s A) exp(t B) to the order that matters.
    path = flat(X) + s * flat(X @ A) + t * flat(X @ B) + s * t * flat(X @ A @ B)
    value = function_of_group(group, "log")(path)
    slope = ca.jtimes(value, s, ca.SX(1))
    both = ca.Function("both", [s, t], [slope, ca.jtimes(slope, t, ca.SX(1))])
    ours = [np.array(part).ravel() for part in both(0, 0)]
    np.testing.assert_allclose(ours[0], first, atol=1e-7 * max(1.0, np.max(np.abs(first))))
    np.testing.assert_allclose(ours[1], second, atol=1e-3 * max(1.0, np.max(np.abs(second))))
    if group.is_complex:
        return
    dual = DualArithmetic(FloatArithmetic())
    entries = [
        [dual.variable(a, {0: b}) for a, b in zip(p, q, strict=True)]
        for p, q in zip(X.tolist(), (X @ A).tolist(), strict=True)
    ]
    (answer,) = group_kernel(group, "log").evaluate(dual, entries)
    np.testing.assert_allclose(
        [entry.tangent[0] for entry in answer], ours[0], atol=1e-12 * max(1.0, np.max(np.abs(first)))
    )


def test_without_a_compiler_the_twin_says_the_same() -> None:
    rng = np.random.default_rng(13)
    for name in ("su3", "so5", "sp4", "sl3", "so4"):
        group = lc.group(name)
        for _ in range(5):
            x = rng.normal(size=group.dim)
            X = scipy.linalg.expm(group.hat(2 * x / np.linalg.norm(x)))
            np.testing.assert_allclose(call_group(group, "log", X), compiled(group)(X), atol=1e-12)


def test_known_answers_come_back_with_the_conditioning_of_the_inverse_jacobian() -> None:
    rng = np.random.default_rng(14)
    group = lc.group("so4")
    for delta in (1e-3, 1e-6, 1e-9):
        Q = generators.haar_rotation(4, rng)
        angles = np.array([np.pi - delta, np.pi - 2 * delta])
        A = np.zeros((4, 4))
        A[1, 0], A[3, 2] = angles
        A = Q @ (A - A.T) @ Q.T
        core = scipy.linalg.block_diag(generators.half_turn_less(delta), generators.half_turn_less(2 * delta))
        x = compiled(group)(Q @ core @ Q.T)
        assert np.linalg.norm(group.hat(x) - A) < 4e-15 * 2 * np.pi / (3 * delta) + 1e-13


@pytest.mark.parametrize("real", ["double", "float"])
@pytest.mark.parametrize("name", ["gl2", "gl3", "sl3", "sp4", "su3", "so5", "so4"])
def test_elements_whose_squares_are_no_numbers(name: str, real: str) -> None:
    """log(1 + E) = E for |E| = 1e-160, in floats 1e-25, where squares of entries made NaN."""
    group = lc.group(name)
    log = compiled(group)
    small = 1e-160 if real == "double" else 1e-25
    E = group.hat(small * np.ones(group.dim))
    np.fill_diagonal(E, 0)
    (L,) = log.batch(np.array([np.eye(group.degree) + E]), real=real)
    np.testing.assert_allclose(
        group.hat(L.astype(float)), E, rtol=1e-15 if real == "double" else 1e-6, atol=1e-15 * small
    )


STRICT = ["-std=c99", "-pedantic", "-Wall", "-Wextra", "-Werror", "-Wconversion", "-Wshadow"]
SANITIZE = ["-O1", "-fsanitize=address,undefined,float-cast-overflow", "-fno-sanitize-recover=all"]
DRIVER = """#include <math.h>
#include <stdio.h>
#include "{name}.h"
#include "data.h"
int main(void)
{{
    double x[64];
    int i;
    for (i = 0; i < {count}; ++i) {{
        {name}_log(data[i], x);
        printf("%d", x[0] == x[0]);
    }}
    return 0;
}}
"""


@pytest.mark.skipif(shutil.which("gcc") is None, reason="needs gcc and its sanitizers")
@pytest.mark.parametrize("name", ["su3", "sp4", "so5"])
def test_the_c_of_iterated_logarithms_is_strict_and_sound_on_anything(name: str, tmp_path: Path) -> None:
    """NaN, infinity, zero and singular matrices, Jordan blocks, tiny and huge ones, under the sanitizers of gcc."""
    rng = np.random.default_rng(15)
    group = lc.group(name)
    d = group.degree
    elements = [scipy.linalg.expm(group.hat(rng.normal(size=group.dim))) for _ in range(10)]
    jordan = -np.eye(d)
    jordan[0, -1] = 1
    odd = [np.zeros((d, d)), np.full((d, d), np.nan), np.full((d, d), np.inf), np.ones((d, d)), 1e-200 * np.eye(d)]
    odd += [1e200 * np.eye(d), rng.normal(size=(d, d))]
    kind = complex if group.is_complex else float
    rows = (
        np.array([np.asarray(X, dtype=kind) for X in [*elements, jordan, *odd]])
        .view(np.float64)
        .reshape(len(elements) + 8, -1)
    )
    words = {"nan": "NAN", "inf": "INFINITY"}
    text = ",".join("{" + ",".join(words.get(repr(float(v)), repr(float(v))) for v in row) + "}" for row in rows)
    folder = lc.generate([k for k in lc.group_kernels(group) if k.name == "log"], tmp_path / "package")
    (tmp_path / "data.h").write_text(f"static const double data[{len(rows)}][{rows.shape[1]}] = {{{text}}};\n")
    (tmp_path / "driver.c").write_text(DRIVER.format(name=name, count=len(rows)))
    command = [
        "gcc",
        *STRICT,
        *SANITIZE,
        f"-I{folder}/include",
        "-I.",
        "driver.c",
        f"{folder}/src/{name}.c",
        "-lm",
        "-o",
        "driver",
    ]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    ran = subprocess.run(["./driver"], cwd=tmp_path, capture_output=True, text=True)
    assert ran.returncode == 0, ran.stderr
    assert ran.stdout[: len(elements)] == "1" * len(elements)
    assert ran.stdout[len(elements) + 1 :] == "0" * 7


@pytest.mark.slow
def test_two_routines_of_one_group_share_their_helpers(tmp_path: Path) -> None:
    """log and renormalise of a group in which both are iterated: the example of the package compiles and passes."""
    group = generators.spin_group(3)
    kernels = [k for k in lc.group_kernels(group) if k.name in ("log", "renormalise")]
    folder = lc.generate(kernels, tmp_path / "package")
    command = ["gcc", *STRICT, "-O1", "-Iinclude", "example.c", f"src/{group.name}.c", "-lm", "-o", "example"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert subprocess.run(["./example"], cwd=folder).returncode == 0


@pytest.mark.parametrize("real", ["so2", "se2", "so3", "se3", "gl2", "sim3", "so4", "so31"])
def test_real_blocks_beside_complex_ones(real: str) -> None:
    """exp leads back; an imaginary part in a real block, or in an entry that is 0, is no element."""
    group = lc.product(real, "su2")
    x = 0.4 * np.random.default_rng(11).normal(size=group.dim)
    X = scipy.linalg.expm(group.hat(x))
    log = compiled(group)
    np.testing.assert_allclose(log(X), x, atol=1e-12)
    np.testing.assert_allclose(log.batch(np.array([X] * 9))[8], x, atol=1e-12)
    d = lc.group(real).degree
    for place in np.ndindex(d, d):
        off = X.astype(complex)
        off[place] += 1e-3j
        assert np.all(np.isnan(log(off)))
