"""exp and its Jacobians where no closed form is known: scalar arithmetic modulo the characteristic polynomial.

By Cayley and Hamilton f(A) = sum_i c_i A^i with fewer terms than A has rows, and where eigenvalues come in pairs +-lambda
(so(n), so(p, q), sp(n), ad of a semisimple algebra) the even and the odd part of f are polynomials in A^2 of half that degree.
The c_i follow from f modulo the characteristic polynomial, whose coefficients follow from traces by Newton's identities; see
`QuotientRing`. Fixed depth, no branches.

exp and its Jacobian: Taylor polynomials after scaling, then doubling. Measured on so4, su3, sl3, so31, sp4, sim3: 2e-15 relative
     for eigenvalues (of ad for the Jacobian) up to 6 in modulus, 2e-14 up to 10.

Each function comes with the condition under which this depth is enough: all eigenvalues of modulus 10 (or 12) at most, by a bound that follows from
the characteristic polynomial and may say no from 6 on. Where it does not hold, `far_routine` is run instead.
"""

from __future__ import annotations

from collections.abc import Sequence
from fractions import Fraction
from math import factorial
from typing import Any

from lie_codegen.exact.even_spectrum import EvenSpectrum, newton_coefficients
from lie_codegen.exact.invariant_form import Relation
from lie_codegen.groups.maps.quotient_ring import Element, QuotientRing, matrix_value, power_sums, related_product
from lie_codegen.groups.maps.spectral_bound import definite_within, guarded, roots_within
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar, terms
from lie_codegen.kernel.complex_scalar import Complex
from lie_codegen.kernel.cotangent import four_pi_squared, taylor
from lie_codegen.kernel.linear import Matrix, dot, identity, matadd
from lie_codegen.kernel.structural_zeros import add, product

#: Eigenvalues up to 10 are brought below 10/16 = 0.63, where the next term of every series is below a rounding error:
#: 0.63^16/16! = 3e-17 and 0.63^22/22! = 3e-26. More halvings would cost bits in the doublings, fewer would cost terms.
_HALVINGS = 4
_LARGEST = 10
#: Taylor's polynomial alone, without poles and pairs, reaches further: 0.75^16/16! = 5e-16, doubled four times.
_LARGEST_PLAIN = 12
#: In floats, of which smaller terms are no part (and would be subnormal, which is slow): 0.63^12/12! = 8e-12, 0.63^11/11! = 2e-10.
_EVEN_TERMS, _EVEN_FLOAT_TERMS = 11, 6
_EXP_TERMS, _EXP_FLOAT_TERMS = 16, 11
#: (t/2) coth(t/2) has poles at t = 2 pi i k. With the nearest three taken out the rest is analytic up to |t| = 8 pi, and its series
#: in t^2 falls by (10/(8 pi))^2 = 0.16 a term: 0.16^18 = 5e-15; in floats 0.16^10 = 1e-8.
_POLES = 3
_REMAINDER_TERMS, _REMAINDER_FLOAT_TERMS = 18, 10


#: A function of a matrix, and the condition under which it is right.
Near = tuple[Matrix, Any]


