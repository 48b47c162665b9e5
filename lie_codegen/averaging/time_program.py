"""Averages of y' = eps f(y, t; eps) to order 4 as a list of steps over nodes, run by C and by Python alike.

With u_q of zero mean in t, y = z + sum eps^q u_q(z, t), z' = sum eps^q F_q(z):

    H_1 = f                                                            F_q = <H_q>,  u_q = P H_q
    H_2 = Df[u1] - Du1[F1]
    H_3 = Df[u2] + D2f[u1, u1]/2 - Du2[F1] - Du1[F2]
    H_4 = Df[u3] + D2f[u1, u2] + D3f[u1, u1, u1]/6 - Du3[F1] - Du2[F2] - Du1[F3].

Derivatives of u_q along vectors follow by differentiating its own formula: P commutes with them. Where f depends on eps, eps is one
more coordinate of the multilinear forms: u1 has the component 1 there, every other direction 0.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

MOST = 4


class Step(NamedTuple):
    """One step of the program.

    Attributes:
        kind: "field" (D^m f along directions), "sum" (a linear combination), "primitive" (P and the mean).
        output: name of the array over nodes.
        terms: for a field the directions, for a sum (coefficient, array) pairs, for a primitive the array.
        mean: of a primitive, the name of the mean.
    """

    kind: str
    output: str
    terms: tuple[Any, ...]
    mean: str = ""


@dataclass
class Program:
    """The steps in order, each array made once."""

    steps: list[Step] = field(default_factory=list)
    known: dict[tuple[Any, ...], str] = field(default_factory=dict)
    means: list[str] = field(default_factory=list)

    def field(self, *directions: str) -> str:
        """D^m f along directions, which are arrays over nodes or means; symmetric, so their order does not matter."""
        return self._made("field", tuple(sorted(directions)), f"d{len(self.known)}")

    def sum(self, *terms: tuple[float, str]) -> str:
        """sum of coefficient * array."""
        return self._made("sum", terms, f"s{len(self.known)}")

    def primitive(self, array: str, name: str = "", mean: str = "") -> tuple[str, str]:
        """(P h, <h>)."""
        key = ("primitive", array)
        if key not in self.known:
            output, average = name or f"p{len(self.known)}", mean or f"m{len(self.known)}"
            self.steps.append(Step("primitive", output, (array,), average))
            self.means.append(average)
            self.known[key] = output
            self.known["mean", array] = average
        return self.known[key], self.known["mean", array]

    def _made(self, kind: str, terms: tuple[Any, ...], name: str) -> str:
        key = (kind, *terms)
        if key not in self.known:
            self.steps.append(Step(kind, name, terms))
            self.known[key] = name
        return self.known[key]

    @property
    def arrays(self) -> list[str]:
        """Names over nodes."""
        return [each.output for each in self.steps]


def program(order: int) -> Program:
    """F1 .. F_order and u1 .. u_order, the last of them not needed."""
    p = Program()
    p.primitive(p.field(), "u1", "F1")
    if order > 1:
        p.primitive(p.sum((1, p.field("u1")), (-1, _by1(p, "F1")[0])), "u2", "F2")
    if order > 2:
        terms = [(1, p.field("u2")), (0.5, p.field("u1", "u1")), (-1, _by2(p, "F1")[0]), (-1, _by1(p, "F2")[0])]
        p.primitive(p.sum(*terms), "u3", "F3")
    if order > 3:
        terms = [(1, p.field("u3")), (1, p.field("u1", "u2")), (1 / 6, p.field("u1", "u1", "u1"))]
        terms += [(-1, _third_along_first(p)), (-1, _by2(p, "F2")[0]), (-1, _by1(p, "F3")[0])]
        p.primitive(p.sum(*terms), "u4", "F4")
    return p


def _by1(p: Program, v: str) -> tuple[str, str]:
    """(Du1[v], DF1[v]) for a constant v."""
    return p.primitive(p.field(v))


def _by2(p: Program, v: str) -> tuple[str, str]:
    """(Du2[v], DF2[v]): u2 = P(Df[u1] - P Df[F1])."""
    u1, F1 = _by1(p, v)
    inner = p.primitive(p.sum((1, p.field("F1", v)), (1, p.field(F1))))[0]
    return p.primitive(p.sum((1, p.field("u1", v)), (1, p.field(u1)), (-1, inner)))


def _twice1(p: Program, a: str, b: str) -> tuple[str, str]:
    """(D2u1[a, b], D2F1[a, b])."""
    return p.primitive(p.field(a, b))


def _twice2(p: Program, a: str, b: str) -> str:
    """D2u2[a, b] for constants a and b: Du2[a] differentiated along b."""
    (ua, Fa), (ub, Fb), (uab, Fab) = _by1(p, a), _by1(p, b), _twice1(p, a, b)
    inner = p.sum((1, p.field("F1", a, b)), (1, p.field(Fb, a)), (1, p.field(Fa, b)), (1, p.field(Fab)))
    outer = [(1, p.field("u1", a, b)), (1, p.field(ub, a)), (1, p.field(ua, b)), (1, p.field(uab))]
    return p.primitive(p.sum(*outer, (-1, p.primitive(inner)[0])))[0]


def _third_along_first(p: Program) -> str:
    """Du3[F1], from H_3 differentiated along F1; Du2[F1] and Du1[F2] change with their arguments too."""
    u1, F1 = _by1(p, "F1")
    u2, F2 = _by2(p, "F1")
    moved = [
        (1, p.field("u2", "F1")), (1, p.field(u2)), (0.5, p.field("u1", "u1", "F1")), (1, p.field("u1", u1)),
        (-1, _twice2(p, "F1", "F1")), (-1, _by2(p, F1)[0]), (-1, _twice1(p, "F2", "F1")[0]), (-1, _by1(p, F2)[0]),
    ]  # fmt: skip
    return p.primitive(p.sum(*moved))[0]


def differentiated(order: int) -> tuple[Program, dict[str, str]]:
    """`program(order)` with the derivative of each of its arrays along a constant "v", and their names by the names of the arrays.

    The steps are multilinear, linear, or P and the mean: each is differentiated by its own rule, the point moving along v.
    """
    p, rates = program(order), dict[str, str]()
    for step in list(p.steps):
        if step.kind == "field":
            directions = [str(each) for each in step.terms]
            moved = [(1, p.field(*directions, "v"))]
            for i, each in enumerate(directions):
                moved.append((1, p.field(*directions[:i], rates[each], *directions[i + 1 :])))
            rates[step.output] = p.sum(*moved)
        elif step.kind == "sum":
            rates[step.output] = p.sum(*((factor, rates[array]) for factor, array in step.terms))
        else:
            rates[step.output], rates[step.mean] = p.primitive(rates[str(step.terms[0])])
    return p, rates


def indexed(names: Sequence[object], means: Sequence[str]) -> list[str]:
    """C expressions of directions at node j, each with its component along eps."""
    return [f"{each}{'' if each in means else '[j]'}, {1.0 if each == 'u1' else 0.0}" for each in names]
