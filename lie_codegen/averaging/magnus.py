"""The Magnus series X(t) = exp(Z(t)), Z = sum eps^q Z_q(t), of any order, exactly.

    Z' = sum_k (-1)^k B_k / k! ad_Z^k eps U          (X' = eps X U; B_1 = -1/2)
       = eps U + eps^2 / 2 [Ut, U] + eps^3 / 4 [int [Ut, U], U] + eps^3 / 12 [Ut, [Ut, U]] + ...

TR 93-59, (38) and (43); the recursion over orders is that of `floquet` with no mean taken out, so Z_q is secular: it has
powers of t up to q. Z_q(T) = T F_q.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from functools import cached_property
from math import factorial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.errors import InputError, ShapeError
from lie_codegen.flow.batched_exponential import expm
from lie_codegen.groups.catalogue_load import GroupLike, as_group
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernel.saved import Saved
from lie_codegen.on_demand import sympy as sp
from lie_codegen.signals.floquet_magnus import bernoulli
from lie_codegen.signals.periodic_input import PeriodicInput
from lie_codegen.signals.periodic_reader import PeriodicLike, as_periodic
from lie_codegen.signals.time_series import expressions_of, functions_of

_MOST = 12


@dataclass(frozen=True, eq=False, repr=False)
class Magnus(Saved):
    """The Magnus series of X' = eps X hat(u), X(0) = I, to order p.

    Attributes:
        group, u, order: what is expanded, when it is first read, and how far.
    """

    group: MatrixGroup
    u: PeriodicInput
    order: int

    @cached_property
    def _series(self) -> tuple[Any, tuple[Any, ...]]:
        """The calculus of the input's functions, and Z_1 .. Z_p in it."""
        calculus, signal = self.u.waveform.calculus(self.group.algebra.table, self.group.dim)
        weights = [
            abs(b) / factorial(k) if k == 1 else b / factorial(k) for k, b in enumerate(bernoulli(self.order + 1))
        ]
        found: list[Any] = []
        nested: dict[tuple[int, int], Any] = {(0, 1): signal}
        for q in range(1, self.order + 1):
            terms: list[tuple[Fraction | int, Any]] = [(1, signal)] if q == 1 else []
            for k in range(1, q):
                inner = [(m, nested[k - 1, q - m]) for m in range(1, q) if (k - 1, q - m) in nested]
                value = calculus.combine([(1, calculus.bracket(found[m - 1], s)) for m, s in inner])
                nested[k, q] = value
                terms.append((weights[k], value))
            found.append(calculus.primitive(calculus.combine(terms)))
        return calculus, tuple(found)

    @cached_property
    def exact_Z(self) -> tuple[sp.ImmutableMatrix, ...]:
        """Z_1 .. Z_p, each (n, 1), as expressions in t."""
        return expressions_of(self.u, *self._series)

    @cached_property
    def Z(self) -> list[Callable[[ArrayLike], Array]]:
        """[Z_1, .., Z_p]: functions of t, (...,) -> (..., n)."""
        return functions_of(self.u, *self._series)

    def exponent(self, eps: float, t: ArrayLike) -> Array:
        """sum_{q<=p} eps^q Z_q(t): (...,) -> (..., n)."""
        total = sum((eps**q * z(t) for q, z in enumerate(self.Z, start=1)), np.zeros(self.group.dim))
        return np.asarray(total)

    def state(self, eps: float, t: ArrayLike) -> Array:
        """exp(hat(exponent)): (...,) -> (..., d, d)."""
        return expm(self.group.hat(self.exponent(eps, t)))


def magnus(group: GroupLike, u: PeriodicLike, order: int) -> Magnus:
    """The Magnus series to a given order.

    It converges for t up to a limit only: see `convergence`. For times of order 1 / eps use `average`.

    Args:
        group: object, catalogue name or file.
        u: n components, sums of sines and cosines, or a list of their formulas.
        order: 1 to 12, the power of eps of the last term.

    Raises:
        InputError: an order that is not 1 to 12, or a sampled input (its secular terms are not periodic).
        ShapeError: if u has not n components.
    """
    group, u = as_group(group, "magnus"), as_periodic(u, "magnus")
    if isinstance(order, bool) or not isinstance(order, int) or not 1 <= order <= _MOST:
        raise InputError(f"magnus: order must be an integer from 1 to {_MOST}, got {order!r}")
    if u.dim != group.dim:
        raise ShapeError(f"magnus: u has {u.dim} components, {group.name} has {group.dim}: {', '.join(group.labels)}")
    if not u.waveform.has_formula:
        raise InputError("magnus: the input has no one formula; the Magnus series needs sums of sines and cosines")
    return Magnus(group, u, order)
