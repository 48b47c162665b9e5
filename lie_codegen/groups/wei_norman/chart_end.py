"""How solutions leave a Wei-Norman chart: never, at a zero of the determinant, or by escape in finite time.

A determinant of M^{-1} that never vanishes does not make the coordinates global. Three arguments decide, from the basis
order alone:

1. Peeling. If an end of the list is a solvable ideal in chain order (`ideal_chain`) and the rest a subalgebra, or an end is
   one element and the rest an ideal, then the coordinates of the whole last as long as those of the rest.
2. A rest that is a compact algebra (its radical is central and its Killing form negative elsewhere): its adjoint group is
   bounded, |M| <= C / |det M^{-1}|, so the chart ends at walls only. This is a fact of the brackets, not of the matrices.
3. A rest K S or S K with K compact and S solvable in chain order, such as Iwasawa's K A N: then G = K S, S is global, and
   the chart ends where that of K does; never, if K is abelian.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Literal

from lie_codegen.algebra.cartan import is_maximal_compact
from lie_codegen.algebra.ideal_chain import is_chain_order, is_ideal, is_subalgebra
from lie_codegen.algebra.lie_algebra import LieAlgebra
from lie_codegen.algebra.structure import structure
from lie_codegen.algebra.subspace import brackets, whole
from lie_codegen.exact.numbers import Number, domain_matrix, is_positive_definite
from lie_codegen.groups.iwasawa import iwasawa
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.on_demand import sympy as sp

#: How the coordinates of a solution can end: not at all, at a zero of the determinant, by escape in finite time although the
#: determinant never vanishes, or at a zero with an escape before it not excluded.
End = Literal["never", "walls", "escape", "either"]


def chart_end(group: MatrixGroup, has_walls: bool) -> tuple[End, str]:
    """How the chart in the basis order ends, and why; `has_walls` tells whether the determinant vanishes anywhere."""
    algebra = group.algebra
    rest = _peeled(algebra)
    names = ", ".join(algebra.labels[i] for i in rest)
    outside = "" if len(rest) == group.dim else "the other elements extend the chart by quadratures (chain of ideals); "
    if not rest:
        return "never", "the basis is in the order of a chain of ideals, so the equations are a cascade of quadratures"
    if is_compact(restricted(algebra, rest)):
        return (
            "walls",
            f"{outside}{names} span a compact algebra, so M is bounded by 1 / |det M^-1|: no escape before a wall",
        )
    for compact, solvable in _splittings(rest):
        if _is_compact_times_solvable(group, rest, compact, solvable):
            k, s = (", ".join(algebra.labels[i] for i in part) for part in (compact, solvable))
            if all((min(i, j), max(i, j)) not in algebra.table for i in compact for j in compact):
                return "never", f"{outside}G = K S with K compact and abelian ({k}) and S solvable in chain order ({s})"
            return "walls", f"{outside}G = K S with K compact ({k}), which has the walls, and S solvable ({s}), global"
    if has_walls:
        return "either", f"{outside}nothing excludes that {names} escape in finite time before a wall"
    return (
        "escape",
        f"{outside}the exponentials of {names} do not fill the group: det M^-1 != 0 is no proof of globality",
    )


def _peeled(algebra: LieAlgebra) -> list[int]:
    """What is left of the basis when solvable ideals and single elements are taken from its ends."""
    left = list(range(algebra.dim))
    while left:
        shorter = _peel(algebra, left)
        if shorter is None:
            return left
        left = shorter
    return left


def _peel(algebra: LieAlgebra, left: list[int]) -> list[int] | None:
    if is_ideal(algebra, left[1:], left):
        return left[1:]
    if is_ideal(algebra, left[:-1], left):
        return left[:-1]
    for size in range(1, len(left)):
        for ideal, rest in ((left[-size:], left[:-size]), (left[:size], left[size:])):
            if is_ideal(algebra, ideal, left) and is_subalgebra(algebra, rest) and _is_chain(algebra, ideal):
                return rest
    return None


def _is_chain(algebra: LieAlgebra, part: Sequence[int]) -> bool:
    return is_subalgebra(algebra, part) and is_chain_order(algebra, part)


def is_compact(algebra: LieAlgebra) -> bool:
    """Whether an invariant scalar product exists: the radical is the centre, and the Killing form negative on [g, g]."""
    parts = structure(algebra)
    if not parts.reductive:
        return False
    derived = sp.Matrix([list(vector) for vector in brackets(algebra, whole(algebra), whole(algebra))])
    if not derived.rows:
        return True
    form = domain_matrix((-derived * sp.Matrix(parts.killing) * derived.T).tolist())
    return is_positive_definite(form)


def _splittings(rest: list[int]) -> list[tuple[list[int], list[int]]]:
    """(compact, solvable) parts: one before the other, in both orders."""
    cuts = range(1, len(rest))
    return [(rest[:cut], rest[cut:]) for cut in cuts] + [(rest[cut:], rest[:cut]) for cut in cuts]


def _is_compact_times_solvable(
    group: MatrixGroup, rest: Sequence[int], compact: Sequence[int], solvable: Sequence[int]
) -> bool:
    algebra = group.algebra
    if not (is_subalgebra(algebra, compact) and _is_chain(algebra, solvable)):
        return False
    own = restricted(algebra, compact)
    if structure(own).semisimple and is_compact(own):
        return True
    inside = [rest.index(i) for i in compact]
    return is_maximal_compact(restricted(algebra, rest), inside)


def restricted(algebra: LieAlgebra, part: Sequence[int]) -> LieAlgebra:
    """The subalgebra spanned by some basis elements."""
    if list(part) == list(range(algebra.dim)):
        return algebra
    place = {old: new for new, old in enumerate(part)}
    table: dict[tuple[int, int], dict[int, sp.Expr]] = {}
    for (i, j), row in algebra.table.items():
        if i in place and j in place:
            a, b = place[i], place[j]
            sign = 1 if a < b else -1
            table[min(a, b), max(a, b)] = {place[k]: sign * value for k, value in row.items()}
    return LieAlgebra(algebra.name, tuple(algebra.labels[i] for i in part), table)


def escaping_input(group: MatrixGroup) -> str | None:
    """A constant input that leaves the chart in finite time: the compact element of an sl2 in three basis elements.

    On SL(2) each of the six orders of h, e, f gives matrices with X_11 > 0 (if e is not left of f) or X_22 > 0, and
    exp(t (e - f)) has cos t there. Inside a larger group the solution stays in the subgroup, by uniqueness.
    """
    algebra = group.algebra
    decomposition = iwasawa(group, structure(algebra).levi)
    for vector in decomposition.k if decomposition is not None else ():
        pair = [i for i, value in enumerate(vector) if value != 0]
        if len(pair) == 2 and _is_sl2_pair(algebra, pair[0], pair[1]):
            return combination_text({algebra.labels[i]: vector[i] for i in pair})
    return None


def _is_sl2_pair(algebra: LieAlgebra, i: int, j: int) -> bool:
    """Whether A_i, A_j and their bracket, itself a multiple of a basis element A_h with ad_h diagonal on them, span sl2."""
    one = sp.S.One
    found = list(algebra.bracket({i: one}, {j: one}))
    if len(found) != 1 or found[0] in (i, j):
        return False
    return all(list(algebra.bracket({found[0]: one}, {k: one})) == [k] for k in (i, j))


def combination_text(combination: Mapping[str, Number]) -> str:
    """A linear combination as it is written, in the order given: e - f, 1/2 a + sqrt(3) b."""
    text = ""
    for label, value in combination.items():
        negative = value.could_extract_minus_sign()
        size = -value if negative else value
        term = label if size == 1 else f"{size} {label}" if size.is_Atom else f"({size}) {label}"
        text += (" - " if negative else " + ") + term
    return text.removeprefix(" + ").replace(" - ", "-", 1) if text.startswith(" - ") else text.removeprefix(" + ")
