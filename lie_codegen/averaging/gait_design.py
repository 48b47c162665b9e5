"""lc.gait: the best gait of a connection by Fourier series, |d| / sqrt(E T) with E = int r'^T (M_22 - M_21 A) r' dt.

At the optimum the speed along the path is optimal too, and the ratio is displacement by metric length. Gradients are exact: the whole computation (metric, Magnus
exponents, product of exponentials) is analytic in the coefficients and is run at complex ones.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.algebra.brackets import bracket
from lie_codegen.arrays import Array
from lie_codegen.averaging.gait_path import gait_of_fourier, gait_path
from lie_codegen.averaging.path_end import product_of
from lie_codegen.averaging.shape_connection import ShapeConnection
from lie_codegen.errors import InputError
from lie_codegen.exact.counts import count_between
from lie_codegen.flow.logarithm import matrix_log
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernel.saved import Saved
from lie_codegen.signals.periodic_input import PeriodicInput

_COMPLEX_STEP = 1e-30
_SERIES = 14
_SETTLED, _MOST_STEPS = 1e-7, 300


@dataclass(frozen=True, eq=False, repr=False)
class Gait(Saved):
    """A gait that was found.

    Attributes:
        r: the shape r(t), of period 2 pi.
        X: (d, d) its displacement X(T); log: (n,) log X(T).
        distance: what was maximised, |translation of X(T)|, or the component named.
        rotation: the norm of the angles of log X(T).
        energy: E = int r'^T (M_22 - M_21 A) r' dt over T = 2 pi.
        efficiency: distance / sqrt(E T).
        objective: efficiency - penalty rotation^2, at a local maximum.
    """

    r: PeriodicInput
    X: Array
    log: Array
    distance: float
    rotation: float
    energy: float
    efficiency: float
    objective: float


def gait(
    connection: ShapeConnection,
    *,
    maximise: str = "distance",
    harmonics: int = 3,
    penalty: float = 10.0,
    start: Any = None,
    centre: ArrayLike | None = None,
    amplitude: float = 1.0,
    steps: int = 64,
) -> Gait:
    """A gait of locally greatest displacement by effort: BFGS with exact gradients.

    Args:
        connection: of a body with k >= 2 shapes.
        maximise: "distance", the length of the translation of X(T) (of log X(T) where the group has none), or the label of a component of log X(T).
        harmonics: of the Fourier series of each shape.
        penalty: times the square of the rotation of X(T), for a gait that goes straight; without it the search turns away.
        start: gait to begin with; a circle of the first two shapes otherwise, in the better direction.
        centre, amplitude: of the start.
        steps: Magnus steps a period during the search; the result is computed to 1e-12 anew.

    Raises:
        InputError: an unknown label, one shape only, harmonics outside 1 to 1000, steps outside 4 harmonics to 100,000.
    """
    group, k = connection.group, connection.size
    if k < 2:
        raise InputError(
            "gait: with one shape coordinate a gait goes back on its own way and moves nothing; two are needed"
        )
    if maximise != "distance" and maximise not in group.labels:
        raise InputError(f'gait: maximise is "distance" or one of {", ".join(group.labels)}, got {maximise!r}')
    harmonics = count_between(harmonics, 1, 1000, "gait: harmonics")
    # a harmonic needs four steps of its own: with fewer the search climbs an error of the steps, which has no top
    steps = count_between(steps, 4 * harmonics, 100_000, "gait: steps, at least four a harmonic,")
    if start is None:
        starts = [PeriodicInput(["cos(t)", f"{sign}*sin(t)", *["0"] * (k - 2)], period="2*pi") for sign in ("1", "-1")]
    else:
        starts = [start]
    search = _Search(connection, maximise, harmonics, float(penalty), steps)
    tables = [_table(gait_path(each, k, amplitude, centre).fourier, k, harmonics) for each in starts]
    # of the two directions the better one: the other would have to turn round first
    best = max(tables, key=lambda table: float(search.objective(table)))
    return _finished(connection, search, _climbed(search, best))


class _Search:
    """The objective as a function of real Fourier coefficients (k, 2 harmonics + 1): mean, cosines, sines."""

    def __init__(self, connection: ShapeConnection, maximise: str, harmonics: int, penalty: float, steps: int) -> None:
        self.connection, self.maximise, self.harmonics, self.penalty = connection, maximise, harmonics, penalty
        self.group = connection.group
        self.basis = _real_basis(self.group)
        self.steps, self.h = steps, 2 * np.pi / steps
        points = 0.5 + np.array([-1, 1]) * np.sqrt(3) / 6
        times = (self.h * (np.arange(steps)[:, None] + points)).ravel()
        n = np.arange(1, harmonics + 1)
        angles = times[:, None] * n
        self.values = np.hstack([np.ones((len(times), 1)), np.cos(angles), np.sin(angles)])
        self.rates = np.hstack([np.zeros((len(times), 1)), -n * np.sin(angles), n * np.cos(angles)])
        self.angles, self.lengths = _kinds(self.group)

    def parts(self, p: Array) -> tuple[Any, Any, Any]:
        """distance, sum of squares of angles, energy; analytic in p of any leading shape."""
        p = p.reshape(*p.shape[:-1], self.connection.size, -1)
        r, rate = np.einsum("tc,...kc->...tk", self.values, p), np.einsum("tc,...kc->...tk", self.rates, p)
        A = self.connection.A(r)
        u = -np.einsum("...nk,...k->...n", A, rate)
        metric = self.connection.metric(r)
        energy = (self.h / 2) * np.einsum("...tk,...tkl,...tl->...", rate, metric, rate)
        first, second = u[..., 0::2, :], u[..., 1::2, :]
        # two Gauss points a step, X' = X u: Omega = h (u_1 + u_2) / 2 + sqrt(3) h^2 [u_1, u_2] / 12
        omega = self.h / 2 * (first + second)
        omega = omega + np.sqrt(3) / 12 * self.h**2 * bracket(self.group.algebra, first, second)
        X = _product(_exp(np.einsum("...n,nab->...ab", omega, self.basis)))
        log = self._log(X)
        rotation = np.sum(log[..., self.angles] ** 2, axis=-1)
        if self.maximise != "distance":
            return log[..., self.group.labels.index(self.maximise)], rotation, energy
        moved = X[..., :-1, -1] if self.lengths is not None else log
        return np.sqrt(np.sum(moved**2, axis=-1)), rotation, energy

    def objective(self, p: Array) -> Any:
        """distance / sqrt(E T) - penalty rotation^2."""
        distance, rotation, energy = self.parts(p)
        penalty = 0 if len(self.angles) == self.group.dim else self.penalty
        return distance / np.sqrt(2 * np.pi * energy) - penalty * rotation

    def gradient(self, p: Array) -> Array:
        """Exact to rounding, from one evaluation at as many complex points as there are numbers."""
        return np.asarray(self.objective(p + 1j * _COMPLEX_STEP * np.eye(len(p))).imag / _COMPLEX_STEP)

    def _log(self, X: Array) -> Array:
        """log X in the algebra, by roots and a series; analytic."""
        from lie_codegen.flow.batched_exponential import logm

        flat = self.basis.reshape(len(self.basis), -1)
        inverse = np.linalg.pinv(flat)
        value = np.asarray(logm(X))
        return value.reshape(*value.shape[:-2], -1) @ inverse


def _table(fourier: Array | None, k: int, harmonics: int) -> Array:
    """The numbers of a start: mean, cosines, sines of each shape."""
    if fourier is None:
        raise InputError("gait: start with a smooth gait, sums of sines and cosines")
    c = np.zeros((k, harmonics + 1), dtype=complex)
    have = min(harmonics, fourier.shape[1] - 1)
    c[:, : have + 1] = fourier[:, : have + 1]
    p = np.hstack([c[:, :1].real, 2 * c[:, 1:].real, -2 * c[:, 1:].imag]).ravel()
    # a circle about the middle is a saddle in its higher harmonics: a small push off it
    return np.asarray(p + 1e-3 * np.cos(np.arange(len(p))))


def _climbed(search: _Search, p: Array) -> Array:
    from scipy.optimize import minimize

    found = minimize(
        lambda q: -float(search.objective(q)),
        p,
        jac=lambda q: -search.gradient(q),
        method="BFGS",
        options={"gtol": _SETTLED, "maxiter": _MOST_STEPS},
    )
    return np.asarray(found.x)


def _finished(connection: ShapeConnection, search: _Search, p: Array) -> Gait:
    k = connection.size
    table = p.reshape(k, -1)
    H = search.harmonics
    path = gait_of_fourier(np.hstack([table[:, :1], (table[:, 1 : H + 1] - 1j * table[:, H + 1 :]) / 2]), 2 * np.pi)
    X = connection.path_displacement(path)
    log = np.asarray(matrix_log(connection.group, X)[0])
    _, _, energy = search.parts(p)
    if search.maximise != "distance":
        distance = float(log[connection.group.labels.index(search.maximise)])
    else:
        distance = float(np.linalg.norm(X[:-1, -1] if search.lengths is not None else log))
    rotation = float(np.linalg.norm(log[search.angles]))
    efficiency = distance / float(np.sqrt(2 * np.pi * energy))
    penalty = 0.0 if len(search.angles) == connection.group.dim else search.penalty
    r = PeriodicInput.from_fourier(table[:, 1 : H + 1].T, table[:, H + 1 :].T, mean=table[:, 0], period="2*pi")
    return Gait(r, X, log, distance, rotation, float(energy), efficiency, efficiency - penalty * rotation**2)


def _kinds(group: MatrixGroup) -> tuple[Array, Array | None]:
    """Positions of the angles, and of the lengths where the last column of X is a translation."""
    lengths = np.array([i for i, unit in enumerate(group.units) if unit.split("/")[0] == "m"], dtype=int)
    angles = np.array([i for i in range(group.dim) if i not in lengths], dtype=int)
    affine = not np.any(group.basis[:, -1, :]) and len(lengths) > 0
    return angles, lengths if affine else None


def _real_basis(group: MatrixGroup) -> Array:
    """(n, d, d) real matrices; complex ones as blocks [[re, -im], [im, re]], so that complex steps stay free."""
    if not group.is_complex:
        return group.basis
    return np.array([np.block([[m.real, -m.imag], [m.imag, m.real]]) for m in group.basis])


def _exp(A: Array) -> Array:
    """exp of small matrices by Taylor's series: a step turns by far less than one."""
    identity = np.broadcast_to(np.eye(A.shape[-1]), A.shape)
    total = identity
    for j in range(_SERIES, 0, -1):
        total = identity + A @ total / j
    return np.asarray(total)


def _product(steps: Array) -> Array:
    """(..., N, d, d) -> (..., d, d) in order."""
    return product_of(np.moveaxis(steps, -3, 0))
