"""The critical points of an error function, its least value and the levels below which it is an error function.

    d phi = 0 from many starts by Levenberg and Marquardt: E <- E exp(-(J^T J + mu)^-1 J^T d phi), J = H^T.

It is enough to look at X_d = 1: by compatibility (A2) the flow X' = X hat(P xi_d) carries phi(., X_d) along with X_d, and with it
critical points, values and indices.

Completeness: for a Morse function, proper where the group is not compact, sum (-1)^index is the Euler characteristic: 0 where a maximal
compact subgroup has positive dimension, 1 where the group is contractible. A sum that disagrees says that a point was missed.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, overload

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.control.cut_locus import cut_level
from lie_codegen.control.descent import descend, leads_home, place
from lie_codegen.control.error_catalogue import as_error
from lie_codegen.control.error_function import ErrorFunction
from lie_codegen.control.error_inputs import refuse_inputs
from lie_codegen.control.error_samples import ErrorSamples, basis_scales, error_samples, random_elements
from lie_codegen.control.euler_characteristic import euler_characteristic
from lie_codegen.errors import InputError
from lie_codegen.exact.counts import seeded
from lie_codegen.flow.batched_exponential import expm
from lie_codegen.groups.catalogue_load import GroupLike, as_group
from lie_codegen.kernel.saved import Saved

#: Two points are one where no entry differs by more; eigenvalues of H below the second count as zero.
_SAME, _FLAT = 1e-5, 1e-6
_STEPS, _ROUNDS, _RAYS = 80, 3, 50
#: phi below minus this, relative to its largest value seen, is negative.
_NEGATIVE = 1e-9


@dataclass(frozen=True, eq=False, repr=False)
class CriticalPoint(Saved):
    """A place where d phi = 0.

    Attributes:
        X: (d, d) configuration, the reference being the identity.
        value: phi there.
        index: number of negative eigenvalues of the Hessian.
        nullity: number of those that vanish; above 0 it is one point of a critical manifold.
    """

    X: Array
    value: float
    index: int
    nullity: int


@dataclass(frozen=True, eq=False, repr=False)
class CriticalPoints(Saved, Sequence[CriticalPoint]):
    """The critical points that were found, the reference first, then by value.

    Attributes:
        points: them.
        L: the least critical value other than at the reference: the constant of (A1) and Theorem 4.2; infinite where there is none; None
            where phi is not proper.
        L_component: the least critical value on the boundary of the component of the reference (a mountain pass), L or above it.
        status: "complete" (the sum of (-1)^index is the Euler characteristic), "degenerate" (a critical manifold, which makes that test
            void), "cut" (phi holds a logarithm, which is smooth up to its cut: L is at most the least of phi there), "incomplete" (the sum disagrees: a point was missed), "unchecked" (the Euler characteristic of the group is not known),
            or "not proper" (phi stays bounded on the way to infinity: no L).
        euler: the sum of (-1)^index, None where degenerate.
    """

    points: tuple[CriticalPoint, ...]
    L: float | None
    L_component: float | None
    status: str
    euler: int | None

    @overload
    def __getitem__(self, place: int) -> CriticalPoint: ...
    @overload
    def __getitem__(self, place: slice) -> tuple[CriticalPoint, ...]: ...
    def __getitem__(self, place: Any) -> Any:
        return self.points[place]

    def __len__(self) -> int:
        return len(self.points)

    def __iter__(self) -> Iterator[CriticalPoint]:
        return iter(self.points)


def critical_points(
    error: Any, *, group: GroupLike | None = None, gains: Mapping[str, Any] | None = None, seed: int = 0
) -> CriticalPoints:
    """The critical points of an error function at X_d = 1; see the module.

    Args:
        error: an `ErrorFunction`; or, with `group` and `gains`, what `tracking_law` takes.
        group, gains: for an error given by name or as (phi, transport).
        seed: of the starts.

    Raises:
        InputError: phi is negative somewhere, or zero at another place than the reference; names the place and the value.
    """
    if isinstance(error, ErrorFunction):
        pair = error
    elif group is None:
        raise InputError("critical_points takes an ErrorFunction, or an error by name with group= and gains=")
    else:
        pair = as_error(as_group(group, "critical_points"), error, gains or {})
    return found_points(pair, seed)


@lru_cache(maxsize=64)
def found_points(pair: ErrorFunction, seed: int = 0) -> CriticalPoints:
    """The same, once a process for equal pairs.

    Raises:
        InputError: as `critical_points`.
    """
    samples, rng = error_samples(refuse_inputs(pair)), seeded(seed, "critical_points")
    check_positive(pair, samples, rng)
    if pair.uses_log:
        return _up_to_the_cut(pair, samples, rng)
    proper = not _bounded_ray(samples, rng)
    chi = euler_characteristic(pair.group) if proper else None
    points: list[CriticalPoint] = [_reference(samples)]
    starts, total = max(40, 14 * pair.group.dim), 0
    for _ in range(_ROUNDS):
        points = _merged(points, _search(samples, random_elements(pair.group, starts, rng)), samples)
        degenerate = any(point.nullity for point in points)
        total = sum((-1) ** point.index for point in points)
        if degenerate or chi is None or total == chi:
            break
        starts *= 4
    _check_zeros(pair, points)
    if not proper:
        return CriticalPoints(tuple(points), None, None, "not proper", None if degenerate else total)
    L = points[1].value if len(points) > 1 else float("inf")
    status = (
        "degenerate" if degenerate else "unchecked" if chi is None else "complete" if total == chi else "incomplete"
    )
    return CriticalPoints(tuple(points), L, _mountain_pass(samples, points), status, None if degenerate else total)


def _up_to_the_cut(pair: ErrorFunction, samples: ErrorSamples, rng: np.random.Generator) -> CriticalPoints:
    """The critical points where phi is smooth; none of those that lie on the cut itself."""
    found = _search(samples, random_elements(pair.group, max(40, 14 * pair.group.dim), rng))
    points = _merged([_reference(samples)], found, samples)
    _check_zeros(pair, points)
    L = min(cut_level(samples, rng), points[1].value if len(points) > 1 else float("inf"))
    return CriticalPoints(tuple(points), L, L, "cut", None)


def check_positive(pair: ErrorFunction, samples: ErrorSamples, rng: np.random.Generator) -> None:
    """Looks for the least value of phi: at random places, and downhill from the lowest of them.

    Raises:
        InputError: it is negative.
    """
    E = random_elements(pair.group, 1500, rng)
    with np.errstate(all="ignore"):
        phi, _ = samples.first(E)
    kept = np.isfinite(phi)
    E, phi = E[kept], phi[kept]
    if not len(phi):
        raise InputError(f"error function {pair.name} on {pair.group.name}: phi is nowhere a finite number")
    scale = float(np.max(np.abs(phi)))
    order = np.argsort(phi)
    chosen = np.concatenate([order[:6], order[np.linspace(6, len(order) - 1, 6, dtype=int)]])
    low, values = descend(samples, E[chosen], floor=-10 * scale)
    least = int(np.argmin(values))
    if values[least] < -_NEGATIVE * scale:
        at, value = low[least], float(values[least])
        for polished, exact, _ in _search(samples, low[least][None]):
            at, value = (polished, exact) if exact <= value + _NEGATIVE * scale else (at, value)
        raise InputError(
            f"error function {pair.name} on {pair.group.name} is negative: phi = {value:.6g} at "
            f"{place(pair.group, at)}; an error function is zero at X = X_d and positive elsewhere"
        )


def _parts(samples: Any) -> tuple[Array, Array, Array]:
    return samples.phi, samples.slope, samples.hessian


def _search(samples: ErrorSamples, E: Array) -> list[tuple[Array, float, Array]]:
    """Places where the slope vanishes to rounding, with phi and the symmetric Hessian."""
    n = samples.group.dim
    mu = np.full(len(E), 1e-2)
    with np.errstate(all="ignore"):
        now = samples.at(E)
        size = max(1e-300, float(np.nanmedian(np.linalg.norm(now.slope, axis=1))))
        for _ in range(_STEPS):
            J = np.swapaxes(now.hessian, 1, 2)
            left = np.swapaxes(J, 1, 2) @ J
            damped = left + (mu * np.trace(left, axis1=1, axis2=2) / n + 1e-300)[:, None, None] * np.eye(n)
            good = np.all(np.isfinite(damped), axis=(1, 2))
            damped[~good] = np.eye(n)
            right = np.einsum("nba,nb->na", J, now.slope)
            x = -np.linalg.solve(damped, np.where(good[:, None], right, 0)[..., None])[..., 0]
            x /= np.maximum(1, np.linalg.norm(x / basis_scales(samples.group), axis=1))[:, None]
            moved = samples.moved(E, x)
            new = samples.at(moved)
            better = np.isfinite(new.phi) & (np.linalg.norm(new.slope, axis=1) < np.linalg.norm(now.slope, axis=1))
            E = np.where(better[:, None, None], moved, E)
            now = type(now)(
                *(
                    np.where(better.reshape(-1, *[1] * (a.ndim - 1)), b, a)
                    for a, b in zip(_parts(now), _parts(new), strict=True)
                )
            )
            mu = np.where(better, np.maximum(mu / 10, 1e-15), np.minimum(mu * 4, 1e6))
            if np.all(~better | (np.linalg.norm(now.slope, axis=1) < 1e-13 * size)):
                break
    settled = np.linalg.norm(now.slope, axis=1) < 1e-9 * size
    # Far out slope and Hessian may both fade: there the step to the point that they speak of is still long.
    pull = np.linalg.pinv(np.where(np.isfinite(now.hessian), now.hessian, 0), rcond=1e-6)
    settled &= np.linalg.norm(np.einsum("nba,nb->na", pull, now.slope) / basis_scales(samples.group), axis=1) < 1e-4
    return [(E[i], float(now.phi[i]), (now.hessian[i] + now.hessian[i].T) / 2) for i in np.flatnonzero(settled)]


def _reference(samples: ErrorSamples) -> CriticalPoint:
    one = np.eye(samples.group.degree, dtype=samples.group.basis.dtype)
    here = samples.at(one[None])
    return _point(samples, one, float(here.phi[0]), (here.hessian[0] + here.hessian[0].T) / 2)


def _point(samples: ErrorSamples, E: Array, value: float, hessian: Array) -> CriticalPoint:
    scale = basis_scales(samples.group)
    values = np.linalg.eigvalsh(hessian * scale * scale[:, None])
    flat = _FLAT * max(1e-300, float(np.max(np.abs(values))))
    return CriticalPoint(E, value, int(np.sum(values < -flat)), int(np.sum(np.abs(values) <= flat)))


def _merged(
    points: list[CriticalPoint], found: list[tuple[Array, float, Array]], samples: ErrorSamples
) -> list[CriticalPoint]:
    """Those that are new; of a critical manifold, whose points are all different, one a value."""
    result = list(points)
    for E, value, hessian in found:
        size = max(1.0, float(np.max(np.abs(E))))
        if any(np.max(np.abs(E - point.X)) <= _SAME * size for point in result):
            continue
        made = _point(samples, E, value, hessian)
        close = 1e-6 * max(1e-9, abs(value))
        if made.nullity and any(p.nullity and abs(p.value - value) <= close for p in result[1:]):
            continue
        result.append(made)
    return [result[0], *sorted(result[1:], key=lambda point: (point.value, tuple(point.X.real.ravel())))]


def _check_zeros(pair: ErrorFunction, points: list[CriticalPoint]) -> None:
    scale = max(1e-300, *(abs(point.value) for point in points)) if len(points) > 1 else 1.0
    for point in points[1:]:
        if point.value <= _NEGATIVE * scale:
            word = "negative" if point.value < -_NEGATIVE * scale else "zero elsewhere than at the reference"
            raise InputError(
                f"error function {pair.name} on {pair.group.name} is {word}: phi = {point.value:.6g} at "
                f"{place(pair.group, point.X)}"
            )


def _bounded_ray(samples: ErrorSamples, rng: np.random.Generator) -> bool:
    """Whether phi stays bounded along a one-parameter subgroup that leaves every bounded set."""
    group = samples.group
    x = rng.normal(size=(_RAYS, group.dim))
    x = x / np.linalg.norm(x, axis=1, keepdims=True) * basis_scales(group)
    with np.errstate(all="ignore"):
        ends = [expm(group.hat(s * x)) for s in (1.0, 8.0, 32.0)]
        backward = [expm(group.hat(-s * x)) for s in (1.0, 8.0, 32.0)]
        sizes = [np.max(np.abs(E) + np.abs(F), axis=(1, 2)) for E, F in zip(ends, backward, strict=True)]
        phi = [samples.first(E)[0] for E in ends]
    # Turning directions come back: only those along which the matrix or its inverse still grows lead to infinity.
    leaves = (sizes[2] > 2 * sizes[1]) & (sizes[1] > 2 * sizes[0]) & np.isfinite(phi[2])
    return bool(np.any(leaves & (phi[2] <= 1.2 * np.maximum(phi[1], phi[0]))))


def _mountain_pass(samples: ErrorSamples, points: list[CriticalPoint]) -> float:
    """The least value among the points from which a path downhill ends at the reference."""
    for point in points[1:]:
        if leads_home(samples, point.X, point.value, point.index):
            return point.value
    return float("inf")
