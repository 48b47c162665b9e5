"""What the kernels of a group are: their ports, their cost, and how they follow from the group's own spectrum."""

from __future__ import annotations

import random
import time
from fractions import Fraction

import numpy as np
import pytest
import scipy.linalg
import sympy as sp
from kernel_calls import adjoint_matrix, call, call_group, kernel, load, unflatten

import lie_codegen as lc
from lie_codegen.codegen.tape import tape_of
from lie_codegen.errors import InputError
from lie_codegen.exact.even_spectrum import EvenSpectrum, even_spectrum, newton_coefficients
from lie_codegen.exact.modular import modular_images
from lie_codegen.exact.numbers import exact_number
from lie_codegen.exact.quadratic_form import QuadraticForm
from lie_codegen.exact.spectral_pattern import spectral_pattern
from lie_codegen.groups.derivation import GroupDerivation
from lie_codegen.groups.kernels import KERNEL_NAMES, group_kernel, group_kernels
from lie_codegen.groups.maps.log_structure import log_structure
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernel.arithmetic import FloatArithmetic
from lie_codegen.kernel.casadi_arithmetic import function_of
from lie_codegen.kernel.complex_scalar import Complex
from lie_codegen.kernel.cotangent import CotangentFunctions, taylor
from lie_codegen.kernel.dual import decimal_arithmetic
from lie_codegen.kernel.stumpff import StumpffFunctions

SHAPES = {
    "product_exp": ("g", "X"),
    "wei_norman_matrix": ("g", "M"),
    "wei_norman_rate": ("g u", "g_dot"),
    "exp": ("x", "X"),
    "log": ("X", "x"),
    "compose": ("X Y", "Z"),
    "inverse": ("X", "X_inverse"),
    "Ad": ("X", "Ad_X"),
    "ad": ("x", "ad_x"),
    "bracket": ("x y", "z"),
    "ljac": ("x", "J"),
    "rjac": ("x", "J"),
    "ljac_inv": ("x", "J_inv"),
    "rjac_inv": ("x", "J_inv"),
    "defect": ("X", "defect"),
    "renormalise": ("X", "Y"),
}


@pytest.mark.parametrize("name", lc.group_names())
def test_every_group_has_the_kernels_of_the_front_door(name: str) -> None:
    group = load(name)
    kernels = group_kernels(group)
    assert tuple(k.name for k in kernels) == KERNEL_NAMES == tuple(SHAPES)
    for k in kernels:
        inputs, output = SHAPES[k.name]
        assert [port.name for port in k.inputs] == inputs.split()
        assert [port.name for port in k.outputs] == [output]
        for port in k.inputs + k.outputs:
            matrix = port.name in ("X", "Y", "Z", "X_inverse")
            square = port.name in ("M", "Ad_X", "ad_x", "J", "J_inv")
            d = group.degree if matrix else group.dim
            assert port.shape == (() if port.name == "defect" else (d, d) if matrix or square else (d,))
            assert port.is_complex == (matrix and group.is_complex)
        assert k.namespace == group.name
        assert k.formula
        assert k.source


def test_an_unknown_kernel_is_refused() -> None:
    with pytest.raises(InputError, match="no kernel 'expp'"):
        group_kernel(load("so3"), "expp")


@pytest.mark.parametrize("name", ["so3", "se3", "su2", "sl2", "aff1", "osc4", "so31", "su3", "sim2"])
def test_the_plain_float_meaning_is_the_compiled_expression(name: str) -> None:
    rng = random.Random(8)
    for k in group_kernels(load(name)):
        arguments = k.sample(rng)
        [expected] = k.evaluate(FloatArithmetic(), *arguments)
        flat = [np.array([_parts(entry, p.is_complex) for entry in np.ravel(np.array(a, dtype=object))]).ravel()
                for a, p in zip(arguments, k.inputs, strict=True)]  # fmt: skip
        actual = unflatten(k.outputs[0], np.array(function_of(k)(*flat)))
        wanted = np.array(
            [Complex.of(z).re + 1j * Complex.of(z).im for z in np.ravel(np.array(expected, dtype=object))]
        )
        np.testing.assert_allclose(actual.ravel(), wanted, atol=1e-13 * max(1.0, float(np.max(np.abs(wanted)))))


