"""The effective potential of a vibrated system: V + lambda_ab dphi_a J^-1 dphi_b / 2.

Where lifts come from potentials, b_a = -dphi_a, the mean force -(1/2) lambda_ab <Y_a : Y_b> is that of (1/2) lambda_ab <dphi_a, J^-1 dphi_b>, with
lambda_ab the mean of U^a U^b of the primitives of zero mean. Bullo, SIAM J. Control Optim. 41 (2002), on a group; in the left frame
(dphi)_i = -(dphi/dGamma)(rho(A_i) Gamma + r(A_i)).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product

from lie_codegen.mechanics.mechanical_system import MechanicalSystem
from lie_codegen.on_demand import sympy as sp
from lie_codegen.signals.periodic_input import PeriodicInput
from lie_codegen.signals.time_polynomial import fourier_terms


@dataclass(frozen=True)
class EffectivePotential:
    """What was found.

    Attributes:
        value: exact, in the advected names; None where there is none.
        reason: why not.
    """

    value: sp.Expr | None
    reason: str | None


def effective_potential(system: MechanicalSystem, u: PeriodicInput) -> EffectivePotential:
    """The effective potential, or the reason why there is none."""
    n = system.dim
    still = dict.fromkeys(system.symbols[:n], sp.S.Zero)
    V = potential_of(system, [entry.xreplace(still) for entry in system.force])
    if V is None:
        return EffectivePotential(None, "the force at rest is no gradient of a polynomial in the advected vectors")
    for a, row in enumerate(system.inputs):
        if potential_of(system, row) is None:
            names = ", ".join(vector.name for vector in system.advected) or "none are advected"
            return EffectivePotential(
                None, f"the lift of input {a + 1} is no gradient of a polynomial in the advected vectors ({names})"
            )
    U = [each.without_mean().primitive() for each in fourier_terms(u)]
    inverse = system.inertia.inv()
    total = V
    for a, b in product(range(len(U)), repeat=2):
        mean = sp.trigsimp((U[a] * U[b]).mean())
        total += sp.Rational(1, 2) * mean * (sp.Matrix(system.inputs[a]).T * inverse * sp.Matrix(system.inputs[b]))[0]
    return EffectivePotential(sp.expand(total), None)


def potential_of(system: MechanicalSystem, force: Sequence[sp.Expr]) -> sp.Expr | None:
    """V(Gamma) without constant, of force = -dV; None if no polynomial of one degree more has it."""
    if all(entry == 0 for entry in force):
        return sp.S.Zero
    n, gamma = system.dim, list(system.symbols[system.dim :])
    if not gamma:
        return None
    rho, r = system.advection
    degree = max(sp.Poly(entry, *gamma).total_degree() for entry in force if entry != 0)
    monomials = [
        sp.prod(g**e for g, e in zip(gamma, exponents, strict=True))
        for exponents in product(range(degree + 2), repeat=len(gamma))
        if 1 <= sum(exponents) <= degree + 1
    ]
    unknowns = [sp.Dummy() for _ in monomials]
    V = sum((c * m for c, m in zip(unknowns, monomials, strict=True)), sp.S.Zero)
    equations: list[sp.Expr] = []
    for i in range(n):
        # force_i = -(dV)_i = (dV/dGamma)(rho(A_i) Gamma + r(A_i))
        velocity = [
            sum((sp.nsimplify(rho[i, a, b]) * g for b, g in enumerate(gamma)), sp.S.Zero) + sp.nsimplify(r[i, a])
            for a in range(len(gamma))
        ]
        slope = sum((sp.diff(V, g) * v for g, v in zip(gamma, velocity, strict=True)), sp.S.Zero)
        equations += sp.Poly(sp.expand(slope - force[i]), *gamma).coeffs()
    solutions = sp.linsolve(equations, unknowns)
    if not solutions:
        return None
    (values,) = solutions
    zero = dict.fromkeys(unknowns, sp.S.Zero)
    return sp.expand(sum((v.xreplace(zero) * m for v, m in zip(values, monomials, strict=True)), sp.S.Zero))
