"""Where Wei-Norman coordinates hold: the walls of the determinant, and whether solutions can escape before them.

A determinant of M^{-1} that never vanishes does not make the coordinates global. Three arguments decide, from the basis
order alone:

1. Peeling. If an end of the list is a solvable ideal in chain order (`ideal_chain`) and the rest a subalgebra, or an end is
   one element and the rest an ideal, then the coordinates of the whole last as long as those of the rest.
2. A rest of skew-Hermitian matrices: all exponentials are unitary, |M| <= C / |det M^{-1}|, so the chart ends at walls only.
3. A rest K S or S K with K compact and S solvable in chain order, such as Iwasawa's K A N: then G = K S, S is global, and
   the chart ends where that of K does; never, if K is abelian.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Literal

import sympy as sp

from lie_codegen.algebra.ideal_chain import is_chain_order, is_ideal, is_subalgebra
from lie_codegen.algebra.lie_algebra import LieAlgebra
from lie_codegen.algebra.structure import structure
from lie_codegen.algebra.subspace import span, unit
from lie_codegen.groups.iwasawa import iwasawa
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernels import wei_norman_body
from lie_codegen.kernels.arithmetic import Arithmetic
from lie_codegen.kernels.expressions import expression_body
from lie_codegen.kernels.kernel import Kernel, Port
from lie_codegen.kernels.wei_norman import WeiNorman, wei_norman

#: How the coordinates of a solution can end: not at all, at a zero of the determinant, by escape in finite time although the
#: determinant never vanishes, or at a zero with an escape before it not excluded.
End = Literal["never", "walls", "escape", "either"]


@dataclass(frozen=True)
class ChartDomain:
    """The chart of X = exp(g_1 A_1) ... exp(g_n A_n) around g = 0.

    Attributes:
        determinant: det M^{-1}, factored.
        walls: the factors that vanish somewhere, positive or negative on the chart as at g = 0.
        end: how a solution can leave the chart; "never" is a global chart.
        text: the domain in words.
        reason: why.
    """

    determinant: sp.Expr
    walls: tuple[sp.Expr, ...]
    end: End
    text: str
    reason: str

    @property
    def is_global(self) -> bool:
        """Whether coordinates exist for all time, whatever the input."""
        return self.end == "never"


def chart_domain(group: MatrixGroup) -> ChartDomain:
    """The domain of the Wei-Norman chart of a group in its basis order."""
    wn = wei_norman(group)
    _, factors = wn.determinant_factors
    walls = tuple(factor for factor, _ in factors if not _positive(factor))
    end, reason = _end(group, bool(walls))
    return ChartDomain(wn.determinant, walls, end, _text(wn, walls, end), reason)


def wei_norman_determinant(group: MatrixGroup) -> Kernel:
    """g -> det M(g)^{-1}, from its factored form; 1 at g = 0, and the chart ends where it vanishes."""
    wn = wei_norman(group)
    return Kernel(
        name="wei_norman_determinant",
        namespace=group.name,
        inputs=(Port("g", (group.dim,), description="Wei-Norman coordinates"),),
        outputs=(Port("det", (), description="det M(g)^-1"),),
        body=expression_body([wn.g], [wn.determinant]),
        formula=f"det M(g)^-1 = {wn.determinant}",
        source="Wei and Norman, Proc. AMS 15 (1964) 327",
    )


def chart_margin(group: MatrixGroup) -> Kernel:
    """g -> margin, 1 at g = 0 and 0 at the edge of the chart, by which a simulation decides to restart it.

    Product of the walls, each 1 at g = 0; times sqrt(n) / |M(g)| (Frobenius) where an escape is possible. Constant 1 on a
    global chart. By left invariance a restart is X = X_k Phi(g) with g = 0 at t_k.
    """
    domain = chart_domain(group)
    wn = wei_norman(group)
    origin = dict.fromkeys(wn.g, 0)
    scaled = sp.Mul(*(wall / wall.subs(origin) for wall in domain.walls))
    walls = expression_body([wn.g], [scaled])

    def body(ops: Arithmetic, g: Any) -> tuple[Any, ...]:
        [margin] = walls(ops, g)
        if domain.end in ("never", "walls"):
            return (ops.constant(1) if domain.end == "never" else margin,)
        entries = [entry for row in wei_norman_body.matrix(ops, wn.data, g) for entry in row]
        total = ops.constant(0)
        for entry in entries:
            total = total + entry * entry
        return (margin * ops.sqrt(ops.constant(group.dim) / total),)

    return Kernel(
        name="chart_margin",
        namespace=group.name,
        inputs=(Port("g", (group.dim,), description="Wei-Norman coordinates"),),
        outputs=(Port("margin", (), description="1 at g = 0, 0 at the edge of the chart"),),
        body=body,
        formula=f"{scaled}" + ("" if domain.end in ("never", "walls") else " * sqrt(n) / |M(g)|"),
    )


def _positive(factor: sp.Expr) -> bool:
    real = {symbol: sp.Dummy(real=True) for symbol in factor.free_symbols}
    return factor.xreplace(real).is_positive is True


def _text(wn: WeiNorman, walls: Sequence[sp.Expr], end: End) -> str:
    if not walls:
        start = f"det M^-1 = {wn.determinant} never vanishes"
        if end == "never":
            return f"all of R^{wn.group.dim}: {start}, and coordinates exist for all time"
        return f"{start} on R^{wn.group.dim}, yet solutions may escape to infinity in finite time: not a global chart"
    inside = "; ".join(_wall_text(wn, wall) for wall in walls)
    tail = "" if end == "walls" else ", if no solution escapes in finite time before"
    return f"{inside}{tail}"


def _wall_text(wn: WeiNorman, wall: sp.Expr) -> str:
    if isinstance(wall, sp.cos):
        coefficient, symbol = wall.args[0].as_coeff_Mul()
        if symbol in wn.g:
            return f"|{symbol}| < {sp.pi / (2 * abs(coefficient))}"
    sign = ">" if wall.subs(dict.fromkeys(wn.g, 0)) > 0 else "<"
    return f"{wall} {sign} 0"


def _end(group: MatrixGroup, has_walls: bool) -> tuple[End, str]:
    algebra = group.algebra
    rest = _peeled(algebra)
    names = ", ".join(algebra.labels[i] for i in rest)
    outside = "" if len(rest) == group.dim else "the other elements extend the chart by quadratures (chain of ideals); "
    if not rest:
        return "never", "the basis is in the order of a chain of ideals, so the equations are a cascade of quadratures"
    if _skew(group, rest):
        return (
            "walls",
            f"{outside}{names} are skew-Hermitian, so M is bounded by 1 / |det M^-1|: no escape before a wall",
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


def _skew(group: MatrixGroup, part: Sequence[int]) -> bool:
    return all((group.exact_basis[i] + group.exact_basis[i].H).is_zero_matrix for i in part)


def _splittings(rest: list[int]) -> list[tuple[list[int], list[int]]]:
    """(compact, solvable) parts: one before the other, in both orders."""
    cuts = range(1, len(rest))
    return [(rest[:cut], rest[cut:]) for cut in cuts] + [(rest[cut:], rest[:cut]) for cut in cuts]


def _is_compact_times_solvable(
    group: MatrixGroup, rest: Sequence[int], compact: Sequence[int], solvable: Sequence[int]
) -> bool:
    algebra = group.algebra
    if not (_skew(group, compact) and is_subalgebra(algebra, compact) and _is_chain(algebra, solvable)):
        return False
    if structure(restricted(algebra, compact)).semisimple:
        return True
    if not structure(restricted(algebra, rest)).semisimple:
        return False
    decomposition = iwasawa(group, span(unit(algebra, i) for i in rest))
    return decomposition is not None and span(decomposition.k) == span(unit(algebra, i) for i in compact)


def restricted(algebra: LieAlgebra, part: Sequence[int]) -> LieAlgebra:
    """The subalgebra spanned by some basis elements."""
    place = {old: new for new, old in enumerate(part)}
    table: dict[tuple[int, int], dict[int, sp.Expr]] = {}
    for (i, j), row in algebra.table.items():
        if i in place and j in place:
            a, b = place[i], place[j]
            sign = 1 if a < b else -1
            table[min(a, b), max(a, b)] = {place[k]: sign * value for k, value in row.items()}
    return LieAlgebra(algebra.name, tuple(algebra.labels[i] for i in part), table)
