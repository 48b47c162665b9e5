"""Polynomials modulo a monic p(t): functions of a matrix with p(B) = 0, as a handful of scalars.

An element is the list of its coefficients, lowest first. A function f(B) computed here costs r^2 operations a product, where
matrices would cost their size cubed. f(B) is found from f mod p; an error in p is multiplied by the divided difference of f
of order r, so that nearly equal or equal eigenvalues do no harm.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction

from lie_codegen.exact.invariant_form import Relation
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.complex_scalar import Complex
from lie_codegen.kernel.linear import Matrix, identity, matadd, number, scaled
from lie_codegen.kernel.small_inverse import inverse
from lie_codegen.kernel.structural_zeros import add, product

Element = list[Scalar]


class QuotientRing:
    """R[t] / p(t) with p = t^r + c_{r-1} t^{r-1} + .. + c_0."""

    def __init__(self, ops: Arithmetic, coefficients: Sequence[Scalar]) -> None:
        self.ops = ops
        self.p = list(coefficients)
        self.r = len(self.p)

    def constant(self, value: Scalar) -> Element:
        """A scalar as an element."""
        return [value] + [0] * (self.r - 1)

    def plus(self, a: Element, b: Element, factor: Scalar = 1) -> Element:
        """a + factor b."""
        return [add(x, product(factor, y)) for x, y in zip(a, b, strict=True)]

    def scaled(self, factor: Scalar, a: Element) -> Element:
        """factor a."""
        return [product(factor, x) for x in a]

    def shifted(self, a: Element) -> Element:
        """t a."""
        # t t^(r-1) = t^r = -(c_0 + .. + c_(r-1) t^(r-1)): what leaves at the top comes back as a multiple of p.
        top = a[-1]
        low = [0, *a[:-1]]
        return [add(x, product(-1, product(c, top))) for x, c in zip(low, self.p, strict=True)]

    def times(self, a: Element, b: Element) -> Element:
        """a b."""
        result = self.scaled(a[-1], b)
        for value in reversed(a[:-1]):
            result = self.plus(self.shifted(result), b, value)
        return result

    def inverse(self, a: Element) -> Element:
        """1 / a: the first column of the inverse of the multiplication by a."""
        # Multiplication by a is a matrix whose column k is a t^k. It takes 1/a to 1 = (1, 0, .., 0).
        columns = [a]
        while len(columns) < self.r:
            columns.append(self.shifted(columns[-1]))
        table = [[column[i] for column in columns] for i in range(self.r)]
        return [row[0] for row in inverse(self.ops, table)]

    def series(self, coefficients: Sequence[Fraction]) -> Element:
        """sum_j coefficients[j] t^j."""
        result = self.constant(self.ops.constant(coefficients[-1]))
        for value in reversed(coefficients[:-1]):
            result = self.shifted(result)
            result[0] = add(result[0], self.ops.constant(value))
        return result

    def compose(self, coefficients: Sequence[Fraction], a: Element) -> Element:
        """sum_j coefficients[j] a^j."""
        result = self.constant(self.ops.constant(coefficients[-1]))
        for value in reversed(coefficients[:-1]):
            result = self.times(result, a)
            result[0] = add(result[0], self.ops.constant(value))
        return result

    def over_linear(self, pole: Scalar) -> Element:
        """1 / (t + pole), by synthetic division: p(t) = (t + pole) s(t) + p(-pole) gives -s / p(-pole)."""
        quotient: list[Scalar] = [1]
        for c in reversed(self.p[1:]):
            quotient.append(add(c, product(-1, product(pole, quotient[-1]))))
        remainder = add(self.p[0], product(-1, product(pole, quotient[-1])))
        factor = -1 / remainder
        return [product(factor, value) for value in reversed(quotient)]

    def square_root(self, a: Element, steps: int) -> Element:
        """The principal root: in closed form for r = 2 over the reals, else by the Denman-Beavers product form."""
        if self.r == 2 and not any(isinstance(value, Complex) for value in (*a, *self.p)):
            return self._square_root_2(a)
        # M -> 1 and Y -> sqrt(a) quadratically: Y^2 = a M all the way, with one inverse a step (Denman and Beavers).
        half, quarter = self.ops.constant(Fraction(1, 2)), self.ops.constant(Fraction(1, 4))
        M, Y = a, a
        for step in range(steps):
            M_inverse = self.inverse(M)
            moved = self.scaled(half, M_inverse)
            moved[0] = add(moved[0], half)
            Y = self.times(Y, moved)
            if step + 1 < steps:
                M = self.scaled(quarter, self.plus(M, M_inverse))
                M[0] = add(M[0], half)
        return Y

    def _square_root_2(self, a: Element) -> Element:
        """(a + sqrt(det a)) / sqrt(tr a + 2 sqrt(det a)), with trace and determinant of the multiplication by a."""
        # s = sqrt(a) as a 2 x 2 matrix: s^2 - (tr s) s + det s = 0 by Cayley and Hamilton, so s = (a + det s)/tr s, where
        # det s = sqrt(det a) and (tr s)^2 = tr s^2 + 2 det s = tr a + 2 det s.
        other = self.shifted(a)
        determinant = a[0] * other[1] - a[1] * other[0]
        root = self.ops.sqrt(determinant)
        factor = 1 / self.ops.sqrt(a[0] + other[1] + 2 * root)
        return [factor * (a[0] + root), factor * a[1]]


def matrix_value(
    ops: Arithmetic, element: Element, powers: Sequence[Matrix], relation: Relation | None = None
) -> Matrix:
    """sum_i element[i] B^i from I, B, .., B^b: Horner's rule in B^b, whose products obey the relation (sign 1)."""
    # b powers are there: the sum is cut into chunks of b terms, which share them, and only every b-th power costs a
    # product (Paterson and Stockmeyer).
    block = len(powers) - 1
    chunks = [element[start : start + block] for start in range(0, len(element), block)]
    if len(chunks) > 1 and len(chunks[-1]) == 1:
        # c B^(k b) joins the chunk before it: no product with a multiple of the identity.
        [last], before = chunks.pop(), chunks.pop()
        total = matadd(_combination(before, powers), powers[block], last)
    else:
        total = _combination(chunks.pop(), powers)
    for chunk in reversed(chunks):
        moved = related_product(ops, powers[block], total, 1, relation or {})
        total = matadd(_combination(chunk, powers), moved)
    return total


