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


def finite_numbers(where: str, value: ArrayLike) -> Array:
    """As an array of doubles.

    Raises:
        InputError: naming `where`: no numbers, or NaN or infinity.
    """
    try:
        array = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        raise InputError(f"{where} is a number or an array of numbers, given {value!r:.60}") from None
    if not np.all(np.isfinite(array)):
        raise InputError(f"{where} must be finite, given {value!r:.60}")
    return array


def normal_quantile(uniform: Array) -> Array:
    """Standard normal numbers of uniform ones in (0, 1), by the inverse of the distribution function."""
    from scipy.special import ndtri

    return np.asarray(ndtri(uniform))


@dataclass(frozen=True, eq=False, repr=False)
class Normal(Distribution):
    """Gaussian numbers, or vectors of them.

    Attributes:
        mean: a number or an array, which gives the shape of a value.
        std: standard deviation, of the same shape or one for all entries; or
        cov: (n, n) covariance of an (n,) vector, symmetric, no negative eigenvalue.

    Raises:
        InputError: a negative std, a covariance that is not one, numbers that are not finite.
        ShapeError: shapes that do not go together.
    """

    mean: Any = 0.0
    std: Any = 1.0
    cov: Any = None

    def __post_init__(self) -> None:
        mean, std = finite_numbers("Normal: mean", self.mean), finite_numbers("Normal: std", self.std)
        if np.any(std < 0):
            raise InputError("Normal: std must not be negative")
        cov = None
        if self.cov is not None:
            cov = finite_numbers("Normal: cov", self.cov)
            if cov.ndim != 2 or cov.shape[0] != cov.shape[1] or mean.shape not in ((), (len(cov),)):
                raise ShapeError(f"Normal: cov has shape {cov.shape} and mean {mean.shape}; give (n, n) and (n,)")
            covariance_factor("Normal: cov", cov)
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
        """Values (N, *mean.shape) of `uniform` numbers (N, slots) in (0, 1)."""
        z = normal_quantile(uniform)
        if self.cov is not None:
            return np.asarray(self.mean + z @ covariance_factor("Normal: cov", self.cov).T)
        return np.asarray(self.mean + self.std * z.reshape(len(z), *self.mean.shape))


def covariance_factor(where: str, cov: Array) -> Array:
    """A with A A' = cov, by eigenvectors: a covariance may be singular.

    Raises:
        InputError: naming `where`: not symmetric, or an eigenvalue below zero by more than rounding.
    """
    values, vectors = np.linalg.eigh((cov + cov.T) / 2)
    bound = 1e-12 * max(1e-300, float(np.max(np.abs(cov))))
    if not np.allclose(cov, cov.T, rtol=1e-9, atol=bound) or values[0] < -bound * len(cov):
        raise InputError(f"{where} must be symmetric without negative eigenvalues")
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0)))


@dataclass(frozen=True, eq=False, repr=False)
class Uniform(Distribution):
    """Numbers, or arrays of them, between low and high.

    Attributes:
        low, high: of one shape, or they broadcast.

    Raises:
        InputError: a low above its high, or numbers that are not finite.
        ShapeError: shapes that do not broadcast.
    """

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
        """Values (N, *low.shape) of `uniform` numbers (N, slots) in (0, 1)."""
        return np.asarray(self.low + (self.high - self.low) * uniform.reshape(len(uniform), *self.low.shape))


@dataclass(frozen=True, eq=False, repr=False)
class LogUniform(Uniform):
    """Numbers whose logarithm is uniform.

    Attributes:
        low, high: positive, of one shape, or they broadcast.

    Raises:
        InputError: a low that is not positive or lies above its high, or numbers that are not finite.
        ShapeError: shapes that do not broadcast.
    """

    def __post_init__(self) -> None:
        super().__post_init__()
        if np.any(self.low <= 0):
            raise InputError("LogUniform: low must be positive")

    def draw(self, uniform: Array) -> Array:
        """Values (N, *low.shape) of `uniform` numbers (N, slots) in (0, 1)."""
        low, high = np.log(self.low), np.log(self.high)
        return np.asarray(np.exp(low + (high - low) * uniform.reshape(len(uniform), *self.low.shape)))


def _range(name: str, low: ArrayLike, high: ArrayLike) -> tuple[Array, Array]:
    first, last = finite_numbers(f"{name}: low", low), finite_numbers(f"{name}: high", high)
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
    """One of some values, with probabilities p or all alike.

    Attributes:
        values: numbers, arrays along the first axis, or texts.
        p: a probability a value.

    Raises:
        ShapeError: no values, or arrays of different shapes.
        InputError: values of another kind or not finite; probabilities that are negative, not one a value or do not add to one.
    """

    values: Any
    p: Any = None

    def __post_init__(self) -> None:
        values = _listed("Choice", self.values)
        p = None if self.p is None else finite_numbers("Choice: p", self.p)
        if p is not None and (p.shape != (len(values),) or np.any(p < 0) or abs(np.sum(p) - 1) > 1e-9):
            raise InputError(f"Choice: p is {len(values)} probabilities that add to one")
        settle(self, values=values, p=p)

    @property
    def slots(self) -> int:
        """One."""
        return 1

    def draw(self, uniform: Array) -> Array:
        """Values (N, *values.shape[1:]) of `uniform` numbers (N, 1) in (0, 1)."""
        count = len(self.values)
        steps = np.arange(1, count) / count if self.p is None else np.cumsum(self.p)[:-1]
        return np.asarray(self.values[np.searchsorted(steps, uniform[:, 0], side="right")])


@dataclass(frozen=True, eq=False, repr=False)
class Grid(Distribution):
    """All of some values: several grids of a space make their product.

    The samples run through the product in the order of nested loops, the last input fastest, and again from the start.

    Attributes:
        values: numbers, arrays along the first axis, or texts.

    Raises:
        ShapeError: no values, or arrays of different shapes.
        InputError: values of another kind or not finite.
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
class Joint(Distribution):
    """Several inputs by one function of uniform numbers: the space's key is a tuple of names.

    Attributes:
        function: (N, slots) numbers in (0, 1) -> a tuple of (N, ...) arrays, one a name, or a dict of them.
        slots_each: uniform numbers of one sample.

    Raises:
        InputError: what is no function, or slots that are no whole number.
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
        """The values by name.

        Args:
            names: of the inputs.
            uniform: (N, slots) numbers in (0, 1).

        Raises:
            ShapeError: an array that has not one value a sample along its first axis.
        """
        made = self.function(uniform)
        pairs = made if isinstance(made, Mapping) else dict(zip(names, made, strict=True))
        columns = {name: np.asarray(pairs[name]) for name in names}
        wrong = [name for name, column in columns.items() if len(column) != len(uniform)]
        if wrong:
            raise ShapeError(f"Joint: {', '.join(wrong)} has not one value a sample along its first axis")
        return columns
