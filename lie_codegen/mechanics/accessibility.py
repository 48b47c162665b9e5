"""Controllability of I xi' = ad*_xi I xi + sum u_a f_a, X' = X hat(xi), and what a direction sensor sees of it.

First order (velocities commanded): the Lie span of the directions, `algebra/controllability.py`; Geyer, Proposition 12.

Second order, from rest, with Y_a = I^{-1} f_a:
    state accessible            symmetric products of the Y_a span the algebra;
    configuration accessible    the Lie span of those symmetric products is the algebra;
    configuration controllable  and every bad symmetric product (each Y_a an even number of times) is a combination of
                                good ones of lower degree.
Bullo, Leonard and Lewis, as cited for Proposition 13 by Geyer, The Attitude Control Problem. Proposition 13 concerns
two torques along principal axes: for the full state it needs I_1 != I_2 (rank 6, against 5 for I_1 = I_2); for the
attitude alone, as it is worded, I_1 = I_2 is enough.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any, TypeAlias

from lie_codegen.algebra.lie_algebra import LieAlgebra
from lie_codegen.algebra.subspace import bracket
from lie_codegen.errors import InputError, ShapeError
from lie_codegen.exact.counts import count_between
from lie_codegen.exact.numbers import domain_matrix, exact_number
from lie_codegen.exact.positive_matrix import positive_matrix
from lie_codegen.groups.catalogue_load import GroupLike, as_algebra
from lie_codegen.kernel.saved import Saved
from lie_codegen.mechanics.connection import metric_of, symmetric_product
from lie_codegen.mechanics.euler_poincare import euler_poincare, velocity_symbols
from lie_codegen.on_demand import sympy as sp
from lie_codegen.shapes import entries_of

_DEGREE = 4
#: Levels of brackets, products or derivatives: each has several times the terms of the one before.
_MOST_LEVELS = 12

Vector: TypeAlias = "list[sp.Expr]"


@dataclass(frozen=True, eq=False, repr=False)
class SecondOrderControllability(Saved):
    """What the forces reach from rest.

    Attributes:
        symmetric_growth: dimensions spanned by symmetric products of degree up to 1, 2, ...
        state_accessible: whether position and velocity can be moved in every direction.
        configuration_accessible: whether the configuration can.
        configuration_controllable: whether the sufficient condition for reaching every nearby configuration at rest
        holds;
            False means undecided.
        reason: one sentence.
    """

    symmetric_growth: tuple[int, ...]
    state_accessible: bool
    configuration_accessible: bool
    configuration_controllable: bool
    reason: str


def second_order_controllability(
    group: GroupLike | LieAlgebra, inertia: Any, forces: Sequence[Any], degree: int = _DEGREE
) -> SecondOrderControllability:
    """Accessibility and controllability from rest by symmetric products, exact.

    Args:
        group: the group, its name, its file, or its algebra.
        inertia: a number, (n,) or (n, n), positive definite; numbers or exact texts.
        forces: body covectors f_a, (n,) each, or labels of basis elements.
        degree: highest degree of symmetric products looked at.

    Raises:
        ShapeError: a force has not n entries.
        InputError: no force; a degree outside 1 to 12.
    """
    algebra = as_algebra(group, "second_order_controllability")
    degree = count_between(degree, 1, _MOST_LEVELS, "second_order_controllability: degree")
    inertia = metric_of(algebra, inertia)
    fields = [list(inertia.inv() * sp.Matrix(force)) for force in force_vectors(algebra, forces)]
    levels = _symmetric_levels(algebra, inertia, fields, degree)
    growth: list[int] = []
    span: list[Vector] = []
    for level in levels:
        span = _independent([*span, *(v for v, _ in level)])
        growth.append(len(span))
    closed = span
    while True:
        longer = _independent(closed + [list(bracket(algebra, x, y)) for x, y in product(closed, repeat=2)])
        if len(longer) == len(closed):
            break
        closed = longer
    state, configuration = len(span) == algebra.dim, len(closed) == algebra.dim
    good = _bad_are_spanned(levels)
    how = f"symmetric products of degree up to {degree} span {growth[-1]} of {algebra.dim} dimensions"
    verdict = (
        "the state is accessible"
        if state
        else f"their Lie brackets span {len(closed)}, so only the configuration is accessible"
        if configuration
        else f"their Lie brackets span {len(closed)}: the configuration is not accessible"
    )
    tail = "; every bad product is spanned by lower good ones" if good and configuration else ""
    return SecondOrderControllability(
        tuple(growth), state, configuration, good and configuration, f"{how}; {verdict}{tail}"
    )


def accessibility_rank(
    group: GroupLike | LieAlgebra,
    inertia: Any,
    forces: Sequence[Any],
    xi: Sequence[Any] | None = None,
    depth: int = 4,
) -> int:
    """Rank at (1, xi) of the Lie algebra of drift and control fields on G x g, 2 n for full accessibility.

    In the left trivialisation fields are pairs (a, A) of polynomials of xi, and
    [(a, A), (b, B)] = ([a, b] + Db A - Da B, DB A - DA B).

    Args:
        group: object, catalogue name, file, or its `LieAlgebra`.
        inertia: symmetric positive definite: a number, (n,) or (n, n), exact.
        forces: (m, n) covectors, exact.
        xi: (n,) the velocity at which; zero if not given.
        depth: brackets of fields with the given ones, from 0 to 12 times.

    Raises:
        ShapeError: a force or xi has not n entries.
        InputError: a depth outside 0 to 12.
    """
    algebra = as_algebra(group, "accessibility_rank")
    depth = count_between(depth, 0, _MOST_LEVELS, "accessibility_rank: depth")
    inertia = metric_of(algebra, inertia)
    n = algebra.dim
    symbols = velocity_symbols(algebra)
    zero = [sp.S.Zero] * n
    drift = (list(symbols), euler_poincare(algebra, inertia, symbols))
    controls = [(zero, list(inertia.inv() * sp.Matrix(force))) for force in force_vectors(algebra, forces)]
    velocity = zero if xi is None else [exact_number(x) for x in entries_of(xi, n, "accessibility_rank: xi")]
    point = dict(zip(symbols, velocity, strict=True))
    layer, found = [drift, *controls], [drift, *controls]
    for _ in range(depth):
        layer = [_field_bracket(algebra, symbols, f, g) for f in (drift, *controls) for g in layer]
        found += layer
        layer = [field for field in layer if any(entry != 0 for entry in (*field[0], *field[1]))]
    rows = [[entry.subs(point) for entry in (*a, *b)] for a, b in found]
    return int(domain_matrix(rows).rank())


@dataclass(frozen=True, eq=False, repr=False)
class DirectionObservability(Saved):
    """What a body sensor of one inertial direction, y = R' z, tells about a free body.

    Attributes:
        rank: of the five dimensions of (y, omega), how many the outputs y, y', y'', ... determine at the point.
        omega_observable: rank == 5.
        heading_observable: False always: R and exp(phi hat(z)) R give the same y for ever.
        reason: one sentence.
    """

    rank: int
    omega_observable: bool
    heading_observable: bool
    reason: str


def direction_observability(
    inertia: Any, y: Sequence[Any], omega: Sequence[Any], derivatives: int = 5
) -> DirectionObservability:
    """Rank of d(y, y', ..., y^(k)) on S^2 x R^3 along y' = y x omega, I omega' = I omega x omega, exact at a point.

    Section 9 of Geyer's paper lets omega be seen "if the body is not symmetric", through omega x I omega (printed
    omega x omega). Precisely: omega is seen unless it stays along y, as for omega = 0 or a rotation about y that is
    principal: then y stands still, and only the two components of omega across y are seen.

    Args:
        inertia: symmetric positive definite: a number, (3,) or (3, 3), exact. [kg m^2]
        y: (3,) the direction that is measured, exact.
        omega: (3,) body angular velocity, exact. [rad/s]
        derivatives: k, from 0 to 12.

    Raises:
        ShapeError: y or omega has not three entries.
        InputError: derivatives outside 0 to 12.
    """
    derivatives = count_between(derivatives, 0, _MOST_LEVELS, "direction_observability: derivatives")
    y, omega = entries_of(y, 3, "direction_observability: y"), entries_of(omega, 3, "direction_observability: omega")
    inertia = inertia if isinstance(inertia, sp.MatrixBase) else positive_matrix(inertia, 3, "inertia")
    ys, ws = sp.symbols("y1:4", real=True), sp.symbols("w1:4", real=True)
    Y, W = sp.Matrix(ys), sp.Matrix(ws)
    flow = list(Y.cross(W)) + list(inertia.inv() * (inertia * W).cross(W))
    state = (*ys, *ws)
    output, rows = list(ys), []
    at = dict(zip(state, [exact_number(v) for v in (*y, *omega)], strict=True))
    for _ in range(derivatives + 1):
        rows += [[sp.diff(f, s).subs(at) for s in state] for f in output]
        output = [
            sp.expand(sum((sp.diff(f, s) * v for s, v in zip(state, flow, strict=True)), sp.S.Zero)) for f in output
        ]
    radial = [at[s] for s in ys] + [sp.S.Zero] * 3  # the direction off the sphere
    tangent = domain_matrix([radial]).nullspace().to_Matrix().T
    rank = int(domain_matrix((sp.Matrix(rows) * tangent).tolist()).rank())
    seen = "omega is seen whole" if rank == 5 else f"only {rank} of the 5 dimensions of (y, omega) are seen there"
    return DirectionObservability(rank, rank == 5, False, f"{seen}; the angle about the direction never is")


def force_vectors(algebra: LieAlgebra, forces: Sequence[Sequence[sp.Expr] | str]) -> list[Vector]:
    """Covectors (n,) from vectors or labels.

    Raises:
        ShapeError, InputError: as the callers say.
    """
    if isinstance(forces, str) or not hasattr(forces, "__len__"):
        raise ShapeError(f"forces must be a list of covectors or labels, given {forces!r:.80}")
    if not len(forces):
        raise InputError("give at least one force")
    result = []
    for force in forces:
        if isinstance(force, str):
            result.append([sp.Integer(int(k == algebra.index(force))) for k in range(algebra.dim)])
            continue
        covector = entries_of(force, algebra.dim, f"a force on {algebra.name}")
        result.append([exact_number(x) for x in covector])
    return result


def _symmetric_levels(
    algebra: LieAlgebra, inertia: sp.MatrixBase, fields: list[Vector], degree: int
) -> list[list[tuple[Vector, tuple[int, ...]]]]:
    """For each degree the symmetric products with the number of times each field occurs."""
    count = len(fields)
    levels = [[(field, tuple(int(a == b) for b in range(count))) for a, field in enumerate(fields)]]
    for total in range(2, degree + 1):
        level: list[tuple[Vector, tuple[int, ...]]] = []
        for left in range(1, total // 2 + 1):
            for (x, nx), (y, ny) in product(levels[left - 1], levels[total - left - 1]):
                value = symmetric_product(algebra, inertia, x, y)
                times = tuple(a + b for a, b in zip(nx, ny, strict=True))
                if any(entry != 0 for entry in value) and (value, times) not in level:
                    level.append((value, times))
        levels.append(level)
    return levels


def _bad_are_spanned(levels: list[list[tuple[Vector, tuple[int, ...]]]]) -> bool:
    lower: list[Vector] = []
    for level in levels:
        bad = [v for v, times in level if all(k % 2 == 0 for k in times)]
        if len(_independent(lower + bad)) > len(lower):
            return False
        lower = _independent(lower + [v for v, times in level if any(k % 2 for k in times)])
    return True


def _independent(vectors: list[Vector]) -> list[Vector]:
    """A basis of the span, from the first ones on."""
    kept = [v for v in vectors if any(entry != 0 for entry in v)]
    if not kept:
        return []
    _, pivots = domain_matrix([list(row) for row in zip(*kept, strict=True)]).rref()
    return [kept[p] for p in pivots]


def _field_bracket(
    algebra: LieAlgebra, symbols: Sequence[sp.Symbol], f: tuple[Vector, Vector], g: tuple[Vector, Vector]
) -> tuple[Vector, Vector]:
    (a, A), (b, B) = f, g

    def along(field: Vector, direction: Vector) -> Vector:
        return [sum((sp.diff(e, s) * d for s, d in zip(symbols, direction, strict=True)), sp.S.Zero) for e in field]

    turning = zip(bracket(algebra, a, b), along(b, A), along(a, B), strict=True)
    first = [sp.expand(x + y - z) for x, y, z in turning]
    return first, [sp.expand(x - y) for x, y in zip(along(B, A), along(A, B), strict=True)]