def _parts(entry: object, is_complex: bool) -> list[float]:
    z = Complex.of(entry)
    return [float(z.re), float(z.im)] if is_complex else [float(z.re)]


def operations(name: str, kernel_name: str) -> int:
    return sum(s.op not in ("INPUT", "CONST") for s in tape_of(kernel(name, kernel_name)).statements)


@pytest.mark.parametrize(
    ("name", "kernel_name", "most"),
    [
        ("so3", "exp", 80), ("so3", "log", 220), ("so3", "ljac", 80), ("so3", "ljac_inv", 80), ("so3", "inverse", 0),
        ("se3", "exp", 112), ("se3", "log", 370), ("se3", "ljac", 310), ("se3", "ljac_inv", 300), ("se3", "inverse", 18),
        ("se3", "Ad", 80), ("se_2_3", "exp", 145), ("h3", "exp", 4), ("h3", "log", 75), ("engel", "ljac", 40),
        ("so4", "log", 600), ("su3", "exp", 700), ("su3", "ljac", 3100), ("sp4", "ljac", 5900), ("so31", "ljac_inv", 580),
    ],
)  # fmt: skip
def test_operations_do_not_grow(name: str, kernel_name: str, most: int) -> None:
    assert operations(name, kernel_name) <= most


@pytest.mark.parametrize("name", ["so3", "se3"])
def test_deriving_all_kernels_takes_a_fraction_of_a_second(name: str) -> None:
    import dataclasses

    group = dataclasses.replace(load(name), description="not derived before")
    start = time.process_time()
    for k in group_kernels(group):
        function_of(k)
    assert time.process_time() - start < 1.0


def test_patterns_of_known_groups() -> None:
    def summary(name: str) -> tuple[list[tuple[int, int]], list[tuple[int, int]]]:
        data = GroupDerivation(load(name))
        patterns = (data.matrix_pattern, data.adjoint_pattern)
        return tuple([(c.zeros, c.pairs) for c in p or ()] for p in patterns)  # type: ignore[return-value]

    assert summary("so3") == ([(1, 1)] * 3, [(1, 1)] * 3)
    assert summary("sl2") == ([(0, 1)] * 2, [(1, 1)] * 3)
    assert summary("se3") == ([(1, 1)] * 3 + [(2, 1)], [(1, 2)] * 3 + [(1, 1)] * 3)
    assert summary("h3") == ([(1, 0), (2, 0), (3, 0)], [(2, 0), (2, 0), (1, 0)])
    assert summary("su3") == ([], [])
    form = spectral_pattern(list(load("so3").exact_basis))[0].form  # type: ignore[index]
    assert form == QuadraticForm(tuple(((i, i), sp.S.One) for i in range(3)))


def test_signs_of_quadratic_forms() -> None:
    def form(**terms: object) -> QuadraticForm:
        return QuadraticForm(tuple(((int(k[1]), int(k[2])), exact_number(v)) for k, v in terms.items()))

    assert form(q00=1, q11=2).is_nonnegative
    assert form(q00=1, q01=2, q11=1).is_nonnegative
    assert form(q00=3, q01="2*sqrt(3)", q11=1).is_nonnegative
    assert not form(q00=1, q01=3, q11=1).is_nonnegative
    assert not form(q01=1).is_nonnegative
    assert not form(q00=-1).is_nonnegative


def test_even_spectra_of_known_families() -> None:
    assert GroupDerivation(load("so4")).matrix_spectrum == EvenSpectrum(2, 2, False)
    assert GroupDerivation(load("so4")).adjoint_spectrum == EvenSpectrum(2, 2, True)
    assert GroupDerivation(load("su3")).adjoint_spectrum == EvenSpectrum(3, 2, True)
    assert GroupDerivation(load("sl3")).matrix_spectrum is None
    assert even_spectrum(load("aff1").exact_basis) is None
    assert newton_coefficients([Fraction(6), Fraction(14), Fraction(36)]) == [-6, 11, -6]


