"""defect, renormalise and lc.nearest, against SciPy's exp, published values, and first-order optimality."""

from __future__ import annotations

import generators
import numpy as np
import pytest
import scipy.linalg
from kernel_calls import call_group

import lie_codegen as lc
from lie_codegen.errors import InputError, NotFiniteError, NotOnGroupError, ShapeError
from lie_codegen.groups.maps.membership import membership
from lie_codegen.groups.matrix_group import MatrixGroup

NAMES = (*lc.group_names(), "so5", "su4", "so_2_2", "sl4", "gl3", "sp6", "se4")


def _unit(d: int, i: int, j: int) -> np.ndarray:
    E = np.zeros((d, d))
    E[i, j] = 1
    return E


def _of(basis: dict[str, object]) -> MatrixGroup:
    return lc.from_matrices("tied", list(basis), [np.array(A, dtype=float).tolist() for A in basis.values()])


REPRESENTATIONS = {
    "spin3": lambda: generators.spin_group(2),
    "spin4": lambda: generators.spin_group(3),
    "sl2c": generators.special_linear_complex,
    "u2": lambda: generators.unitary_group(2),
    "su2_real": lambda: generators.real_double(lc.group("su2")),
    "se3_generic": lambda: generators.generic_basis(lc.group("se3"), np.random.default_rng(5)),
    "so31_generic": lambda: generators.generic_basis(lc.group("so31"), np.random.default_rng(5)),
    # What ties their blocks together is no polynomial.
    "spiral": lambda: _of({"a": [[0.5, -1, 0], [1, 0.5, 0], [0, 0, 0]], "x": _unit(3, 0, 2), "y": _unit(3, 1, 2)}),
    "screw": lambda: _of({"a": [[0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 0, 1], [0, 0, 0, 0]]}),
    "dilations": lambda: _of({"a": np.diag([2, 1, 0]), "x": _unit(3, 0, 1), "y": _unit(3, 1, 2), "z": _unit(3, 0, 2)}),
    "jordan": lambda: _of({"a": [[1, 1, 0], [0, 1, 0], [0, 0, 0]], "x": _unit(3, 0, 2), "y": _unit(3, 1, 2)}),
    "two_turns": lambda: _of({"a": [[0, -1, 0, 0], [1, 0, 0, 0], [0, 0, 0, -2], [0, 0, 2, 0]]}),
    "phase_beside_scale": lambda: lc.from_matrices("mixed", ["a"], [[["i", 0], [0, 1]]]),
    "sl3_sl3": lambda: lc.product("sl3", "sl3"),
    "so3_su2": lambda: lc.product("so3", "su2"),
    "gl2_su2": lambda: lc.product("gl2", "su2"),
    "sl2_scaled": lambda: generators.generic_basis(lc.group("sl2"), np.random.default_rng(5), scale=100),
}


@pytest.fixture(params=(*NAMES, *REPRESENTATIONS))
def group(request: pytest.FixtureRequest) -> MatrixGroup:
    """Made when its test runs: at the level of the module every worker of every run would make them all."""
    return REPRESENTATIONS[request.param]() if request.param in REPRESENTATIONS else lc.group(request.param)


def element(group: MatrixGroup, rng: np.random.Generator, size: float = 1.0) -> np.ndarray:
    x = rng.normal(size=group.dim)
    A = group.hat(x)
    return scipy.linalg.expm(A * size / max(1.0, np.linalg.norm(A, 2)))


def test_the_defect_is_rounding_on_the_group_and_linear_in_the_distance(group: MatrixGroup) -> None:
    rng = np.random.default_rng(1)
    for _ in range(5):
        X = element(group, rng, 2.0)
        assert call_group(group, "defect", X) < 2e-13  # SciPy's exp is good to 1e-13 or so
        if group.dim == X.size * (2 if group.is_complex else 1):
            continue
        # What is kept up to a factor is relative to the entries that it reads, however small.
        read = [np.array(form.matrix.tolist(), dtype=complex) != 0 for form in membership(group).forms if form.semi]
        least = min([1.0, *(float(np.max(np.abs(X[rows.any(axis=1)][:, rows.any(axis=1)]))) for rows in read)])
        found = [
            float(call_group(group, "defect", generators.off_the_group(group, X, size, np.random.default_rng(2))))
            * least
            / size
            for size in (1e-8, 1e-5, 1e-3)
        ]
        assert 0.01 < found[0] < 5
        np.testing.assert_allclose(found[1:], found[0], rtol=0.1)
        along = generators.off_the_group(group, X, 1e-8, rng, across=False)
        assert call_group(group, "defect", along) < 1e-13


@pytest.mark.parametrize("name", ["so3", "so4", "so5", "so31", "se3", "h3"])
def test_what_is_in_no_component_or_off_the_group_is_seen(name: str) -> None:
    for text, X in generators.without_logarithm(name, np.random.default_rng(0)):
        assert call_group(lc.group(name), "defect", X) >= 0.009, text


