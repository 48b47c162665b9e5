"""Where charts end: domains in words, recommended orders, margins; every claim beside a numeric experiment."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import lie_codegen as lc
from lie_codegen.algebra.ideal_chain import chain_order, is_chain_order
from lie_codegen.algebra.structure import structure
from lie_codegen.groups.catalogue_names import group_names
from lie_codegen.groups.change_of_basis import change_of_basis
from lie_codegen.groups.kernels import group_kernel
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.groups.wei_norman.chart_domain import chart_domain
from lie_codegen.groups.wei_norman.chart_kernels import chart_margin, wei_norman_determinant
from lie_codegen.groups.wei_norman.order import wei_norman_order
from lie_codegen.kernel.arithmetic import FloatArithmetic

OPS = FloatArithmetic()
SOLVABLE = [name for name in group_names() if structure(lc.group(name).algebra).solvable]
IWASAWA = {"k": {"e": 1, "f": -1}, "h": {"h": 1}, "e": {"e": 1}}


def integrate(group: MatrixGroup, u, until: float) -> tuple[float, np.ndarray]:
    """The time reached and g there, stopped where |g| passes 1e4."""
    rate = group_kernel(group, "wei_norman_rate")

    def slope(t: float, g: np.ndarray) -> np.ndarray:
        return np.array(rate.evaluate(OPS, list(g), list(u(t)))[0], dtype=float)

    def far(t: float, g: np.ndarray) -> float:
        return float(np.max(np.abs(g))) - 1e4

    far.terminal = True
    found = solve_ivp(slope, (0, until), np.zeros(group.dim), method="DOP853", rtol=1e-10, atol=1e-10, events=far)
    return float(found.t[-1]), found.y[:, -1]


def input_of(group: MatrixGroup, combination: dict[str, float]):
    vector = np.zeros(group.dim)
    for label, value in combination.items():
        vector[group.algebra.index(label)] = value
    return lambda t: vector


@pytest.mark.parametrize("order", list(itertools.permutations("hef")), ids="".join)
def test_every_order_of_sl2_is_never_singular_and_escapes(order: tuple[str, ...]) -> None:
    group = lc.group("sl2").reorder(order)
    domain = chart_domain(group)
    assert domain.walls == ()
    assert domain.end == "escape"
    assert not domain.is_global
    witness = "e - f" if order.index("e") < order.index("f") else "f - e"
    assert f"escape (under the constant input {witness}" in domain.text
    reached, g = integrate(group, input_of(group, {"e": 1.0, "f": -1.0}), 3.0)
    assert reached == pytest.approx(np.pi / 2, abs=1e-3)
    assert np.max(np.abs(g)) > 9e3


@pytest.mark.parametrize(
    ("name", "witness"),
    [("gl2", {"e": 1, "f": -1}), ("sl3", {"e12": 1, "f21": -1}), ("sp4", {"e11": 1, "f11": -1})],
)
def test_the_input_named_in_the_text_escapes(name: str, witness: dict[str, float]) -> None:
    group = lc.group(name)
    first, second = witness
    assert f"{first} - {second}" in chart_domain(group).text
    reached, _ = integrate(group, input_of(group, witness), 3.0)
    assert reached == pytest.approx(np.pi / 2, abs=1e-3)


def test_iwasawa_basis_of_sl2_is_global() -> None:
    order = wei_norman_order(lc.group("sl2"))
    assert not order.is_global
    assert order.labels == ("h", "e", "f")
    assert {label: dict(row) for label, row in order.change_of_basis.items()} == IWASAWA
    assert order.changed_domain.is_global
    assert "det M^-1 = 1 never vanishes" in order.reason
    group = order.changed_group

    def turning(t: float) -> np.ndarray:
        return np.array([1.0 + np.sin(t), np.cos(2 * t), np.sin(3 * t)])

    reached, g = integrate(group, turning, 12.0)
    assert reached == 12.0
    assert abs(g[0]) > 6


@pytest.mark.parametrize("name", SOLVABLE)
def test_solvable_groups_have_a_global_order(name: str) -> None:
    group = lc.group(name)
    assert chart_domain(group).is_global
    for order in itertools.islice(itertools.permutations(group.labels), 0, 120, 7):
        found = wei_norman_order(group.reorder(order))
        assert found.is_global
        assert found.domain.walls == ()


def test_bad_orders_of_solvable_algebras_are_told_apart() -> None:
    group = lc.group("se2").reorder(["vx", "omega", "vy"])
    assert not chart_domain(group).is_global
    assert chart_domain(group).wall_texts == ("|g2| < pi/2",)
    assert wei_norman_order(group).labels == ("omega", "vx", "vy")


def test_chain_orders_are_those_without_walls_on_osc4() -> None:
    """The chain condition is sufficient; on osc4 it picks orders whose determinant is checked to have no zeros."""
    algebra = lc.group("osc4").algebra
    good = [order for order in itertools.permutations(range(4)) if is_chain_order(algebra, order)]
    assert 0 < len(good) < 24
    for order in good:
        labels = [algebra.labels[i] for i in order]
        assert chart_domain(lc.group("osc4").reorder(labels)).walls == ()
    assert not is_chain_order(algebra, [1, 0, 2, 3])
    assert chain_order(lc.group("so3").algebra, range(3)) is None


@pytest.mark.parametrize(
    ("name", "texts"),
    [
        ("so3", ("|g2| < pi/2",)),
        ("se3", ("|g2| < pi/2",)),
        ("se_2_3", ("|g2| < pi/2",)),
        ("sgal3", ("|g2| < pi/2",)),
        ("sim3", ("|g2| < pi/2",)),
        ("so4", ("|g2| < pi/2", "|g3| < pi/2", "|g5| < pi/2")),
    ],
)
def test_compact_semisimple_parts_end_at_walls(name: str, texts: tuple[str, ...]) -> None:
    domain = chart_domain(lc.group(name))
    assert domain.end == "walls"
    assert domain.wall_texts == texts


def test_interleaved_se3_is_put_in_order() -> None:
    found = wei_norman_order(lc.group("se3").reorder(["w1", "v1", "w2", "v2", "w3", "v3"]))
    assert found.labels == ("w1", "w2", "w3", "v1", "v2", "v3")
    assert found.domain.end == "walls"


@pytest.mark.parametrize(("name", "walls"), [("sl3", 1), ("sp4", 2), ("so31", 1)])
def test_iwasawa_leaves_only_the_walls_of_k(name: str, walls: int) -> None:
    found = wei_norman_order(lc.group(name))
    assert found.changed_domain.end == "walls"
    assert len(found.changed_domain.walls) == walls


def test_products_of_sl2_are_global_in_the_iwasawa_basis() -> None:
    found = wei_norman_order(lc.product(lc.group("sl2"), lc.group("h3")))
    assert found.changed_domain.is_global


@pytest.mark.parametrize("name", ["so3", "sl2", "se3", "so4", "su3", "so31", "aff1"])
def test_determinant_kernel_is_the_determinant_of_the_matrix_kernel(name: str) -> None:
    group = lc.group(name)
    rng = np.random.default_rng(11)
    for g in rng.uniform(-0.9, 0.9, size=(4, group.dim)):
        [M] = group_kernel(group, "wei_norman_matrix").evaluate(OPS, list(g))
        [det] = wei_norman_determinant(group).evaluate(OPS, list(g))
        assert float(det) * np.linalg.det(np.array(M, dtype=float)) == pytest.approx(1, rel=1e-11)


def test_margin_is_one_at_the_origin_and_falls_to_the_edge() -> None:
    for name in ("so3", "sl2", "se3", "so31", "su3", "h3"):
        group = lc.group(name)
        margin = chart_margin(group)
        [start] = margin.evaluate(OPS, [0.0] * group.dim)
        assert float(start) == pytest.approx(1, abs=1e-15)
    [near] = chart_margin(lc.group("so3")).evaluate(OPS, [0.3, np.pi / 2 - 1e-3, 0.1])
    assert float(near) == pytest.approx(1e-3, rel=1e-5)
    group = lc.group("sl2")
    margins = []
    for until in (0.5, 1.0, 1.5):
        _, g = integrate(group, input_of(group, {"e": 1.0, "f": -1.0}), until)
        margins.append(float(chart_margin(group).evaluate(OPS, list(g))[0]))
    assert margins[0] > margins[1] > margins[2]
    assert margins[2] < 0.02
    [flat] = chart_margin(lc.group("h3")).evaluate(OPS, [50.0, -70.0, 9.0])
    assert float(flat) == 1.0


def test_a_restart_at_any_time_continues_the_same_solution() -> None:
    """X = X_k Phi(g), g = 0 at t_k: two charts of so3 glued beyond the wall of the first."""
    group = lc.group("so3")
    rate, phi = (group_kernel(group, name) for name in ("wei_norman_rate", "product_exp"))
    u = np.array([0.2, 1.0, -0.1])

    def step(g: np.ndarray, h: float, count: int) -> np.ndarray:
        def slope(_: float, y: np.ndarray) -> list[float]:
            return list(rate.evaluate(OPS, list(y), list(u))[0])

        return solve_ivp(slope, (0, h * count), g, rtol=1e-12, atol=1e-12).y[:, -1]

    X = np.eye(3)
    for _ in range(4):
        [factor] = phi.evaluate(OPS, list(step(np.zeros(3), 1.0, 1)))
        X = X @ np.array(factor, dtype=float)
    from scipy.linalg import expm

    np.testing.assert_allclose(X, expm(4 * group.hat(u)), atol=1e-10)


def test_change_of_basis_of_a_solvable_algebra_in_general_position() -> None:
    mixed = {"a": {"J": 1, "P": 1}, "b": {"J": 1, "P": -1, "Z": 1}, "c": {"Q": 1, "J": 2}, "d": {"Z": 1, "Q": 3}}
    found = wei_norman_order(change_of_basis(lc.group("osc4"), mixed))
    assert found.changed_domain.is_global
    assert found.changed_group.dim == 4
