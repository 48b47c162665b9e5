"""The closed grammar of numbers and formulas."""

from __future__ import annotations

import pytest
import sympy as sp
from hypothesis import given, settings
from hypothesis import strategies as st

from lie_codegen.errors import ExpressionError
from lie_codegen.exact.expression import FORMULA_FUNCTIONS, parse_expression, parse_number
from lie_codegen.kernel.matrix_formula import scalar_formula

T, X = sp.symbols("t x")
NAMES = {"t": T, "x": X, "pi": sp.pi}
ELEMENT, INVERSE = (sp.ImmutableMatrix(2, 2, sp.symbols(f"{name}1:5")) for name in ("x", "y"))


def formula(text: str) -> sp.Expr:
    return parse_expression(text, NAMES, FORMULA_FUNCTIONS)


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("1/3", sp.Rational(1, 3)),
        ("0.1", sp.Rational(1, 10)),
        (".5", sp.Rational(1, 2)),
        ("2.", sp.Integer(2)),
        ("1e-3", sp.Rational(1, 1000)),
        ("1E2", sp.Integer(100)),
        ("-sqrt(2)/2", -sp.sqrt(2) / 2),
        ("2*pi", 2 * sp.pi),
        ("1+2*i", 1 + 2 * sp.I),
        ("i*I", -1),
        ("-2^2", -4),
        ("(-2)^2", 4),
        ("2^3^2", 512),
        ("2**-1", sp.Rational(1, 2)),
        ("--3", 3),
        ("+4", 4),
        ("6/3/2", 1),
        ("1 - 2 - 3", -4),
        (" ( 1 ) ", 1),
        ("2^-2", sp.Rational(1, 4)),
    ],
)
def test_numbers_mean_what_mathematics_means(text: str, value: sp.Expr) -> None:
    assert parse_number(text) == value


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("cos(t)", sp.cos(T)),
        ("-x^2", -(X**2)),
        ("atan2(x, t)", sp.atan2(X, T)),
        ("abs(x)*exp(-t)", sp.Abs(X) * sp.exp(-T)),
        ("2*sin(3*t + pi/4)", 2 * sp.sin(3 * T + sp.pi / 4)),
    ],
)
def test_formulas(text: str, value: sp.Expr) -> None:
    assert formula(text) == value


@pytest.mark.parametrize(
    ("text", "message", "column"),
    [
        ("", "empty", 1),
        ("1+", "ends too soon", 3),
        ("1 2", "'2' is not expected", 3),
        ("(1", r"expected '\)'", 3),
        ("1)", "not expected", 2),
        ("1/0", "division by zero", 3),
        ("1/(1-1)", "division by zero", 3),
        ("0^-1", "division by zero", 3),
        ("2^0.5", "exponent", 3),
        ("2^65", "exponent", 3),
        ("y", "no name 'y'", 1),
        ("1 + f(2)", "no function 'f'", 5),
        ("sqrt()", "not expected", 6),
        ("sqrt(1, 2)", "takes 1 argument", 1),
        ("1 $ 2", "not understood", 3),
        ("__import__('os')", "not understood", 12),
        ("1;2", "not understood", 2),
        ("3.1.4", "not expected", 4),
        ("1_000", "not expected", 2),
        ("0x10", "not expected", 2),
        ("lambda: 1", "not understood", 7),
    ],
)
def test_errors_name_the_column(text: str, message: str, column: int) -> None:
    with pytest.raises(ExpressionError, match=message) as caught:
        parse_number(text)
    assert str(caught.value).startswith(f"column {column}: ")


@pytest.mark.parametrize(
    "text", ["log(0)", "atan2(1)", "cos(1, 2)", "cos", "t(1)", "t.real", "[1]", "t if x else 1", "t=1"]
)
def test_formulas_that_are_none(text: str) -> None:
    with pytest.raises(ExpressionError):
        formula(text)


def test_texts_too_long_or_too_deep() -> None:
    with pytest.raises(ExpressionError, match="characters"):
        parse_number("1" * 4001)
    with pytest.raises(ExpressionError, match="deep"):
        parse_number("(" * 100 + "1" + ")" * 100)
    with pytest.raises(ExpressionError, match="deep"):
        parse_number("2^" * 100 + "1")
    with pytest.raises(ExpressionError, match="digits"):
        parse_number("1e999")
    with pytest.raises(ExpressionError, match="expected a text"):
        parse_number(3)
    assert parse_number("(" * 20 + "1" + ")" * 20) == 1


@settings(max_examples=300, deadline=None, derandomize=True)
@given(st.text(alphabet="0123456789.eE+-*/^() ,ipqrtscoxt", max_size=40))
def test_any_text_gives_an_expression_or_a_named_error(text: str) -> None:
    value = formula_or_error(text)
    if isinstance(value, ExpressionError):
        assert str(value).startswith("column ")
    else:
        assert isinstance(value, sp.Expr)
        assert value.free_symbols <= {T, X}
        assert not value.has(sp.zoo, sp.nan, sp.oo)


def formula_or_error(text: str) -> sp.Expr | ExpressionError:
    try:
        return formula(text)
    except ExpressionError as error:
        return error


@st.composite
def printed(draw: st.DrawFn, depth: int = 0) -> tuple[str, float]:
    """A text of the grammar and its value in floating point."""
    if depth > 3 or draw(st.booleans()):
        number = draw(st.integers(0, 20))
        return str(number), float(number)
    (a, x), (b, y) = draw(printed(depth + 1)), draw(printed(depth + 1))
    operator = draw(st.sampled_from("+-*"))
    return f"({a}){operator}({b})", {"+": x + y, "-": x - y, "*": x * y}[operator]


@settings(max_examples=100, deadline=None, derandomize=True)
@given(printed())
def test_arithmetic_agrees_with_python(case: tuple[str, float]) -> None:
    text, value = case
    assert float(parse_number(text)) == value


@pytest.mark.parametrize(
    "text",
    [
        "1e999999999",
        "0^-1",
        "(" * 100 + "1" + ")" * 100,
        "",
        "2 $ 3",
        "1 +",
        "log(0)",
        "tr(log(0)*X)",
        "X^-2",
        "2^X",
        "X'^-1",
    ]
    + ["(" * k + "9" + "^16)" * k for k in (4, 40)]
    + ["norm2(10^60*(10^60*(10^60*(10^60*(10^60*(10^60*X))))))"],
)
def test_formulas_of_matrices_are_as_closed(text: str) -> None:
    with pytest.raises(ExpressionError, match="column"):
        scalar_formula(text, {"X": ELEMENT, "Xi": INVERSE}, {}, {})


def test_formulas_of_matrices_have_the_grammar_of_numbers() -> None:
    known = {"X": ELEMENT, "Xi": INVERSE}
    assert scalar_formula("2^3^2 + 2**-1", known, {}, {}) == 512 + sp.Rational(1, 2)
    assert scalar_formula("tr((X)^-1*(2*X)')", known, {}, {}) == (INVERSE * 2 * ELEMENT.T).trace()
    assert scalar_formula("(tr(X)^(1+1) - tr(X^2))/2", known, {}, {}).expand() == ELEMENT.det().expand()


def test_a_number_as_numpy_prints_it_is_refused_with_the_remedy() -> None:
    with pytest.raises(ExpressionError, match=r"column 3: '\.' is not understood .* write float\(x\)"):
        parse_number("np.float64(0.25)")
