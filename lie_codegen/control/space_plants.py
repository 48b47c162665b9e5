"""Plants that are on no group: spheres, mechanisms in coordinates, Lagrangian systems.

sphere        q'' = F - |q'|^2 q,  |q| = 1, the command F taken to the tangent space
mechanism     M(q) q'' + C(q, q') q' + dV = F
Lagrangian    M(q) q'' = dL/dq - d(M v + b)/dq v + f - dD/dv + B(q) u
"""

from __future__ import annotations

import random
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from math import sqrt
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.control.plants import Plant
from lie_codegen.control.positive_solve import solve_positive
from lie_codegen.errors import InputError, NotFiniteError, ShapeError
from lie_codegen.exact.expression import FORMULA_FUNCTIONS, parse_expression
from lie_codegen.exact.positive_matrix import real_number
from lie_codegen.flow.product_step import Move
from lie_codegen.identifiers import shown
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.definition import record_factory
from lie_codegen.kernel.expressions import ExpressionEvaluator
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.linear import Vector, dot, minus, plus, scaled
from lie_codegen.mechanics.lagrangian import LagrangianSystem
from lie_codegen.on_demand import sympy as sp

#: (ops, t, q, v, command) -> the rate of v.
Acceleration = Callable[[Arithmetic, Scalar, Vector, Vector, Vector], Vector]
#: How far |q| may be from 1, as for elements of a group.
_NEAR = 1e-5


@dataclass(frozen=True)
class SpacePlant:
    """A point of R^n with its velocity.

    Attributes:
        name: prefix of the C symbols.
        size: n.
        command: components of the command.
        order: 1 or 2.
        acceleration: the rate of the velocity (order 2), or of the point.
        sphere: whether the points are those of the unit sphere.
    """

    name: str
    size: int
    command: int
    order: int
    acceleration: Acceleration
    sphere: bool = False

    @property
    def namespace(self) -> str:
        return self.name

    @property
    def sizes(self) -> tuple[int, int, int]:
        return self.size, self.size if self.order == 2 else 0, self.command

    @cached_property
    def ports(self) -> tuple[Port, Port]:
        return Port("q", (self.size,)), Port("q_dot", (self.size,))

    @property
    def moves(self) -> tuple[Move, ...]:
        return ()

    @property
    def numbers(self) -> tuple[Port, ...]:
        return ()

    def unpacked(self, flat: Sequence[Scalar]) -> tuple[Any, Vector]:
        return list(flat[: self.size]), list(flat[self.size : sum(self.sizes[:2])])

    def closed(self, X: Any, v: Vector) -> Vector:
        return [*X, *v]

    def parts(self, X: Any, v: Vector) -> tuple[list[Any], Vector]:
        return [], [*X, *v]

    def joined(self, elements: Sequence[Any], w: Vector) -> tuple[Any, Vector]:
        return list(w[: self.size]), list(w[self.size :])

    def rates(
        self, ops: Arithmetic, t: Scalar, X: Any, v: Vector, command: Vector, numbers: Mapping[str, Any]
    ) -> tuple[list[Vector], Vector]:
        return [], [*v, *self.acceleration(ops, t, X, v, command)]

    def landed(self, ops: Arithmetic, X: Any, v: Vector) -> tuple[Any, Vector]:
        """Back on the sphere, from which a step strays by h^5."""
        if not self.sphere:
            return X, v
        q = scaled(1 / ops.sqrt(dot(X, X)), X)
        return q, minus(v, scaled(dot(q, v), q)) if v else v

    def disturbed(self, ops: Arithmetic, X: Any, shift: Vector) -> Any:
        return self.landed(ops, plus(X, shift), [])[0]

    def starts(self, X0: ArrayLike | None, xi0: ArrayLike | None) -> tuple[Array, bool]:
        first = [0.0] * (self.size - 1) + [1.0 if self.sphere else 0.0]
        q = self._rows(first if X0 is None else X0, "X0")
        if self.order == 1 and xi0 is not None:
            raise InputError(
                "closed_loop: xi0 is given, but this law commands the velocity: the loop has none of its own"
            )
        v = self._rows([0.0] * self.size if xi0 is None else xi0, "xi0")
        many = q.ndim == 2 or v.ndim == 2
        count = max(len(each) if each.ndim == 2 else 1 for each in (q, v))
        q, v = (np.broadcast_to(each, (count, self.size)) for each in (q, v))
        if self.sphere:
            length = np.linalg.norm(q, axis=1)
            if np.max(np.abs(length - 1)) > _NEAR:
                raise InputError(
                    f"closed_loop: X0 has length {length[np.argmax(np.abs(length - 1))]:.6g}; it is a point of the unit sphere"
                )
            q = q / length[:, None]
            if np.max(np.abs(np.sum(q * v, axis=1))) > _NEAR * max(1.0, float(np.max(np.abs(v)))):
                raise InputError("closed_loop: xi0 is not tangent to the sphere at X0")
            v = v - np.sum(q * v, axis=1, keepdims=True) * q
        return np.ascontiguousarray(np.concatenate([q, v], axis=1)[:, : sum(self.sizes[:2])]), many

    def _rows(self, value: ArrayLike, what: str) -> Array:
        try:
            rows = np.asarray(value, dtype=float)
        except (TypeError, ValueError):
            raise InputError(
                f"closed_loop: {what} is {shown(value)}; give {self.size} numbers, or one row a loop"
            ) from None
        if rows.ndim not in (1, 2) or rows.shape[-1] != self.size:
            raise ShapeError(f"closed_loop: {what} has shape {rows.shape}; give ({self.size},) or (N, {self.size})")
        if not np.all(np.isfinite(rows)):
            raise NotFiniteError(f"closed_loop: {what} holds NaN or infinity")
        return rows

    def split(self, states: Array) -> tuple[Array, Array]:
        speed = states[..., self.size : sum(self.sizes[:2])]
        return np.ascontiguousarray(states[..., : self.size]), np.ascontiguousarray(speed)

    def sample(self, rng: random.Random) -> list[float]:
        q = [rng.uniform(-1, 1) for _ in range(self.size)]
        v = [rng.uniform(-1, 1) for _ in range(self.sizes[1])]
        if self.sphere:
            length = sqrt(sum(x * x for x in q))
            q = [x / length for x in q]
            along = sum(a * b for a, b in zip(q, v, strict=bool(v)))
            v = [b - along * a for a, b in zip(q, v, strict=bool(v))]
        return [*q, *v]


