"""(Omega, k, phi): round trips for every axis order, convention and sign; the torque-free solution; refusals."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from lie_codegen.errors import InputError, NotFiniteError, ShapeError
from lie_codegen.kernel.numpy_arithmetic import evaluate
from lie_codegen.rigid_body.free_rigid_body import SlowState, free_rigid_body

SIGNS = [s for s in itertools.product((1, -1), repeat=3) if s[0] * s[1] * s[2] == -1]
ORDERS = list(itertools.permutations((3, 4, 5)))


def by_numpy(body, name, *arguments):
    """A kernel of the body without compiling: 48 bodies are tried below."""
    (kernel,) = (k for k in body.kernels() if k.name == name)
    results = evaluate(kernel, *arguments)
    return results if len(results) > 1 else results[0]


def euler(inertia):
    i = np.array(inertia, float)
    return lambda t, w: np.cross(i * w, w) / i


@pytest.mark.parametrize("axis", ["max", "min"])
@pytest.mark.parametrize("inertia", ORDERS)
def test_every_order_axis_and_sign_solves_eulers_equations(inertia, axis):
    """u linear in t with the stated rate is an exact solution: residual of (3) by differences in time."""
    for signs in SIGNS:
        body = free_rigid_body(inertia, axis=axis, signs=signs)
        spin, k, phi = np.array([1.3, 0.4, 2.0]), np.array([0.6, 0.05, 0.95]), np.array([0.123, -0.4, 0.31])
        rate = by_numpy(body, "frequency", spin, k)
        step = 1e-3
        weights = np.array([1, -8, 8, -1]) / (12 * step)
        shifted = np.stack([by_numpy(body, "from_slow", spin, k, phi + rate * n * step) for n in (-2, -1, 1, 2)])
        motion = by_numpy(body, "from_slow", spin, k, phi)
        expected = np.array([euler(inertia)(0, w) for w in motion])
        np.testing.assert_allclose(np.tensordot(weights, shifted, 1), expected, atol=3e-11)


@pytest.mark.parametrize("axis", ["max", "min"])
@pytest.mark.parametrize("inertia", ORDERS)
def test_coordinates_round_trip(inertia, axis):
    rng = np.random.default_rng(4)
    for signs in SIGNS:
        body = free_rigid_body(inertia, axis=axis, signs=signs)
        spin, k = rng.uniform(0.1, 3, 400), rng.uniform(0, 0.999, 400)
        phi = rng.uniform(-0.5, 0.5, 400)
        omega = by_numpy(body, "from_slow", spin, k, phi)
        back = SlowState(*by_numpy(body, "to_slow", omega))
        np.testing.assert_allclose(back.Omega, spin, rtol=2e-15)
        np.testing.assert_allclose(back.k, k, rtol=1e-13)
        np.testing.assert_allclose(np.exp(2j * np.pi * back.phi), np.exp(2j * np.pi * phi), atol=2e-14)
        np.testing.assert_allclose(by_numpy(body, "from_slow", *back), omega, atol=3e-15 * spin.max())
    # the compiled functions of the last body
    compiled = body.to_slow(omega)
    np.testing.assert_allclose(compiled, back, rtol=1e-13, atol=1e-14)
    np.testing.assert_allclose(body.from_slow(*compiled), omega, atol=3e-15 * spin.max())


def test_motion_is_the_integrated_one():
    body = free_rigid_body((3, 4, 5))
    start = np.array([0.9, -0.4, 1.2])
    t = np.linspace(0, 60, 7)
    oracle = solve_ivp(euler((3, 4, 5)), (0, 60), start, "DOP853", t_eval=t, rtol=1e-13, atol=1e-14).y.T
    np.testing.assert_allclose(body.motion(start, t), oracle, atol=2e-11)


def test_constants_and_the_modulus_by_momentum_parameter():
    """(18): k^2 = (I1 - I2)(I - I3) / ((I2 - I3)(I1 - I)) with I = L^2 / 2T; (17a), (17b)."""
    body = free_rigid_body((3, 4, 5))
    omega = np.random.default_rng(5).normal(size=(50, 3)) * [0.3, 0.3, 0.1] + [0, 0, 1.5]
    energy, momentum = body.energy_and_momentum(omega)
    np.testing.assert_allclose(energy, (omega**2 * [3, 4, 5]).sum(1) / 2)
    parameter = momentum**2 / (2 * energy)
    slow = body.to_slow(omega)
    np.testing.assert_allclose(slow.k**2, (3 - 4) * (parameter - 5) / ((4 - 5) * (3 - parameter)), rtol=1e-9)
    g13 = 3 / 5 * np.sqrt((1 / 3) / (1 / 5))
    np.testing.assert_allclose(momentum, 5 * slow.Omega * np.sqrt(1 + g13**2 * slow.k**2), rtol=1e-14)


def test_gamma_identities():
    """gamma_23^2 - gamma_13^2 = 1 and gamma_12^2 + gamma_32^2 = 1, exactly."""
    for inertia in ((3, 4, 5), (5, 4, 3), ("2.5", "3", "4.1")):
        model = free_rigid_body(inertia).model
        assert (model.small_gamma(2, 3) ** 2 - model.small_gamma(1, 3) ** 2).nsimplify() == 1
        assert (model.small_gamma(1, 2) ** 2 + model.small_gamma(3, 2) ** 2).nsimplify() == 1


def test_adapted_body_takes_any_motion_off_the_separatrix():
    rng = np.random.default_rng(6)
    body = free_rigid_body((3, 4, 5))
    for omega in rng.normal(size=(25, 3)):
        own = body.adapted_to(omega)
        np.testing.assert_allclose(own.from_slow(*own.to_slow(omega)), omega, atol=1e-14)


def test_steady_spin_and_slow_inertia():
    body = free_rigid_body((3, 4, 5), rates=("0.1", "-0.2", "0.3"))
    slow = body.to_slow([0, 0, 2.0], tau=0.5)
    assert slow == (2.0, 0.0, 0.0)
    same = free_rigid_body(("3 + 0.1*tau", "4 - tau/5", "5 + 0.3*tau"))
    now = free_rigid_body(("3.05", "3.9", "5.15"))
    omega = [0.2, 0.3, 1.0]
    for other in (body, same):
        np.testing.assert_allclose(other.to_slow(omega, tau=0.5), now.to_slow(omega), rtol=1e-14)


def test_refusals_say_why():
    body = free_rigid_body((3, 4, 5))
    cases = [
        (lambda: free_rigid_body((3, 3.001, 5)), "harmonic oscillator"),
        (lambda: free_rigid_body((3, 4, 4.002)), "harmonic oscillator"),
        (lambda: free_rigid_body((1, 2, 4)), "above the sum of the other two"),
        (lambda: free_rigid_body((0, 4, 5)), "positive"),
        (lambda: free_rigid_body((3, 4)), "inertia must hold 3 entries"),
        (lambda: free_rigid_body((3, 4, 5), signs=(1, 1, 1)), "product is -1"),
        (lambda: free_rigid_body((3, 4, 5), axis="mid"), "'max' or 'min'"),
        (lambda: free_rigid_body((3, 4, "5 + t")), "no name 't'"),
        (lambda: body.to_slow([1.5, 0.1, 0.1]), "axis='min'"),
        (lambda: body.to_slow([0.1, 0.1, -1.5]), "other sense"),
        (lambda: body.to_slow([0.0, 0.0, 0.0]), "at rest"),
        (lambda: body.to_slow(body.from_slow(1.0, 0.999999, 0.2) * [1.0000005, 1.0000005, 1]), "separatrix"),
        (lambda: body.from_slow(1.0, 0.9999999, 0.2), "separatrix"),
        (lambda: body.from_slow(-1.0, 0.5, 0.2), "amplitude"),
        (lambda: body.from_slow(1.0, -0.5, 0.2), "negative"),
    ]
    for call, words in cases:
        with pytest.raises(InputError, match=words):
            call()
    with pytest.raises(NotFiniteError):
        body.to_slow([np.nan, 0, 1])
    with pytest.raises(ShapeError):
        body.to_slow([1.0, 2.0])


@pytest.mark.parametrize("seed", range(4))
def test_a_matrix_of_inertia_keeps_its_axes(seed: int) -> None:
    """Euler's equations with the whole matrix, by scipy, in the user's axes."""

    R = Rotation.random(random_state=seed).as_matrix()
    J = R @ np.diag([2.0, 3.0, 4.5]) @ R.T
    J = (J + J.T) / 2
    omega0 = np.random.default_rng(seed).normal(size=3)
    body = free_rigid_body(J).adapted_to(omega0)
    t = np.linspace(0, 12, 7)
    run = solve_ivp(
        lambda _, w: np.linalg.solve(J, np.cross(J @ w, w)), (0, 12), omega0, t_eval=t, rtol=1e-11, atol=1e-12
    )
    np.testing.assert_allclose(body.motion(omega0, t), run.y.T, rtol=0, atol=1e-8)
    np.testing.assert_allclose(body.rotation @ np.diag([2.0, 3.0, 4.5]) @ body.rotation.T, J, rtol=0, atol=1e-13)
    assert np.linalg.det(body.rotation) == pytest.approx(1.0)
    energy, momentum = body.energy_and_momentum(omega0)
    assert float(energy) == pytest.approx(omega0 @ J @ omega0 / 2, rel=1e-13)
    assert float(momentum) == pytest.approx(np.linalg.norm(J @ omega0), rel=1e-13)


def test_matrices_of_inertia_that_are_refused() -> None:
    assert free_rigid_body(np.diag([3.0, 4.0, 5.0])) == free_rigid_body((3.0, 4.0, 5.0))
    for matrix, words in (
        ([[2, 1, 0], [0, 3, 0], [0, 0, 4]], "not symmetric"),
        ([[2, 0], [0, 3]], "no finite"),
        ([[2, "tau", 0], ["tau", 3, 0], [0, 0, 4]], "holds numbers"),
        ([[1, 0.5, 0], [0.5, 1, 0], [0, 0, 9]], "above the sum"),
    ):
        with pytest.raises(InputError, match=words):
            free_rigid_body(matrix)
    with pytest.raises(InputError, match="rates are of principal"):
        free_rigid_body([[2, 0.1, 0], [0.1, 3, 0], [0, 0, 4]], rates=(1, 0, 0))
