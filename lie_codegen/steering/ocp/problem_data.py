"""The data of an optimal control problem: what `lc.ocp` checked, as plain values."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernel.brackets import ad_star
from lie_codegen.kernel.linear import Matrix, Vector, dot, matvec, plus, scaled
from lie_codegen.kernel.runge_kutta import CLASSICAL, EULER, MIDPOINT
from lie_codegen.steering.ocp.layout import Layout
from lie_codegen.steering.ocp.terms import Point, Scope, Term

Rows = tuple[tuple[float, ...], ...]

#: Nodes and weights on [0, 1] of the quadrature of the cost.
QUADRATURES: dict[str, tuple[tuple[float, float], ...]] = {
    "left": ((0.0, 1.0),),
    "trapezoid": ((0.0, 0.5), (1.0, 0.5)),
    "simpson": ((0.0, 1 / 6), (0.5, 4 / 6), (1.0, 1 / 6)),
}
#: Explicit tableaus in which each stage needs only the one before it.
INTEGRATORS = {"rkmk4": CLASSICAL, "midpoint": MIDPOINT, "exact": EULER}
ORDERS = {"rkmk4": 4, "midpoint": 2, "exact": 1}


@dataclass(frozen=True)
class Affine:
    """xi = B u + drift.

    Attributes:
        columns: (n, m) B.
        drift: (n,).
    """

    columns: Rows
    drift: tuple[float, ...]


@dataclass(frozen=True)
class SecondOrder:
    """xi is a state: I xi' = ad*_xi I xi - drag xi + force + B u. Bullo and Murray, CIT-CDS 97-003, (10).

    Attributes:
        inertia, inverse: (n, n) I and its inverse.
        drag: (n, n).
        columns: (n, m) B.
        force: further body force, n entries in all; () for none.
    """

    inertia: Rows
    inverse: Rows
    drag: Rows
    columns: Rows
    force: tuple[Term, ...]


@dataclass(frozen=True)
class Condition:
    """Rows of g <= 0, or of e = 0.

    Attributes:
        name: what it is called where it is violated.
        term: its formula or kernel.
        sense: "g" or "e".
    """

    name: str
    term: Term
    sense: str


@dataclass(frozen=True)
class Cost:
    """A part of a cost.

    Attributes:
        term: its formula or kernel.
        is_residual: the cost is |r|^2 / 2 of its entries.
    """

    term: Term
    is_residual: bool


@dataclass(frozen=True)
class ProblemData:
    """min sum l + phi subject to X' = X hat(xi), z' = f, lower <= u <= upper, g <= 0, e = 0.

    Where the duration is free, between two bounds, it is a state T that does not move, the time of the equations runs from 0 to
    1 (`duration`), and xi, f, l and t are multiplied by T. `elements` names the parameters that are elements of the group.
    """

    name: str
    group: MatrixGroup
    inputs: Layout
    states: Layout
    parameters: Layout
    velocity: Affine | SecondOrder | tuple[Term, ...]
    rates: tuple[tuple[str, tuple[Term, ...]], ...]
    stage_cost: tuple[Cost, ...]
    terminal_cost: tuple[Cost, ...]
    constraints: tuple[Condition, ...]
    terminal: tuple[Condition, ...]
    lower: tuple[float, ...]
    upper: tuple[float, ...]
    duration: float
    intervals: int
    quadrature: str
    integrator: str
    free_duration: tuple[float, float] | None = None
    elements: tuple[str, ...] = ()

    @property
    def scope(self) -> Scope:
        """The names of a stage."""
        return Scope(self.group, (self.inputs, self.states, self.parameters))

    @property
    def end_scope(self) -> Scope:
        """The names at the end: no control acts there."""
        return self.scope.without_inputs()

    @property
    def terms(self) -> tuple[Term, ...]:
        """Every formula and kernel."""
        law = self.velocity
        own = law if isinstance(law, tuple) else law.force if isinstance(law, SecondOrder) else ()
        rates = (term for _, terms in self.rates for term in terms)
        costs = (each.term for each in (*self.stage_cost, *self.terminal_cost))
        conditions = (each.term for each in (*self.constraints, *self.terminal))
        return (*own, *rates, *costs, *conditions)

    @property
    def is_invariant(self) -> bool:
        """xi depends on the controls alone, and there are no other states: a step is one exponential, exactly."""
        return isinstance(self.velocity, Affine) and not self.states.shapes

    @property
    def tableau(self) -> tuple[tuple[float, ...], tuple[float, ...], tuple[float, ...]]:
        """(a, b, c) of the integrator, a_i the entry beside the diagonal; of one stage where that is exact."""
        chosen = INTEGRATORS["exact" if self.is_invariant else self.integrator]
        a = tuple(float(row[-1]) if row else 0.0 for row in chosen.a)
        return a, tuple(float(w) for w in chosen.b), tuple(c for c, _ in chosen.stages)

    @property
    def inner_weights(self) -> tuple[float, ...]:
        """Weights of the stages at the node within an interval, where the quadrature has one: the integrator's own interpolant.

        Of order 3 for the classical method, 2 for the midpoint rule, exact for an exact step: the quadrature's order is kept, for
        an error of order h^4 within an interval is one of h^5 of its cost. Hairer, Norsett and Wanner, II.6.
        """
        inner = [c for c, _ in QUADRATURES[self.quadrature] if 0 < c < 1]
        if not inner:
            return ()
        c = inner[0]
        stages = len(self.tableau[0])
        if stages == 1:
            return (c,)
        if stages == 2:
            return (c - c**2, c**2)
        ends, middle = c**2 / 2 - 2 * c**3 / 3, c**2 - 2 * c**3 / 3
        return (c - c**2 - ends, middle, middle, -ends)

    def xi(self, at: Point) -> Vector:
        """(n,) body velocity, by the time of the equations."""
        return scaled(self._scale(at), self._velocity(self._in_seconds(at)))

    def _scale(self, at: Point) -> Any:
        """T, or 1."""
        return 1 if self.free_duration is None else at.values["state"][self.states.slices()["T"][0]][0]

    def _in_seconds(self, at: Point) -> Point:
        """The point with the time that formulas know."""
        return at if self.free_duration is None else replace(at, t=self._scale(at) * at.t)

    def _velocity(self, at: Point) -> Vector:
        """(n,) body velocity."""
        if isinstance(self.velocity, Affine):
            moved = matvec(_constants(self.velocity.columns), at.values["input"])
            return plus(moved, list(self.velocity.drift))
        if isinstance(self.velocity, SecondOrder):
            return list(at.values["state"][self.states.slices()["xi"][0]])
        return [entry for term in self.velocity for entry in self.scope.evaluate(term, at, "any", "velocity")]

    def rate(self, at: Point) -> Vector:
        """(q,) rates of the states, in their order."""
        scale, at = self._scale(at), self._in_seconds(at)
        by_name: dict[str, Vector] = {
            name: [entry for term in terms for entry in self.scope.evaluate(term, at, "any", f"rates of {name}")]
            for name, terms in self.rates
        }
        if isinstance(self.velocity, SecondOrder):
            by_name["xi"] = self._acceleration(self.velocity, at)
        return scaled(scale, [entry for name in self.states.names for entry in by_name[name]])

    def _acceleration(self, law: SecondOrder, at: Point) -> Vector:
        xi = self._velocity(at)
        total = ad_star(at.ops, self.group.algebra, xi, matvec(_constants(law.inertia), xi))
        total = plus(total, matvec(_constants(law.columns), at.values["input"]))
        total = plus(total, scaled(-1, matvec(_constants(law.drag), xi)))
        if law.force:
            pushed = [entry for term in law.force for entry in self.scope.evaluate(term, at, "any", "force")]
            total = plus(total, pushed)
        return matvec(_constants(law.inverse), total)

    def cost(self, parts: tuple[Cost, ...], at: Point, where: str) -> tuple[Any, Vector]:
        """The scalar parts' sum, and all residuals; the whole cost is the sum plus half the residuals' square."""
        scope = self.scope if "input" in at.values else self.end_scope
        scale = self._scale(at) if "input" in at.values else 1  # a stage's cost is paid for as long as the stage lasts
        at = self._in_seconds(at)
        total: Any = 0
        residual: Vector = []
        for part in parts:
            entries = scope.evaluate(part.term, at, "parts" if part.is_residual else "scalar", where)
            if part.is_residual:
                residual += entries
            else:
                total = total + entries[0]
        if isinstance(scale, int):
            return total, residual
        return scale * total, scaled(at.ops.sqrt(scale), residual)

    def rows(self, conditions: tuple[Condition, ...], at: Point, where: str = "") -> Vector:
        """Entries of conditions, one after the other; `where` comes first in messages."""
        scope = self.scope if "input" in at.values else self.end_scope
        at = self._in_seconds(at)
        kinds = {"g": "any", "e": "parts"}  # a complex entry is zero when its parts are; it is not below zero
        named = [(each, f"{where}{each.name}") for each in conditions]
        return [entry for each, name in named for entry in scope.evaluate(each.term, at, kinds[each.sense], name)]

    @property
    def lasting(self) -> tuple[Condition, ...]:
        """Path conditions that no control enters: they hold at the end too."""
        return tuple(each for each in self.constraints if not self.scope.uses(each.term) & set(self.inputs.names))


def _constants(rows: Rows) -> Matrix:
    """Zeros and ones as plain integers, so that they leave no trace."""
    return [[int(value) if value in (0, 1, -1) else value for value in row] for row in rows]


def total_square(residual: Vector) -> Any:
    """|r|^2."""
    return dot(residual, residual)