def test_residues_respect_sums_and_products() -> None:
    numbers = [exact_number(text) for text in ("sqrt(3)", "1/2", "sqrt(2)", "3", "sqrt(6)", "3/2", "sqrt(2) - 1/2")]
    prime, (root3, half, root2, three, root6, three_halves, last) = modular_images(numbers)  # type: ignore[misc]
    assert root3 * root3 % prime == three
    assert root2 * root3 % prime == root6
    assert half * three % prime == three_halves
    assert (root2 - half) % prime == last
    prime, (pi, square, ratio) = modular_images([sp.pi, sp.pi**2, 1 / (2 * sp.pi)])  # type: ignore[misc]
    assert pi * pi % prime == square
    assert 2 * ratio * pi % prime == 1


@pytest.mark.parametrize("z", ["0", "1e-9", "0.5", "0.999", "1.001", "5.9", "6.1", "9.8", "39", "-0.9", "-1.1", "-30"])
def test_entire_functions_against_their_series(z: str) -> None:
    """c_k(z) and the tails of (sqrt z / 2) cot(sqrt z / 2), with derivatives, summed exactly to 60 digits."""
    exact = sp.Rational(z)
    value = float(exact)
    for top in (3, 5, 7):
        functions = StumpffFunctions(FloatArithmetic(), value, top, signed=value < 0)
        for k in range(top + 1):
            wanted = sp.N(sum((-exact) ** j / sp.factorial(2 * j + k) for j in range(60)), 30)
            assert functions.c(k) == pytest.approx(float(wanted), rel=4e-14, abs=3e-16)
    ops = decimal_arithmetic(60)
    for a in range(3):
        for order in range(3):
            ours = CotangentFunctions(FloatArithmetic(), value, signed=value < 0).remainder(a, order)
            if abs(value) < 20:
                terms = (
                    taylor(j) * sp.binomial(j - a, order) * (-exact) ** (j - a - order) for j in range(a + order, 240)
                )
                wanted = sp.N(sum((sp.Rational(t) for t in terms), sp.S.Zero), 30)
            else:
                wanted = sp.N(CotangentFunctions(ops, ops.constant(exact), signed=value < 0).remainder(a, order), 30)
            assert ours == pytest.approx(float(wanted), rel=2e-13)


@pytest.mark.parametrize("name", ["so3", "se2", "se3", "h3", "sl2", "osc4", "aff1", "su2"])
def test_any_basis_of_an_algebra_will_do(name: str) -> None:
    """A random exact change of basis: the kernels follow from the definition, not from a name or a convenient basis."""
    original = load(name)
    group = changed_basis(original, seed=sum(map(ord, name)))
    rng = np.random.default_rng(1)
    data = GroupDerivation(group)
    closed = GroupDerivation(original)
    assert (data.adjoint_pattern is None) == (closed.adjoint_pattern is None)
    x = rng.normal(size=group.dim)
    x /= np.linalg.norm(group.hat(x), 2)
    functions = {k.name: (k, function_of(k)) for k in group_kernels(group)}

    def value(kernel_name: str, argument: np.ndarray) -> np.ndarray:
        k, f = functions[kernel_name]
        flat = np.stack([argument.real, argument.imag], -1).ravel() if k.inputs[0].is_complex else argument.ravel()
        return unflatten(k.outputs[0], np.array(f(flat)))

    X = value("exp", x)
    np.testing.assert_allclose(X, scipy.linalg.expm(group.hat(x)), atol=1e-14)
    condition = float(np.linalg.cond(group.basis.reshape(group.dim, -1)))
    np.testing.assert_allclose(value("log", X), x, atol=1e-14 * condition)
    ad = adjoint_matrix(group, x)
    np.testing.assert_allclose(value("Ad", X), scipy.linalg.expm(ad), atol=1e-13 * condition**2)
    n = group.dim
    series = scipy.linalg.expm(np.block([[ad, np.eye(n)], [np.zeros((n, 2 * n))]]))[:n, n:]
    np.testing.assert_allclose(value("ljac", x), series, atol=1e-13 * condition**2)
    np.testing.assert_allclose(value("ljac_inv", x) @ series, np.eye(n), atol=1e-12 * condition**2)


