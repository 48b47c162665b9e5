"""Equations (45)-(46) of TR 93-59 as printed, kept to show where they fail; nothing else uses them.

    Zhat(t) = eps u_av t + eps^2 t / (2T) int_0^T [ut, u] + eps (ut - u_av t).

Lemma 4 claims |Z - Zhat| = O(eps^2) for any mean. [ut, u] is not periodic when u_av != 0, and its secular part adds O(eps):
the claim holds for u_av = 0 alone (as Theorem 4 then says). The right second-order form for any mean has two exponentials,
exp(t (eps F_1 + eps^2 F_2)) exp(eps (ut - u_av t)): `average(group, u, order=2, form="floquet")`.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lie_codegen.averaging.areas import area_rate, areas
from lie_codegen.flow.batched_exponential import expm
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.signals.periodic_input import PeriodicInput


def printed_state(group: MatrixGroup, u: PeriodicInput, eps: float, t: ArrayLike) -> NDArray[Any]:
    """exp(Zhat(t)), (...,) -> (..., d, d); first order only, unless u_av = 0."""
    times = np.asarray(t, dtype=float)
    drift = np.array([float(v) for v in area_rate(group.algebra, areas(u), u.period)])
    return expm(group.hat(eps * u.integral(times) + eps**2 * times[..., None] * drift))
