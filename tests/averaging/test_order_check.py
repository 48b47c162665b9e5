"""The order of every form, measured on several groups, in every metric; the erratum of (45)-(46)."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import lie_codegen as lc
from lie_codegen.averaging.order_check import measure, slopes
from lie_codegen.averaging.printed_form import printed_state
from lie_codegen.errors import AssumptionWarning, ChartError, InputError
from lie_codegen.flow.reference_flow import reference_flow

MIXED = ["1/2 + cos(t)", "-3/10 + sin(t) + 3/10*cos(2*t)", "4/10 + 1/2*cos(t + 1)"]
ZERO = [
    "cos(t)",
    "sin(t) + 3/10*cos(2*t)",
    "1/2*cos(t + 1)",
    "1/2*sin(2*t)",
    "1/3*cos(3*t)",
    "0",
    "1/4*sin(t)",
    "1/5*cos(2*t)",
]
MEANS = ["+ 1/3", "- 1/5", "+ 1/10", "+ 1/4", "- 1/6", "+ 1/7", "- 1/9", "+ 1/8"]
EPS = (0.2, 0.1, 0.05, 0.025)

TOML = """
name = "pseudo"
labels = ["p", "q", "r", "s"]
[brackets]
"p,q" = { q = "1/2" }
"p,r" = { r = "-1/2", q = 1 }
"p,s" = { s = 1 }
"""


@pytest.fixture(scope="module")
def own_group(tmp_path_factory: pytest.TempPathFactory) -> lc.MatrixGroup:
    """A solvable group from a file."""
    path: Path = tmp_path_factory.mktemp("groups") / "pseudo.toml"
    path.write_text(TOML)
    return lc.group(str(path))


def inputs(dim: int, mean: bool) -> lc.PeriodicInput:
    return lc.PeriodicInput([z + (m if mean else "") for z, m in zip(ZERO, MEANS, strict=True)][:dim], "2*pi")


@pytest.mark.parametrize("name", ["so3", "se2", "se3", "su2", "sl2", "h3", "su3", "own"])
def test_published_orders(name: str, own_group: lc.MatrixGroup) -> None:
    group = own_group if name == "own" else lc.group(name)
    for order in (1, 2, 3, 4):
        for mean in (True, False):
            check = lc.order_check(group, inputs(group.dim, mean), order, horizon=2.0)
            assert check.passed, check
            if not check.exact:
                assert abs(check.slope - order) < 0.3 or (order == 1 and not mean), check
    for form in ("product", "single"):
        assert lc.order_check(group, inputs(group.dim, False), 2, form, horizon=2.0).passed
    assert lc.order_check(group, inputs(group.dim, False), 3, "single", horizon=2.0).passed


def test_a_wrong_average_fails_the_check() -> None:
    """The second-order state with its rate spoiled by 1 % is of first order, and the slopes say so."""
    group, u = lc.group("so3"), inputs(3, False)
    averaged = lc.average(group, u, 2, "single")

    def spoiled(eps: float, t: np.ndarray) -> np.ndarray:
        drift = 0.01 * eps**2 * t[:, None] * averaged.F[1]
        return averaged.state(eps, t) @ (np.eye(3) + group.hat(drift))

    sup, _ = measure(group, u, spoiled, (0.0125, 0.00625), 2.5)
    assert slopes((0.0125, 0.00625), sup)[0] < 1.5


def test_exactness_on_nilpotent_groups() -> None:
    for name, order in (("h3", 3), ("engel", 4)):
        group = lc.group(name)
        check = lc.order_check(group, inputs(group.dim, True), order)
        assert check.exact
        assert check.nilpotent
        assert check.passed
        assert not lc.order_check(group, inputs(group.dim, True), order - 1).exact


def test_one_order_better_at_whole_periods_where_the_next_rate_vanishes() -> None:
    """Even inputs on SO(3): F_2 and F_4 vanish."""
    check = lc.order_check(lc.group("so3"), lc.PeriodicInput(["cos(t)", "cos(2*t)", "cos(3*t)"], "2*pi"), 3)
    assert check.next_rate_vanishes
    assert check.slope == pytest.approx(3, abs=0.15)
    assert check.whole_period_slopes[-1] > 3.85
    assert not lc.order_check(lc.group("so3"), inputs(3, True), 3).next_rate_vanishes


def test_the_printed_form_of_lemma_4_is_first_order_and_the_right_one_second() -> None:
    """Erratum of (45)-(46): the published figures for b = 0.8 pi."""
    group, u = lc.group("so3"), lc.PeriodicInput(MIXED, "2*pi")
    printed, _ = measure(group, u, lambda eps, t: printed_state(group, u, eps, t), EPS, 0.8 * np.pi)
    np.testing.assert_allclose(printed, [0.2652, 0.1693, 0.09345, 0.04884], rtol=2e-3)
    np.testing.assert_allclose(slopes(EPS, printed), [0.6476, 0.8572, 0.9362], atol=3e-3)
    right = lc.order_check(group, u, 2, horizon=0.8 * np.pi)
    np.testing.assert_allclose(right.errors, [0.06002, 0.01518, 0.003806, 0.0009525], rtol=2e-2)
    assert min(right.slopes) > 1.97
    zero = inputs(3, False)
    fine, _ = measure(group, zero, lambda eps, t: printed_state(group, zero, eps, t), EPS, 2.0)
    assert slopes(EPS, fine)[-1] > 1.9


def test_every_metric_shows_the_order() -> None:
    group, u = lc.group("so3"), inputs(3, False)
    for form, metric in (("product", "product"), ("single", "single"), ("floquet", "angle"), ("single", "frobenius")):
        check = lc.order_check(group, u, 2, form, metric=metric, eps=(0.1, 0.05, 0.025))
        assert check.passed, check
    with pytest.raises(InputError, match="rotations of space"):
        lc.order_check(lc.group("se2"), u, 2, metric="angle")
    with pytest.warns(AssumptionWarning), pytest.raises(ChartError, match="no principal logarithm"):
        lc.order_check(
            group, lc.PeriodicInput(["1", "0", "0"], "2*pi"), 1, metric="single", horizon=3.2, eps=(0.1, 0.05)
        )


def test_the_reference_flow_against_runge_kutta() -> None:
    group, u = lc.group("sl2"), inputs(3, True)
    flow = reference_flow(group, u, 0.2, 15.0)
    solution = solve_ivp(
        lambda t, x: (x.reshape(2, 2) @ group.hat(0.2 * u(t))).ravel(), (0, flow.t[-1]), np.eye(2).ravel(),
        method="DOP853", rtol=1e-13, atol=1e-13, t_eval=flow.t[::40],
    )  # fmt: skip
    np.testing.assert_allclose(flow.X[::40].reshape(-1, 4), solution.y.T, atol=1e-11)
    assert np.all(flow.X[0] == np.eye(2))


def test_bad_questions_are_refused() -> None:
    group, u = lc.group("so3"), inputs(3, False)
    for wrong in ({"eps": (0.1,)}, {"eps": (0.1, 0.1)}, {"eps": (0.1, -0.1)}, {"horizon": 0}, {"metric": "miles"}):
        with pytest.raises(InputError):
            lc.order_check(group, u, 2, **wrong)
