"""Structure of algebras and controllability, exact."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
import sympy as sp

import lie_codegen as lc
from lie_codegen.algebra.controllability import require_controllable
from lie_codegen.algebra.lyndon import bracket_word, lyndon_words, standard_factorization
from lie_codegen.algebra.subspace import brackets, contains, span
from lie_codegen.errors import InputError, UncontrollableError
from lie_codegen.groups.catalogue_names import group_names

#: kind, derived series, lower central series, dimensions of centre, radical and Levi subalgebra.
KNOWN = {
    "aff1": ("solvable", [2, 1, 0], [2, 1], 0, 2, 0),
    "engel": ("nilpotent", [4, 2, 0], [4, 2, 1, 0], 1, 4, 0),
    "gl2": ("reductive", [4, 3], [4, 3], 1, 1, 3),
    "h3": ("nilpotent", [3, 1, 0], [3, 1, 0], 1, 3, 0),
    "h5": ("nilpotent", [5, 1, 0], [5, 1, 0], 1, 5, 0),
    "osc4": ("solvable", [4, 3, 1, 0], [4, 3], 1, 4, 0),
    "r3": ("abelian", [3, 0], [3, 0], 3, 3, 0),
    "se2": ("solvable", [3, 2, 0], [3, 2], 0, 3, 0),
    "se3": ("Levi + radical", [6], [6], 0, 3, 3),
    "se_2_3": ("Levi + radical", [9], [9], 0, 6, 3),
    "sgal3": ("Levi + radical", [10, 9], [10, 9], 0, 7, 3),
    "sim2": ("solvable", [4, 2, 0], [4, 2], 0, 4, 0),
    "sim3": ("Levi + radical", [7, 6], [7, 6], 0, 4, 3),
    "sl2": ("semisimple", [3], [3], 0, 0, 3),
    "sl3": ("semisimple", [8], [8], 0, 0, 8),
    "so2": ("abelian", [1, 0], [1, 0], 1, 1, 0),
    "so3": ("semisimple", [3], [3], 0, 0, 3),
    "so31": ("semisimple", [6], [6], 0, 0, 6),
    "so4": ("semisimple", [6], [6], 0, 0, 6),
    "sp4": ("semisimple", [10], [10], 0, 0, 10),
    "su2": ("semisimple", [3], [3], 0, 0, 3),
    "su3": ("semisimple", [8], [8], 0, 0, 8),
}


@pytest.mark.parametrize("name", group_names())
def test_structure_of_the_catalogue(name: str) -> None:
    parts = lc.structure(lc.group(name))
    derived, central = (list(map(len, series)) for series in (parts.derived_series, parts.lower_central_series))
    assert (parts.kind, derived, central, len(parts.centre), len(parts.radical), len(parts.levi)) == KNOWN[name]


@pytest.mark.parametrize("name", group_names())
def test_killing_form_is_the_trace_of_adjoints(name: str) -> None:
    group = lc.group(name)
    c = group.algebra.structure_constants
    expected = np.einsum("iab,jba->ij", c, c)
    np.testing.assert_allclose(np.array(lc.structure(group).killing, dtype=float), expected, atol=1e-12)


def test_killing_form_of_so3_and_sl2() -> None:
    assert lc.structure(lc.group("so3")).killing == -2 * sp.eye(3)
    assert lc.structure(lc.group("sl2")).killing == sp.Matrix([[8, 0, 0], [0, 0, 4], [0, 4, 0]])


@pytest.mark.parametrize("name", ["se3", "sgal3", "sim3", "gl2", "se_2_3"])
def test_levi_subalgebra_in_general_position(name: str) -> None:
    """A random exact change of basis hides the rotations; the lift through the radical finds a subalgebra again."""
    group = lc.group(name)
    rng = np.random.default_rng(7)
    while True:
        matrix = rng.integers(-1, 2, size=(group.dim, group.dim))
        if round(np.linalg.det(matrix)):
            break
    mixed = {
        f"b{i}": {label: int(v) for label, v in zip(group.labels, row, strict=True)} for i, row in enumerate(matrix)
    }
    algebra = lc.change_of_basis(group, mixed).algebra
    parts = lc.structure(lc.change_of_basis(group, mixed))
    levi, radical = parts.levi, parts.radical
    assert brackets(algebra, levi, levi) == levi
    assert len(span([*levi, *radical])) == group.dim == len(levi) + len(radical)
    assert contains(radical, brackets(algebra, span(sp.eye(group.dim).tolist()), radical))


def test_levi_lift_through_a_radical_that_is_not_abelian() -> None:
    action = {
        "h": [[1, 0, 0], [0, -1, 0], [0, 0, 0]],
        "e": [[0, 1, 0], [0, 0, 0], [0, 0, 0]],
        "f": [[0, 0, 0], [1, 0, 0], [0, 0, 0]],
    }
    group = lc.semidirect(lc.group("sl2"), lc.group("h3"), action)
    mixed = {
        "a": {"h": 1, "x": 1}, "b": {"e": 1, "y": 1, "z": 1}, "c": {"f": 1, "x": -1}, "d": {"x": 1}, "p": {"y": 1}, "q": {"z": 1},
    }  # fmt: skip
    moved = lc.change_of_basis(group, mixed)
    levi = lc.structure(moved).levi
    assert len(levi) == 3
    assert brackets(moved.algebra, levi, levi) == levi


def test_lyndon_words_are_counted_by_the_necklace_formula() -> None:
    for letters, length in itertools.product((2, 3), range(1, 8)):
        words = list(lyndon_words(letters, length))
        count = sum(sp.mobius(d) * letters ** (length // d) for d in sp.divisors(length)) // length
        assert len(words) == len(set(words)) == count
        assert words == sorted(words)
        for word in words:
            assert all(word < word[k:] for k in range(1, length))


def test_standard_factorization_and_brackets() -> None:
    assert standard_factorization((0, 0, 1, 0, 1)) == ((0, 0, 1), (0, 1))
    assert str(bracket_word((0, 0, 1), ("x", "y"))) == "[x, [x, y]]"
    assert bracket_word((0, 0, 1, 1), ("x", "y")).text == "[x, [[x, y], y]]"


@pytest.mark.parametrize(
    ("name", "controls", "growth", "words"),
    [
        ("so3", ("w1", "w2"), (2, 3), [["w1", "w2"], ["[w1, w2]"]]),
        ("engel", ("x1", "x2"), (2, 3, 4), [["x1", "x2"], ["[x1, x2]"], ["[x1, [x1, x2]]"]]),
        ("se3", ("w1", "w2", "v1"), (3, 5, 6), [["w1", "w2", "v1"], ["[w1, w2]", "[w2, v1]"], ["[w1, [w2, v1]]"]]),
        ("h5", ("x1", "y1"), (2, 3), [["x1", "y1"], ["[x1, y1]"]]),
    ],
)
def test_growth_and_words(name: str, controls: tuple[str, ...], growth: tuple[int, ...], words: list) -> None:
    report = lc.controllability(lc.group(name), controls)
    assert report.growth == growth
    assert report.depth == len(growth) - 1
    assert [[str(word) for word in layer] for layer in report.words] == words
    assert report.controllable == (growth[-1] == lc.group(name).dim)


@pytest.mark.parametrize(
    ("name", "controls"),
    [("sl4", ("e14", "f21", "f32", "f43")), ("su3", ("l1", "l4", "l6")), ("so4", ("L12", "L23", "L34")), ("sgal3", ("w1", "w2", "v1", "t"))],
)  # fmt: skip
def test_words_span_each_layer_of_all_brackets(name: str, controls: tuple[str, ...]) -> None:
    """Against the span of all brackets of all lengths, made by brute force in floating point."""
    group = lc.group(name)
    report = lc.controllability(group, controls)
    c = group.algebra.structure_constants
    eye = np.eye(group.dim)
    layers = [[eye[group.algebra.index(label)] for label in controls]]
    for length in range(2, len(report.growth) + 1):
        pairs = [(a, length - a) for a in range(1, length)]
        layers.append([np.einsum("i,j,ijk", x, y, c) for a, b in pairs for x in layers[a - 1] for y in layers[b - 1]])
    dims = [
        np.linalg.matrix_rank(np.array(list(itertools.chain(*layers[: k + 1]))), tol=1e-9) for k in range(len(layers))
    ]
    assert tuple(dims) == report.growth
    values = [_value(group, word) for layer in report.words for word in layer]
    assert np.linalg.matrix_rank(np.array(values), tol=1e-9) == len(values) == report.growth[-1]


def _value(group, word) -> np.ndarray:
    if word.left is None:
        return np.eye(group.dim)[group.algebra.index(word.text)]
    x, y = _value(group, word.left), _value(group, word.right)
    return np.einsum("i,j,ijk", x, y, group.algebra.structure_constants)


def test_reports_name_what_is_out_of_reach() -> None:
    with pytest.raises(UncontrollableError, match=r"growth vector \(2, 3\); out of reach: x2, y2"):
        require_controllable(lc.group("h5").algebra, ("x1", "y1"))
    for controls in ((), "w1", ("w1", "w1"), ("nope",), (7,), (True,)):
        with pytest.raises(InputError):
            lc.controllability(lc.group("so3"), controls)