@pytest.mark.parametrize("name", ["se2", "se3", "se4", "se_2_3", "sgal3", "sim2", "sim3", "osc4", "h3"])
@pytest.mark.parametrize("far", [1e2, 1e5, 6.4e6, 1e9])
def test_a_pose_far_from_the_origin_is_looked_at_as_closely_as_one_near_it(name: str, far: float) -> None:
    """The rotation of a pose in metres from the centre of the Earth is one, or it is not: what is off shows at its own size, and has
    no logarithm; what is on the group has one that leads back."""
    group = lc.group(name)
    near = scipy.linalg.expm(group.hat(0.3 * np.random.default_rng(8).normal(size=group.dim)))
    moved = np.array(near)
    for A in group.basis:
        if not np.any(np.linalg.matrix_power(A, group.degree)):  # a translation, a boost
            moved = moved @ (np.eye(group.degree) + far * A + far**2 / 2 * A @ A)
    assert call_group(group, "defect", moved) < 1e-12
    back = call_group(group, "exp", call_group(group, "log", moved))
    np.testing.assert_allclose(back, moved, atol=1e-11 * np.max(np.abs(moved)))
    np.testing.assert_allclose(back[near == moved], moved[near == moved], atol=1e-11)
    for i, j in np.argwhere(near == moved):
        E = np.zeros_like(near)
        E[i, j] = 1e-3
        off = call_group(group, "defect", near + E)
        if off > 1e-5:
            np.testing.assert_allclose(call_group(group, "defect", moved + E), off, rtol=1e-6)
            assert np.all(np.isnan(call_group(group, "log", moved + E)))
        for bad in (np.inf, -np.inf, np.nan):
            E[i, j] = bad
            assert np.isnan(call_group(group, "defect", moved + E))
            assert np.all(np.isnan(call_group(group, "log", moved + E)))


def test_a_reflection_far_from_the_origin_and_a_twisted_small_body_are_refused() -> None:
    far = np.diag([1.0, 1.0, -1.0, 1.0])
    far[:3, 3] = 1e5
    assert call_group(lc.group("se3"), "defect", far) == 2
    small = np.diag([1e-5, 1e-5, -1e-5, 1.0])
    assert call_group(lc.group("sim3"), "defect", small) == 2
    small[2, 2], small[0, 1] = 1e-5, 5e-6
    assert call_group(lc.group("sim3"), "defect", small) > 0.1
    with pytest.raises(NotOnGroupError, match="negative"):
        lc.simulate("se3", lambda t: np.ones(6), t=[0.0, 1.0], X0=far)


@pytest.mark.parametrize(("first", "second"), [("sl3", "sl3"), ("su3", "su3"), ("gl2", "sl3"), ("sim3", "sl3")])
def test_each_block_of_a_product_keeps_its_own_determinant(first: str, second: str) -> None:
    """2 A beside B/2: the determinant of both together is 1."""
    group = lc.product(first, second)
    X = element(group, np.random.default_rng(9))
    assert call_group(group, "defect", X) < 1e-13
    d = lc.group(first).degree
    factor = np.exp(0.3j) if group.is_complex else 1.2
    Y = np.array(X)
    Y[:d, :d] *= factor
    Y[d:, d:] /= factor
    assert call_group(group, "defect", Y) > 0.05
    with pytest.raises(NotOnGroupError, match="det of rows and columns"):
        lc.simulate(group, np.zeros(group.dim), t=[0.0, 1.0], X0=Y)
    off = X + 1e-5 * np.random.default_rng(10).normal(size=X.shape) * (X != 0)
    assert call_group(group, "defect", call_group(group, "renormalise", off)) < 1e-8


def test_a_negative_determinant_counts_two_and_nan_comes_out_as_nan() -> None:
    assert call_group(lc.group("gl2"), "defect", np.diag([2.0, -3.0])) == 2
    for name in ("so3", "se3", "su2", "gl2"):
        X = np.eye(lc.group(name).degree)
        X[0, 0] = np.nan
        assert np.isnan(call_group(lc.group(name), "defect", X))


def test_conditions_are_as_few_as_cut_the_group_out() -> None:
    assert [form.text for form in membership(lc.group("so3")).forms] == ["X^T X - 1"]
    assert [form.text for form in membership(lc.group("se3")).forms] == ["X S X^T - S"]
    assert [form.semi for form in membership(lc.group("sim3")).forms] == [True]
    assert membership(lc.group("sl3")).determinants == (((0, 1, 2), "one"),)
    assert not membership(lc.group("sl3")).forms
    assert not any(membership(lc.group(name)).normaliser for name in NAMES)
    assert membership(generators.spin_group(3)).normaliser