def exponential(
    ops: Arithmetic, A: Matrix, even: EvenSpectrum | None, relation: Relation, *, normal: bool, traceless: bool
) -> Near:
    """exp(A); `normal` where A is real and antisymmetric, or complex and antihermitian."""
    if even is not None:
        B = related_product(ops, A, A, 1, relation)
        ring, powers, near = _even_ring(ops, B, even, relation, definite=normal)
        V, S = _half_scale(ring)
        cosh, sinh = _doubled(ring, V, S)
        cosh[0] = add(cosh[0], 1)
        odd = related_product(ops, A, matrix_value(ops, sinh, powers, relation), -1, relation)
        return matadd(matrix_value(ops, cosh, powers, relation), odd), near
    if normal and any(isinstance(entry, Complex) for row in A for entry in row):
        # A = i H: cosine and sine of the hermitian H have real coefficients, half the work of complex ones.
        H = [[_times_i(entry, -1) for entry in row] for row in A]
        ring, powers, near = _plain_ring(ops, H, traceless=traceless, real=True)
        V, S = _half_scale(ring, step=1, sign=-1)
        cosine, sine = _doubled(ring, V, S)
        cosine[0] = add(cosine[0], 1)
        return matrix_value(ops, [Complex(c, s) for c, s in zip(cosine, sine, strict=True)], powers), near
    ring, powers, near = _plain_ring(ops, A, traceless=traceless)
    scale = Fraction(1, 2**_HALVINGS)
    count = terms(ops, _EXP_TERMS, _EXP_FLOAT_TERMS)
    value = ring.series([Fraction(0)] + [scale**j / factorial(j) for j in range(1, count)])
    for _ in range(_HALVINGS):
        value = ring.plus(ring.times(value, value), value, 2)
    value[0] = add(value[0], 1)
    return matrix_value(ops, value, powers), near


def jacobian_of_exp(
    ops: Arithmetic, ad: Matrix, even: EvenSpectrum, relation: Relation, sign: int, *, normal: bool
) -> Near:
    """(e^a - 1)/a at a = sign ad = sinh(a)/a + a (cosh(a) - 1)/a^2, the last as 2 (sinh(a/2)/a)^2."""
    square = related_product(ops, ad, ad, 1, relation)
    ring, powers, near = _even_ring(ops, square, even, relation, definite=normal)
    V, S = _half_scale(ring)
    _, sinh = _doubled(ring, V, S)
    odd = ring.scaled(2 * sign, ring.times(S, S))
    first, second = (matrix_value(ops, e, powers, relation) for e in (sinh, odd))
    return matadd(first, related_product(ops, ad, second, -1, relation)), near


def plain_jacobian_of_exp(ops: Arithmetic, ad: Matrix, *, traceless: bool, sign: int) -> Near:
    """(e^a - 1)/a at a = sign ad, for any spectrum: phi(2 t) = phi(t) (e^t + 1) / 2."""
    ring, powers, near = _plain_ring(ops, ad, traceless=traceless)
    scale = Fraction(sign, 2**_HALVINGS)
    count = terms(ops, _EXP_TERMS, _EXP_FLOAT_TERMS)
    value = ring.series([Fraction(0)] + [scale**j / factorial(j) for j in range(1, count)])
    phi = ring.series([scale**j / factorial(j + 1) for j in range(count)])
    half = ops.constant(Fraction(1, 2))
    for _ in range(_HALVINGS):
        phi = ring.plus(phi, ring.times(value, phi), half)
        value = ring.plus(ring.times(value, value), value, 2)
    return matrix_value(ops, phi, powers), near


def inverse_jacobian_of_exp(
    ops: Arithmetic, ad: Matrix, even: EvenSpectrum, relation: Relation, sign: int, *, normal: bool
) -> Near:
    """a/(e^a - 1) at a = sign ad: a/2 coth(a/2) by its three nearest poles and a series, and -a/2."""
    square = related_product(ops, ad, ad, 1, relation)
    ring, powers, near = _even_ring(ops, square, even, relation, definite=normal)
    poles = [four_pi_squared() * k * k for k in range(1, _POLES + 1)]
    total = ring.series([_remainder(j, poles) for j in range(terms(ops, _REMAINDER_TERMS, _REMAINDER_FLOAT_TERMS))])
    for pole in poles:
        total = ring.plus(total, ring.over_linear(ops.constant(pole)), 2)
    total = ring.shifted(total)
    total[0] = add(total[0], 1)
    half = ops.constant(Fraction(-sign, 2))
    return matadd(matrix_value(ops, total, powers, relation), ad, half), near


