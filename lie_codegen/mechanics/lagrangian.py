"""Lagrangian systems from text: mass matrix, equations of motion, control-affine form, cyclic coordinates.

L = v' M(q) v / 2 + b(q)' v - V(q),
M(q) q'' = dL/dq - d(M v + b)/dq v + f(q, v) - dD/dv + B(q) u,
y = (q, v),  y' = X(y) + Y_a(q) u^a,  Y_a = (0, M^{-1} B e_a).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

from lie_codegen.errors import InputError
from lie_codegen.exact.budget import Meter, expanded_terms
from lie_codegen.identifiers import check_identifier
from lie_codegen.kernel.saved import Saved
from lie_codegen.mechanics.formulas import formula, names_in, parameter_values
from lie_codegen.mechanics.vector_fields import Field, tidy
from lie_codegen.on_demand import sympy as sp

_CONSTANTS = {"pi"}


@dataclass(frozen=True, eq=False, repr=False)
class LagrangianSystem(Saved):
    """A mechanical system in exact form.

    Attributes:
        coordinates: names of q, n of them; the velocity of "x" is written "dx" (or "x_dot").
        inputs: names of u, m of them.
        lagrangian: L(q, v).
        mass: (n, n) M(q).
        gyroscopic: (n,) b(q), the part of dL/dv at rest.
        force: (n, 1) generalized forces f(q, v) without inputs.
        dissipation: Rayleigh function D(q, v); its force is -dD/dv.
        input_matrix: (n, m) B(q).
        parameters: names that stayed symbols, in order.
        constants: (name, value) of the parameters that have one.
    """

    coordinates: tuple[str, ...]
    inputs: tuple[str, ...]
    lagrangian: sp.Expr
    mass: sp.ImmutableMatrix
    gyroscopic: sp.ImmutableMatrix
    force: sp.ImmutableMatrix
    dissipation: sp.Expr
    input_matrix: sp.ImmutableMatrix
    parameters: tuple[str, ...] = ()
    constants: tuple[tuple[str, sp.Expr], ...] = ()

    @cached_property
    def q(self) -> tuple[sp.Symbol, ...]:
        """Symbols of the coordinates."""
        return tuple(sp.Symbol(name, real=True) for name in self.coordinates)

    @cached_property
    def v(self) -> tuple[sp.Symbol, ...]:
        """Symbols of the velocities."""
        return tuple(sp.Symbol(f"d{name}", real=True) for name in self.coordinates)

    @property
    def state(self) -> tuple[sp.Symbol, ...]:
        """(q, v)."""
        return self.q + self.v

    @cached_property
    def parameter_symbols(self) -> tuple[sp.Symbol, ...]:
        """Symbols of the parameters."""
        return tuple(sp.Symbol(name, real=True) for name in self.parameters)

    @cached_property
    def potential(self) -> sp.Expr:
        """V(q) = -L at rest."""
        return tidy(-self.lagrangian.xreplace(dict.fromkeys(self.v, sp.S.Zero)))

    @cached_property
    def mass_inverse(self) -> sp.ImmutableMatrix:
        """M^{-1}."""
        if self.mass.is_diagonal():
            return sp.ImmutableMatrix(sp.diag(*(1 / self.mass[i, i] for i in range(self.mass.rows))))
        determinant = self.mass.det(method="berkowitz")
        return sp.ImmutableMatrix((self.mass.adjugate() / determinant).applyfunc(tidy))

    @cached_property
    def generalized_force(self) -> sp.ImmutableMatrix:
        """M q'' at u = 0."""
        q, v = sp.Matrix(self.q), sp.Matrix(self.v)
        momentum = self.mass * v + self.gyroscopic
        conservative = sp.Matrix([sp.diff(self.lagrangian, x) for x in self.q]) - momentum.jacobian(q) * v
        damping = sp.Matrix([sp.diff(self.dissipation, x) for x in self.v])
        return sp.ImmutableMatrix((conservative + self.force - damping).applyfunc(tidy))

    @cached_property
    def drift(self) -> Field:
        """X(q, v) = (v, M^{-1} ...), (2n, 1)."""
        acceleration = (self.mass_inverse * self.generalized_force).applyfunc(tidy)
        return sp.ImmutableMatrix([*self.v, *acceleration])

    @cached_property
    def input_fields(self) -> tuple[Field, ...]:
        """Y_a = (0, M^{-1} B e_a), each (2n, 1)."""
        columns = self.mass_inverse * self.input_matrix
        zeros = [sp.S.Zero] * len(self.q)
        return tuple(sp.ImmutableMatrix([*zeros, *columns[:, a].applyfunc(tidy)]) for a in range(columns.cols))

    @cached_property
    def cyclic(self) -> tuple[str, ...]:
        """Coordinates on which nothing depends and on which no force or dissipation acts: their momentum is conserved."""
        found = []
        for i, (x, w) in enumerate(zip(self.q, self.v, strict=True)):
            everything = (self.lagrangian, self.dissipation, *self.force, *self.input_matrix)
            acted = self.force[i] != 0 or any(entry != 0 for entry in self.input_matrix[i, :])
            independent = all(sp.simplify(sp.diff(entry, x)) == 0 for entry in everything)
            if independent and not acted and sp.expand(sp.diff(self.dissipation, w)) == 0:
                found.append(self.coordinates[i])
        return tuple(found)


def lagrangian_system(
    *,
    coordinates: Sequence[str],
    lagrangian: Any,
    forces: Mapping[str, Any] | None = None,
    dissipation: Any = "0",
    parameters: Mapping[str, Any] | None = None,
    inputs: Sequence[str] | None = None,
) -> LagrangianSystem:
    """A mechanical system from formulas in the closed grammar.

    Args:
        coordinates: names; the velocity of "x" is "dx" or "x_dot" in every formula.
        lagrangian: L, at most quadratic in the velocities.
        forces: coordinate -> generalized force, affine in the inputs, as in {"x": "u - 0.1*dx"}.
        dissipation: Rayleigh function D, as in "c*dx^2/2"; the force is -dD/dv.
        parameters: name -> number (a float is the decimal it prints as), or None to keep it as an argument.
        inputs: names of the inputs; None takes the names in the forces that nothing else defines, in order.

    Raises:
        ExpressionError: a text outside the grammar or an unknown name, with its column.
        InputError: a Lagrangian that is not quadratic in the velocities, a singular mass matrix, forces not affine in
            the inputs, names that clash.
    """
    names = tuple(check_identifier(name, "coordinate") for name in _list(coordinates, "coordinates"))
    known, hidden = _state_names(names)
    values = parameter_values(parameters)
    for name in values:
        check_identifier(name, "parameter")
        if name in known or name in hidden or name in _CONSTANTS:
            raise InputError(f"parameter {name!r} hides a coordinate, a velocity or a constant; rename it")
    known.update(values)
    energy = formula(lagrangian, {**known, **hidden}, "lagrangian")
    rayleigh = formula(dissipation, {**known, **hidden}, "dissipation")
    forces = dict(forces or {})
    for name in forces:
        if name not in names:
            raise InputError(f"forces: {name!r} is no coordinate; they are {', '.join(names)}")
    control = _inputs(forces, inputs, {*known, *hidden, *_CONSTANTS})
    symbols = {name: sp.Symbol(name, real=True) for name in control}
    applied = [formula(forces.get(name, 0), {**known, **hidden, **symbols}, f"force on {name}") for name in names]
    matrix, rest = _affine(applied, list(symbols.values()), names)
    velocities = [sp.Symbol(f"d{name}", real=True) for name in names]
    free = tuple(name for name, value in values.items() if value.is_Symbol)
    constants = tuple((name, value) for name, value in values.items() if not value.is_Symbol)
    return system_from(names, control, energy, rest, rayleigh, matrix, velocities, free, constants)


def system_from(
    coordinates: tuple[str, ...],
    inputs: tuple[str, ...],
    lagrangian: sp.Expr,
    force: sp.ImmutableMatrix,
    dissipation: sp.Expr,
    input_matrix: sp.ImmutableMatrix,
    velocities: Sequence[sp.Symbol],
    parameters: tuple[str, ...],
    constants: tuple[tuple[str, sp.Expr], ...] = (),
) -> LagrangianSystem:
    """The system of an exact Lagrangian; checks that it is mechanical.

    Raises:
        InputError: L not quadratic in the velocities, or a singular mass matrix (the direction is named).
    """
    # Each term of the expanded Lagrangian is built, differentiated twice and tidied: some 25 products.
    Meter("the expanded Lagrangian").spend(25 * expanded_terms(lagrangian))
    lagrangian = sp.expand(lagrangian)
    mass = sp.hessian(lagrangian, velocities)
    if mass.has(*velocities):
        raise InputError("the Lagrangian is not quadratic in the velocities: its mass matrix depends on them")
    at_rest = dict.fromkeys(velocities, sp.S.Zero)
    gyroscopic = sp.Matrix([sp.diff(lagrangian, w) for w in velocities]).xreplace(at_rest).applyfunc(tidy)
    mass = mass.applyfunc(tidy)
    for i, name in enumerate(coordinates):
        if all(entry == 0 for entry in mass[i, :]):
            raise InputError(f"the mass matrix is singular: no kinetic energy contains d{name}")
    if tidy(mass.det(method="berkowitz")) == 0:
        null = ", ".join(str(sp.simplify(entry)) for entry in mass.nullspace()[0])
        raise InputError(f"the mass matrix is singular: no kinetic energy along ({null}) in {', '.join(coordinates)}")
    return LagrangianSystem(
        coordinates, inputs, lagrangian, sp.ImmutableMatrix(mass), sp.ImmutableMatrix(gyroscopic),
        sp.ImmutableMatrix(force), dissipation, sp.ImmutableMatrix(input_matrix), parameters, constants,
    )  # fmt: skip


def _list(values: Sequence[str], what: str) -> Sequence[str]:
    if isinstance(values, str) or not values or len(set(values)) != len(values):
        raise InputError(f"{what} {values!r}: give a sequence of different names")
    return values


def _state_names(names: tuple[str, ...]) -> tuple[dict[str, sp.Expr], dict[str, sp.Expr]]:
    """Names of (q, v), and the second spelling of the velocities."""
    known: dict[str, sp.Expr] = {name: sp.Symbol(name, real=True) for name in names}
    hidden: dict[str, sp.Expr] = {}
    for name in names:
        if f"d{name}" in known:
            raise InputError(f"coordinate 'd{name}' is also the velocity of {name!r}; rename it")
        known[f"d{name}"] = hidden[f"{name}_dot"] = sp.Symbol(f"d{name}", real=True)
    return known, hidden


def _inputs(forces: Mapping[str, Any], given: Sequence[str] | None, defined: set[str]) -> tuple[str, ...]:
    if given is None:
        found = [name for force in forces.values() for name in names_in(force) if name not in defined]
        given = tuple(dict.fromkeys(found))
    clash = sorted(set(given) & defined)
    if clash:
        raise InputError(f"input {clash[0]!r} has the name of something else; rename it")
    return tuple(check_identifier(name, "input") for name in given)


def _affine(
    applied: Sequence[sp.Expr], inputs: list[sp.Symbol], names: tuple[str, ...]
) -> tuple[sp.ImmutableMatrix, sp.ImmutableMatrix]:
    rows = [[sp.diff(force, u) for u in inputs] for force in applied]
    for name, row in zip(names, rows, strict=True):
        if any(entry.has(*inputs) for entry in row):
            raise InputError(f"the force on {name} is not affine in the inputs {', '.join(map(str, inputs))}")
    zero = dict.fromkeys(inputs, sp.S.Zero)
    return sp.ImmutableMatrix(len(applied), len(inputs), [entry for row in rows for entry in row]), sp.ImmutableMatrix(
        [force.xreplace(zero) for force in applied]
    )