def _combination(coefficients: Sequence[Scalar], powers: Sequence[Matrix]) -> Matrix:
    total = [scaled(coefficients[0], row) for row in powers[0]]
    for value, power in zip(coefficients[1:], powers[1:], strict=False):
        total = matadd(total, power, value)
    return total


def related_product(ops: Arithmetic, a: Matrix, b: Matrix, sign: int, relation: Relation) -> Matrix:
    """M = a b where M_p = sign factor M_q is known for positions p and relation[p] = (q, factor): one of each pair is computed."""
    size = len(a)
    columns = list(zip(*b, strict=True))
    known: dict[tuple[int, int], Scalar] = {}
    for place in ((i, j) for i in range(size) for j in range(size)):
        if place in known:
            continue
        other, factor = relation.get(place, (place, 1))
        if other == place and sign * factor == -1 and place in relation:
            known[place] = 0  # an entry that is minus itself
            continue
        value: Scalar = 0
        for x, y in zip(a[place[0]], columns[place[1]], strict=True):
            value = add(value, product(x, y))
        known[place] = value
        if other != place:
            known[other] = product(number(ops, sign / factor), value)
    return [[known[i, j] for j in range(size)] for i in range(size)]


def trace_of_product(a: Matrix, b: Matrix) -> Scalar:
    """tr a b."""
    total: Scalar = 0
    for i, row in enumerate(a):
        for k, value in enumerate(row):
            total = add(total, product(value, b[k][i]))
    return total


def power_sums(powers: Sequence[Matrix], count: int) -> list[Scalar]:
    """tr B, .., tr B^count from I, B, .., B^b with 2 b >= count."""
    top = len(powers) - 1
    eye = identity(len(powers[1]))
    sums = []
    for k in range(1, count + 1):
        # tr B^k from B^top and B^(k - top): the trace of a product costs d^2, the product d^3
        first = min(k, top)
        sums.append(trace_of_product(powers[first], powers[k - first] if k > first else eye))
    return sums
