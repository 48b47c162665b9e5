"""Routh reduction of Lagrangian systems with cyclic coordinates.

    p = g_nu,nu (nu' + A x') + b_nu,   A = g_nu,nu^{-1} g_nu,x,
    R(x, x') = L - p nu' = x' h x' / 2 + (A' p + ...) x' - V_p(x),   V_p = V + (p - b)' g_nu,nu^{-1} (p - b) / 2,
    B_ij = dA_i/dx_j - dA_j/dx_i.

The Routhian is the Lagrangian of the reduced system: its part linear in x' gives the gyroscopic forces -B p x'.
Sanyal, Bloch and McClamroch, Sec. II.A, (1)-(3); Bloch, Nonholonomic Mechanics and Control.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from lie_codegen.errors import InputError
from lie_codegen.identifiers import check_identifier
from lie_codegen.kernel.saved import Saved
from lie_codegen.mechanics.formulas import formula, names_in
from lie_codegen.mechanics.lagrangian import LagrangianSystem, system_from
from lie_codegen.mechanics.vector_fields import tidy
from lie_codegen.on_demand import sympy as sp


@dataclass(frozen=True, eq=False, repr=False)
class RouthReduction(Saved):
    """A system with its cyclic coordinates eliminated.

    Attributes:
        full: the system before.
        system: the reduced system, whose Lagrangian is the Routhian.
        cyclic: names of the eliminated coordinates.
        momenta: their momenta p.
        connection: (c, m) A, as a function of the shape x.
        amended_potential: V_p(x).
        cyclic_velocity: (c, 1) nu' as a function of (x, x'), for reconstruction.
    """

    full: LagrangianSystem
    system: LagrangianSystem
    cyclic: tuple[str, ...]
    momenta: tuple[sp.Expr, ...]
    connection: sp.ImmutableMatrix
    amended_potential: sp.Expr
    cyclic_velocity: sp.ImmutableMatrix

    @property
    def curvature(self) -> tuple[sp.ImmutableMatrix, ...]:
        """For each cyclic coordinate B_ij = dA_i/dx_j - dA_j/dx_i, (m, m) antisymmetric."""
        q = self.system.q

        def entry(alpha: int, i: int, j: int) -> sp.Expr:
            a = self.connection
            return tidy(sp.diff(a[alpha, i], q[j]) - sp.diff(a[alpha, j], q[i]))

        return tuple(
            sp.ImmutableMatrix(len(q), len(q), lambda i, j, alpha=alpha: entry(alpha, i, j))
            for alpha in range(len(self.cyclic))
        )


def routh_reduce(system: LagrangianSystem, *, momentum: Mapping[str, Any]) -> RouthReduction:
    """Eliminate cyclic coordinates at given momenta.

    Args:
        system: of `lagrangian_system`.
        momentum: cyclic coordinate -> its conserved momentum: a number, or a formula in the system's parameters whose
            unknown names become parameters of the reduced system.

    Raises:
        InputError: a coordinate that is not cyclic (with the reason), all coordinates, or a name that is taken.
    """
    if not momentum:
        raise InputError(f"momentum is empty; cyclic here: {', '.join(system.cyclic) or 'none'}")
    for name in momentum:
        if name not in system.coordinates:
            raise InputError(f"momentum: {name!r} is no coordinate; they are {', '.join(system.coordinates)}")
        if name not in system.cyclic:
            raise InputError(f"{name} is not cyclic: {_why_not_cyclic(system, name)}")
    if len(momentum) == len(system.coordinates):
        raise InputError("every coordinate would be eliminated; leave one that is not cyclic")
    parameters, values = _momenta(system, momentum)
    gone = [system.coordinates.index(name) for name in momentum]
    kept = [i for i in range(len(system.q)) if i not in gone]
    velocities = sp.Matrix([system.v[i] for i in kept])
    inner = system.mass.extract(gone, gone)
    coupling = system.mass.extract(gone, kept)
    inverse = inner.inv().applyfunc(tidy)
    connection = (inverse * coupling).applyfunc(tidy)
    excess = sp.Matrix(values) - system.gyroscopic.extract(gone, [0])
    rate = (inverse * excess - connection * velocities).applyfunc(sp.expand)
    replaced = dict(zip([system.v[i] for i in gone], rate, strict=True))
    routhian = sp.expand(system.lagrangian.xreplace(replaced) - (sp.Matrix(values).T * rate)[0])
    reduced = system_from(
        tuple(system.coordinates[i] for i in kept),
        system.inputs,
        routhian,
        system.force.extract(kept, [0]).xreplace(replaced),
        system.dissipation,
        system.input_matrix.extract(kept, list(range(len(system.inputs)))),
        list(velocities),
        parameters,
        system.constants,
    )
    return RouthReduction(
        system, reduced, tuple(momentum), tuple(values), sp.ImmutableMatrix(connection), reduced.potential,
        sp.ImmutableMatrix(rate),
    )  # fmt: skip


def _momenta(system: LagrangianSystem, momentum: Mapping[str, Any]) -> tuple[tuple[str, ...], list[sp.Expr]]:
    parameters = list(system.parameters)
    taken = {*map(str, system.state), *system.inputs}
    values = []
    for name, value in momentum.items():
        for other in names_in(value):
            if other in taken:
                raise InputError(f"momentum of {name}: {other!r} is the name of something that varies")
            if other not in parameters and other not in dict(system.constants) and other != "pi":
                parameters.append(check_identifier(other, "momentum"))
        known = {**dict(system.constants), **{p: sp.Symbol(p, real=True) for p in parameters}}
        values.append(formula(value, known, f"momentum of {name}"))
    return tuple(parameters), values


def _why_not_cyclic(system: LagrangianSystem, name: str) -> str:
    index = system.coordinates.index(name)
    if sp.simplify(sp.diff(system.lagrangian, system.q[index])) != 0:
        return "the Lagrangian depends on it"
    if system.force[index] != 0 or any(entry != 0 for entry in system.input_matrix[index, :]):
        return "a force or an input acts on it, so its momentum is not conserved"
    if sp.expand(sp.diff(system.dissipation, system.v[index])) != 0:
        return "dissipation acts on it, so its momentum is not conserved"
    return "a force, an input or the dissipation depends on it"
