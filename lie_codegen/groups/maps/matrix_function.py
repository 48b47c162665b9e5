"""f(A(x)) e_j in closed form where A^k (A^2 + q)^m e_j = 0, for f = exp, (e^t - 1)/t and t/(e^t - 1).

With mu = lambda^2 and f(lambda) = even(mu) + lambda odd(mu), Newton's interpolation at the nodes 0 (k of them in lambda) and
-q (m times in mu) gives

    f(A) e_j = sum_{i < a} even_i A^{2 i} e_j + sum_{s < m} even[0^a, (-q)^{s+1}] A^{2 a} (A^2 + q)^s e_j + the same with
               A odd and a = floor(k/2) in place of ceil(k/2),

where even_i are Taylor coefficients and the divided differences are derivatives in mu of the remainders of the series: smooth in
x, entire for exp and (e^t - 1)/t. (Hermite interpolation on the spectrum, the definition of a function of a matrix.)
"""

from __future__ import annotations

from collections.abc import Sequence

from lie_codegen.exact.quadratic_form import QuadraticForm
from lie_codegen.exact.spectral_pattern import ColumnPattern
from lie_codegen.groups.maps.analytic_functions import MatrixFunction, Remainder, Values
from lie_codegen.groups.maps.linear_family import LinearFamily, Sparse
from lie_codegen.kernel.arithmetic import Scalar
from lie_codegen.kernel.structural_zeros import add, is_zero, product


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
            # All remainders that any column with this q will ask for, at once: they share one sine, one cosine, one square root of q.
            z = self.family.form(form) if not self._vanishes(form) else 0
            remainders = sorted(
                set(_remainders(pattern)) | {t for p in self.patterns if p.form == form for t in _remainders(p)}
            )
            signed = not form.is_nonnegative
            self._values[form] = (z, self.function.at(self.ops, z, remainders, signed=signed))
        return self._values[form]

    def _vanishes(self, form: QuadraticForm) -> bool:
        return all(any(is_zero(self.family.x[i]) for i in pair) for pair, _ in form.coefficients)

    def _terms(self, pattern: ColumnPattern) -> list[tuple[tuple[int, int], Scalar]]:
        """((power, s), coefficient): f(A) e_j = sum of coefficient A^power (A^2 + q)^s e_j."""
        # A^(2 i + odd) for the node 0, counted in mu = lambda^2: of k zeros in lambda the even part has ceil(k/2), the odd one, which has a lambda in
        # front, floor(k/2). Behind them the node -q: the divided difference over 0 (a times) and -q (s + 1 times) is the s-th derivative
        # of the remainder of the series after a terms, over s!, which is entire in q: nothing is divided by q.
        terms: list[tuple[tuple[int, int], Scalar]] = []
        for odd in (False, True):
            a = _zeros(pattern, odd)
            for i in range(a):
                value = self.function.taylor(odd, i)
                constant = int(value) if value.denominator == 1 else self.ops.constant(value)
                terms.append(((2 * i + odd, 0), constant))
            if pattern.form is not None:
                values = self._at(pattern.form, pattern)[1]
                terms += [((2 * a + odd, s), values.remainder((odd, a, s))) for s in range(pattern.pairs)]
        return terms


def _zeros(pattern: ColumnPattern, odd: bool) -> int:
    return pattern.zeros // 2 if odd else (pattern.zeros + 1) // 2


def _remainders(pattern: ColumnPattern) -> list[Remainder]:
    return [(odd, _zeros(pattern, odd), s) for odd in (False, True) for s in range(pattern.pairs)]


class _Krylov:
    """A^power (A^2 + q)^s v from v = e_j or a sparse v; of e_j only the rows where it does not vanish identically."""

    def __init__(self, family: LinearFamily, pattern: ColumnPattern, start: int | Sparse) -> None:
        self.family = family
        self.start = start
        self.pattern = pattern
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
            form = self.pattern.form
            if isinstance(self.start, int) and form is not None:
                exact = self.family.factored(form, self.start, power, s)
                if exact is not None:
                    return exact
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