@record_factory()
def sphere_plant(n: int, order: int = 2) -> SpacePlant:
    """A point of S^n in R^{n+1}."""

    def acceleration(ops: Arithmetic, t: Scalar, q: Vector, v: Vector, command: Vector) -> Vector:
        tangent = minus(command, scaled(dot(q, command), q))
        return tangent if order == 1 else minus(tangent, scaled(dot(v, v), q))

    return SpacePlant(f"s{n}", n + 1, n + 1, order, acceleration, sphere=True)


@record_factory()
def mechanism_plant(
    inertia: Sequence[Sequence[Any]],
    potential: Any = 0,
    parameters: Mapping[str, Any] | None = None,
    name: str = "mechanism",
) -> SpacePlant:
    """M(q) q'' + C(q, q') q' + dV = F from texts in q1 .. qn and the parameters.

    Raises:
        ShapeError: the inertia is not square. ExpressionError: a text outside the grammar.
    """
    n = len(inertia)
    if any(len(row) != n for row in inertia):
        raise ShapeError(f"closed_loop: the inertia must have {n} rows of {n} entries")
    q, v = (sp.symbols(f"{letter}1:{n + 1}", real=True) for letter in ("q", "v"))
    names = {**{symbol.name: symbol for symbol in q}, "pi": sp.pi}
    names |= {key: real_number(value, key) for key, value in (parameters or {}).items()}

    def read(entry: Any) -> sp.Expr:
        if isinstance(entry, str):
            return parse_expression(entry, names, FORMULA_FUNCTIONS)
        return entry.subs(names) if isinstance(entry, sp.Expr) else real_number(entry, "inertia")

    M, V = sp.Matrix([[read(entry) for entry in row] for row in inertia]), read(potential)
    momentum, speed = M * sp.Matrix(v), sp.Matrix(v)
    # C v = (d(M v)/dq) v - d(v' M v/2)/dq: the same vector whichever matrix C stands for it.
    energy = (speed.T * momentum)[0] / 2
    bias = momentum.jacobian(sp.Matrix(q)) * speed - sp.Matrix([sp.diff(energy - V, x) for x in q])

    def acceleration(ops: Arithmetic, t: Scalar, at: Vector, w: Vector, command: Vector) -> Vector:
        evaluate = ExpressionEvaluator(ops, dict(zip([*q, *v], [*at, *w], strict=True)))
        matrix = [[evaluate(entry) for entry in row] for row in M.tolist()]
        return solve_positive(matrix, minus(command, [evaluate(entry) for entry in bias]))

    return SpacePlant(name, n, n, 2, acceleration)


