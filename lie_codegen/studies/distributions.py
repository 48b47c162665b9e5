"""What an input of a study is drawn from: plain records that turn uniform numbers into values, sample by sample."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.errors import InputError, ShapeError
from lie_codegen.flow.batched_exponential import expm
from lie_codegen.groups.catalogue_load import GroupLike, as_group
from lie_codegen.groups.maps.admission import admitted
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernel.saved import Saved
from lie_codegen.values import settle


class Distribution(Saved, ABC):
    """Base of what an input is drawn from.

    `slots` uniform numbers in (0, 1) make one value; `draw` makes many. Subclasses are frozen records of plain data.
    """

    @property
    @abstractmethod
    def slots(self) -> int:
        """Uniform numbers for one value."""

    def draw(self, uniform: Array) -> Array:
        """(N, slots) uniform numbers -> (N, ...) values.

        Raises:
            InputError: of a Grid, which is gone through, and of a Joint, which makes several inputs at once.
        """
        raise InputError(f"a {type(self).__name__} is not drawn by itself; give it to lc.study in its space")


def _numbers(where: str, value: ArrayLike) -> Array:
    try:
        array = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        raise InputError(f"{where} is a number or an array of numbers, given {value!r:.60}") from None
    if not np.all(np.isfinite(array)):
        raise InputError(f"{where} must be finite, given {value!r:.60}")
    return array


def _quantile(uniform: Array) -> Array:
    from scipy.special import ndtri

    return np.asarray(ndtri(uniform))


@dataclass(frozen=True, eq=False, repr=False)
class Normal(Distribution):
    """Gaussian numbers, or vectors of them.

    Attributes:
        mean: a number or an array, which gives the shape of a value.
        std: standard deviation, of the same shape or one for all entries; or
        cov: (n, n) covariance of an (n,) vector, symmetric, no negative eigenvalue.
    """

    mean: Any = 0.0
    std: Any = 1.0
    cov: Any = None

    def __post_init__(self) -> None:
        mean, std = _numbers("Normal: mean", self.mean), _numbers("Normal: std", self.std)
        if np.any(std < 0):
            raise InputError("Normal: std must not be negative")
        cov = None
        if self.cov is not None:
            cov = _numbers("Normal: cov", self.cov)
            if cov.ndim != 2 or cov.shape[0] != cov.shape[1] or mean.shape not in ((), (len(cov),)):
                raise ShapeError(f"Normal: cov has shape {cov.shape} and mean {mean.shape}; give (n, n) and (n,)")
            _factor("Normal: cov", cov)
            mean = np.broadcast_to(mean, (len(cov),)).copy()
        else:
            try:
                mean, std = (np.array(each) for each in np.broadcast_arrays(mean, std))
            except ValueError:
                raise ShapeError(f"Normal: mean has shape {mean.shape} and std {std.shape}") from None
        settle(self, mean=mean, std=std, cov=cov)

    @property
    def slots(self) -> int:
        """One a number."""
        return int(self.mean.size)

    def draw(self, uniform: Array) -> Array:
        """(N, slots) -> (N, *mean.shape)."""
        z = _quantile(uniform)
        if self.cov is not None:
            return np.asarray(self.mean + z @ _factor("Normal: cov", self.cov).T)
        return np.asarray(self.mean + self.std * z.reshape(len(z), *self.mean.shape))


def _factor(where: str, cov: Array) -> Array:
    """A with A A' = cov, by eigenvectors: a covariance may be singular."""
    values, vectors = np.linalg.eigh((cov + cov.T) / 2)
    bound = 1e-12 * max(1e-300, float(np.max(np.abs(cov))))
    if not np.allclose(cov, cov.T, rtol=1e-9, atol=bound) or values[0] < -bound * len(cov):
        raise InputError(f"{where} must be symmetric without negative eigenvalues")
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0)))


