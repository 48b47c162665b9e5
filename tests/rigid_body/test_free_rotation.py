"""The whole free rotation: published numbers, SciPy's integration, the solid angle of the nutation, refusals, C."""

from __future__ import annotations

import numpy as np
import pytest
from package_program import run_example
from scipy.integrate import quad, solve_ivp
from scipy.spatial.transform import Rotation

import lie_codegen as lc
from lie_codegen.errors import AssumptionWarning, InputError, NotOnGroupError, ShapeError
from lie_codegen.kernel.numpy_arithmetic import evaluate

J = np.array([[5, 0.4, -0.3], [0.4, 3.8, 0.2], [-0.3, 0.2, 2.9]])
START = Rotation.from_rotvec([0.3, -0.5, 0.9]).as_matrix()


def hat(w):
    return np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])


def integrated(inertia, X, omega, t, rtol=3e-14):
    inverse = np.linalg.inv(inertia)

    def rate(_, y):
        return np.concatenate([(y[:9].reshape(3, 3) @ hat(y[9:])).ravel(), inverse @ np.cross(inertia @ y[9:], y[9:])])

    y = solve_ivp(rate, (0, t), np.concatenate([X.ravel(), omega]), method="DOP853", rtol=rtol, atol=1e-16).y[:, -1]
    return y[:9].reshape(3, 3), y[9:]


def test_published_long_axis_mode():
    free = lc.free_rotation(J.tolist(), START, (0.3, 0.2, 1))
    assert free.mode == "LAM"
    assert free.k == pytest.approx(0.51970818045, abs=1e-11)
    assert free.nutation_period == pytest.approx(19.3515060835, abs=1e-9)
    assert free.precession_rate == pytest.approx(1.1061411337, abs=1e-10)
    assert free.precession_rate * free.nutation_period % (2 * np.pi) == pytest.approx(2.5559409570, abs=1e-9)
    assert free.geometric_phase == pytest.approx(1.20893554928, abs=1e-10)
    np.testing.assert_allclose(free.X(50)[0], [0.95450288421, 0.27045734654, 0.12560679816], atol=1e-10)
    np.testing.assert_allclose(free.omega(50), [-0.10017972872, -0.46337503916, 0.95896200151], atol=1e-10)


def test_published_short_axis_mode():
    free = lc.free_rotation(J, START, (1, 0.2, -0.3))
    assert (free.mode, free.k) == ("SAM", pytest.approx(0.11784336656, abs=1e-10))
    assert free.nutation_period == pytest.approx(10.8464989690, abs=1e-9)
    np.testing.assert_allclose(free.X(50)[0], [0.25196552752, 0.66113437587, 0.70669279746], atol=1e-10)


@pytest.mark.parametrize(
    ("moments", "omega"),
    [
        ((3, 3, 5), (0.3, 0.4, 0.9)),  # symmetric, both kinds
        ((5, 5, 2), (0.3, 0.4, 0.9)),
        ((3, 3.0000001, 5), (0.3, 0.4, 0.9)),  # nearly symmetric
        ((3, 4, 5), (0, 0, -1)),  # pure spin, and next to it
        ((3, 4, 5), (1, 0, 0)),
        ((3, 4, 5), (1e-9, 0, 1)),
        ((4, 5, 3), (0.3, -0.4, -0.9)),  # the user's axes in another order
        ((5, 4, 3), (-0.6, 0.5, 0.1)),
        ((2, 2, 2), (0.1, 0.2, 0.3)),  # a sphere
        ((3, 3, 5), (1, 0.5, 0)),  # spin across the axis of symmetry
        ((3, 4, 5), (0, 0, 0)),
    ],
)
def test_against_integration(moments, omega):
    free = lc.free_rotation(moments, START, omega)
    X, w = integrated(np.diag(moments).astype(float), START, np.array(omega, dtype=float), 20.0)
    np.testing.assert_allclose(free.X(20.0), X, atol=6e-13)
    np.testing.assert_allclose(free.omega(20.0), w, atol=1e-13)
    np.testing.assert_allclose(free.X(0.0), START, atol=2e-15)


def random_bodies(count, t):
    """Largest differences in attitude and in angular velocity."""
    rng, worst = np.random.default_rng(20), np.zeros(2)
    for _ in range(count):
        moments = np.sort(rng.uniform(1, 2, 3))
        axes = Rotation.random(random_state=rng).as_matrix()
        inertia = axes @ np.diag(moments) @ axes.T
        inertia = (inertia + inertia.T) / 2
        start, omega = Rotation.random(random_state=rng).as_matrix(), rng.normal(size=3)
        free = lc.free_rotation(inertia, start, omega)
        X, w = integrated(inertia, start, omega, t)
        worst = np.maximum(worst, [np.abs(free.X(t) - X).max(), np.abs(free.omega(t) - w).max()])
    return worst


