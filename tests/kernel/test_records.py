"""Values as plain records: what is written is read back equal, in a file and in a definition; damaged ones are refused."""

from __future__ import annotations

import json
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
import sympy as sp

import lie_codegen as lc
from lie_codegen.errors import InputError
from lie_codegen.kernel.definition import NoDefinitionError, described, plain
from lie_codegen.kernel.plain_data import made_from
from lie_codegen.kernel.records import decoded, encoded, record_definition
from lie_codegen.values import same

x, p, n = sp.Symbol("x", real=True), sp.Symbol("p", positive=True), sp.Symbol("n", integer=True)


@pytest.mark.parametrize(
    "value",
    [
        sp.ImmutableMatrix([[x, sp.sqrt(2) / 2], [0, sp.sin(x) ** 2]]),
        sp.ImmutableMatrix(0, 3, []),
        sp.sqrt(p**2 + 1) * p,
        sp.Mul(sp.Integer(-1), x + sp.sin(p) + 1, sp.Pow(x**2 + 1, -1)),
        (x + 1) * sp.Abs(x - sp.Rational(1, 3)) ** sp.Rational(1, 2),
        sp.cos(sp.Symbol("z")) + n,
        {(1, -2): 0.1, "text": float("inf"), (0,): [complex(1, -0.0)], 3: None},
        np.array([[0.1, float("nan")], [-0.0, 5e-324]]),
        (np.array([1 + 2j, 3e300 - 1j]), np.arange(3), np.array([[True]])),
        np.array(2.5),
        np.zeros((0, 3), dtype=complex),
    ],
)
def test_a_value_is_read_back_equal(value: Any) -> None:
    arrays: dict[str, Any] = {}
    record = json.loads(json.dumps(encoded(value, arrays, "it")))
    again = decoded(record, arrays, "it")
    assert same(again, value)
    assert type(again) is type(value)


@dataclass(frozen=True)
class Odd:
    """Fields named as those of a definition, one of them no data."""

    kind: str
    parameters: Any


@pytest.fixture
def odd(monkeypatch: pytest.MonkeyPatch) -> type[Odd]:
    """As if it were a class of the package."""
    monkeypatch.setattr(lc.kernel.records, "Odd", Odd, raising=False)
    monkeypatch.setattr(Odd, "__module__", "lie_codegen.kernel.records")
    return Odd


def test_a_record_stands_in_a_definition(odd: type[Odd]) -> None:
    group = lc.group("so3")
    value = odd("a", {"J": np.array([[0.1, 2.0]]), "group": group, "formula": x**2 / 3, (0, 1): 2j})
    definition = plain(value)
    assert definition == record_definition(value)
    again = made_from(json.loads(definition.text))
    assert same(again, value)
    assert plain(again).text == definition.text
    assert plain(odd("a", {"J": np.array([[0.1 + 2**-56, 2.0]])})) != definition  # numbers count to the last bit
    text = "; ".join(described(definition_of_a_kernel(value)))
    assert "Odd" in text
    assert "kind = a" in text


def definition_of_a_kernel(value: Any) -> Any:
    from lie_codegen.kernel.definition import definition_of

    return definition_of("lie_codegen.control.attitude_law:attitude_law", {"record": value, "k": Fraction(1, 3)})


def test_a_formula_outside_the_grammar_is_refused() -> None:
    for value in (sp.gamma(x), sp.Integral(sp.exp(-(x**2)), x), sp.Float("0.1")):
        with pytest.raises(InputError, match="it cannot be saved"):
            encoded(value, {}, "it")


def test_what_is_no_data_has_no_definition(odd: type[Odd]) -> None:
    with pytest.raises(NoDefinitionError, match=r"Odd\.parameters cannot be saved: function is no data"):
        plain(odd("a", lambda: 0))


@pytest.mark.parametrize(
    "record",
    [
        [],
        {"record": "os:system", "fields": {}},
        {"array": "a7"},
        {"tuple": 3},
        {"tree": ["Lambda", ["number", "1"]], "symbols": []},
    ],
)
def test_a_damaged_record_is_refused(record: Any) -> None:
    with pytest.raises(InputError):
        decoded(record, {}, "the file")
