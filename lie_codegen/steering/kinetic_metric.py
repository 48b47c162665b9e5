"""The metric of the kinetic energy on a group: lengths of paths, geodesics, and the distance that they give.

    <X xi, X eta> = xi^T I eta,     length = int sqrt(xi^T I xi) dt,     d(X, Y) = inf over paths from X to Y       (11)

of Geyer's paper, left-invariant: d(Z X, Z Y) = d(X, Y). Over unit time the square of a geodesic's length is the least
int xi^T I xi dt, so that extremals of least energy are the geodesics: those of the free body.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.errors import InputError, ShapeError
from lie_codegen.exact.positive_matrix import positive_matrix
from lie_codegen.flow.elements import group_element
from lie_codegen.groups.build import library_of
from lie_codegen.groups.catalogue_load import GroupLike, as_group
from lie_codegen.groups.change_of_basis import change_of_basis
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernel.saved import Saved
from lie_codegen.on_demand import sympy as sp
from lie_codegen.runtime.rows import row_by_row
from lie_codegen.steering.front import steer
from lie_codegen.steering.plan import Plan


@dataclass(frozen=True, eq=False, repr=False)
class KineticMetric(Saved):
    """What `kinetic_energy_metric` makes.

    Attributes:
        group: the group.
        inertia: (n, n) I, exact.
    """

    group: MatrixGroup
    inertia: Any

    @cached_property
    def matrix(self) -> Array:
        """(n, n) I in doubles."""
        return np.array(self.inertia.tolist(), dtype=float)

    def inner(self, xi: ArrayLike, eta: ArrayLike) -> Array:
        """xi^T I eta of body velocities, (..., n) -> (...)."""
        return np.asarray(np.einsum("...i,ij,...j->...", np.asarray(xi, float), self.matrix, np.asarray(eta, float)))

    def norm(self, xi: ArrayLike) -> Array:
        """sqrt(xi^T I xi): the root of twice the kinetic energy, (..., n) -> (...)."""
        return np.asarray(np.sqrt(self.inner(xi, xi)))

    def length(self, X: ArrayLike) -> float:
        """Length of a path through elements (k, d, d): of the one-parameter arcs between neighbours, which of a smooth path is right to
        the square of their distance.

        Raises:
            ShapeError: less than two elements.
        """
        path = np.asarray(X)
        if path.ndim != 3 or len(path) < 2 or path.shape[1:] != (self.group.degree,) * 2:
            raise ShapeError(f"length takes (k, {self.group.degree}, {self.group.degree}) elements, got {path.shape}")
        steps = np.linalg.inv(path[:-1]) @ path[1:]
        return float(np.sum(self.norm(row_by_row(library_of(self.group).log, np.ascontiguousarray(steps))[0])))

    def geodesic(self, X: ArrayLike, Y: ArrayLike) -> Plan:
        """The shortest geodesic found from X to Y in unit time, a plan from the identity to X^{-1} Y in the basis `frame`.

        Raises:
            NotOnGroupError: X or Y is no element.
            SteeringError: none was found.
        """
        start, end = (group_element(self.group, each, "kinetic_energy_metric") for each in (X, Y))
        framed, moments = self.frame
        return steer(framed, np.linalg.inv(start) @ end, framed.labels, 1.0, "optimal", weights=moments)

    def distance(self, X: ArrayLike, Y: ArrayLike) -> float:
        """d(X, Y), (11): the length of the shortest geodesic found, which is never below the distance; that it is the distance is
        likely, not proved.

        Raises:
            NotOnGroupError, SteeringError: as `geodesic`.
        """
        start, end = (np.asarray(each) for each in (X, Y))
        if start.shape == end.shape and np.array_equal(start, end):
            return 0.0
        plan = self.geodesic(X, Y)
        nodes, weights = np.polynomial.legendre.leggauss(32)
        edges = np.linspace(0, 1, 9)
        t = (edges[:-1, None] + np.diff(edges)[:, None] * (nodes + 1) / 2).ravel()
        _, moments = self.frame
        speeds = np.sqrt(plan.u(t) ** 2 @ moments).reshape(8, -1)
        return float(np.sum(np.diff(edges)[:, None] / 2 * weights * speeds))

    @cached_property
    def frame(self) -> tuple[MatrixGroup, Array]:
        """The group in a basis in which I is diagonal, and the diagonal: I = U^T D U with U unit triangular, exact."""
        n = self.group.dim
        lower, diagonal = sp.Matrix(self.inertia).LDLdecomposition(hermitian=False)
        moments = np.array([float(diagonal[i, i]) for i in range(n)])
        if lower == sp.eye(n):
            return self.group, moments
        columns = lower.T.inv()
        labels = self.group.labels
        combined = {f"e{j + 1}": {labels[i]: columns[i, j] for i in range(n) if columns[i, j] != 0} for j in range(n)}
        return change_of_basis(self.group, combined, name=f"{self.group.name}_metric"), moments


def kinetic_energy_metric(group: GroupLike, inertia: Any) -> KineticMetric:
    """The left-invariant metric xi^T I xi on a group, with its lengths, geodesics and distance.

    Args:
        group: the group.
        inertia: positive definite: a number, (n,) or (n, n), numbers or exact texts. [kg m^2, kg ...]

    Raises:
        InputError, ShapeError: it is not.

    Source: Geyer, (11), with the kinetic energy (4).
    """
    group = as_group(group, "kinetic_energy_metric")
    if inertia is None:
        raise InputError("kinetic_energy_metric: give an inertia, a number for a multiple of the identity")
    return KineticMetric(group, sp.ImmutableMatrix(positive_matrix(inertia, group.dim, "inertia")))
