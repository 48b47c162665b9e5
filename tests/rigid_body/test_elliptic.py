"""Elliptic functions: numpy, compiled scalar C and compiled lanes against mpmath, over the whole range of k."""

from __future__ import annotations

import mpmath as mp
import numpy as np
import pytest

from lie_codegen.errors import NotFiniteError, ShapeError
from lie_codegen.groups.build import build
from lie_codegen.kernel.elliptic import ladder, nome, phase
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.numpy_arithmetic import NumpyArithmetic, evaluate
from lie_codegen.rigid_body.elliptic_kernels import elliptic_kernels

KERNELS = {kernel.name: kernel for kernel in elliptic_kernels()}
MODULI = (0.0, 1e-8, 1e-3, 0.1, 0.5, 0.6, 0.9, 0.99, 0.999, 0.9999, 0.99999, 0.999999)
DIGITS = 40


@pytest.fixture(scope="module")
def library():
    return build(elliptic_kernels())


def oracle(phi, k):
    """(sn, cn, dn, zeta), by mpmath's theta functions and Legendre integral; no code shared with the ladder."""
    k, phi = mp.mpf(k), mp.mpf(phi)
    m = k * k
    K, E = mp.ellipk(m), mp.ellipe(m)
    u = 4 * K * phi
    sn, cn, dn = (mp.ellipfun(name, u, m=m) for name in ("sn", "cn", "dn"))
    angle = mp.atan2(sn, cn)
    amplitude = angle + 2 * mp.pi * mp.nint(phi - angle / (2 * mp.pi))
    return sn, cn, dn, mp.ellipe(amplitude, m) - u * E / K


def points(count, seed=0, reach=0.24):
    """Phases of |u| < 6 and moduli of the whole range."""
    rng = np.random.default_rng(seed)
    return [(float(phi), k) for k in MODULI for phi in rng.uniform(-reach, reach, count)]


@pytest.mark.parametrize("how", ["numpy", "scalar", "lanes"])
def test_functions_are_mpmaths_to_2e_15_near_and_2e_14_at_40(how, library):
    call = {
        "numpy": lambda phi, k: evaluate(KERNELS["jacobi"], phi, k),
        "scalar": lambda phi, k: np.array([library.jacobi(p, q) for p, q in zip(phi, k, strict=True)]).T,
        "lanes": lambda phi, k: library.jacobi.batch(phi=phi, k=k),
    }[how]
    with mp.workdps(DIGITS):
        near = points(5)
        far = [(40 / (4 * float(mp.ellipk(mp.mpf(k) ** 2))) * sign, k) for k in MODULI for sign in (1, -1)]
        for samples, tolerance in ((near, 2e-15), (far, 2e-14)):
            exact = np.array([[float(x) for x in oracle(phi, k)] for phi, k in samples])
            phi, k = np.array(samples).T
            np.testing.assert_allclose(np.array(tuple(call(phi, k))).T, exact, rtol=0, atol=tolerance)


@pytest.mark.parametrize("compiled", [False, True])
def test_complete_integrals_and_their_derivatives(compiled, library):
    with mp.workdps(DIGITS):
        for k in MODULI:
            exact = {
                "K": mp.ellipk(mp.mpf(k) ** 2),
                "E": mp.ellipe(mp.mpf(k) ** 2),
                "K_derivative": mp.diff(lambda x: mp.ellipk(x * x), mp.mpf(k)),
                "E_derivative": mp.diff(lambda x: mp.ellipe(x * x), mp.mpf(k)),
            }
            for name, value in exact.items():
                got = float(library[name](k)) if compiled else float(evaluate(KERNELS[name], k)[0])
                # the error of the input, 1e-16 / (1 - k), is in the result whatever the formula
                condition = 1 / (1 - k) if name == "K_derivative" else 1
                assert got == pytest.approx(float(value), rel=5e-16 * (6 + condition), abs=1e-30), (name, k)