@dataclass(frozen=True, eq=False, repr=False)
class Uniform(Distribution):
    """Numbers, or arrays of them, between low and high, which have one shape or broadcast."""

    low: Any = 0.0
    high: Any = 1.0

    def __post_init__(self) -> None:
        low, high = _range(type(self).__name__, self.low, self.high)
        settle(self, low=low, high=high)

    @property
    def slots(self) -> int:
        """One a number."""
        return int(self.low.size)

    def draw(self, uniform: Array) -> Array:
        """(N, slots) -> (N, *low.shape)."""
        return np.asarray(self.low + (self.high - self.low) * uniform.reshape(len(uniform), *self.low.shape))


@dataclass(frozen=True, eq=False, repr=False)
class LogUniform(Uniform):
    """Numbers whose logarithm is uniform, between low > 0 and high."""

    def __post_init__(self) -> None:
        super().__post_init__()
        if np.any(self.low <= 0):
            raise InputError("LogUniform: low must be positive")

    def draw(self, uniform: Array) -> Array:
        """(N, slots) -> (N, *low.shape)."""
        low, high = np.log(self.low), np.log(self.high)
        return np.asarray(np.exp(low + (high - low) * uniform.reshape(len(uniform), *self.low.shape)))


def _range(name: str, low: ArrayLike, high: ArrayLike) -> tuple[Array, Array]:
    first, last = _numbers(f"{name}: low", low), _numbers(f"{name}: high", high)
    try:
        a, b = (np.array(each) for each in np.broadcast_arrays(first, last))
    except ValueError:
        raise ShapeError(f"{name}: low has shape {first.shape} and high {last.shape}") from None
    if np.any(a > b):
        raise InputError(f"{name}: low lies above high")
    return a, b


def _listed(name: str, values: Any) -> Array:
    try:
        array = np.asarray(values)
    except ValueError:
        raise ShapeError(f"{name}: the values have different shapes") from None
    if array.ndim == 0 or len(array) == 0:
        raise ShapeError(f"{name}: give a list of values, got {values!r:.60}")
    if array.dtype.kind not in "biufcU":
        raise InputError(f"{name}: the values are numbers, arrays of them or texts, given {values!r:.60}")
    if array.dtype.kind in "fc" and not np.all(np.isfinite(array)):
        raise InputError(f"{name}: the values must be finite")
    return array


@dataclass(frozen=True, eq=False, repr=False)
class Choice(Distribution):
    """One of some values (numbers, arrays along the first axis, or texts), with probabilities p or all alike."""

    values: Any
    p: Any = None

    def __post_init__(self) -> None:
        values = _listed("Choice", self.values)
        p = None if self.p is None else _numbers("Choice: p", self.p)
        if p is not None and (p.shape != (len(values),) or np.any(p < 0) or abs(np.sum(p) - 1) > 1e-9):
            raise InputError(f"Choice: p is {len(values)} probabilities that add to one")
        settle(self, values=values, p=p)

    @property
    def slots(self) -> int:
        """One."""
        return 1

    def draw(self, uniform: Array) -> Array:
        """(N, 1) -> (N, *values.shape[1:])."""
        count = len(self.values)
        steps = np.arange(1, count) / count if self.p is None else np.cumsum(self.p)[:-1]
        return np.asarray(self.values[np.searchsorted(steps, uniform[:, 0], side="right")])


@dataclass(frozen=True, eq=False, repr=False)
class Grid(Distribution):
    """All of some values (numbers, arrays along the first axis, or texts): several grids of a space make their product.

    The samples run through the product in the order of nested loops, the last input fastest, and again from the start.
    """

    values: Any

    def __post_init__(self) -> None:
        settle(self, values=_listed("Grid", self.values))

    def __len__(self) -> int:
        return len(self.values)

    @property
    def slots(self) -> int:
        """None: a grid is no matter of chance."""
        return 0


@dataclass(frozen=True, eq=False, repr=False)
class Designed(Distribution):
    """Base of points that are laid out together for all such inputs of a space.

    Attributes:
        of: a random distribution, or the low end of a uniform one.
        high: its high end, 1 if not given.
    """

    of: Any = 0.0
    high: Any = None

    def __post_init__(self) -> None:
        name = type(self).__name__
        if isinstance(self.of, Distribution):
            if self.high is not None or self.of.slots == 0 or isinstance(self.of, Designed):
                raise InputError(f"{name}: give a random distribution alone, or low and high")
            return
        settle(self, of=Uniform(self.of, 1.0 if self.high is None else self.high), high=None)

    @property
    def slots(self) -> int:
        """Those of the distribution."""
        return int(self.of.slots)

    def draw(self, uniform: Array) -> Array:
        """As the distribution."""
        return np.asarray(self.of.draw(uniform))


