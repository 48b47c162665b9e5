"""lc.Uncertain: an element of a group with a covariance; lc.fuse: several estimates of one element into one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.door import warn_caller
from lie_codegen.errors import ComputationError, InputError, NotFiniteError, ShapeError, SpreadWarning
from lie_codegen.exact.counts import seeded
from lie_codegen.groups.build import library_of
from lie_codegen.groups.catalogue_load import as_group
from lie_codegen.groups.maps.admission import admitted
from lie_codegen.groups.maps.covariance import compounded, flowed, transported
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernel.saved import Saved
from lie_codegen.runtime.rows import row_by_row
from lie_codegen.shapes import shaped
from lie_codegen.values import settle

_MOST_STEPS = 50
_SETTLED = 1e-13


@dataclass(frozen=True, eq=False, repr=False)
class Uncertain(Saved):
    """The random element X exp(hat xi), xi ~ (mean_shift, covariance): the noise is on the body side.

    Attributes:
        group: the group; its name or its file may be given.
        X: (d, d) element; projected where it is within 1e-5 of the group.
        covariance: (n, n) of xi, symmetric, no negative eigenvalue, in the units of the basis.
        mean_shift: (n,) the mean of xi; zero but for compounds of fourth order.

    Raises:
        ShapeError, NotFiniteError, InputError: about what does not fit.
        NotOnGroupError: X is not on the group; says how far off.
    """

    group: MatrixGroup
    X: Array
    covariance: Array
    mean_shift: Array = None  # type: ignore[assignment]

    def __post_init__(self) -> None:
        group = as_group(self.group)
        shift = np.zeros(group.dim) if self.mean_shift is None else np.asarray(self.mean_shift, dtype=float)
        if shift.shape != (group.dim,) or not np.all(np.isfinite(shift)):
            raise ShapeError(f"Uncertain: mean_shift is ({group.dim},) finite numbers, given {shift.shape}")
        settle(
            self,
            group=group,
            X=admitted(group, self.X, "Uncertain: X").X,
            covariance=_covariance(self.covariance, group.dim, "Uncertain: covariance"),
            mean_shift=shift,
        )
        _warn_wide(self)

    def compound(self, other: Uncertain, order: Literal[2, 4] = 4) -> Uncertain:
        """X1 exp(hat a) X2 exp(hat b), a and b independent, about X1 X2.

        Args:
            other: of the same group.
            order: in the deviations; see `lie_codegen.groups.maps.covariance` for the formulas. On groups of nilpotency
                class 2 the fourth order is exact.

        Raises:
            InputError: another group, or another order.
        """
        self._same(other, "compound")
        if order not in (2, 4):
            raise InputError(f"Uncertain.compound: order is 2 or 4, given {order!r}")
        back = np.linalg.inv(self._adjoint(other.X))
        first = transported(back, self.covariance)
        total, shift = compounded(self.group.algebra.ad_matrices, first, other.covariance, order)
        # Means of the parts add to first order; their products are of sixth order in the deviations.
        shift = shift + back @ self.mean_shift + other.mean_shift
        return Uncertain(self.group, self.X @ other.X, total, shift)

    def inverse(self) -> Uncertain:
        """(X exp(hat xi))^-1 = X^-1 exp(-hat Ad_X xi): the covariance is Ad_X S Ad_X^T, exactly."""
        adjoint = self._adjoint(self.X)
        shift = -adjoint @ self.mean_shift
        return Uncertain(self.group, np.linalg.inv(self.X), transported(adjoint, self.covariance), shift)

    def between(self, other: Uncertain, order: Literal[2, 4] = 4) -> Uncertain:
        """self^-1 other, for independent elements.

        Args:
            other: of the same group.
            order: as in `compound`.

        Raises:
            InputError: another group, or another order.
        """
        self._same(other, "between")
        return self.inverse().compound(other, order)

    def flow(self, u: ArrayLike, duration: float = 1.0, noise: ArrayLike | None = None) -> Uncertain:
        """The element after X' = X hat(u + w), w white noise of density Q, for a constant u: S' = -ad_u S - S ad_u^T + Q.

        Args:
            u: (n,) body velocity.
            duration: T. [time unit]
            noise: (n, n) Q, symmetric, no negative eigenvalue; zero when None.

        Raises:
            ShapeError, NotFiniteError, InputError: about what does not fit; |ad_u| T beyond 1e12, of which rounding leaves nothing.
        """
        n = self.group.dim
        velocity = shaped(u, (n,), "Uncertain.flow: u")
        if not np.all(np.isfinite(velocity)) or not np.isfinite(duration):
            raise NotFiniteError("Uncertain.flow: u or duration is NaN or infinite")
        if duration < 0:
            raise InputError(f"Uncertain.flow: noise does not run backwards; duration = {duration:g} is negative")
        Q = np.zeros((n, n)) if noise is None else _covariance(noise, n, "Uncertain.flow: noise")
        S = flowed(self.group.algebra.ad_matrices, velocity, float(duration), self.covariance, Q)
        step = library_of(self.group).exp(np.ascontiguousarray(duration * velocity))
        shift = np.linalg.inv(self._adjoint(step)) @ self.mean_shift
        return Uncertain(self.group, self.X @ step, S, shift)

    def samples(self, count: int, seed: int = 0) -> Array:
        """(count, d, d) random elements, xi Gaussian; the same for the same seed.

        Args:
            count: how many.
            seed: of the generator of random numbers.

        Raises:
            ArgumentError: a count or a seed that is negative or no integer.
        """
        rng = seeded(seed, f"samples({self.group.name})")
        values, vectors = np.linalg.eigh(self.covariance)
        root = vectors * np.sqrt(np.maximum(values, 0))
        xi = self.mean_shift + rng.normal(size=(count, self.group.dim)) @ root.T
        moved: Array = self.X @ row_by_row(library_of(self.group).exp, np.ascontiguousarray(xi))[0]
        return moved

    def _adjoint(self, X: Array) -> Array:
        return np.asarray(library_of(self.group).Ad(np.ascontiguousarray(X)))

    def _same(self, other: Uncertain, where: str) -> None:
        if not isinstance(other, Uncertain) or other.group != self.group:
            raise InputError(
                f"Uncertain.{where}: the other must be an lc.Uncertain on {self.group.name}, given {other!r:.80}"
            )


def fuse(estimates: Sequence[Uncertain]) -> Uncertain:
    """The most probable element under independent estimates (Z_i, S_i) of it, with its covariance.

    Minimises sum_i e_i^T S_i^-1 e_i, e_i = log(Z_i^-1 X), by Gauss-Newton steps X <- X exp(hat d) with J_i =
    rjac_inv(e_i): H d = -sum J_i^T S_i^-1 e_i, H = sum J_i^T S_i^-1 J_i; the covariance is H^-1.

    Raises:
        InputError: no estimate, several groups, or a covariance that is singular (an exact estimate needs no fusing).
        ComputationError: the steps do not settle, or an e_i has no logarithm: the estimates are too far apart.
    """
    parts = list(estimates)
    if not parts or not all(isinstance(each, Uncertain) and each.group == parts[0].group for each in parts):
        raise InputError("fuse: give one lc.Uncertain at least, all on one group")
    group = parts[0].group
    lib = library_of(group)
    information = [_information(each, i) for i, each in enumerate(parts)]
    X = parts[int(np.argmax([np.trace(each) for each in information]))].X
    last, size = np.inf, np.inf
    for _ in range(_MOST_STEPS):
        with np.errstate(all="ignore"):
            errors = [np.asarray(lib.log(np.ascontiguousarray(np.linalg.solve(each.X, X)))) for each in parts]
        if not np.all(np.isfinite(errors)):
            raise ComputationError(
                f"fuse on {group.name}: an estimate has no logarithm seen from the others: too far apart"
            )
        jacobians = [np.asarray(lib.rjac_inv(error)) for error in errors]
        normal = sum(J.T @ W @ J for J, W in zip(jacobians, information, strict=True))
        # An estimate with a mean shift is centred there: e_i is compared with it.
        slope = sum(
            J.T @ W @ (e - each.mean_shift) for J, W, e, each in zip(jacobians, information, errors, parts, strict=True)
        )
        step = -np.linalg.solve(normal, slope)
        last, size = size, float(np.linalg.norm(step))
        X = X @ lib.exp(step)
        if size <= _SETTLED or (size <= 1e3 * _SETTLED and size >= last / 2):
            return Uncertain(group, X, np.linalg.inv(normal))
    raise ComputationError(
        f"fuse on {group.name}: {_MOST_STEPS} steps do not settle, the last was {size:.3g}: too far apart"
    )


def _information(estimate: Uncertain, number: int) -> Array:
    S = estimate.covariance
    values = np.linalg.eigvalsh(S)
    if values[0] <= 1e-14 * max(values[-1], 1e-300):
        raise InputError(f"fuse: the covariance of estimate {number} is singular; give every direction a deviation")
    return np.asarray(np.linalg.inv(S))


def _covariance(given: ArrayLike, n: int, where: str) -> Array:
    S: Array = np.asarray(given, dtype=float)
    if S.shape != (n, n):
        raise ShapeError(f"{where} has shape {S.shape}, ({n}, {n}) is needed")
    if not np.all(np.isfinite(S)):
        raise NotFiniteError(f"{where} holds NaN or infinity")
    scale = float(np.max(np.abs(S), initial=0.0))
    if np.max(np.abs(S - S.T), initial=0.0) > 1e-9 * scale:
        raise InputError(f"{where} is not symmetric: the largest difference is {np.max(np.abs(S - S.T)):.3g}")
    S = np.asarray((S + S.T) / 2)
    if scale and np.linalg.eigvalsh(S)[0] < -1e-9 * scale:
        raise InputError(f"{where} has the negative eigenvalue {np.linalg.eigvalsh(S)[0]:.3g}: no covariance")
    return S


def _warn_wide(estimate: Uncertain) -> None:
    """A Gaussian that reaches the cut of the logarithm is no longer the law of one element."""
    values, vectors = np.linalg.eigh(estimate.covariance)
    reach = (3 * np.sqrt(np.maximum(values, 0)) * vectors).T
    angles = np.abs(np.linalg.eigvals(estimate.group.hat(reach)).imag)
    if np.max(angles, initial=0.0) > np.pi:
        warn_caller(
            f"Uncertain on {estimate.group.name}: three deviations turn by {np.max(angles):.3g} rad, beyond the half turn where "
            "rotations meet again: the Gaussian is truncated there, which no formula here accounts for",
            SpreadWarning,
        )