def test_renormalising_squares_the_error_and_leaves_the_group_alone(group: MatrixGroup) -> None:
    rng = np.random.default_rng(3)
    X = element(group, rng)
    X = call_group(group, "renormalise", X)
    np.testing.assert_allclose(call_group(group, "renormalise", X), X, atol=2e-14 * max(1.0, np.max(np.abs(X))))
    Y = generators.off_the_group(group, X, 1e-3, rng)
    once = call_group(group, "renormalise", Y)
    twice = call_group(group, "renormalise", once)
    assert call_group(group, "defect", once) < 3e-5
    assert call_group(group, "defect", twice) < 1e-8
    assert call_group(group, "defect", call_group(group, "renormalise", twice)) < 3e-14


def test_renormalising_rotations_converges_to_the_polar_factor() -> None:
    rng = np.random.default_rng(4)
    for name in ("so3", "so5"):
        R = generators.haar_rotation(lc.group(name).degree, rng)
        Y = R + 1e-3 * rng.normal(size=R.shape)
        U, _, V = np.linalg.svd(Y)
        for _ in range(4):
            Y = call_group(lc.group(name), "renormalise", Y)
        np.testing.assert_allclose(Y, U @ V, atol=1e-14)


def test_published_nearest_elements() -> None:
    near = lc.nearest("so3", [[0.9, -0.3, 0.1], [0.2, 1.1, 0], [0, 0.1, 1]])
    np.testing.assert_allclose(near.distance, 0.186893123459, atol=1e-12)
    np.testing.assert_allclose(near.X[0], [0.968048247767, -0.242942564691, 0.062140970846], atol=1e-12)
    near = lc.nearest("sl3", np.array([[2, 1, 0], [0, 1, 1], [1, 0, 1]]) / 1.5)
    np.testing.assert_allclose(near.distance, 0.057164350546, atol=1e-12)
    np.testing.assert_allclose(near.X[0], [1.347574230867, 0.680151561286, -0.013455562613], atol=1e-12)
    near = lc.nearest("su2", [[1.1, 0.2j], [0.1, 0.9 + 0.1j]])
    np.testing.assert_allclose(near.distance, 0.223856346968, atol=1e-12)
    expected = [0.992583333971 - 0.049629166699j, -0.049629166699 + 0.099258333397j]
    np.testing.assert_allclose(near.X[0], expected, atol=1e-12)


def test_the_nearest_element_is_on_the_group_and_the_rest_is_normal_to_it(group: MatrixGroup) -> None:
    rng = np.random.default_rng(6)
    X = element(group, rng)
    for size in (1e-9, 1e-5, 1e-3, 0.05):
        Y = generators.off_the_group(group, X, size, rng)
        near = lc.nearest(group, Y)
        assert near.distance <= size * (1 + 1e-6) + 1e-13
        assert call_group(group, "defect", near.X) < 1e-13
        rest = Y - near.X
        slopes = [np.sum((near.X @ A).conj() * rest).real / np.linalg.norm(near.X @ A) for A in group.basis]
        assert np.max(np.abs(slopes)) < 1e-12


def test_far_matrices_have_a_nearest_element_too_where_it_is_global() -> None:
    """Against 400 random elements and the steps of a generic minimiser from each of the best."""
    rng = np.random.default_rng(7)
    for name in ("so3", "so4", "su2", "su3", "sl3"):
        group = lc.group(name)
        for _ in range(3):
            Y = rng.normal(size=(group.degree,) * 2) + (
                1j * rng.normal(size=(group.degree,) * 2) if group.is_complex else 0
            )
            near = lc.nearest(group, Y)
            assert call_group(group, "defect", near.X) < 1e-12
            for _ in range(400):
                x = rng.normal(size=group.dim) * 2
                assert np.linalg.norm(scipy.linalg.expm(group.hat(x)) - Y) >= near.distance - 1e-12


def test_several_matrices_at_once_and_values_that_compare() -> None:
    rng = np.random.default_rng(8)
    several = np.array([generators.haar_rotation(3, rng) for _ in range(4)]) + 1e-6
    near = lc.nearest("so3", several)
    assert near.X.shape == (4, 3, 3)
    assert near.distance.shape == (4,)
    assert near == lc.nearest(lc.group("so3"), several)
    assert near != lc.nearest("so3", several[::-1])
    assert len(repr(near).splitlines()) == 1


def test_what_has_no_nearest_element_is_refused_by_name() -> None:
    with pytest.raises(ShapeError, match="3, 3"):
        lc.nearest("so3", np.eye(4))
    with pytest.raises(NotFiniteError):
        lc.nearest("so3", np.full((3, 3), np.nan))
    with pytest.raises(InputError, match="real"):
        lc.nearest("so3", np.eye(3) * 1j)
    with pytest.raises(InputError, match="numbers"):
        lc.nearest("so3", [["a"]])
    with pytest.raises(NotOnGroupError, match="determinant"):
        lc.nearest("gl2", np.diag([2.0, -3.0]))
