"""Controls as Fourier series over the manoeuvre, the averaged and the exact endpoint they lead to.

u_i(t) = c_i0 + sum_{k=1}^{K} (c_ik cos(2 pi k t) + s_ik sin(2 pi k t)), unit time. With U~ = int U, to second order of
averaging (single exponential; Leonard and Krishnaprasad, TR 93-59, Theorem 4 with its mean part put right)
    log X(1) = int_0^1 U dt + 1/2 int_0^1 [U~, U] dt,
a quadratic form of the coefficients: the means, and the areas of the projected loops times the structure constants.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.steering.closed_form.endpoint import flow_end

_STEPS_A_HARMONIC = 32
_MOST_FACTOR = 8  # a solver may try controls of any size


@dataclass(frozen=True)
class Family:
    """Fourier controls of a system; a member is its coefficients c, (m, 1 + 2 K), flattened.

    Attributes:
        group, controls: the system; controls are positions.
        harmonics: K.
    """

    group: MatrixGroup
    controls: tuple[int, ...]
    harmonics: int

    @property
    def shape(self) -> tuple[int, int]:
        """(m, 1 + 2 K)."""
        return len(self.controls), 1 + 2 * self.harmonics

    def waves(self, t: Array) -> Array:
        """(k, 1 + 2 K): 1, cos, sin, cos 2, sin 2 ... at the times t."""
        columns = [np.ones_like(t)]
        for k in range(1, self.harmonics + 1):
            columns += [np.cos(2 * np.pi * k * t), np.sin(2 * np.pi * k * t)]
        return np.stack(columns, axis=-1)

    def evaluate(self, c: Array, t: Array) -> Array:
        """(k, m) the controls."""
        return np.asarray(self.waves(t) @ c.reshape(self.shape).T)

    @cached_property
    def energy_weights(self) -> Array:
        """w with int |u|^2 = sum w c^2."""
        return np.tile(np.array([1.0] + [0.5] * (2 * self.harmonics)), len(self.controls))

    @cached_property
    def _area_forms(self) -> Array:
        """(2 K + 1, 2 K + 1) B: 1/2 int (U~_i U_j - U~_j U_i) = c_i B c_j, exact."""
        size = 1 + 2 * self.harmonics
        B = np.zeros((size, size))
        for k in range(1, self.harmonics + 1):
            w = 2 * np.pi * k
            cos, sin = 2 * k - 1, 2 * k
            B[cos, sin], B[sin, cos] = 0.5 / w, -0.5 / w
            B[sin, 0], B[0, sin] = 1 / w, -1 / w
        return B

    @cached_property
    def _brackets(self) -> Array:
        """(m, m, n) structure constants of the controls."""
        return np.asarray(self.group.algebra.structure_constants[np.ix_(self.controls, self.controls)])

    def averaged(self, c: Array) -> tuple[Array, Array]:
        """log X(1) to second order, (n,), and its derivative by c, (n, m (1 + 2 K))."""
        rows = c.reshape(self.shape)
        gamma = self._brackets
        moved = rows @ self._area_forms.T
        areas = rows @ self._area_forms @ rows.T
        value = np.einsum("ij,ijk->k", areas, gamma) / 2
        slope = np.einsum("jp,ijk->kip", moved, gamma)
        value[list(self.controls)] += rows[:, 0]
        for number, position in enumerate(self.controls):
            slope[position, number, 0] += 1.0
        return value, slope.reshape(self.group.dim, -1)

    def exact(self, c: Array, refine: int = 1) -> tuple[Array, Array]:
        """X(1), (d, d), and vee(X^-1 dX / dc), (n, m (1 + 2 K)), by RKMK4 and Simpson's rule.

        The endpoint is good to about 1e-7, with refine=16 to 1e-13.
        """
        steps = _STEPS_A_HARMONIC * (1 + self.harmonics)
        steps *= int(np.clip(np.sqrt(np.sum(self.energy_weights * c * c)) / 8, 1, _MOST_FACTOR))
        X, s, carried = flow_end(self.group, self.controls, lambda s: self.evaluate(c, s), steps, refine)
        return X, np.einsum("kin,kp->nip", carried, self.waves(s)).reshape(self.group.dim, -1)

    def fitted(self, u: Array, t: Array) -> Array:
        """The member nearest to samples u, (k, m), on a uniform grid t of [0, 1]."""
        waves = self.waves(t)
        return np.asarray(np.linalg.lstsq(waves, u, rcond=None)[0].T.ravel())