@pytest.mark.parametrize("compiled", [False, True])
def test_derivatives_in_phi_and_k(compiled, library):
    """Relative to the largest entry: 2e-13 up to k = 0.99, 1e-10 at 0.999999 (the conditioning 1 / k'^2)."""
    with mp.workdps(DIGITS):
        for phi, k in points(2, seed=1):
            if k == 0:
                continue
            # the oracle takes phi as its input, so a difference in k is at fixed phi
            by_phi = [float(mp.diff(lambda p, i=i, k=k: oracle(p, k)[i], mp.mpf(phi))) for i in range(4)]
            by_k = [
                float(mp.diff(lambda q, i=i, p=phi: oracle(p, q)[i], mp.mpf(k), h=mp.mpf(10) ** -20)) for i in range(4)
            ]
            got = library.jacobi_derivative(phi, k) if compiled else evaluate(KERNELS["jacobi_derivative"], phi, k)
            tolerance = 2e-13 if k <= 0.99 else 1e-10
            for value, exact in zip(got, (by_phi, by_k), strict=True):
                np.testing.assert_allclose(value, exact, rtol=0, atol=tolerance * np.abs(exact).max())


def test_derivatives_at_zero_modulus_are_finite_and_exact():
    by_phi, by_k = evaluate(KERNELS["jacobi_derivative"], 0.1, 0.0)
    angle = 0.2 * np.pi
    np.testing.assert_allclose(by_phi, [2 * np.pi * np.cos(angle), -2 * np.pi * np.sin(angle), 0, 0], atol=1e-15)
    np.testing.assert_allclose(by_k, 0, atol=0)


def test_second_derivatives_by_casadi_agree_with_differences_of_first():
    import casadi as ca

    from lie_codegen.kernel.casadi_arithmetic import function_of

    phi, k = ca.SX.sym("phi"), ca.SX.sym("k")
    first = function_of(KERNELS["jacobi_derivative"])(phi, k)
    values = function_of(KERNELS["jacobi"])(phi, k)
    exact = ca.Function("d", [phi, k], [ca.jacobian(ca.vertcat(*values), ca.vertcat(phi, k))])
    second = ca.Function("h", [phi, k], [ca.jacobian(ca.vertcat(*first), ca.vertcat(phi, k))])
    step = 1e-5
    for p, q in ((0.07, 0.3), (-0.21, 0.9), (0.4, 0.6)):
        got = np.array(exact(p, q))
        np.testing.assert_allclose(got.T.ravel(), np.concatenate(evaluate(KERNELS["jacobi_derivative"], p, q)), 1e-12)
        shifted = [
            np.concatenate(evaluate(KERNELS["jacobi_derivative"], p + dp, q + dq))
            for dp, dq in ((step, 0), (-step, 0), (0, step), (0, -step))
        ]
        differences = np.array([shifted[0] - shifted[1], shifted[2] - shifted[3]]).T / (2 * step)
        np.testing.assert_allclose(np.array(second(p, q)), differences, rtol=1e-6, atol=1e-6 * np.abs(got).max() ** 2)


def test_phase_is_the_inverse_at_any_scale():
    ops = NumpyArithmetic()
    rng = np.random.default_rng(3)
    for k in MODULI:
        phi = rng.uniform(-0.5, 0.5, 200)
        sn, cn, dn, _ = evaluate(KERNELS["jacobi"], phi, k)
        scale = 10 ** rng.uniform(-9, 3, 200)
        tolerance = 1e-15 if k <= 0.9999 else 4e-15
        np.testing.assert_allclose(phase(ops, scale * sn, scale * cn, dn, ladder(ops, k)), phi, rtol=0, atol=tolerance)


def test_nome_is_mpmaths():
    for k in MODULI[3:]:
        assert nome(k) == pytest.approx(float(mp.qfrom(k=k)), rel=1e-9)
    assert nome(0.0) == 0.0


def test_outside_the_range_the_result_is_nan_and_bad_input_is_named(library):
    assert np.isnan(np.array(library.jacobi(0.1, 1.5))).any()
    with pytest.raises(NotFiniteError, match="jacobi: k holds NaN"):
        evaluate(KERNELS["jacobi"], 0.1, np.nan)
    three = Kernel("f", "n", (Port("omega", (3,)),), (Port("y", ()),), lambda ops, w: (w[0],))
    with pytest.raises(ShapeError, match="omega has shape"):
        evaluate(three, [1.0, 2.0])
