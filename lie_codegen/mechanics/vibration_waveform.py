"""lc.vibration_waveform: the waveform that stiffens most within a bound of the force.

Averages see lambda = mean U^2, U the primitive of u. Within |u| <= peak a pure cosine gives 1/2 (in units of peak^2 and w = 1), the square wave, whose U is a
triangle, pi^2/12 = .822; odd harmonics in between. Within a bound of the mean square of u the pure cosine is the best there is: lambda = sum |c_k|^2 / (2 k^2).
"""

from __future__ import annotations

import numpy as np

from lie_codegen.errors import InputError
from lie_codegen.signals.periodic_input import PeriodicInput

_GRID, _ROUNDS = 721, 50


def vibration_waveform(harmonics: int = 3, peak: float = 1.0) -> PeriodicInput:
    """u(tau) = sum_k a_k cos(k tau) over odd k up to `harmonics`, of greatest mean U^2 within |u| <= peak.

    The mean square is convex: each round maximises its slope by linear programming, which never loses and ends at a vertex.

    Args:
        harmonics: the highest; even ones do not help and would spoil the symmetry by which even orders vanish.
        peak: of |u|.

    Raises:
        InputError: no positive whole number of harmonics, or no positive peak.
    """
    from scipy.optimize import linprog

    if isinstance(harmonics, bool) or not isinstance(harmonics, int) or not 1 <= harmonics <= 63:
        raise InputError(f"vibration_waveform: harmonics is a whole number from 1 to 63, got {harmonics!r}")
    if not (np.isfinite(peak) and peak > 0):
        raise InputError(f"vibration_waveform: peak must be positive, got {peak!r}")
    odd = np.arange(1, harmonics + 1, 2)
    # u is odd about a quarter of the period and even about 0: a quarter of it holds all values
    table = np.cos(np.linspace(0, np.pi / 2, _GRID)[:, None] * odd)
    a = np.zeros(len(odd))
    a[0] = 1.0
    for _ in range(_ROUNDS):
        found = linprog(-a / odd**2, A_ub=np.vstack([table, -table]), b_ub=np.ones(2 * _GRID), bounds=(None, None))
        if not found.success or np.abs(found.x - a).max() < 1e-12:
            break
        a = found.x
    # between the points of a grid of spacing d the wave rises by at most (d/2)^2 max |u''| / 2: scaled back by that
    spacing = np.pi / 2 / (64 * _GRID - 1)
    fine = np.cos(spacing * np.arange(64 * _GRID)[:, None] * odd) @ a
    highest = float(np.abs(fine).max()) + spacing**2 / 8 * float(odd**2 @ np.abs(a))
    a = a * float(peak) / max(1.0, highest)
    cosines = np.zeros((harmonics, 1))
    cosines[odd - 1, 0] = a
    return PeriodicInput.from_fourier(cosines, np.zeros_like(cosines), period="2*pi")
