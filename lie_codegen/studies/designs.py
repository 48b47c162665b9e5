"""Samples laid out together and not drawn one by one: Sobol points and Latin hypercubes."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.errors import InputError
from lie_codegen.studies.distributions import Distribution, Uniform
from lie_codegen.values import settle


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
        """As the distribution, of `uniform` numbers (N, slots) in (0, 1)."""
        return np.asarray(self.of.draw(uniform))


class Sobol(Designed):
    """Scrambled Sobol points (scipy.stats.qmc) for a distribution: Sobol(low, high), Sobol(Normal(0, 1)).

    All Sobol inputs of a space are the coordinates of one sequence. A power of two samples fills evenly.

    Attributes:
        of: a distribution, or the lower end; with
        high: the upper end, 1 if not given.

    Raises:
        InputError: a distribution beside `high`, or one that is not random; ends as `Uniform`.
        ShapeError: ends that do not broadcast.
    """


class LatinHypercube(Designed):
    """A Latin hypercube (scipy.stats.qmc) for a distribution: LatinHypercube(low, high), LatinHypercube(Normal(0, 1)).

    All such inputs of a space are the coordinates of one design, which is laid out for all n samples at once: at most
    2 10^7 numbers, and n cannot grow later. Sobol has neither limit.

    Attributes:
        of: a distribution, or the lower end; with
        high: the upper end, 1 if not given.

    Raises:
        InputError: a distribution beside `high`, or one that is not random; ends as `Uniform`.
        ShapeError: ends that do not broadcast.
    """
