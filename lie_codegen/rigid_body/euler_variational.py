"""Variation of parameters for perturbed Euler's equations, exact: Table 2, and the averages of Table 3.

    Omega' = eps F_Omega,  k' = eps F_k,  phi' = Lambda + eps G,  phi = u / (4 K(k)),                  (24)

every function taken on the unperturbed solution. Elliptic functions enter as the symbols sn, cn, dn and
z = Zeta / k^2, complete integrals as K and S = (1 - E / K) / k^2: code and quadrature put their own values there.
Coppola, Table 2 (right as printed, with phi = u / 4K, which the text does not define) and Table 3.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from lie_codegen.errors import InputError
from lie_codegen.kernel.saved import Saved
from lie_codegen.mechanics.formulas import formula, names_in, parameter_values
from lie_codegen.on_demand import sympy as sp
from lie_codegen.rigid_body.principal_body import TAU, PrincipalBody
from lie_codegen.shapes import entries_of

OMEGA, K_MODULUS, K_INTEGRAL, S_MEAN = sp.symbols("Omega k K S", positive=True)
SN, CN, DN, ZETA = sp.symbols("sn cn dn z", real=True)
_RATES = sp.symbols("w1 w2 w3", real=True)
_ACCELERATIONS = sp.symbols("dw1 dw2 dw3", real=True)


@dataclass(frozen=True, eq=False, repr=False)
class EulerPerturbation(Saved):
    """A body and the perturbing accelerations of (3).

    Attributes:
        body: the principal body.
        terms: (g_1, g_2, g_3) per unit eps [rad/s^2], in the user's axes, in the symbols w1..dw3 and tau.
    """

    body: PrincipalBody
    terms: tuple[sp.Expr, sp.Expr, sp.Expr]

    @property
    def is_autonomous(self) -> bool:
        """Whether neither the inertia nor the perturbation depends on tau."""
        return self.body.is_constant and not any(term.has(TAU) for term in self.terms)

    def on(self, omega: Sequence[Any], acceleration: Sequence[Any]) -> list[sp.Expr]:
        """(g_1, g_2, g_3) along the paper's axes at the given vectors along the paper's axes."""
        values = dict(zip(_RATES, self.body.to_user(omega), strict=True))
        values.update(zip(_ACCELERATIONS, self.body.to_user(acceleration), strict=True))
        return list(self.body.to_paper([term.xreplace(values) for term in self.terms]))

    @cached_property
    def unperturbed(self) -> list[sp.Expr]:
        """omega of (9) along the paper's axes."""
        body, s = self.body, self.body.signs
        amplitude = K_MODULUS * OMEGA
        return [s[0] * body.gamma(1, 3) * amplitude * CN, s[1] * body.gamma(2, 3) * amplitude * SN, s[2] * OMEGA * DN]

    @cached_property
    def frequency(self) -> sp.Expr:
        """Lambda: the rate of phi without perturbation [1/s]."""
        body = self.body
        return body.gamma(1, 3) * body.gamma(2, 3) * body.coefficients[2] * OMEGA / (4 * K_INTEGRAL)

    @cached_property
    def variational(self) -> tuple[sp.Expr, sp.Expr, sp.Expr]:
        """(F_Omega, F_k, G) of Table 2 at a phase."""
        body, (s1, s2, s3) = self.body, self.body.signs
        k, square = K_MODULUS, K_MODULUS**2
        rest = 1 - square
        g1, g2, g3 = self.on(self.unperturbed, body.unperturbed_acceleration(self.unperturbed))
        g1, g2, g3 = s1 * g1 / body.gamma(1, 3), s2 * g2 / body.gamma(2, 3), s3 * g3
        rate13, rate23 = body.gamma_rate(1, 3), body.gamma_rate(2, 3)
        by_omega = g3 * DN + g2 * k * SN - rate23 * square * OMEGA * SN**2
        by_k = (g1 * CN + g2 * rest * SN - g3 * k * DN) / OMEGA - k * (rate13 * CN**2 + rate23 * rest * SN**2)
        first, second = square * ZETA * CN - SN * DN, square * ZETA * SN + CN * DN
        by_phi = (
            g1 * first / (k * OMEGA * rest)
            + g2 * second / (k * OMEGA)
            - g3 * square * (ZETA * DN - SN * CN) / (OMEGA * rest)
            - rate13 * CN * first / rest
            - rate23 * SN * second
        ) / (4 * K_INTEGRAL)
        return by_omega, by_k, by_phi

    @cached_property
    def affine(self) -> tuple[list[sp.Expr], sp.Matrix] | None:
        """(G_n0, G_nm) along the paper's axes if g is affine in omega, else None."""
        w = list(_RATES)
        terms = self.on(w, list(_ACCELERATIONS))
        if any(term.has(*_ACCELERATIONS) for term in terms):
            return None
        zero = dict.fromkeys(w, sp.Integer(0))
        try:
            polynomials = [sp.Poly(term, *w) for term in terms]
        except sp.PolynomialError:
            return None
        if any(p.total_degree() > 1 or p.free_symbols_in_domain & set(w) for p in polynomials):
            return None
        return [term.xreplace(zero) for term in terms], sp.Matrix(3, 3, lambda i, j: sp.diff(terms[i], w[j]))

    @cached_property
    def averaged(self) -> tuple[sp.Expr, sp.Expr, sp.Expr] | None:
        """(Fbar_Omega, Fbar_k, Gbar) of Table 3 for affine g, in forms without cancellation at k = 0; else None.

        With S = mean of sn^2: mean cn^2 = 1 - S, mean dn^2 = 1 - k^2 S, mean dn = pi / 2K.
        """
        if self.affine is None:
            return None
        constants, matrix = self.affine
        body, s3 = self.body, self.body.signs[2]
        k, square, mean = K_MODULUS, K_MODULUS**2, sp.pi / (2 * K_INTEGRAL)
        n0, n1 = s3 * constants[2], matrix[0, 0] - body.gamma_rate(1, 3)
        n2, n3 = matrix[1, 1] - body.gamma_rate(2, 3), matrix[2, 2]
        dn2 = 1 - square * S_MEAN
        ratio = body.gamma(1, 2)
        by_omega = mean * n0 + OMEGA * (n2 * square * S_MEAN + n3 * dn2)
        by_k = -k * mean * n0 / OMEGA + k * (n1 * (1 - S_MEAN) + n2 * (1 - square) * S_MEAN - n3 * dn2)
        cross = ratio * matrix[1, 0] * S_MEAN - matrix[0, 1] / ratio * (1 - S_MEAN) / (1 - square)
        return by_omega, by_k, -sp.pi * s3 / (8 * K_INTEGRAL**2) * cross