class Sobol(Designed):
    """Scrambled Sobol points (scipy.stats.qmc) for a distribution: Sobol(low, high), Sobol(Normal(0, 1)).

    All Sobol inputs of a space are the coordinates of one sequence. A power of two samples fills evenly.
    """


class LatinHypercube(Designed):
    """A Latin hypercube (scipy.stats.qmc) for a distribution: LatinHypercube(low, high), LatinHypercube(Normal(0, 1)).

    All such inputs of a space are the coordinates of one design, which is laid out for all n samples at once: at most
    2 10^7 numbers, and n cannot grow later. Sobol has neither limit.
    """


@dataclass(frozen=True, eq=False, repr=False)
class OnGroup(Distribution):
    """Elements of a group.

    Attributes:
        group: the group, its name or its file.
        spread: None for Haar's measure, of a compact group; otherwise X = mean exp(hat xi), xi ~ N(0, spread^2):
            a number, (n,) standard deviations, or an (n, n) covariance.
        mean: (d, d) element, the identity if not given.
    """

    group: GroupLike
    spread: Any = None
    mean: Any = None

    def __post_init__(self) -> None:
        group = as_group(self.group, "OnGroup")
        mean = np.eye(group.degree) if self.mean is None else admitted(group, self.mean, "OnGroup: mean").X
        spread = None
        if self.spread is None:
            if not _is_compact(group):
                raise InputError(
                    f"OnGroup: {group.name} is not compact, so its Haar measure is no distribution; give spread=, the standard "
                    "deviation of xi in mean exp(hat xi)"
                )
        else:
            spread = _spread(group, self.spread)
        settle(self, group=group, mean=mean, spread=spread)

    @property
    def slots(self) -> int:
        """n for a spread; for Haar's measure as many as a Gaussian matrix has numbers, or n for each of the factors of `_walk`."""
        group = self._group
        if self.spread is not None:
            return group.dim
        kind = _compact_kind(group)
        if kind is None:
            return _FACTORS * group.dim
        return group.degree**2 * (2 if kind == "su" else 1)

    @property
    def _group(self) -> MatrixGroup:
        return as_group(self.group)

    def draw(self, uniform: Array) -> Array:
        """(N, slots) -> (N, d, d)."""
        group = self._group
        z = _quantile(uniform)
        if self.spread is not None:
            return np.asarray(self.mean @ expm(group.hat(z @ _factor("OnGroup: spread", self.spread).T)))
        d, kind = group.degree, _compact_kind(group)
        if kind is None:
            return _walk(group, z.reshape(len(z), _FACTORS, group.dim))
        matrix = z[:, : d * d] + 1j * z[:, d * d :] if kind == "su" else z
        return _haar(matrix.reshape(-1, d, d))


def _spread(group: MatrixGroup, spread: ArrayLike) -> Array:
    """(n, n) covariance."""
    given = _numbers("OnGroup: spread", spread)
    if given.shape not in ((), (group.dim,), (group.dim, group.dim)):
        raise ShapeError(
            f"OnGroup: spread has shape {given.shape}; {group.name} takes a number, (n,) or (n, n), n = {group.dim}"
        )
    if given.ndim < 2:
        if np.any(given < 0):
            raise InputError("OnGroup: spread must not be negative")
        given = np.diag(np.broadcast_to(given, (group.dim,)) ** 2)
    _factor("OnGroup: spread", given)
    return given


def _compact_kind(group: MatrixGroup) -> str | None:
    """ "so" or "su": the skew matrices of a degree are as many as its rotations have dimensions, so a skew basis of so many spans all."""
    skew = np.allclose(group.basis, -np.conj(np.swapaxes(group.basis, 1, 2)), atol=1e-14)
    d = group.degree
    if not skew:
        return None
    if not np.iscomplexobj(group.basis) and group.dim == d * (d - 1) // 2:
        return "so"
    traceless = np.allclose(np.trace(group.basis, axis1=1, axis2=2), 0, atol=1e-14)
    return "su" if np.iscomplexobj(group.basis) and traceless and group.dim == d * d - 1 else None


