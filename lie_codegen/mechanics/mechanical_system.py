"""lc.mechanical_system: X' = X hat(xi), J xi' = ad*_xi J xi + f(Gamma, xi) - D xi + b_a(Gamma) u^a, by polynomials."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.errors import ExpressionError, InputError, ShapeError
from lie_codegen.exact.positive_matrix import positive_matrix, real_number
from lie_codegen.groups.catalogue_load import GroupLike, as_group
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernel.exact_arithmetic import ExactArithmetic
from lie_codegen.kernel.kernel import Kernel
from lie_codegen.kernel.saved import Saved
from lie_codegen.mechanics.advected import Advected, advected_vectors
from lie_codegen.mechanics.formulas import formula, quantity
from lie_codegen.on_demand import sympy as sp

#: A term of a polynomial: exponents of (xi, Gamma), coefficient.
Terms = tuple[tuple[tuple[int, ...], float], ...]


@dataclass(frozen=True, eq=False, repr=False)
class MechanicalSystem(Saved):
    """A body on a group under forces that are polynomials of its velocity and of advected vectors.

    Attributes:
        group: configurations X.
        inertia: (n, n) J, exact.
        advected: the vectors Gamma.
        force: (n,) f, exact polynomials in xi1.., and the components of Gamma; at most quadratic in xi.
        damping: (n, n) D, exact.
        inputs: (m) covectors b_a, (n,) each, exact polynomials in Gamma.
    """

    group: MatrixGroup
    inertia: sp.ImmutableMatrix
    advected: tuple[Advected, ...]
    force: tuple[sp.Expr, ...]
    damping: sp.ImmutableMatrix
    inputs: tuple[tuple[sp.Expr, ...], ...]

    @property
    def dim(self) -> int:
        """n."""
        return self.group.dim

    @cached_property
    def symbols(self) -> tuple[sp.Symbol, ...]:
        """xi1 .. xin, then the components of the advected vectors."""
        return state_symbols(self.group, self.advected)

    @cached_property
    def metric(self) -> Array:
        """J as doubles."""
        return _floats(self.inertia)

    @cached_property
    def inverse(self) -> Array:
        """J^-1 as doubles."""
        return np.linalg.inv(self.metric)

    @cached_property
    def advection(self) -> tuple[Array, Array]:
        """rho(A_i) and r(A_i) of all advected vectors together: (n, k, k) and (n, k)."""
        n, sizes = self.dim, [a.size for a in self.advected]
        k = sum(sizes)
        rho, r, first = np.zeros((n, k, k)), np.zeros((n, k)), 0
        for vector, size in zip(self.advected, sizes, strict=True):
            here = slice(first, first + size)
            rho[:, here, here], r[:, here] = vector.matrices
            first += size
        return rho, r

    @cached_property
    def acceleration(self) -> tuple[Terms, ...]:
        """(n) polynomials J^-1 (ad*_xi J xi + f - D xi)."""
        n, c = self.dim, self.group.algebra.structure_constants
        # (ad*_x m)_j = c_ijk x_i m_k, m = J x
        quadratic = np.einsum("ijk,kl->jil", c, self.metric)
        raised = np.einsum("aj,jil->ail", self.inverse, quadratic)
        drag = self.inverse @ _floats(self.damping)
        count = len(self.symbols)
        totals: list[dict[tuple[int, ...], float]] = [{} for _ in range(n)]

        def add(component: int, exponents: tuple[int, ...], value: float) -> None:
            totals[component][exponents] = totals[component].get(exponents, 0.0) + value

        for a, i, m in np.ndindex(n, n, n):
            add(a, _unit(count, i, m), float(raised[a, i, m]))
        for a, i in np.ndindex(n, n):
            add(a, _unit(count, i), -float(drag[a, i]))
        for j, terms in enumerate(polynomial_terms(self.force, self.symbols)):
            for exponents, value in terms:
                for a in range(n):
                    add(a, exponents, self.inverse[a, j] * value)
        return tuple(tuple((e, float(v)) for e, v in total.items() if v != 0) for total in totals)

    @cached_property
    def lifts(self) -> tuple[tuple[Terms, ...], ...]:
        """(m) of (n) polynomials Y_a = J^-1 b_a."""
        result = []
        for row in self.inputs:
            terms = polynomial_terms(row, self.symbols)
            lift = []
            for a in range(self.dim):
                total: dict[tuple[int, ...], float] = {}
                for j, entries in enumerate(terms):
                    for exponents, value in entries:
                        total[exponents] = total.get(exponents, 0.0) + self.inverse[a, j] * value
                lift.append(tuple((e, float(v)) for e, v in total.items() if v != 0))
            result.append(tuple(lift))
        return tuple(result)

    def seen(self, X: Array) -> Array:
        """Gamma at configurations (..., d, d): (..., k)."""
        parts = [vector.seen(X) for vector in self.advected]
        return np.concatenate(parts, axis=-1) if parts else np.zeros((*X.shape[:-2], 0))


def mechanical_system(
    group: GroupLike,
    *,
    inertia: Any,
    advected: Mapping[str, Any] | None = None,
    force: Any = None,
    damping: Any = None,
    inputs: Sequence[Any] = (),
) -> MechanicalSystem:
    """X' = X hat(xi), J xi' = ad*_xi J xi + f(Gamma, xi) - D xi + b_a(Gamma) u^a.

    Args:
        group: the group.
        inertia: J, a number, (n,) or (n, n), positive definite, full or not.
        advected: name -> (kind, vector): ("direction", v) is X^-1 v, ("point", p) X^-1 p, ("momentum", mu) Ad*_X mu; the
            components of "G" are G1, G2, ... in the formulas.
        force: (n) formulas of the body force f, polynomials in xi1 .. xin and the advected names, at most quadratic in xi; or a Kernel with
            inputs xi and the advected names and one output (n,).
        damping: D, a number, (n,) or (n, n): the force -D xi.
        inputs: a row b_a for each input: (n) formulas in the advected names, or the label of a basis element.

    Raises:
        InputError: inputs that depend on xi, a force that is no polynomial or more than quadratic in xi, an inertia that is not
            positive definite, a configuration in place of advected names.
        ShapeError: a row without n entries.
    """
    group = as_group(group, "mechanical_system")
    n = group.dim
    vectors = advected_vectors(group, advected)
    symbols = state_symbols(group, vectors)
    names = {str(s): s for s in symbols}
    if len(names) < len(symbols):
        raise InputError("advected names clash with each other or with xi1 ..")
    metric = positive_matrix(inertia, n, "inertia")
    total = _row(group, force, names, vectors, "force") if force is not None else (sp.S.Zero,) * n
    _check_degree(total, symbols[:n], 2, "force")
    rows = tuple(_input(group, row, names, vectors, a) for a, row in enumerate(inputs))
    for a, row in enumerate(rows):
        if any(entry.has(*symbols[:n]) for entry in row):
            raise InputError(
                f"input {a + 1} depends on xi: the lifts of inputs must be free of the velocities, or they do not commute; "
                "put drag into force= or damping="
            )
    return MechanicalSystem(group, metric, vectors, total, _damping(damping, n), rows)


def state_symbols(group: MatrixGroup, vectors: Sequence[Advected]) -> tuple[sp.Symbol, ...]:
    """xi1 .. xin, then the components of the advected vectors."""
    names = [f"xi{i + 1}" for i in range(group.dim)]
    names += [f"{vector.name}{i + 1}" for vector in vectors for i in range(vector.size)]
    return tuple(sp.Symbol(name, real=True) for name in names)


def polynomial_terms(row: Sequence[sp.Expr], symbols: Sequence[sp.Symbol]) -> tuple[Terms, ...]:
    """The entries as (exponents, coefficient) pairs."""
    result = []
    for entry in row:
        pairs = sp.Poly(entry, *symbols).terms() if entry != 0 else []
        result.append(tuple((tuple(e), float(v)) for e, v in pairs))
    return tuple(result)


def _row(
    group: MatrixGroup, given: Any, names: Mapping[str, sp.Symbol], vectors: Sequence[Advected], what: str
) -> tuple[sp.Expr, ...]:
    n = group.dim
    if isinstance(given, Kernel):
        return _of_kernel(group, given, names, vectors, what)
    entries = given.tolist() if isinstance(given, np.ndarray) else given
    if not isinstance(entries, list | tuple) or len(entries) != n:
        raise ShapeError(
            f"{what}: {n} formulas, one for each of {', '.join(group.labels)}, are needed; got {given!r:.60}"
        )
    row = []
    for label, entry in zip(group.labels, entries, strict=True):
        try:
            value = formula(entry, names, f"{what} on {label}")
        except ExpressionError as error:
            if isinstance(entry, str) and "X" in entry:
                raise ExpressionError(
                    f"{error}; a force that depends on the configuration says so by advected vectors: "
                    'advected={"G": ("direction", (0, 0, 1))} gives G1, G2, G3'
                ) from None
            raise
        row.append(_polynomial(value, list(names.values()), f"{what} on {label}"))
    return tuple(row)


def _of_kernel(
    group: MatrixGroup, kernel: Kernel, names: Mapping[str, sp.Symbol], vectors: Sequence[Advected], what: str
) -> tuple[sp.Expr, ...]:
    symbols = list(names.values())
    arguments: dict[str, Any] = {"xi": symbols[: group.dim]}
    first = group.dim
    for vector in vectors:
        arguments[vector.name] = symbols[first : first + vector.size]
        first += vector.size
    unknown = [port.name for port in kernel.inputs if port.name not in arguments]
    if unknown:
        raise InputError(
            f"{what}: the kernel {kernel.name} has the input {unknown[0]!r}; it may have {', '.join(arguments)}"
        )
    (values, *_) = kernel.evaluate(ExactArithmetic(), *(arguments[port.name] for port in kernel.inputs))
    if not isinstance(values, list | tuple) or len(values) != group.dim:
        raise ShapeError(f"{what}: the first output of the kernel {kernel.name} must have {group.dim} entries")
    return tuple(
        _polynomial(value if isinstance(value, sp.Expr) else quantity(value, what), symbols, what) for value in values
    )


def _polynomial(value: sp.Expr, symbols: Sequence[sp.Symbol], what: str) -> sp.Expr:
    value = sp.expand(value)
    if not value.is_polynomial(*symbols):
        raise InputError(f"{what}: {value} is no polynomial in {', '.join(map(str, symbols))}")
    return value


def _input(
    group: MatrixGroup, row: Any, names: Mapping[str, sp.Symbol], vectors: Sequence[Advected], number: int
) -> tuple[sp.Expr, ...]:
    if isinstance(row, str):
        place = group.algebra.index(row)
        return tuple(sp.Integer(int(k == place)) for k in range(group.dim))
    return _row(group, row, names, vectors, f"input {number + 1}")


def _check_degree(row: Sequence[sp.Expr], velocities: Sequence[sp.Symbol], most: int, what: str) -> None:
    for entry in row:
        degree = sp.Poly(entry, *velocities).total_degree() if entry.has(*velocities) else 0
        if degree > most:
            raise InputError(
                f"{what}: {entry} has degree {degree} in xi; the averaged equations are exact for forces that are at most quadratic in "
                "the velocities"
            )


def _damping(value: Any, n: int) -> sp.ImmutableMatrix:
    if value is None:
        return sp.ImmutableMatrix(sp.zeros(n, n))
    rows = value.tolist() if hasattr(value, "tolist") else value
    if not isinstance(rows, list | tuple):
        return sp.ImmutableMatrix(sp.eye(n) * real_number(rows, "damping"))
    if len(rows) != n or any(isinstance(row, list | tuple) and len(row) != n for row in rows):
        raise ShapeError(f"damping: a number, {n} numbers or a {n} x {n} matrix")
    if not any(isinstance(row, list | tuple) for row in rows):
        return sp.ImmutableMatrix(sp.diag(*[real_number(entry, f"damping[{i}]") for i, entry in enumerate(rows)]))
    return sp.ImmutableMatrix([[real_number(entry, "damping") for entry in row] for row in rows])


def _floats(matrix: sp.MatrixBase) -> Array:
    return np.array(matrix.tolist(), dtype=float)


def _unit(count: int, *places: int) -> tuple[int, ...]:
    exponents = [0] * count
    for place in places:
        exponents[place] += 1
    return tuple(exponents)
