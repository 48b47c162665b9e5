"""exp(x A) of one exact matrix as explicit functions of x.

    exp(x A) = sum_j phi_j(x) C_j,   phi_j in { x^k e^{a x} cos(b x), x^k e^{a x} sin(b x) },

where a + i b runs over the roots of the minimal polynomial of A and k below their multiplicity. The constant
matrices C_j solve the confluent Vandermonde system A^l = sum_j phi_j^{(l)}(0) C_j, l = 0 .. deg - 1, exactly. Nothing is
ever simplified: the cost is that of one small linear system (Putzer's method; Altafini, Syst. Control Lett. 54 (2005)
1121, uses it for Wei-Norman equations).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

from lie_codegen.exact.newton_form import NewtonForm, newton_form
from lie_codegen.exact.numbers import Number, domain_matrix, to_numbers
from lie_codegen.on_demand import sympy as sp

_TAYLOR_TERMS = 24


@dataclass(frozen=True)
class Mode:
    """x^power e^{rate x} times cos(frequency x) (or sin, if odd); frequency >= 0."""

    power: int
    rate: Number
    frequency: Number
    odd: bool

    def derivative_at_zero(self, order: int) -> Number:
        """The order-th derivative at x = 0."""
        if order < self.power:
            return sp.S.Zero
        root = self.rate + sp.I * self.frequency
        left = order - self.power
        value = sp.expand(root**left) if left else sp.S.One
        re, im = value.as_real_imag()
        return sp.expand(sp.ff(order, self.power) * (im if self.odd else re))


@dataclass(frozen=True)
class MatrixExponential:
    """exp(x A): for every nonzero entry (i, j) its coefficient on each mode.

    Attributes:
        size: number of rows of A.
        modes: the functions phi_j.
        entries: (i, j) -> {mode position: coefficient}, exact, no zeros.
        taylor: (i, j) -> the first Taylor coefficients of that entry in x.
        newton: the same by divided differences, where eigenvalues are close; None where the modes lose nothing.
    """

    size: int
    modes: tuple[Mode, ...]
    entries: dict[tuple[int, int], dict[int, Number]]
    taylor: dict[tuple[int, int], tuple[Number, ...]]
    newton: NewtonForm | None = None

    @cached_property
    def radius(self) -> float:
        """The largest modulus of an eigenvalue: the inverse of the natural scale of x."""
        return max((float(abs(complex(mode.rate + sp.I * mode.frequency))) for mode in self.modes), default=0.0)

    def is_one(self, place: tuple[int, int]) -> bool:
        """Whether an entry is 1 for every x."""
        row = self.entries[place]
        constant = all(
            self.modes[m].power == 0 and self.modes[m].rate == 0 and self.modes[m].frequency == 0 for m in row
        )
        return constant and list(row.values()) == [1]

    @cached_property
    def reflected(self) -> MatrixExponential:
        """exp(-x A) by functions of x."""
        signs = [(-1) ** (mode.power + mode.odd) for mode in self.modes]
        modes = tuple(replace(mode, rate=-mode.rate) for mode in self.modes)
        entries = {place: {m: signs[m] * value for m, value in row.items()} for place, row in self.entries.items()}
        taylor = {
            place: tuple((-1) ** order * value for order, value in enumerate(row)) for place, row in self.taylor.items()
        }
        newton = None if self.newton is None else self.newton.reflected
        return MatrixExponential(self.size, modes, entries, taylor, newton)


def matrix_exponential(matrix: sp.MatrixBase) -> MatrixExponential:
    """exp(x A) for an exact real square matrix A, from its minimal polynomial."""
    size = matrix.rows
    powers = _powers_to_dependence(matrix)
    coefficients = _minimal_polynomial(powers)
    modes = _modes(coefficients)
    degree = len(modes)
    vandermonde = [[mode.derivative_at_zero(order) for mode in modes] for order in range(degree)]
    inverse = to_numbers(domain_matrix(vandermonde).inv())
    entries: dict[tuple[int, int], dict[int, Number]] = {}
    for i in range(size):
        for j in range(size):
            values = [powers[order][i, j] for order in range(degree)]
            if not any(values):
                continue
            row = {}
            for m in range(degree):
                value = sp.expand(sum((inverse[m][order] * values[order] for order in range(degree)), sp.S.Zero))
                if value != 0:
                    row[m] = value
            entries[i, j] = row
    newton = newton_form(matrix, _roots_of(modes))
    return MatrixExponential(size, modes, entries, _taylor(powers, coefficients, entries), newton)


def _roots_of(modes: tuple[Mode, ...]) -> list[Number]:
    """The roots of the minimal polynomial, as often as they occur in it."""
    roots = []
    for mode in modes:
        if mode.frequency == 0:
            roots.append(mode.rate)
        elif not mode.odd:
            roots += [mode.rate + sp.I * mode.frequency, mode.rate - sp.I * mode.frequency]
    return roots


def _powers_to_dependence(matrix: sp.MatrixBase) -> list[sp.Matrix]:
    """I, A, A^2, ... up to the first that depends on those before it."""
    powers = [sp.eye(matrix.rows)]
    while True:
        powers.append((powers[-1] * matrix).applyfunc(sp.expand))
        table = domain_matrix([list(power.flat()) for power in powers])
        if table.rank() < len(powers):
            return powers


def _minimal_polynomial(powers: list[sp.Matrix]) -> list[Number]:
    """Monic coefficients, lowest first."""
    table = domain_matrix([list(row) for row in zip(*(power.flat() for power in powers), strict=True)])
    relation = to_numbers(table.nullspace().to_dense())[0]
    return [sp.radsimp(sp.expand(value / relation[-1])) for value in relation]


def _modes(coefficients: list[Number]) -> tuple[Mode, ...]:
    x = sp.Dummy("x")
    polynomial = sp.Poly(list(reversed(coefficients)), x, extension=True)
    modes: list[Mode] = []
    for factor, multiplicity in polynomial.factor_list()[1]:
        for root in _roots(factor):
            re, im = root.as_real_imag()
            if sp.N(im, 30) < 0:
                continue
            for power in range(multiplicity):
                modes.append(Mode(power, re, im, odd=False))
                if im != 0:
                    modes.append(Mode(power, re, im, odd=True))
    return tuple(sorted(modes, key=_mode_key))


def _roots(factor: sp.Poly) -> list[Number]:
    """The roots of an irreducible factor, in square roots where there are some, else to 40 digits."""
    coefficients = [value / factor.LC() for value in factor.all_coeffs()]
    if len(coefficients) == 2:
        return [sp.expand(-coefficients[1])]
    if len(coefficients) == 3:
        return _quadratic_roots(coefficients[1], coefficients[2])
    if len(coefficients) == 5 and coefficients[1] == 0 == coefficients[3]:
        squares = _quadratic_roots(coefficients[2], coefficients[4])
        if all(square.is_real for square in squares):
            return [sign * sp.sqrtdenest(sp.sqrt(square)) for square in squares for sign in (1, -1)]
    return [_rounded(root) for root in factor.nroots(n=40, maxsteps=200)]


def _quadratic_roots(p: Number, q: Number) -> list[Number]:
    """The roots of x^2 + p x + q."""
    root = sp.sqrt(sp.expand(p * p / 4 - q))
    return [sp.expand(-p / 2 + root), sp.expand(-p / 2 - root)]


def _rounded(root: Number) -> Number:
    """A numeric root with exact (rational) parts, right to 40 digits; the domain algorithms stay exact on it."""
    re, im = root.as_real_imag()
    return sp.Rational(str(re)) + sp.I * sp.Rational(str(im))


def _mode_key(mode: Mode) -> tuple[float, float, int, bool]:
    return (float(mode.rate), float(mode.frequency), mode.power, mode.odd)


def _taylor(
    powers: list[sp.Matrix], coefficients: list[Number], entries: dict[tuple[int, int], dict[int, Number]]
) -> dict[tuple[int, int], tuple[Number, ...]]:
    """A^l / l! entry by entry; the powers continue by the recurrence of the minimal polynomial."""
    degree = len(coefficients) - 1
    result: dict[tuple[int, int], tuple[Number, ...]] = {}
    for i, j in entries:
        values: list[Any] = [powers[order][i, j] for order in range(degree)]
        while len(values) < _TAYLOR_TERMS:
            tail = values[-degree:]
            values.append(sp.expand(-sum((c * v for c, v in zip(coefficients, tail, strict=False)), sp.S.Zero)))
        result[i, j] = tuple(value / sp.factorial(order) for order, value in enumerate(values))
    return result
