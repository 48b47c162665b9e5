"""Work without a budget, and errors that are not ours: numbers, formulas and durations."""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator
from decimal import Decimal
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
import sympy as sp

import lie_codegen as lc
from lie_codegen import Budget
from lie_codegen.errors import InputError
from lie_codegen.exact.budget import current_budget, field_degree
from lie_codegen.exact.expression import FORMULA_FUNCTIONS, parse_expression, parse_number
from lie_codegen.exact.numbers import exact_number, field_elements
from lie_codegen.kernel.matrix_formula import scalar_formula


@pytest.fixture(autouse=True)
def alarm() -> Iterator[None]:
    """Nothing here may hang."""

    def ring(*_: Any) -> None:
        raise TimeoutError("ten seconds")

    before = signal.signal(signal.SIGALRM, ring)
    signal.alarm(10)
    yield
    signal.alarm(0)
    signal.signal(signal.SIGALRM, before)


SIX_ROOTS = "+".join(f"sqrt({p})" for p in (2, 3, 5, 7, 11, 13))


@pytest.mark.parametrize(
    ("value", "limit"),
    [
        ("(1+sqrt(2)+sqrt(3)+pi)^64", "terms"),
        ("((9^64)^64)^64", "digits"),
        (SIX_ROOTS, "degree"),
        (f"1/({SIX_ROOTS})", "degree"),
        ("11e400", "digits"),
        ("1e1000000", "digits"),
        ("9" * 3000, "digits"),
        (10**5000, "digits"),
        (Decimal("1e1000000"), "digits"),
        (Fraction(1, 10**5000), "digits"),
        (sp.Integer(10) ** 5000, "digits"),
        ("(" * 70 + "1" + ")" * 70, "nesting"),
    ],
    ids=lambda value: type(value).__name__,
)
def test_a_number_over_the_budget_names_its_limit(value: Any, limit: str) -> None:
    with pytest.raises(InputError, match=rf"limit of {limit} is .*Budget\({limit}="):
        exact_number(value)


def test_roots_of_several_entries_are_counted_together() -> None:
    with pytest.raises(InputError, match="limit of degree"):
        field_elements([sp.sqrt(p) for p in (2, 3, 5, 7, 11, 13)])


@pytest.mark.parametrize(
    ("text", "degree"),
    [("sqrt(2)+sqrt(3)+sqrt(6)", 4), ("sqrt(2)+i", 4), ("sqrt(8)/3", 2), ("pi/7", 1), ("sqrt(2)*sqrt(3)", 2)],
)
def test_the_degree_is_that_of_the_field(text: str, degree: int) -> None:
    value = parse_number(text)
    assert field_degree([value]) == degree
    if not value.has(sp.pi):
        assert sp.degree(sp.minimal_polynomial(value)) <= degree


def test_a_budget_is_raised_and_given_back() -> None:
    before = current_budget()
    with Budget(digits=5000):
        assert exact_number(10**4000) == sp.Integer(10) ** 4000
        with Budget(degree=1), pytest.raises(InputError, match="limit of degree is 1"):
            exact_number("sqrt(2)")
        assert current_budget() == Budget(digits=5000)
    assert current_budget() == before
    with pytest.raises(InputError, match="digits must be a positive integer"):
        Budget(digits=0)


def test_a_formula_is_bounded_in_its_digits() -> None:
    t = sp.Symbol("t")
    with pytest.raises(InputError, match="limit of digits"):
        parse_expression("sin(11e400*t)", {"t": t}, FORMULA_FUNCTIONS)


@pytest.mark.parametrize(
    "call",
    [
        lambda: lc.PeriodicInput(["11e400*sin(t)"]),
        lambda: lc.PeriodicInput(["sin(t)"], period="11e400"),
        lambda: lc.PeriodicInput(["sin(t)"], period=11 * 10**400),
    ],
)
def test_inputs_and_periods_beyond_a_double(call: Callable[[], object]) -> None:
    with pytest.raises(InputError):
        call()


@pytest.mark.parametrize(
    "duration",
    [1e-300, 1e300, True, 10**400, 10**5000, float("nan"), -1.0, "1"],
    ids=lambda value: type(value).__name__,
)
def test_durations_the_arithmetic_cannot_carry(duration: Any) -> None:
    with pytest.raises(InputError, match="duration must be"):
        lc.steer("so3", [0.1, 0.2, 0.3], controls=["w1", "w2"], duration=duration)


@pytest.mark.parametrize(
    "formula",
    ["(((sin(t)+1)^60+cos(t))^60+sin(3*t))^60", "((1+sin(t))^64*(1+cos(3*t))^64*(2+sin(5*t))^64)^64"],
)
def test_an_input_of_too_many_products(formula: str) -> None:
    with pytest.raises(InputError, match=r"limit of products is 500000; .*lie_codegen.Budget\(products"):
        lc.PeriodicInput([formula])


def test_an_average_of_too_many_products() -> None:
    u = lc.PeriodicInput(["cos(t)+sin(2*t)", "sin(t)+cos(3*t)", "cos(t)"])
    with lc.Budget(products=1000), pytest.raises(InputError, match=r"the average to this order .* limit of products"):
        lc.average("so3", u, 6)
    assert lc.average("so3", u, 6).order == 6


def test_an_exact_matrix_of_too_many_products() -> None:
    """so(3) in a basis of integers: its M has entries over Q(sqrt 17 + sqrt 22)."""
    rows = {"a": {"w1": 1, "w2": 2}, "b": {"w2": 1, "w3": -3}, "c": {"w1": 2, "w3": 1}}
    group = lc.change_of_basis("so3", rows)
    with lc.Budget(products=50):
        with pytest.raises(InputError, match="limit of products is 50"):
            _ = lc.wei_norman(group).M
        domain = lc.chart_domain(group)
    assert domain.truncated
    assert domain.text.startswith("numeric, not proved")
    assert not lc.chart_domain(group).truncated


@pytest.mark.parametrize("text", ["tr((X^2)^4)", "tr(X'*X^7)", "norm2(X^3 - X')"])
def test_products_of_symbolic_matrices_are_those_of_their_numbers(text: str) -> None:
    """SymPy's own power took half a minute for the first."""
    numbers = np.random.default_rng(0).integers(-3, 4, (4, 4))
    symbols = sp.ImmutableMatrix(4, 4, sp.symbols("x:16", real=True))
    found = scalar_formula(text, {"X": symbols}, {}, {"X": symbols}).subs(
        dict(zip(symbols, numbers.ravel(), strict=True))
    )
    power = np.linalg.matrix_power
    expected = {
        "tr((X^2)^4)": np.trace(power(numbers, 8)),
        "tr(X'*X^7)": np.trace(numbers.T @ power(numbers, 7)),
        "norm2(X^3 - X')": np.sum((power(numbers, 3) - numbers.T) ** 2),
    }
    assert found == int(expected[text])


@pytest.mark.parametrize("text", ["tr(((X^16)^16)^16)", "tr((1 - Xd^-1*X)^16)", "tr(" + "*".join(["X"] * 99) + ")"])
def test_a_product_of_matrices_too_long_to_write_out(text: str) -> None:
    with pytest.raises(InputError, match="the limit of products is 500000"):
        lc.error_function("se3", text)