def _even_ring(
    ops: Arithmetic, B: Matrix, even: EvenSpectrum, relation: Relation, *, definite: bool
) -> tuple[QuotientRing, list[Matrix], Any]:
    """The ring of polynomials in B = A^2, the powers of B that its elements are summed from, and whether A is within reach."""
    degree = even.pairs + even.has_zero
    powers = _powers(ops, B, max((even.pairs + 1) // 2, 1 if degree < 3 else 2 if degree < 6 else 3), relation)
    share = ops.constant(Fraction(1, even.multiplicity))
    sums = [product(share, value) for value in power_sums(powers, even.pairs)]
    coefficients = newton_coefficients(sums)
    if definite:
        near = definite_within(ops, sums[-1], len(sums), _LARGEST**2)
    else:
        near = roots_within(ops, coefficients, _LARGEST**2, 1)
    coefficients = guarded(ops, near, coefficients)
    return QuotientRing(ops, [0, *coefficients] if even.has_zero else coefficients), powers, near


def _plain_ring(
    ops: Arithmetic, A: Matrix, *, traceless: bool, real: bool = False
) -> tuple[QuotientRing, list[Matrix], Any]:
    size = len(A)
    powers = _powers(ops, A, max((size + 1) // 2, 1 if size < 3 else 2), {})
    sums = power_sums(powers, size)
    if traceless:
        sums[0] = 0
    if real:
        sums = [Complex.of(value).re for value in sums]
    coefficients = newton_coefficients(sums)
    if real:
        if size % 2:  # one sum more, by Newton's identity
            sums.append(product(-1, dot(coefficients, sums)))
        near = definite_within(ops, sums[-1], len(sums), _LARGEST_PLAIN)
    else:
        # Without its first term Cauchy's bound is sharp enough as it is.
        near = roots_within(ops, coefficients, _LARGEST_PLAIN, 0 if traceless else 2)
    return QuotientRing(ops, guarded(ops, near, coefficients)), powers, near


def _powers(ops: Arithmetic, A: Matrix, highest: int, relation: Relation) -> list[Matrix]:
    powers = [identity(len(A)), A]
    while len(powers) <= highest:
        half = len(powers) // 2
        a, b = powers[half], powers[len(powers) - half]
        powers.append(related_product(ops, a, b, 1, relation))
    return powers


def _half_scale(ring: QuotientRing, step: int = 0, sign: int = 1) -> tuple[Element, Element]:
    """cosh(t/2) - 1 and sinh(t/2)/t in t^2, or in t (step 1) and with sign -1 cos(t/2) - 1 and sin(t/2)."""
    scale = Fraction(1, 2**_HALVINGS)
    count = terms(ring.ops, _EVEN_TERMS, _EVEN_FLOAT_TERMS)
    even = [Fraction(0)] + [sign**j * scale ** (2 * j) / factorial(2 * j) for j in range(1, count)]
    odd = [sign**j * scale ** (2 * j + 1) / factorial(2 * j + 1) for j in range(count)]
    if step:
        even, odd = [c for e in even for c in (e, Fraction(0))], [c for o in odd for c in (Fraction(0), o)]
    V, S = ring.series(even), ring.series(odd)
    for _ in range(_HALVINGS - 1):
        V, S = _doubled(ring, V, S)
    return V, S


def _doubled(ring: QuotientRing, V: Element, S: Element) -> tuple[Element, Element]:
    """cosh 2t - 1 = 2 V^2 + 4 V and sinh 2t = 2 (1 + V) S: nothing is lost where V is small."""
    square = ring.times(V, V)
    return ring.plus(ring.scaled(2, square), V, 4), ring.scaled(2, ring.plus(S, ring.times(V, S)))


def _times_i(entry: Scalar, sign: int) -> Scalar:
    z = Complex.of(entry)
    return Complex(product(-sign, z.im), product(sign, z.re))


def _remainder(j: int, poles: Sequence[Fraction]) -> Fraction:
    """The coefficient of mu^j in (E(mu) - 1)/mu less the poles' own."""
    return taylor(j + 1) - sum((2 * (-1) ** j / pole ** (j + 1) for pole in poles), Fraction(0))