def changed_basis(group: MatrixGroup, seed: int) -> MatrixGroup:
    rng = random.Random(seed)
    n = group.dim
    while True:
        T = sp.Matrix(n, n, lambda i, j: sp.Rational(rng.randint(-3, 3), rng.randint(1, 2)))
        if T.det() != 0:
            break
    matrices = []
    for i in range(n):
        total = sp.zeros(group.degree, group.degree)
        for j in range(n):
            total += T[i, j] * group.exact_basis[j]
        matrices.append(total)
    return lc.from_matrices(f"{group.name}_changed", [f"b{i}" for i in range(n)], matrices)


def test_blocks_of_logarithms() -> None:
    def kinds(name: str) -> list[str]:
        return [block.kind + "+" * block.scaled for block in log_structure(load(name)).blocks]

    assert kinds("se_2_3") == ["space"]
    assert kinds("sim3") == ["space+"]
    assert kinds("osc4") == ["plane"]
    assert kinds("h3") == []
    assert kinds("su2") == ["spin"]
    assert kinds("gl2") == ["real2+"]
    assert kinds("so4") == ["space4"]
    assert kinds("so31") == ["lorentz"]
    assert kinds("su3") == ["unitary"]
    assert kinds("so5") == ["rotation"]
    assert kinds("sp4") == ["matrix"]
    assert [log_structure(load(name)).is_closed for name in ("sim3", "so31", "su3", "sp4")] == [
        True,
        True,
        False,
        False,
    ]
    assert log_structure(load("se3")).steps == 1
    assert log_structure(load("sgal3")).steps == 2
    assert log_structure(load("so3")).steps == 0


@pytest.mark.slow
@pytest.mark.parametrize("name", ["so5", "se4", "su4", "sl4", "sp6", "gl3", "h7"])
def test_larger_members_of_the_families(name: str) -> None:
    group = load(name)
    rng = np.random.default_rng(2)
    x = rng.normal(size=group.dim)
    x /= np.linalg.norm(group.hat(x), 2)
    X = call(name, "exp", x)
    np.testing.assert_allclose(X, scipy.linalg.expm(group.hat(x)), atol=1e-14)
    np.testing.assert_allclose(call(name, "log", X), x, atol=1e-13)
    ad = adjoint_matrix(group, x)
    np.testing.assert_allclose(call(name, "Ad", X), scipy.linalg.expm(ad), atol=1e-13)
    n = group.dim
    series = scipy.linalg.expm(np.block([[ad, np.eye(n)], [np.zeros((n, 2 * n))]]))[:n, n:]
    np.testing.assert_allclose(call(name, "rjac", -x), series, atol=1e-13)
    np.testing.assert_allclose(call(name, "ljac_inv", x) @ series, np.eye(n), atol=1e-13)


@pytest.mark.parametrize("name", ["so31", "so_2_2", "sp4", "sp6", "sl2"])
def test_what_keeps_a_form_is_inverted_without_cancelling(name: str) -> None:
    """X^{-1} = S^{-1} X^T S moves entries: inverting twice gives X bit for bit, also where |X| |X^{-1}| is 1e10 and X^{-1} by the
    adjugate has no digit left."""
    group = lc.group(name)
    x = np.random.default_rng(12).normal(size=group.dim)
    x *= 8 / np.max(np.abs(np.linalg.eigvals(group.hat(x))))
    X, back = scipy.linalg.expm(group.hat(x)), scipy.linalg.expm(-group.hat(x))
    inverse = call_group(group, "inverse", X)
    np.testing.assert_array_equal(call_group(group, "inverse", inverse), X)
    np.testing.assert_allclose(inverse, back, atol=1e-11 * np.max(np.abs(back)))
