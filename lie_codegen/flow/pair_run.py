"""What a run of the pair 8(5,3) is: states at times, the steps of a single member, and the states within these."""

from __future__ import annotations

import ctypes
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from lie_codegen.arrays import Array
from lie_codegen.flow.pair_library import compiled_pair
from lie_codegen.flow.pair_system import System


class PairRun(NamedTuple):
    """States at times, of N members, and the steps of one.

    Attributes:
        X, y: (k, N, packed) and (k, N, size) at the times, Theta = 0.
        steps, rejected: of all members together.
        evaluations: of the rate, of many members eight at a time.
        error_estimate: of the entries of X and y: the difference to a run with longer steps, over what the tolerances of the two
            promise; of many members that of the pilot.
        left: what interpolation between steps may add to the error.
        knots: (steps, 2 + m + size) the start, the length and the state of every step of a single member: `knot_t`, `knot_h`, `knot_X`,
            `knot_y`; else (0, ...).
    """

    X: Array
    y: Array
    steps: int
    rejected: int
    evaluations: int
    error_estimate: float
    left: float
    knots: Array

    @property
    def knot_t(self) -> Array:
        """When the steps begin."""
        return np.ascontiguousarray(self.knots[:, 0])

    @property
    def knot_h(self) -> Array:
        """How long they are."""
        return np.ascontiguousarray(self.knots[:, 1])

    @property
    def knot_X(self) -> Array:
        """X where they begin; nothing where y holds it."""
        return np.ascontiguousarray(self.knots[:, 2 : self.knots.shape[1] - self.y.shape[-1]])

    @property
    def knot_y(self) -> Array:
        """y where they begin."""
        return np.ascontiguousarray(self.knots[:, self.knots.shape[1] - self.y.shape[-1] :])

    def estimated(self, error: float) -> PairRun:
        """The same with this estimate of its error."""
        if error == self.error_estimate:
            return self
        return PairRun(self.X, self.y, self.steps, self.rejected, self.evaluations, error, self.left, self.knots)

    def within(self, system: System, knots: NDArray[np.intp], parts: Array) -> tuple[Array, Array]:
        """X and y the fractions `parts` of the way through the steps `knots`, by fresh steps of a single member."""
        if self.knots.shape[1] != 2 + system.kept + system.size:  # from a file of before states were kept as elements
            return self._lifted(system).within(system, knots, parts)
        at = np.ascontiguousarray(knots, dtype=np.intp)
        part = np.ascontiguousarray(parts, dtype=float)
        X, y = np.empty((len(at), system.packed)), np.empty((len(at), system.size))
        given, columns = system.record(), (self.knot_t, self.knot_h, self.knot_X, self.knot_y)
        work = system.work()
        given.knot_t, given.knot_h, given.knot_X, given.knot_y = (each.ctypes.data for each in columns)
        given.work = work.ctypes.data
        library = compiled_pair()
        library.pair_within(
            ctypes.addressof(given), len(at), at.ctypes.data, part.ctypes.data, X.ctypes.data, y.ctypes.data
        )
        return X, y

    def _lifted(self, system: System) -> PairRun:
        """The same with the elements of the knots in y instead of Theta = 0 and X beside it."""
        lift, vectors, y = system.lift, system.size - system.group, self.knot_y
        elements = np.array([lift(X) for X in self.knot_X]) if lift is not None else y[:, :0]
        knots = np.concatenate([self.knots[:, :2], elements, y[:, y.shape[1] - vectors :]], axis=1)
        return self._replace(y=np.empty((0, 1, system.size)), knots=knots)

    def at(self, system: System, times: Array) -> tuple[Array, Array]:
        """X and y at times within the run of a single member."""
        begun = self.knot_t
        knots = np.searchsorted(begun, times, side="right") - 1
        return self.within(system, knots, (times - begun[knots]) / self.knot_h[knots])
