"""The values of a connection xi = -A(r) r': A, its curvature, the metric of shapes, the end of a gait and its area integral."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.averaging.gait_path import GaitPath, gait_path
from lie_codegen.averaging.path_end import end_of
from lie_codegen.averaging.shape_frame import ShapeFrame
from lie_codegen.errors import InputError, ShapeError
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernel.saved import Saved
from lie_codegen.on_demand import sympy as sp

#: Step of the complex differences that give exact first derivatives of analytic formulas.
_COMPLEX_STEP = 1e-30
#: |M_11| is singular where its smallest singular value is below about this part of the largest.
_SINGULAR = 1e-11


@dataclass(frozen=True, eq=False, repr=False)
class ShapeForm(Saved):
    """A principal connection: xi = -A(r) r'.

    Attributes:
        group: of the body's configurations.
        shape: names of the k shape coordinates.
        exact_A: (n, k) formulas of A; None where a metric is given.
        exact_metric: (n + k, n + k) formulas of M on (xi, r'), symmetric; None where A is given.
        frame: a change of body frame X -> X h(r), or None.
    """

    group: MatrixGroup
    shape: tuple[str, ...]
    exact_A: sp.ImmutableMatrix | None
    exact_metric: sp.ImmutableMatrix | None
    frame: ShapeFrame | None = None

    @property
    def size(self) -> int:
        """k."""
        return len(self.shape)

    def A(self, r: ArrayLike) -> Array:
        """A(r): (..., k) -> (..., n, k).

        Raises:
            InputError: M_11 is singular there.
        """
        return self._framed(self._shape(r))

    def metric(self, r: ArrayLike) -> Array:
        """M_22 - M_21 A, the metric of shape velocities at zero momentum, (..., k, k); the identity where A alone is given."""
        at = self._shape(r)
        if self.exact_metric is None:
            return np.broadcast_to(np.eye(self.size), (*at.shape[:-1], self.size, self.size))
        n, M = self.group.dim, self._values("M", at)
        return np.asarray(M[..., n:, n:] - M[..., n:, :n] @ self._plain(at))

    def curvature(self, r: ArrayLike) -> Array:
        """DA_ij(r) = d_i A_j - d_j A_i - [A_i, A_j]: (..., k) -> (..., k, k, n)."""
        at, c = self._shape(r), self.group.algebra.structure_constants
        A = self._plain(at)
        slopes = self._slopes(at)  # (..., i, n, j) = d_i A_j
        forward = np.einsum("...inj->...ijn", slopes)
        DA = forward - np.swapaxes(forward, -3, -2) - np.einsum("...ai,...bj,abc->...ijc", A, A, c)
        return DA if self.frame is None else self.frame.turned(at, DA)

    def displacement(self, gait: Any, *, amplitude: float = 1.0, centre: ArrayLike | None = None) -> Array:
        """X(T) of X' = X hat(-A(r) r'), X(0) = 1, after one period of r(t) = centre + amplitude s(t), (d, d).

        Sixth-order Magnus steps, twice as many until X(T) is settled to 1e-12.

        Args:
            gait: s, a PeriodicInput of the shape, or (N, k) corners whose last is the first.

        Raises:
            InputError: the gait does not close, or M_11 is singular at a point of it.
        """
        path = gait_path(gait, self.size, amplitude, centre)
        return self.path_displacement(path)

    def path_displacement(self, path: GaitPath) -> Array:
        """The same of a resolved path."""
        end = end_of(self.group, lambda t: self._velocity(path, t), path.knots)
        if self.frame is None:
            return end
        h = self.frame.element(path.at(np.zeros(1))[0][0])
        return np.asarray(np.linalg.solve(h, end @ h))

    def cbvi(self, gait: Any, *, amplitude: float = 1.0, centre: ArrayLike | None = None, nodes: int = 24) -> Array:
        """The corrected body velocity integral -int int DA over the region that the gait encloses, (n,).

        It approximates log X(T), best in the frame of `best_frame`. The region is swept by segments from the mean of the gait, which
        counts what is enclosed twice twice.

        Args:
            gait, amplitude, centre: as `displacement`.
            nodes: of Gauss's rule along the segments.
        """
        path = gait_path(gait, self.size, amplitude, centre)
        x, weights = np.polynomial.legendre.leggauss(nodes)
        scale, weights = (x + 1) / 2, weights / 2
        times, spans = [], []
        for a, b in zip(path.knots, path.knots[1:], strict=False):
            y, v = np.polynomial.legendre.leggauss(max(16, 6 * nodes // max(1, len(path.knots) - 1)))
            times.append(a + (b - a) * (y + 1) / 2)
            spans.append(v * (b - a) / 2)
        when, span = np.concatenate(times), np.concatenate(spans)
        r, rate = path.at(when)
        middle = span @ r / path.T
        arm = r - middle
        DA = self.curvature(middle + scale[:, None, None] * arm)  # (nodes, times, k, k, n)
        # the two-form on the cone: lambda ((r - c)_i r'_j - (r - c)_j r'_i) / 2 summed over all i, j
        area = np.einsum("ti,tj->tij", arm, rate)
        return -np.asarray(np.einsum("a,t,tij,atijn->n", weights * scale, span, area, DA))

    def locked_inverse(self, r: ArrayLike) -> Array:
        """M_11^-1, (..., n, n).

        Raises:
            InputError: no metric is given, or M_11 is singular.
        """
        if self.exact_metric is None:
            raise InputError("a stored momentum needs the metric: give metric= in place of A=")
        at, n = self._shape(r), self.group.dim
        block = self._values("M", at)[..., :n, :n]
        self._check_regular(block, at)
        return np.asarray(np.linalg.inv(block))

    def _shape(self, r: ArrayLike) -> Array:
        given = np.asarray(r)
        at = given if np.iscomplexobj(given) else np.asarray(given, dtype=float)
        if at.shape[-1:] != (self.size,):
            raise ShapeError(f"r has shape {at.shape}; its last axis must be {self.size}: {', '.join(self.shape)}")
        return at

    def _velocity(self, path: GaitPath, t: Array) -> Array:
        r, rate = path.at(t)
        return -np.asarray(np.einsum("tnk,tk->tn", self._plain(r), rate))

    def _framed(self, at: Array) -> Array:
        A = self._plain(at)
        return A if self.frame is None else self.frame.moved(at, A)

    def _plain(self, at: Array) -> Array:
        """A in the original frame, analytic in r."""
        n = self.group.dim
        if self.exact_metric is None:
            return self._values("A", at)
        M = self._values("M", at)
        self._check_regular(M[..., :n, :n], at)
        return np.asarray(np.linalg.solve(M[..., :n, :n], M[..., :n, n:]))

    def _slopes(self, at: Array) -> Array:
        """d_i A_j in the original frame, (..., i, n, j), by complex steps."""
        parts = [self._plain(at + 1j * _COMPLEX_STEP * unit).imag / _COMPLEX_STEP for unit in np.eye(self.size)]
        return np.stack(parts, axis=-3)

    @cached_property
    def _symbols(self) -> tuple[sp.Symbol, ...]:
        return tuple(sp.Symbol(name, real=True) for name in self.shape)

    @cached_property
    def _functions(self) -> dict[str, Any]:
        """The formulas as numpy functions of the shapes, common parts once."""
        given = {"A": self.exact_A, "M": self.exact_metric}
        return {
            key: sp.lambdify(self._symbols, list(matrix), modules="numpy", cse=True)
            for key, matrix in given.items()
            if matrix is not None
        }

    def _values(self, key: str, at: Array) -> Array:
        n, k = self.group.dim, self.size
        kind = complex if np.iscomplexobj(at) else float
        result = np.empty((*at.shape[:-1], *((n, k) if key == "A" else (n + k, n + k))), dtype=kind)
        with np.errstate(divide="ignore", invalid="ignore"):
            entries = self._functions[key](*(at[..., i] for i in range(self.size)))
        for place, entry in enumerate(entries):
            result[..., place // result.shape[-1], place % result.shape[-1]] = entry
        if not np.all(np.isfinite(result)):
            bad = at[~np.all(np.isfinite(result), axis=(-2, -1))]
            raise InputError(
                f"the formulas of the connection have no value at r = {np.real(bad).reshape(-1, self.size)[0].tolist()}"
            )
        return result

    def _check_regular(self, block: Array, at: Array) -> None:
        with np.errstate(all="ignore"):
            # the cofactors over the determinant would do; LAPACK's inverse fails as a whole on one exactly singular matrix
            size = np.abs(block).max(axis=(-2, -1))
            regular = np.abs(np.linalg.det(block / np.where(size > 0, size, 1)[..., None, None])) > 0
            safe = np.where(regular[..., None, None], block, np.eye(self.group.dim))
            bad = ~regular | (np.abs(np.linalg.inv(safe)).max(axis=(-2, -1)) * size > 1 / _SINGULAR)
        if np.any(bad):
            where = np.real(np.broadcast_to(at, (*bad.shape, self.size))[bad]).reshape(-1, self.size)[0]
            raise InputError(
                f"M_11 is singular at r = {np.round(where, 9).tolist()}: the shape does not determine the velocity there; systems with constraints, as "
                "snakeboards, need the nonholonomic momentum equation, which a connection is not"
            )