#: Factors of `_walk`, and the standard deviation of each, in an orthonormal basis.
_FACTORS, _WIDTH = 24, 8.0


def _is_compact(group: MatrixGroup) -> bool:
    """Whether all one-parameter subgroups stay bounded: then -tr(A B) is an invariant inner product, and a generic element has
    eigenvalues on the imaginary axis. The form alone would take diag(2 i t, t) for one, the eigenvalues alone a shear."""
    form = _trace_form(group)
    if np.linalg.eigvalsh(form)[0] <= 1e-9 * np.max(np.abs(form)):
        return False
    generic = group.hat(np.sqrt(np.arange(2.0, 2.0 + group.dim)))
    values = np.linalg.eigvals(generic)
    return bool(np.max(np.abs(values.real)) <= 1e-9 * np.max(np.abs(values)))


def _trace_form(group: MatrixGroup) -> Array:
    """(n, n) matrix of -Re tr(A B) in the basis."""
    return np.asarray(-np.einsum("aij,bji->ab", group.basis, group.basis).real)


def _walk(group: MatrixGroup, z: Array) -> Array:
    """(N, factors, n) Gaussian numbers -> (N, d, d) elements, Haar's measure to rounding.

    xi = Ad_g H with g from Haar's measure, H in a Cartan subalgebra, for a Gaussian in an invariant inner product; so wide that exp H is
    uniform on the torus. Such a measure acts on an irreducible representation by one number, the part of its zero weights in its
    dimension (1/3 for the rotations of space, 1/4 for the adjoint of SU(3)), and the product of k elements by its k-th power: it tends
    to Haar's measure (Peter and Weyl).
    """
    axes = np.linalg.inv(np.linalg.cholesky(_trace_form(group)))
    X = np.broadcast_to(np.eye(group.degree), (len(z), group.degree, group.degree))
    for k in range(z.shape[1]):
        X = X @ expm(group.hat(_WIDTH * z[:, k] @ axes))
    return np.asarray(X)


def _haar(gaussian: Array) -> Array:
    """The orthogonal or unitary factor of Gaussian matrices with R's diagonal made positive is Haar on O(d) or U(d) (Mezzadri,
    Notices of the AMS 54 (2007) 592); one column times 1/det leaves Haar's measure of the subgroup det = 1, for Haar's measure of the
    whole group is unchanged by such a factor from the right.
    """
    q, r = np.linalg.qr(gaussian)
    diagonal = np.diagonal(r, axis1=1, axis2=2)
    q = q * (diagonal / np.abs(diagonal))[:, None, :]
    q[:, :, 0] *= np.conj(np.linalg.det(q))[:, None]
    return np.asarray(q)


@dataclass(frozen=True, eq=False, repr=False)
class Joint(Distribution):
    """Several inputs by one function of uniform numbers: the space's key is a tuple of names.

    Attributes:
        function: (N, slots) numbers in (0, 1) -> a tuple of (N, ...) arrays, one a name, or a dict of them.
        slots_each: uniform numbers of one sample.
    """

    function: Callable[[Array], Any]
    slots_each: int

    def __post_init__(self) -> None:
        if not callable(self.function) or isinstance(self.slots_each, bool) or not isinstance(self.slots_each, int):
            raise InputError("Joint takes a function of (N, k) uniform numbers, and k")

    @property
    def slots(self) -> int:
        """As given."""
        return self.slots_each

    def columns(self, names: tuple[str, ...], uniform: Array) -> Mapping[str, Array]:
        """The values by name."""
        made = self.function(uniform)
        pairs = made if isinstance(made, Mapping) else dict(zip(names, made, strict=True))
        columns = {name: np.asarray(pairs[name]) for name in names}
        wrong = [name for name, column in columns.items() if len(column) != len(uniform)]
        if wrong:
            raise ShapeError(f"Joint: {', '.join(wrong)} has not one value a sample along its first axis")
        return columns