def lagrangian_plant(system: LagrangianSystem) -> SpacePlant:
    """A Lagrangian system, its inputs the command.

    Raises:
        InputError: it has no inputs, or parameters without values.
    """
    if system.parameters:
        raise InputError(f"closed_loop: the parameters {', '.join(system.parameters)} of the Lagrangian have no values")
    if not system.inputs:
        raise InputError("closed_loop: the Lagrangian system has no inputs for a law to act by")
    n, columns = len(system.q), system.input_fields

    def acceleration(ops: Arithmetic, t: Scalar, q: Vector, v: Vector, command: Vector) -> Vector:
        evaluate = ExpressionEvaluator(ops, dict(zip(system.state, [*q, *v], strict=True)))
        total = [evaluate(entry) for entry in system.drift[n:]]
        for column, u in zip(columns, command, strict=True):
            total = plus(total, [0 if entry == 0 else evaluate(entry) * u for entry in column[n:]])
        return total

    return SpacePlant("_".join(("system", *system.coordinates)), n, len(columns), 2, acceleration)


def named_plant(
    group: Any, law: Kernel | None, inertia: Any, order: int | None, gains: Mapping[str, Any] | None = None
) -> Plant | None:
    """The plant of what is no group: a sphere "s2", a Lagrangian system, or the mechanism of a manipulator's law; else None.

    Numbers of the mechanism that are inputs of its law are those of `gains`.

    Raises:
        InputError: such a number is not given, or is another in each of many loops.
    """
    if isinstance(group, LagrangianSystem):
        return lagrangian_plant(group)
    definition = None if law is None else law.definition
    kind = "" if definition is None else str(definition["kind"]).rpartition(":")[2]
    size = sphere_dimension(group if group is not None or law is None else law.namespace)
    if size is not None:
        made: Plant = sphere_plant(size, 1 if order == 1 else 2)
        return made
    if kind == "manipulator_law" and definition is not None and (group is None or group == law.namespace):  # type: ignore[union-attr]
        told = definition["parameters"]
        rows = told["inertia"] if inertia is None else inertia
        numbers = _mechanism_numbers(told["parameters"], gains or {})
        made = mechanism_plant(rows, told["potential"], numbers, name=told["name"])
        return made
    return None


def _mechanism_numbers(told: Mapping[str, Any] | None, gains: Mapping[str, Any]) -> dict[str, Any]:
    """The parameters of a mechanism, those that the law takes as inputs from the numbers that it is given."""
    numbers = dict(told or {})
    for name in [name for name, value in numbers.items() if value == "input"]:
        given = gains.get(name)
        if given is None or np.ndim(given) != 0:
            raise InputError(
                f"closed_loop: {name} of the mechanism is an input of its law: give one number, gains={{{name!r}: ...}}; many loops of "
                "other mechanisms are run one by one"
            )
        numbers[name] = float(given)
    return numbers


def sphere_dimension(name: Any) -> int | None:
    """2 for "s2", "S2" and "S^2"; None for what is no sphere."""
    text = name.replace("^", "").lower() if isinstance(name, str) else ""
    return int(text[1:]) if text[:1] == "s" and text[1:].isdigit() and int(text[1:]) > 0 else None
