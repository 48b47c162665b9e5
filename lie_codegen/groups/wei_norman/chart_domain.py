"""Where Wei-Norman coordinates hold: the walls of the determinant, and whether solutions can escape before them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import sympy as sp

from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.groups.wei_norman.chart_end import End, chart_end, escaping_input
from lie_codegen.groups.wei_norman.matrix import WeiNorman, wei_norman


@dataclass(frozen=True)
class ChartDomain:
    """The chart of X = exp(g_1 A_1) ... exp(g_n A_n) around g = 0.

    Attributes:
        determinant: det M^{-1}, factored.
        walls: the factors that vanish somewhere, positive or negative on the chart as at g = 0.
        wall_texts: the side of each wall on which the chart lies, as in "|g2| < pi/2".
        end: how a solution can leave the chart; "never" is a global chart.
        text: the domain in words.
        reason: why.
    """

    determinant: sp.Expr
    walls: tuple[sp.Expr, ...]
    wall_texts: tuple[str, ...]
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
    end, reason = chart_end(group, bool(walls))
    witness = escaping_input(group) if end == "escape" else None
    sides = tuple(_wall_text(wn, wall) for wall in walls)
    return ChartDomain(wn.determinant, walls, sides, end, _text(wn, sides, end, witness), reason)


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
