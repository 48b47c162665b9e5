"""f(A(x)) e_j in closed form where A^k (A^2 + q)^m e_j = 0, for f = exp, (e^t - 1)/t and t/(e^t - 1).

With mu = lambda^2 and f(lambda) = even(mu) + lambda odd(mu), Newton's interpolation at the nodes 0 (k of them in lambda) and
-q (m times in mu) gives

    f(A) e_j = sum_{i < a} even_i A^{2 i} e_j + sum_{s < m} even[0^a, (-q)^{s+1}] A^{2 a} (A^2 + q)^s e_j + the same with
               A odd and a = floor(k/2) in place of ceil(k/2),

where even_i are Taylor coefficients and the divided differences are derivatives in mu of the tails of the series: smooth in
x, entire for exp and (e^t - 1)/t. (Hermite interpolation on the spectrum, the definition of a function of a matrix.)
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import factorial
from typing import Any, Protocol

from lie_codegen.exact.quadratic_form import QuadraticForm
from lie_codegen.exact.spectral_pattern import ColumnPattern
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.cotangent import CotangentFunctions, taylor
from lie_codegen.kernel.linear import number
from lie_codegen.kernel.structural_zeros import add, is_zero, product
from lie_codegen.kernel.stumpff import StumpffFunctions, derivative_weights
from lie_codegen.on_demand import sympy as sp

#: (odd, a, order): the tail after a Taylor terms of the even or odd part, differentiated.
Tail = tuple[bool, int, int]


class Values(Protocol):
    """The tails of one function at one z."""

    def tail(self, tail: Tail) -> Scalar: ...


class MatrixFunction(Protocol):
    """An analytic function of a matrix, by the series of its even and odd parts in mu = lambda^2."""

    def taylor(self, odd: bool, i: int) -> Fraction:
        """The coefficient of mu^i."""

    def at(self, ops: Arithmetic, z: Scalar, tails: Sequence[Tail], *, signed: bool) -> Values:
        """The tails wanted at mu = -z."""


@dataclass(frozen=True)
class ExponentialFunction:
    """sum_j lambda^j / (j + shift)! with the sign of its odd part: exp (shift 0), (e^t - 1)/t (shift 1), both at +-t."""

    shift: int
    sign: int = 1

    def taylor(self, odd: bool, i: int) -> Fraction:
        return Fraction(self.sign if odd else 1, factorial(2 * i + odd + self.shift))

    def at(self, ops: Arithmetic, z: Scalar, tails: Sequence[Tail], *, signed: bool) -> Values:
        return _StumpffValues(self, ops, z, tails, signed)

    def index(self, tail: Tail) -> int:
        """The k of the c_k that the tail is."""
        return 2 * tail[1] + tail[0] + self.shift


class _StumpffValues:
    def __init__(
        self, function: ExponentialFunction, ops: Arithmetic, z: Scalar, tails: Sequence[Tail], signed: bool
    ) -> None:
        self.function = function
        top = max((max(derivative_weights(function.index(t), t[2])) for t in tails), default=0)
        self.c = StumpffFunctions(ops, z, top, signed=signed)

    def tail(self, tail: Tail) -> Scalar:
        value = self.c.derivative(self.function.index(tail), tail[2])
        return -value if tail[0] and self.function.sign < 0 else value


@dataclass(frozen=True)
class BernoulliFunction:
    """t/(e^t - 1) = (t/2) coth(t/2) - t/2; the sign of its odd part is that of t in (e^{-t} - 1)."""

    sign: int = 1

    def taylor(self, odd: bool, i: int) -> Fraction:
        if odd:
            return Fraction(-self.sign, 2) if i == 0 else Fraction(0)
        return taylor(i)

    def at(self, ops: Arithmetic, z: Scalar, tails: Sequence[Tail], *, signed: bool) -> Values:
        return _CotangentValues(self, ops, z, signed)


class _CotangentValues:
    def __init__(self, function: BernoulliFunction, ops: Arithmetic, z: Scalar, signed: bool) -> None:
        self.function = function
        self.ops = ops
        self.values = CotangentFunctions(ops, z, signed=signed)

    def tail(self, tail: Tail) -> Scalar:
        odd, a, order = tail
        if odd:
            return 0 if a + order else self.ops.constant(self.function.taylor(True, 0))
        return self.values.tail(a, order)


EXP = ExponentialFunction(0)
LEFT_JACOBIAN = ExponentialFunction(1)
RIGHT_JACOBIAN = ExponentialFunction(1, -1)
LEFT_JACOBIAN_INVERSE = BernoulliFunction()
RIGHT_JACOBIAN_INVERSE = BernoulliFunction(-1)

Sparse = dict[int, Scalar]


class LinearFamily:
    """A(x) = sum_i x_i A_i at one x, with its square and its quadratic forms; products of coordinates are shared."""

    def __init__(self, ops: Arithmetic, matrices: Sequence[sp.MatrixBase], x: Sequence[Scalar]) -> None:
        self.ops = ops
        self.x = x
        self.size = int(matrices[0].rows)
        self.columns: list[dict[int, dict[int, Any]]] = [{} for _ in range(self.size)]
        for i, matrix in enumerate(matrices):
            for r, row in enumerate(matrix.tolist()):
                for c, value in enumerate(row):
                    if value != 0 and not is_zero(x[i]):
                        self.columns[c].setdefault(r, {})[i] = value
        self._polynomials: dict[Any, tuple[Any, Scalar]] = {}
        self._monomials: dict[tuple[int, ...], Scalar] = {}

    def form(self, form: QuadraticForm) -> Scalar:
        """q(x)."""
        return self._signed(self._polynomial(dict(form.coefficients)))

    def apply(self, column: Mapping[int, Scalar]) -> Sparse:
        """A v for a sparse v."""
        result: Sparse = {}
        for c, value in column.items():
            for r, entry in self.columns[c].items():
                sign, linear = self._polynomial({(i,): a for i, a in entry.items()})
                term = product(product(linear, value), sign)
                result[r] = add(result.get(r, 0), term)
        return result

    def first(self, j: int) -> dict[int, tuple[int, Scalar]]:
        """A e_j as (sign, value): equal entries up to sign are one value."""
        return {r: self._polynomial({(i,): a for i, a in entry.items()}) for r, entry in self.columns[j].items()}

    def second(self, j: int) -> dict[int, tuple[int, Scalar]]:
        """A^2 e_j, from its exact quadratic polynomials."""
        # Summed exactly before any arithmetic: A^2 of a Lie algebra loses most of its terms (of so(3) w w^T - |w|^2 remains), and a term that
        # cancels here is neither computed nor rounded. An entry whose polynomial is zero is zero for every x and is left out.
        squares: dict[int, dict[tuple[int, ...], Any]] = {}
        for c, entry in self.columns[j].items():
            for r, other in self.columns[c].items():
                polynomial = squares.setdefault(r, {})
                for i, a in entry.items():
                    for k, b in other.items():
                        key = (min(i, k), max(i, k))
                        polynomial[key] = sp.expand(polynomial.get(key, 0) + a * b)
        result = {}
        for r, polynomial in squares.items():
            left = {key: value for key, value in polynomial.items() if value != 0}
            if left:
                result[r] = self._polynomial(left)
        return result

    def _signed(self, pair: tuple[int, Scalar]) -> Scalar:
        return product(pair[1], pair[0])

    def _polynomial(self, polynomial: Mapping[tuple[int, ...], Any]) -> tuple[int, Scalar]:
        """A homogeneous polynomial, up to a sign that makes its first coefficient positive."""
        # With the first coefficient positive p and -p have one key, so that the two entries +-w_3 of a rotation cost one value.
        items = sorted(polynomial.items())
        sign = -1 if items[0][1].is_negative else 1
        key = tuple((m, sign * value) for m, value in items)
        if key not in self._polynomials:
            total: Scalar = 0
            # One common factor is taken out: (a^2 + b^2) / 4 rather than a^2 / 4 + b^2 / 4.
            scale = key[0][1]
            for m, value in key:
                ratio = sp.radsimp(value / scale)
                term = self._monomial(m)
                if ratio == -1 and not is_zero(total):
                    total = total - term
                else:
                    total = add(total, product(number(self.ops, ratio), term))
            self._polynomials[key] = (1, product(number(self.ops, scale), total))
        return sign, self._polynomials[key][1]

    def _monomial(self, m: tuple[int, ...]) -> Scalar:
        if m not in self._monomials:
            self._monomials[m] = self.x[m[0]] if len(m) == 1 else product(self.x[m[0]], self.x[m[1]])
        return self._monomials[m]


class FunctionOfMatrix:
    """Columns of f(A(x)) for one f, one family and its column patterns; shared functions are computed once a form."""

    def __init__(self, family: LinearFamily, patterns: Sequence[ColumnPattern], function: MatrixFunction) -> None:
        self.family = family
        self.patterns = patterns
        self.function = function
        self.ops = family.ops
        self._values: dict[QuadraticForm, tuple[Scalar, Values]] = {}

    def column(self, j: int) -> Sparse:
        """f(A) e_j."""
        return self._sum(self.patterns[j], _Krylov(self.family, self.patterns[j], j))

    def apply(self, vector: Sparse) -> Sparse:
        """f(A) v for a sparse v, in as many products as its longest column needs if its columns share a form."""
        columns = [self.patterns[j] for j in vector]
        forms = {pattern.form for pattern in columns if pattern.form is not None}
        if len(forms) > 1:
            total: Sparse = {}
            for j, value in vector.items():
                for r, entry in self.column(j).items():
                    total[r] = add(total.get(r, 0), product(entry, value))
            return total
        # The columns share one q, so one polynomial mu^k (mu + q)^m, as long as the longest, annihilates all of them: Newton's sum for it is right
        # for each, and by linearity for v. With different q it would be right for none but its own column.
        zeros = max((pattern.zeros for pattern in columns), default=1)
        pairs = max((pattern.pairs for pattern in columns), default=0)
        # A column without pairs is annihilated by its zeros alone, and so by any longer polynomial.
        longest = ColumnPattern(zeros, pairs, next(iter(forms), None), ())
        return self._sum(longest, _Krylov(self.family, longest, vector))

    def _sum(self, pattern: ColumnPattern, krylov: _Krylov) -> Sparse:
        terms = self._terms(pattern)
        result: Sparse = {}
        for (power, s), coefficient in terms:
            if is_zero(coefficient):
                continue
            vector = krylov.vector(power, s, self._z(pattern))
            for r, (sign, value) in vector.items():
                term = product(coefficient, value)
                old = result.get(r, 0)
                result[r] = (old - term if not is_zero(old) else -term) if sign < 0 else add(old, term)
        return result

    def _z(self, pattern: ColumnPattern) -> Scalar:
        return 0 if pattern.form is None else self._at(pattern.form, pattern)[0]

    def _at(self, form: QuadraticForm, pattern: ColumnPattern) -> tuple[Scalar, Values]:
        if form not in self._values:
            # All tails that any column with this q will ask for, at once: they share one sine, one cosine, one square root of q.
            z = self.family.form(form) if not self._vanishes(form) else 0
            tails = sorted(set(_tails(pattern)) | {t for p in self.patterns if p.form == form for t in _tails(p)})
            signed = not form.is_nonnegative
            self._values[form] = (z, self.function.at(self.ops, z, tails, signed=signed))
        return self._values[form]

    def _vanishes(self, form: QuadraticForm) -> bool:
        return all(any(is_zero(self.family.x[i]) for i in pair) for pair, _ in form.coefficients)

    def _terms(self, pattern: ColumnPattern) -> list[tuple[tuple[int, int], Scalar]]:
        """((power, s), coefficient): f(A) e_j = sum of coefficient A^power (A^2 + q)^s e_j."""
        # A^(2 i + odd) for the node 0, counted in mu = lambda^2: of k zeros in lambda the even part has ceil(k/2), the odd one, which has a lambda in
        # front, floor(k/2). Behind them the node -q: the divided difference over 0 (a times) and -q (s + 1 times) is the s-th derivative
        # of the tail of the series after a terms, over s!, which is entire in q: nothing is divided by q.
        terms: list[tuple[tuple[int, int], Scalar]] = []
        for odd in (False, True):
            a = _zeros(pattern, odd)
            for i in range(a):
                value = self.function.taylor(odd, i)
                constant = int(value) if value.denominator == 1 else self.ops.constant(value)
                terms.append(((2 * i + odd, 0), constant))
            if pattern.form is not None:
                values = self._at(pattern.form, pattern)[1]
                terms += [((2 * a + odd, s), values.tail((odd, a, s))) for s in range(pattern.pairs)]
        return terms


def _zeros(pattern: ColumnPattern, odd: bool) -> int:
    return pattern.zeros // 2 if odd else (pattern.zeros + 1) // 2


def _tails(pattern: ColumnPattern) -> list[Tail]:
    return [(odd, _zeros(pattern, odd), s) for odd in (False, True) for s in range(pattern.pairs)]


class _Krylov:
    """A^power (A^2 + q)^s v from v = e_j or a sparse v; of e_j only the rows where it does not vanish identically."""

    def __init__(self, family: LinearFamily, pattern: ColumnPattern, start: int | Sparse) -> None:
        self.family = family
        self.start = start
        self.supports = dict(pattern.supports)
        self._done: dict[tuple[int, int], dict[int, tuple[int, Scalar]]] = {}

    def vector(self, power: int, s: int, z: Scalar) -> dict[int, tuple[int, Scalar]]:
        if (power, s) not in self._done:
            found = self._compute(power, s, z)
            rows = self.supports.get((power, s))
            self._done[power, s] = {r: v for r, v in found.items() if rows is None or r in rows}
        return self._done[power, s]

    def _compute(self, power: int, s: int, z: Scalar) -> dict[int, tuple[int, Scalar]]:
        if s:
            # (A^2 + q) w = A^2 w + q w, each part known from one power of (A^2 + q) less. Where the sum vanishes for every x, by the exact
            # pattern, it is not formed: in floating point it would be a rounding error.
            higher = self._plain(self.vector(power + 2, s - 1, z))
            for r, value in self._plain(self.vector(power, s - 1, z)).items():
                rows = self.supports.get((power, s))
                if rows is None or r in rows:
                    higher[r] = add(higher.get(r, 0), product(z, value))
            return {r: (1, value) for r, value in higher.items()}
        if power == 0:
            start = {self.start: 1} if isinstance(self.start, int) else self.start
            return {r: (1, value) for r, value in start.items()}
        if isinstance(self.start, int) and power == 1:
            return self.family.first(self.start)
        if isinstance(self.start, int) and power == 2:
            return self.family.second(self.start)
        applied = self.family.apply(self._plain(self.vector(power - 1, 0, z)))
        return {r: (1, value) for r, value in applied.items()}

    def _plain(self, vector: dict[int, tuple[int, Scalar]]) -> Sparse:
        return {r: product(value, sign) for r, (sign, value) in vector.items()}
