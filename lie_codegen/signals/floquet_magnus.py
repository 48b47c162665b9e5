"""The Floquet-Magnus recursion: the averaged system of any order, for inputs with or without a mean.

    X(t) = exp(t sum_q eps^q F_q) exp(sum_q eps^q Lambda_q(t)),   Lambda_q periodic, Lambda_q(0) = 0.

Left-invariant form, X' = eps X U: Lambda' = sum_k B_k / k! ad_Lambda^k ((-1)^k eps U - F), so that with
S_q^(k)[Y] = sum_m [Lambda_m, S_{q-m}^(k-1)[Y]] and S^(0)[Y] = Y,

    G_q = delta_{q1} U + 1/2 S_q^(1)[U + F] + sum_{k even} B_k / k! S_q^(k)[U - F],
    F_q = mean(G_q),   Lambda_q = int_0^t (G_q - F_q).

An input that is itself a series, U = sum eps^(q-1) U_q, joins at every order: G_q starts from U_q, and U_q stands beside F_q.

There are no secular terms. Truncated at F_p and Lambda_{p-1} the error is O(eps^p) on [0, b / eps]. The recursion is
that of Casas, Oteo and Ros for exp(Lambda) exp(t F), reversed for left-invariant systems.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from fractions import Fraction
from math import factorial
from typing import Any, Protocol, TypeVar, cast

S = TypeVar("S")


class Calculus(Protocol[S]):
    """What the recursion needs of signals with values in a Lie algebra."""

    def bracket(self, x: S, y: S, *, mean_only: bool = False) -> S:
        """[x, y], or its mean over a period."""

    def combine(self, terms: Iterable[tuple[Fraction | int, S]]) -> S:
        """sum of factor * signal."""

    def mean(self, x: S) -> S:
        """The mean over a period, as a constant signal."""

    def primitive(self, x: S) -> S:
        """int_0^t x."""


def bernoulli(count: int) -> list[Fraction]:
    """B_0 .. B_{count-1}, with B_1 = -1/2."""
    numbers: list[Fraction] = []
    for n in range(count):
        row = [Fraction(1, m + 1) for m in range(n + 1)]
        for m in range(1, n + 1):
            for j in range(m, 0, -1):
                row[j - 1] = j * (row[j - 1] - row[j])
        numbers.append(-row[0] if n == 1 else row[0])
    return numbers


def floquet_magnus(calculus: Calculus[S], u: S | Sequence[S], order: int) -> tuple[list[S], list[S]]:
    """([F_1 .. F_p], [Lambda_1 .. Lambda_{p-1}]) for eps = 1 time unit 1; F_q are constant signals.

    Args:
        calculus: of the signals.
        u: U; or a list [U_1, U_2, ...] of the terms of X' = X sum eps^q U_q, as far as they are known or wanted.
        order: p.
    """
    weights = [b / factorial(k) for k, b in enumerate(bernoulli(order + 1))]
    inputs: list[S] = list(u) if isinstance(u, list) else [cast(S, u)]
    rates: list[S] = []
    logarithms: list[S] = []
    minus: dict[tuple[int, int], S] = {}
    plus: list[S] = []
    for q in range(1, order + 1):
        last = q == order
        own: list[tuple[Fraction | int, Any]] = [(1, inputs[q - 1])] if q <= len(inputs) else []
        terms = list(own)
        for m in range(1, q):
            terms.append((Fraction(1, 2), calculus.bracket(logarithms[m - 1], plus[q - m - 1], mean_only=last)))
        for k in range(1, q):
            if k % 2 and (last or k + 1 >= order):
                continue
            pairs = [(m, minus[k - 1, q - m]) for m in range(1, q - k + 1)]
            value = calculus.combine([(1, calculus.bracket(logarithms[m - 1], s, mean_only=last)) for m, s in pairs])
            minus[k, q] = value
            if k % 2 == 0:
                terms.append((weights[k], value))
        g = calculus.combine(terms)
        f = calculus.mean(g)
        rates.append(f)
        minus[0, q] = calculus.combine([*own, (-1, f)])
        plus.append(calculus.combine([*own, (1, f)]))
        if not last:
            logarithms.append(calculus.primitive(calculus.combine([(1, g), (-1, f)])))
    return rates, logarithms
