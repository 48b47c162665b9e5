"""What an error function is invariant under, computed: phi(G X, G X_d) = phi(X, X_d), phi(X G, X_d G) = phi(X, X_d), phi(X, X_d) = phi(X_d, X)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.control.error_function import ErrorFunction
from lie_codegen.control.error_samples import error_samples, random_elements
from lie_codegen.errors import InputError
from lie_codegen.identifiers import shown
from lie_codegen.kernel.saved import Saved

_PLACES, _SAME = 12, 1e-9


@dataclass(frozen=True, eq=False, repr=False)
class Invariance(Saved):
    """What holds at twelve random pairs of places, to 1e-9.

    Attributes:
        left: phi(G X, G X_d) = phi(X, X_d): the constants do not depend on where the reference is.
        right: phi(X G, X_d G) = phi(X, X_d).
        symmetric: phi(X, X_d) = phi(X_d, X).
    """

    left: bool
    right: bool
    symmetric: bool


def invariance(error: ErrorFunction) -> Invariance:
    """The invariances of an error function.

    Raises:
        InputError: it is none, as `lc.error_function` makes it.
    """
    if not isinstance(error, ErrorFunction):
        raise InputError(f"invariance: takes an error function, as lc.error_function makes it; given {shown(error)}")
    return _invariance(error)


@lru_cache(maxsize=64)
def _invariance(error: ErrorFunction) -> Invariance:
    samples, rng = error_samples(error), np.random.default_rng(0)
    X, Y, G = (random_elements(error.group, _PLACES, rng, 1.0) for _ in range(3))

    def phi(A: Array, B: Array) -> Array:
        return samples.first(A, B)[0]

    here = phi(X, Y)
    size = max(1e-300, float(np.max(np.abs(here))))

    def same(A: Array, B: Array) -> bool:
        return bool(np.max(np.abs(phi(A, B) - here)) <= _SAME * size)

    return Invariance(same(G @ X, G @ Y), same(X @ G, Y @ G), same(Y, X))
