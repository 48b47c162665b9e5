"""Brackets of the fields of a Lagrangian system at a point, in any arithmetic, by dual numbers: nothing is expanded, nothing is tidied.

X = (v, M(q)^-1 ...) and Y_a = (0, M^-1 B e_a) are evaluated through a linear solve; [V, W] = DW.V - DV.W takes each derivative along a field by a dual number,
nested as deep as the word is. A symbolic bracket of a three-link chain holds a hundred thousand operations; this is a few thousand.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from lie_codegen.errors import InputError
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.block_solve import solve
from lie_codegen.kernel.dual import DualArithmetic, tangent_of
from lie_codegen.kernel.expressions import ExpressionEvaluator
from lie_codegen.kernel.linear import Vector, minus, negative, plus, scaled
from lie_codegen.mechanics.bracket_series import Word, pairs
from lie_codegen.mechanics.lagrangian import LagrangianSystem
from lie_codegen.on_demand import sympy as sp


class Dynamics:
    """The formulas of a system, as they were derived."""

    def __init__(self, system: LagrangianSystem, constant: Sequence[sp.Expr]) -> None:
        self.system = system
        q, v = sp.Matrix(system.q), sp.Matrix(system.v)
        momentum = system.mass * v + system.gyroscopic
        conservative = sp.Matrix([sp.diff(system.lagrangian, x) for x in system.q]) - momentum.jacobian(q) * v
        damping = sp.Matrix([sp.diff(system.dissipation, x) for x in system.v])
        still = sum((c * system.input_matrix[:, a] for a, c in enumerate(constant)), sp.zeros(len(system.q), 1))
        self.force = list(conservative + system.force - damping + still)
        self._check()

    def _check(self) -> None:
        velocities = list(self.system.v)
        if self.system.input_matrix.has(*velocities):
            raise InputError("the force of an input depends on the velocities; it must depend on positions alone")
        for entry in self.force:
            if not entry.has(*velocities):
                continue
            try:
                degree = sp.Poly(entry, *velocities).total_degree()
            except sp.PolynomialError:
                degree = None
            if degree is None or degree > 2:
                raise InputError(
                    f"the drift is of degree {degree} in the velocities; vibrational averaging needs at most 2"
                )

    def point(self, ops: Arithmetic, state: Vector, parameters: Mapping[sp.Symbol, Scalar]) -> Fields:
        """The fields at a state."""
        return Fields(self, ops, state, parameters)


class Fields:
    """Values of words at one point, each once."""

    def __init__(
        self, dynamics: Dynamics, ops: Arithmetic, state: Vector, parameters: Mapping[sp.Symbol, Scalar]
    ) -> None:
        self.dynamics, self.ops, self.state, self.parameters = dynamics, ops, list(state), parameters
        self.known: dict[Any, Vector] = {}
        self.moving: dict[Any, Fields] = {}
        self.evaluate = ExpressionEvaluator(ops, {**parameters, **dict(zip(dynamics.system.state, state, strict=True))})
        self.mass: dict[tuple[int, int], Scalar] = {}

    def word(self, word: Word | tuple[str, int]) -> Vector:
        """The value of a word; ("Y", a) is the lift."""
        if word not in self.known:
            self.known[word] = self._value(word)
        return self.known[word]

    def sum(self, terms: Mapping[Word, Scalar]) -> Vector:
        """sum of coefficient * word."""
        total: Vector = [0] * len(self.state)
        for word, coefficient in terms.items():
            total = plus(total, scaled(coefficient, self.word(word)))
        return total

    def _value(self, word: Any) -> Vector:
        count = self.dynamics.system.input_matrix.cols
        if word == 0:
            return [*self.state[len(self.state) // 2 :], *self._solved(self.dynamics.force)]
        if isinstance(word, tuple) and word[0] == "Y":
            return [*([0] * (len(self.state) // 2)), *self._solved(list(self.dynamics.system.input_matrix[:, word[1]]))]
        if isinstance(word, int):
            if word <= count:
                return self._bracket(("Y", word - 1), 0)
            a, b = pairs(count)[word - 1 - count]
            # <Ya : Yb> = [Ya, [X, Yb]] = -[Ya, [Yb, X]]
            return negative(self._bracket(("Y", a), 1 + b))
        return self._bracket(*word)

    def _bracket(self, first: Any, second: Any) -> Vector:
        return minus(self._along(second, first), self._along(first, second))

    def _along(self, field: Any, direction: Any) -> Vector:
        """D field . direction, by a dual number whose tangent is the direction."""
        if direction not in self.moving:
            dual = DualArithmetic(self.ops)
            state = [dual.variable(x, {0: d}) for x, d in zip(self.state, self.word(direction), strict=True)]
            self.moving[direction] = Fields(self.dynamics, dual, state, self.parameters)
        there = self.moving[direction]
        return [tangent_of(x, 0, there.ops.level) for x in there.word(field)]  # type: ignore[attr-defined]

    def _solved(self, right: Sequence[sp.Expr]) -> Vector:
        system = self.dynamics.system
        n = len(system.q)
        if not self.mass:
            self.mass = {
                (i, j): self.evaluate(system.mass[i, j]) for i in range(n) for j in range(n) if system.mass[i, j] != 0
            }
        [found] = solve(self.mass, [{i: self.evaluate(x) for i, x in enumerate(right) if x != 0}], n)
        return [found.get(i, 0) for i in range(n)]
