"""Averages as sums of (coefficient, bracket): the Floquet-Magnus recursion on the free Lie algebra of X, [Y_a, X] and <Y_a : Y_b>.

    G = X + U^a [Y_a, X] - U^a U^b <Y_a : Y_b> / 2,    Z_q = sum_j T_qj(u) bracket_j:

the coefficients follow from the input alone, whatever the system. This is the table of which Fig. 2 of Sanyal, Bloch and McClamroch shows four rows: T^1 of [Y, X], T^2 of
<Y : Y>, T^3 of [[Y, X], X] (printed wrong there, with the square of U / 2 in place of its second integral) and T^4 of [<Y : Y>, X]. Over one period the pull-back
gauge holds for inputs with a mean too, whose U has secular terms: T Z is the logarithm of the flow over that period.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from itertools import combinations_with_replacement

from lie_codegen.errors import InputError
from lie_codegen.kernel.saved import Saved
from lie_codegen.on_demand import sympy as sp
from lie_codegen.signals.floquet_magnus import floquet_magnus
from lie_codegen.signals.periodic_reader import PeriodicLike, as_periodic
from lie_codegen.signals.time_polynomial import TimePolynomial, constant, fourier_terms

#: A generator by its number, or the bracket of two words.
Word = int | tuple["Word", "Word"]
#: word -> its coefficient as a function of the fast time.
Series = Mapping[Word, TimePolynomial]
GAUGES = ("zero_mean", "pull_back")
_MOST = 4


@dataclass(frozen=True, eq=False, repr=False)
class BracketTerm(Saved):
    """One row of the table.

    Attributes:
        order: q, of Z_q.
        bracket: as a text, "[[Y,X],X]" for one input, "[[Y1,X],<Y1:Y2>]" for several.
        coefficient: exact, with the parameters of the input as symbols.
    """

    order: int
    bracket: str
    coefficient: sp.Expr


@dataclass(frozen=True)
class _Calculus:
    """Series of words: what the recursion needs."""

    zero_mean: bool
    period: sp.Expr

    def bracket(self, x: Series, y: Series, *, mean_only: bool = False) -> Series:
        """[x, y]; words are ordered, [b, a] = -[a, b]."""
        total: dict[Word, TimePolynomial] = {}
        for a, f in x.items():
            for b, g in y.items():
                if a == b:
                    continue
                word, sign = ((a, b), 1) if _key(a) < _key(b) else ((b, a), -1)
                product = f * g
                if mean_only:
                    product = constant(product.mean(), self.period)
                product = product.scaled(sp.Integer(sign))
                total[word] = total[word] + product if word in total else product
        return _kept(total)

    def combine(self, terms: Iterable[tuple[Fraction | int, Series]]) -> Series:
        """sum of factor * series."""
        total: dict[Word, TimePolynomial] = {}
        for factor, series in terms:
            for word, f in series.items():
                part = f.scaled(sp.Rational(Fraction(factor).numerator, Fraction(factor).denominator))
                total[word] = total[word] + part if word in total else part
        return _kept(total)

    def mean(self, x: Series) -> Series:
        """The means over a period."""
        return _kept({word: constant(f.mean(), self.period) for word, f in x.items()})

    def primitive(self, x: Series) -> Series:
        """Of zero mean, or zero at the start of the period."""
        return _kept({word: f.primitive() if self.zero_mean else f.integral() for word, f in x.items()})


@dataclass(frozen=True, eq=False, repr=False)
class BracketSeries(Saved):
    """The series of an input.

    Attributes:
        inputs: u^a.
        rates: (order) Z_q as word -> coefficient.
        logarithms: (order - 1) Lambda_q as word -> function of the fast time.
        primitives: U^a of the gauge.
        count: m, the number of inputs.
    """

    inputs: tuple[TimePolynomial, ...]
    rates: tuple[dict[Word, sp.Expr], ...]
    logarithms: tuple[dict[Word, TimePolynomial], ...]
    primitives: tuple[TimePolynomial, ...]

    @property
    def count(self) -> int:
        """m."""
        return len(self.inputs)


def check_series(order: int, gauge: str) -> None:
    """The order and the gauge are there.

    Raises:
        InputError: they are not.
    """
    if isinstance(order, bool) or not isinstance(order, int) or not 1 <= order <= _MOST:
        raise InputError(f"order {order!r} is not there: brackets are taken to orders 1 to {_MOST}")
    if gauge not in GAUGES:
        raise InputError(f"no gauge {gauge!r}; choose one of {', '.join(map(repr, GAUGES))}")


def bracket_series(inputs: tuple[TimePolynomial, ...], order: int, gauge: str) -> BracketSeries:
    """The series to an order.

    Raises:
        InputError: an order above 4, an unknown gauge.
    """
    check_series(order, gauge)
    period = inputs[0].period
    zero_mean = gauge == "zero_mean"
    U = tuple(u.primitive() if zero_mean else u.integral() for u in inputs)
    series: dict[Word, TimePolynomial] = {0: constant(sp.S.One, period)}
    for a, each in enumerate(U):
        series[1 + a] = each
    for number, (a, b) in enumerate(pairs(len(U)), start=1 + len(U)):
        # the pair (a, b) stands twice in the double sum unless a = b
        series[number] = (U[a] * U[b]).scaled(sp.Rational(-1, 2) if a == b else sp.Integer(-1))
    calculus = _Calculus(zero_mean, period)
    rates, logarithms = floquet_magnus(calculus, _kept(series), order)
    values = tuple({w: sp.expand(f.mean()) for w, f in rate.items()} for rate in rates)
    return BracketSeries(inputs, values, tuple(dict(each) for each in logarithms), U)


def bracket_table(u: PeriodicLike, order: int = 2, gauge: str = "pull_back") -> tuple[BracketTerm, ...]:
    """The averaged coefficients of all brackets, Z = sum eps^(q-1) sum coefficient * bracket, exact in the parameters of the input.

    Args:
        u: sums of sines and cosines, one component an input; a mean is allowed in the pull-back gauge.
        order: 1 to 4.
        gauge: "pull_back" (the paper's) or "zero_mean".

    Raises:
        InputError: an order or gauge there is not; a mean in the zero-mean gauge, where U would not be periodic.
    """
    u = as_periodic(u, "bracket_table")
    waves = fourier_terms(u)
    if gauge == "zero_mean" and any(wave.mean() != 0 for wave in waves):
        raise InputError("bracket_table: an input with a mean has no primitive of zero mean; use gauge='pull_back'")
    series = bracket_series(waves, order, gauge)
    return tuple(
        BracketTerm(q, word_text(word, len(waves)), value)
        for q, rate in enumerate(series.rates, start=1)
        for word, value in rate.items()
    )


def pairs(count: int) -> tuple[tuple[int, int], ...]:
    """(a, b), a <= b: the symmetric products, in the order of their generators."""
    return tuple(combinations_with_replacement(range(count), 2))


def word_text(word: Word, count: int) -> str:
    """A bracket as a text."""
    names = ["Y"] if count == 1 else [f"Y{a + 1}" for a in range(count)]
    if isinstance(word, int):
        if word == 0:
            return "X"
        if word <= count:
            return f"[{names[word - 1]},X]"
        a, b = pairs(count)[word - 1 - count]
        return f"<{names[a]}:{names[b]}>"
    return f"[{word_text(word[0], count)},{word_text(word[1], count)}]"


def _key(word: Word) -> tuple[int, str]:
    """An order of words in which X comes last, so that brackets read [[Y,X],X] as in the paper."""
    return (1, "") if word == 0 else (0, repr(word))


def _kept(series: Mapping[Word, TimePolynomial]) -> Series:
    return {word: f for word, f in series.items() if f.terms}