def test_fifty_random_bodies():
    assert np.all(random_bodies(50, 2.0) < 1e-13)


@pytest.mark.slow
def test_a_thousand_random_bodies():
    assert np.all(random_bodies(1000, 2.0) < 1e-13)


def test_a_turn_and_its_solid_angle():
    """X(t + Tn) = exp(hat(h) m Tn) X(t); the geometric phase is minus the solid angle of l about its axis, by quadrature."""
    free = lc.free_rotation((3, 4, 5), START, (0.5, 0.6, 1))
    h = free.H / np.linalg.norm(free.H)
    turn = Rotation.from_rotvec(h * free.precession_rate * free.nutation_period).as_matrix()
    np.testing.assert_allclose(free.X(7.3 + free.nutation_period), turn @ free.X(7.3), atol=1e-13)

    def slope(t):  # (1 - l3) d angle / dt
        w = free.omega(t)
        p, rate = np.array([3, 4, 5]) * w, np.cross(np.array([3, 4, 5]) * w, w)
        around = (p[0] * rate[1] - p[1] * rate[0]) / (p[0] ** 2 + p[1] ** 2)
        return (1 - p[2] / np.linalg.norm(p)) * around

    solid = quad(slope, 0, free.nutation_period, epsabs=1e-12, limit=200)[0]
    assert free.geometric_phase == pytest.approx(-solid, abs=1e-9)


def test_momentum_and_energy_are_kept_at_any_time():
    free = lc.free_rotation(J, START, (0.3, 0.2, 1))
    t = np.array([0, 1e3, 1e6])
    X, w = free.X(t), free.omega(t)
    np.testing.assert_allclose(np.einsum("nij,jk,nk->ni", X, J, w), np.tile(free.H, (3, 1)), atol=1e-13)
    np.testing.assert_allclose(np.einsum("ni,ij,nj->n", w, J, w) / 2, free.energy, atol=1e-13)
    assert free.dynamic_inertia == pytest.approx(free.H @ free.H / 2 / free.energy)


def test_batches():
    omega = np.array([(0.3, 0.2, 1), (1, 0.2, -0.3), (0, 0, 0)])
    free = lc.free_rotation(J, START, omega)
    assert list(free.mode) == ["LAM", "SAM", "fixed axis"]
    assert free.X([1.0, 2.0]).shape == (3, 2, 3, 3)
    for i, each in enumerate(omega):
        np.testing.assert_allclose(free.X([1.0, 2.0])[i], lc.free_rotation(J, START, each).X([1.0, 2.0]), atol=1e-14)


def test_the_body_at_the_middle_axis():
    with pytest.warns(AssumptionWarning, match="unstable"):
        free = lc.free_rotation((3, 4, 5), START, (0, 1, 0))
    np.testing.assert_allclose(free.X(3.0), START @ Rotation.from_rotvec([0, 3, 0]).as_matrix(), atol=1e-14)


def test_refusals():
    third = np.sqrt((4 - 3) * 3 / (5 * (5 - 4)))  # L^2 = 2 T I2
    cases = [
        (((3, 4, 5), START, (1, 0.3, third)), InputError, "separatrix"),
        (((1, 2, 4), START, (0, 0, 1)), InputError, "one is above the sum"),
        (((-1, 2, 2), START, (0, 0, 1)), InputError, "not positive"),
        (([[3, 0.1, 0], [0, 4, 0], [0, 0, 5]], START, (0, 0, 1)), InputError, r"not symmetric: J\[0\]\[1\]"),
        (((3, 4), START, (0, 0, 1)), ShapeError, "three moments"),
        (((3, 4, 5), 2 * START, (0, 0, 1)), NotOnGroupError, "no rotation"),
        (((3, 4, 5), START, (0, 1)), ShapeError, "omega has shape"),
        (((3, 4, 5), START, (0, np.nan, 1)), InputError, "NaN"),
    ]
    for arguments, error, words in cases:
        with pytest.raises(error, match=words):
            lc.free_rotation(*arguments)


def test_c_its_twin_and_its_package(tmp_path):
    free = lc.free_rotation(J, START, (0.3, 0.2, 1))
    prepare, at = free.kernels()
    moments, axes = np.linalg.eigh(J)
    axes = axes * [np.sign(np.linalg.det(axes)), 1, 1]
    motion = evaluate(prepare, moments, axes, START, np.array([0.3, 0.2, 1]))
    np.testing.assert_allclose(evaluate(at, *motion[:-1], 50.0)[0], free.X(50.0), atol=1e-13)
    folder = lc.generate(list(free.kernels()), tmp_path / "out", name="free_rotation")
    run_example(folder, "free_rotation")


def test_a_rotation_is_a_value(tmp_path):
    free = lc.free_rotation(J, START, (0.3, 0.2, 1))
    assert lc.load(free.save(tmp_path / "free.npz")) == free