def euler_perturbation(
    body: PrincipalBody, terms: Sequence[Any], parameters: Mapping[str, Any] | None = None
) -> EulerPerturbation:
    """g_n from formulas in w1 w2 w3 dw1 dw2 dw3 and tau (the user's axes) and named parameters.

    dw1 dw2 dw3 stand for the unperturbed accelerations, which is enough to first order in eps.

    Args:
        body: of `free_rigid_body`, or its `.model`.
        terms: g_1, g_2, g_3: texts or SymPy expressions. [rad/s^2 per unit eps]
        parameters: name -> number, of every name that is no variable.

    Raises:
        InputError: not three terms, a parameter that hides a variable, or one without a value.
        ExpressionError: a text outside the grammar.
    """
    if isinstance(terms, str) or len(terms) != 3:
        raise InputError(f"three perturbing terms g_1, g_2, g_3 are needed, got {terms!r}")
    known = {str(symbol): symbol for symbol in (*_RATES, *_ACCELERATIONS, TAU)}
    values = parameter_values(parameters)
    hidden = sorted(set(known) & set(values))
    if hidden:
        raise InputError(f"parameter {hidden[0]!r} hides a variable of the perturbation; rename it")
    unset = sorted(name for name, value in values.items() if value.is_Symbol)
    if unset:
        raise InputError(f"parameter {unset[0]!r} has no value")
    attitude = sorted(
        {name for term in terms for name in names_in(term) if re.fullmatch("X[1-3][1-3]", name)} - set(values)
    )
    if attitude:
        raise InputError(
            f"{attitude[0]} is an entry of the attitude, which (Omega, k, phi) do not tell: use lc.tumbling_average"
        )
    first, second, third = (formula(term, {**known, **values}, f"g_{n + 1}") for n, term in enumerate(terms))
    return EulerPerturbation(body, (first, second, third))


def moving_parts(
    body: PrincipalBody, *, torques: Any = None, gains: Any = None, products: Any = None
) -> tuple[sp.Expr, sp.Expr, sp.Expr]:
    """The g_n of a body with internal moving parts, (25), per unit eps.

        g_1 = G_10 + sum_m G_1m w_m - (dI_1/dtau / I_1) w_1
              + (I_23 (w3^2 - w2^2) - I_13 (w1 w2 + dw3) + I_12 (w1 w3 - dw2)) / I_1,   cyclically.

    Args:
        body: the body; its dI/dtau gives the term of (26) without mass flow.
        torques: (3,) G_n0.
        gains: (3, 3) G_nm beyond that term: linear feedback, mass flow with a signed rate (negative when ejecting).
        products: (I_12, I_13, I_23), the products of inertia divided by eps.

    Raises:
        ExpressionError: a text that is no formula in tau.
        ShapeError: torques, gains or products of other shapes.
    """
    names = {"tau": TAU}

    def three(value: Any, default: Any, what: str) -> list[Any]:
        return entries_of(default if value is None else value, 3, f"moving_parts: {what}")

    none = (0, 0, 0)
    torque = [formula(v, names, "torque") for v in three(torques, none, "torques")]
    rows = [three(row, none, "a row of gains") for row in three(gains, (none,) * 3, "gains")]
    gain = sp.Matrix(3, 3, [formula(v, names, "gain") for row in rows for v in row])
    p12, p13, p23 = (formula(v, names, "product of inertia") for v in three(products, none, "products"))
    product = {frozenset((0, 1)): p12, frozenset((0, 2)): p13, frozenset((1, 2)): p23}
    w, a, inertia = _RATES, _ACCELERATIONS, body.inertia
    terms = []
    for n in range(3):
        m, o = (n + 1) % 3, (n + 2) % 3
        internal = (
            product[frozenset((m, o))] * (w[o] ** 2 - w[m] ** 2)
            - product[frozenset((n, o))] * (w[n] * w[m] + a[o])
            + product[frozenset((n, m))] * (w[n] * w[o] - a[m])
        )
        linear = sum(gain[n, j] * w[j] for j in range(3)) - sp.diff(inertia[n], TAU) / inertia[n] * w[n]
        terms.append(torque[n] + linear + internal / inertia[n])
    return terms[0], terms[1], terms[2]
