"""crocoddyl's box-FDDP on a bounded task: an action model in Python, exact steps and derivatives, bounds as its own, least energy.

State: the entries of X, real and imaginary parts as coordinates. The end is a penalty w |X - goal|^2, the goal with the nearest phase
where that is free, as box-FDDP has no end conditions; w grows in three runs, each from the last.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.benchmarks.bounded_cases import BoundedCase
from lie_codegen.flow.batched_exponential import expm
from lie_codegen.steering.direct.chain import exponentials

_PENALTIES = (1e2, 1e4, 1e6)
_MOST = 100
_NEAR = 1e-4


def crocoddyl(case: BoundedCase) -> Any:
    """One start of box-FDDP.

    Raises:
        ImportError: crocoddyl is not installed.
    """
    import crocoddyl as solver_library  # type: ignore[import-not-found]

    moving, arriving = _models(solver_library, case)
    d, kind = case.group.degree, case.group.basis.dtype

    def start(target: Array, seed: int) -> Array | None:
        u = 0.3 * case.bound * np.random.default_rng(seed).uniform(-1, 1, (case.pieces, len(case.directions)))
        X = np.eye(d, dtype=kind)
        states = [_entries(X)]
        for step in expm(case.group.hat(case.duration / case.pieces * (case.drift + u @ case.directions))):
            X = X @ step
            states.append(_entries(X))
        controls = list(u)
        running = moving()
        for weight in _PENALTIES:
            end = arriving(target, weight)
            problem = solver_library.ShootingProblem(states[0], [running] * case.pieces, end)
            solver = solver_library.SolverBoxFDDP(problem)
            solver.solve(states, controls, _MOST, True)
            states, controls = [np.array(x) for x in solver.xs], [np.array(v) for v in solver.us]
        return np.array(controls) if end.miss(states[-1]) < _NEAR else None

    return start


def _entries(X: Array) -> Array:
    """(q,) the entries of a matrix, real parts and imaginary parts."""
    return np.concatenate([X.real.ravel(), X.imag.ravel()]) if np.iscomplexobj(X) else X.ravel()


def _models(library: Any, case: BoundedCase) -> tuple[Any, Any]:
    """The classes of the running and the terminal model."""
    d, m, h = case.group.degree, len(case.directions), case.duration / case.pieces
    complex_ = case.unitary
    size = d * d * (2 if complex_ else 1)
    drift, directions = h * case.group.hat(case.drift), h * case.group.hat(case.directions)
    state = library.StateVector(size)

    def matrix(x: Array) -> Array:
        return (x[: d * d] + 1j * x[d * d :]).reshape(d, d) if complex_ else x.reshape(d, d)

    def from_right(E: Array) -> Array:
        """The matrix of X -> X E on the entries."""
        big = np.kron(np.eye(d), E.T)
        return np.block([[big.real, -big.imag], [big.imag, big.real]]) if complex_ else big

    class Moving(library.ActionModelAbstract):  # type: ignore[misc]
        def __init__(self) -> None:
            library.ActionModelAbstract.__init__(self, state, m)
            self.u_lb, self.u_ub = np.full(m, -case.bound), np.full(m, case.bound)

        def calc(self, data: Any, x: Array, u: Array | None = None) -> None:
            if u is not None:
                data.xnext = _entries(matrix(x) @ expm(drift + np.tensordot(u, directions, 1)))
                data.cost = h * float(u @ u)

        def calcDiff(self, data: Any, x: Array, u: Array | None = None) -> None:
            if u is not None:
                E, slopes = exponentials(drift + np.tensordot(u, directions, 1), directions)
                data.Fx = from_right(E)
                data.Fu = np.column_stack([_entries(matrix(x) @ slope) for slope in slopes])
                data.Lu = 2 * h * u
                data.Luu = 2 * h * np.eye(m)

    class Arriving(library.ActionModelAbstract):  # type: ignore[misc]
        def __init__(self, target: Array, weight: float) -> None:
            library.ActionModelAbstract.__init__(self, state, m)
            self._target, self._weight = target, weight

        def _goal(self, X: Array) -> Array:
            if not case.up_to_phase:
                return self._target
            overlap = np.vdot(self._target, X)
            return np.asarray(overlap / abs(overlap) * self._target)

        def miss(self, x: Array) -> float:
            X = matrix(x)
            return float(np.max(np.abs(X - self._goal(X))))

        def calc(self, data: Any, x: Array, u: Array | None = None) -> None:
            X = matrix(x)
            data.cost = self._weight * float(np.sum(np.abs(X - self._goal(X)) ** 2))

        def calcDiff(self, data: Any, x: Array, u: Array | None = None) -> None:
            X = matrix(x)
            goal = self._goal(X)
            data.Lx = 2 * self._weight * _entries(X - goal)
            data.Lxx = 2 * self._weight * np.eye(size)
            if case.up_to_phase:  # the goal follows along i times itself: nothing is lost in that direction
                along = _entries(1j * goal) / np.sqrt(d)
                data.Lxx = data.Lxx - 2 * self._weight * np.outer(along, along)

    return Moving, Arriving
