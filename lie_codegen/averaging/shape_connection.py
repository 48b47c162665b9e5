"""lc.connection: bodies that are moved by their shape, X' = X hat(-A(r) r'), and what a gait displaces.

From a quadratic form M(r) of (xi, r'), blocks M_11 (n, n) and M_12 (n, k): A = M_11^-1 M_12, for the kinetic energy at zero momentum (falling cat, wheels,
oscillator) and for the drag power of a swimmer at low Reynolds number alike. Curvature, left-invariant with xi = -A r':

    DA_ij = d_i A_j - d_j A_i - [A_i, A_j],      log X = -DA_12 area for a small loop, area > 0 counter-clockwise.

TR 93-59, section 6, is the case of constant A (wheels, (68)) and of the oscillator (70); Hatton and Choset, IEEE T-RO 29 (2013), for gaits.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from numpy.typing import ArrayLike

from lie_codegen.averaging.frame_search import best_frame
from lie_codegen.averaging.shape_average import GaitAverage, gait_average
from lie_codegen.averaging.shape_form import ShapeForm
from lie_codegen.averaging.shape_kernels import NAMESPACE, connection_kernels
from lie_codegen.errors import InputError, ShapeError
from lie_codegen.groups.catalogue_load import GroupLike, as_group
from lie_codegen.identifiers import check_identifier
from lie_codegen.kernel.kernel import Kernel
from lie_codegen.mechanics.formulas import formula
from lie_codegen.on_demand import sympy as sp


@dataclass(frozen=True, eq=False, repr=False)
class ShapeConnection(ShapeForm):
    """A principal connection: xi = -A(r) r'; its fields and values are those of `ShapeForm`."""

    def average(
        self, gait: Any, order: int = 3, *, centre: ArrayLike | None = None, momentum: ArrayLike | None = None
    ) -> GaitAverage:
        """The average of small gaits r = centre + eps s(t), exact to any order: log X(T) = T sum eps^q F_q.

        Args:
            gait: s, a PeriodicInput without corners.
            order: p.
            momentum: mu_1 of a spatial momentum mu = eps mu_1 that the body has stored; then F_q are fields, see `GaitAverage`.

        Raises:
            InputError: a gait that does not close or has corners; A not analytic near the centre.
        """
        return gait_average(self, gait, order, centre, momentum)

    def best_frame(
        self, half_width: float = 1.0, degree: int = 3, length: float = 1.0, centre: ArrayLike | None = None
    ) -> ShapeConnection:
        """The same body seen from X h(r), h = exp(beta(r)), the frame that moves least: minimal int |A|^2 over a square of shapes.

        Args:
            half_width: of the square about `centre`.
            degree: of the polynomial beta.
            length: of a turn of one radian as a motion [m], by which angles and lengths are weighed; 1 m if nothing else is said.
        """
        return best_frame(self, half_width, degree, length, centre)

    def kernels(self, harmonics: int = 3, name: str = NAMESPACE) -> tuple[Kernel, ...]:
        """connection, r -> A(r), shape_velocity and gait_step, for lc.build and lc.generate.

        Args:
            harmonics: of the gait's Fourier series.
            name: C identifier that begins every symbol.
        """
        return connection_kernels(self, harmonics, name)


def connection(group: GroupLike, *, shape: Sequence[str], A: Any = None, metric: Any = None) -> ShapeConnection:
    """The connection xi = -A(r) r' of a body that changes its shape.

    Args:
        group: of the body's configurations.
        shape: names of the shape coordinates, k of them.
        A: (n, k) formulas in them, TR 93-59, (68) with C = -A and (70); or
        metric: (n + k, n + k) formulas of the quadratic form of (xi, r'), kinetic energy or drag power: A = M_11^-1 M_12.

    Returns:
        The connection: `.average(...)` of a gait, `.best_frame(...)`, `.kernels()`.

    Raises:
        InputError: both or neither, a metric that is not symmetric, a formula that is not analytic (abs, atan2).
        ShapeError: another shape.
    """
    group = as_group(group, "connection")
    if isinstance(shape, str) or not shape or len(set(shape)) != len(shape):
        raise InputError(f"connection: shape {shape!r}; give a sequence of different names")
    names = tuple(check_identifier(name, "shape coordinate") for name in shape)
    if (A is None) == (metric is None):
        raise InputError("connection: give either A=, (n, k), or metric=, (n + k, n + k)")
    n, k = group.dim, len(names)
    symbols = {name: sp.Symbol(name, real=True) for name in names}
    if A is not None:
        return ShapeConnection(group, names, _matrix(A, (n, k), symbols, "A"), None)
    M = _matrix(metric, (n + k, n + k), symbols, "metric")
    for i in range(n + k):
        for j in range(i):
            if M[i, j] != M[j, i] and sp.simplify(M[i, j] - M[j, i]) != 0:
                raise InputError(
                    f"connection: the metric is not symmetric: entries ({i + 1}, {j + 1}) and ({j + 1}, {i + 1}) differ"
                )
    return ShapeConnection(group, names, None, M)


def _matrix(value: Any, shape: tuple[int, int], symbols: dict[str, sp.Symbol], what: str) -> sp.ImmutableMatrix:
    rows = value.tolist() if hasattr(value, "tolist") else value
    if not isinstance(rows, list | tuple) or any(not isinstance(row, list | tuple) for row in rows):
        raise ShapeError(f"connection: {what} must be a matrix, {shape[0]} x {shape[1]}")
    if len(rows) != shape[0] or any(len(row) != shape[1] for row in rows):
        raise ShapeError(
            f"connection: {what} must be {shape[0]} x {shape[1]}, got {len(rows)} x {len(rows[0]) if rows else 0}"
        )
    entries = [
        [formula(entry, symbols, f"{what}[{i}][{j}]") for j, entry in enumerate(row)] for i, row in enumerate(rows)
    ]
    for row in entries:
        for entry in row:
            if entry.has(sp.Abs, sp.atan2):
                raise InputError(
                    f"connection: {what} holds {entry}, which is not analytic; its derivatives are taken in the complex plane"
                )
    return sp.ImmutableMatrix(entries)
