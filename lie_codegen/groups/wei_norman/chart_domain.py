"""Where Wei-Norman coordinates hold: the walls of the determinant, and whether solutions can escape before them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lie_codegen.algebra.lie_algebra import LieAlgebra
from lie_codegen.errors import InputError
from lie_codegen.groups.catalogue_load import GroupLike, as_group
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.groups.wei_norman.chart_end import End, chart_end, escaping_input
from lie_codegen.groups.wei_norman.matrix import WeiNorman, wei_norman
from lie_codegen.kernel.saved import Saved
from lie_codegen.on_demand import scipy
from lie_codegen.on_demand import sympy as sp

#: Bases of up to this dimension are always treated exactly; of more, where a bracket has few terms (two at most in the catalogue).
_ALWAYS_EXACT = 4
_MANY_TERMS = 3
_RAYS, _POINTS, _REACH = 60, 30, 3.0


@dataclass(frozen=True, eq=False, repr=False)
class ChartDomain(Saved):
    """The chart of X = exp(g_1 A_1) ... exp(g_n A_n) around g = 0.

    Attributes:
        determinant: det M^{-1}, factored; NaN where it was not expanded.
        walls: the factors that vanish somewhere, positive or negative on the chart as at g = 0.
        wall_texts: the side of each wall on which the chart lies, as in "|g2| < pi/2".
        end: how a solution can leave the chart; "never" is a global chart.
        text: the domain in words.
        reason: why.
        truncated: the basis is generic, so that the determinant would fill pages: it was looked at by numbers only.
    """

    determinant: sp.Expr
    walls: tuple[sp.Expr, ...]
    wall_texts: tuple[str, ...]
    end: End
    text: str
    reason: str
    truncated: bool = False

    @property
    def is_global(self) -> bool:
        """Whether coordinates exist for all time, whatever the input."""
        return self.end == "never"


def chart_domain(group: GroupLike) -> ChartDomain:
    """The domain of the Wei-Norman chart of a group in its basis order: where det M(g)^-1 keeps from 0, and how solutions may leave it.

    Args:
        group: object, catalogue name or file.

    Raises:
        UnknownGroupError: no such group.
    """
    group = as_group(group, "chart_domain")
    if is_generic(group.algebra):
        return _numeric_domain(group)
    wn = wei_norman(group)
    try:
        _, factors = wn.determinant_factors
    except InputError:  # over the budget of exact results, or of the degree of the field
        return _numeric_domain(group)
    walls = tuple(factor for factor, _ in factors if not _positive(factor))
    end, reason = chart_end(group, bool(walls))
    witness = escaping_input(group) if end == "escape" else None
    sides = tuple(_wall_text(wn, wall) for wall in walls)
    return ChartDomain(wn.determinant, walls, sides, end, _text(wn, sides, end, witness), reason)


def is_generic(algebra: LieAlgebra) -> bool:
    """Whether brackets are sums of many basis elements, so that exact exponentials and their determinant fill pages."""
    terms = sum(len(row) for row in algebra.table.values())
    return algebra.dim > _ALWAYS_EXACT and terms > _MANY_TERMS * len(algebra.table)


def _numeric_domain(group: MatrixGroup) -> ChartDomain:
    """How far det M^{-1} keeps its sign along random rays; the end by the arguments that need no determinant."""
    rng = np.random.default_rng(0)
    n = group.dim
    ads = group.algebra.ad_matrices
    first = np.inf
    for _ in range(_RAYS):
        ray = rng.normal(size=n)
        ray /= np.linalg.norm(ray)
        for radius in np.linspace(0, _REACH, _POINTS + 1)[1:]:
            if radius >= first:
                break
            if _determinant(ads, radius * ray) <= 0:
                first = float(radius)
    has_walls = bool(np.isfinite(first))
    end, reason = chart_end(group, has_walls)
    where = f"det M^-1 vanishes first at |g| about {first:.3g}" if has_walls else f"det M^-1 > 0 up to |g| = {_REACH:g}"
    text = f"numeric, not proved: {where}, on {_RAYS} random rays"
    return ChartDomain(sp.nan, (), (), end if has_walls or end == "never" else "either", text, reason, truncated=True)


def _determinant(ads: NDArray[Any], g: NDArray[Any]) -> float:
    """det M^{-1}: its i-th column is Ad(exp(-g_n A_n) ... exp(-g_{i+1} A_{i+1})) e_i."""
    n = len(g)
    moved = np.eye(n)
    columns = np.empty((n, n))
    for i in reversed(range(n)):
        columns[:, i] = moved[:, i]
        moved = moved @ scipy.linalg.expm(-g[i] * ads[i])
    return float(np.linalg.det(columns))


def _positive(factor: sp.Expr) -> bool:
    real = {symbol: sp.Dummy(real=True) for symbol in factor.free_symbols}
    return factor.xreplace(real).is_positive is True


def _text(wn: WeiNorman, sides: Sequence[str], end: End, witness: str | None) -> str:
    if not sides:
        start = f"det M^-1 = {wn.determinant} never vanishes"
        if end == "never":
            return f"all of R^{wn.group.dim}: {start}, and coordinates exist for all time"
        how = "may escape" if witness is None else f"escape (under the constant input {witness} for instance)"
        return f"{start} on R^{wn.group.dim}, yet solutions {how} to infinity in finite time: not a global chart"
    inside = "; ".join(sides)
    tail = "" if end == "walls" else ", if no solution escapes in finite time before"
    return f"{inside}{tail}"


def _wall_text(wn: WeiNorman, wall: sp.Expr) -> str:
    if isinstance(wall, sp.cos):
        coefficient, symbol = wall.args[0].as_coeff_Mul()
        if symbol in wn.g:
            return f"|{symbol}| < {sp.pi / (2 * abs(coefficient))}"
    sign = ">" if wall.subs(dict.fromkeys(wn.g, 0)) > 0 else "<"
    return f"{wall} {sign} 0"
