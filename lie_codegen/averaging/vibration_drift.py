"""Drift caused by vibration: from measured spectra of the velocity u to the mean velocity of the frame.

A line u(t) = c cos(omega t) + s sin(omega t) moves the frame at the mean velocity [c, s] / (2 omega), the area rule per unit
time; lines at different frequencies, commensurate or not, add (their cross terms average to zero). For a spectrum,

    drift^k = sum_{i<j} Gamma_ij^k int_0^inf Im S_ij(omega) / omega d omega,

S one-sided, S_ij the density of the mean of z_i conj(z_j) for u = Re z e^{i omega t}, and int S_ii d omega the variance:
only what is out of phase between two axes drifts. TR 93-59, section 1 and Theorem 3; second order in the amplitude.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from lie_codegen.algebra.brackets import bracket
from lie_codegen.arrays import Array
from lie_codegen.errors import InputError, NotFiniteError, ShapeError
from lie_codegen.groups.catalogue_load import GroupLike, as_group
from lie_codegen.kernel.saved import Saved
from lie_codegen.values import settle


@dataclass(frozen=True, eq=False, repr=False)
class VibrationLine(Saved):
    """u(t) = cosine cos(omega t) + sine sin(omega t).

    Attributes:
        omega: angular frequency, positive. [rad/s]
        cosine, sine: (n,) amplitudes of the velocity components. [u unit]

    Raises:
        InputError: omega is not positive and finite.
        ShapeError: cosine and sine have different lengths.
        NotFiniteError: an amplitude is NaN or infinite.
    """

    omega: float
    cosine: tuple[float, ...]
    sine: tuple[float, ...]

    def __post_init__(self) -> None:
        if not (np.isfinite(self.omega) and self.omega > 0):
            raise InputError(f"VibrationLine: omega must be positive, got {self.omega}")
        settle(self, cosine=tuple(map(float, self.cosine)), sine=tuple(map(float, self.sine)))
        if len(self.cosine) != len(self.sine):
            raise ShapeError(f"VibrationLine: {len(self.cosine)} cosine and {len(self.sine)} sine amplitudes")
        if not np.all(np.isfinite([*self.cosine, *self.sine])):
            raise NotFiniteError("VibrationLine: an amplitude is NaN or infinite")


def line_drift(group: GroupLike, lines: Sequence[VibrationLine]) -> Array:
    """(n,) mean velocity caused by the lines: sum [c, s] / (2 omega). [u unit^2 / (rad/s)]

    Args:
        group: object, catalogue name or file.
        lines: `VibrationLine`s of n components; lines of one frequency must be given as one.

    Raises:
        ShapeError: amplitudes that have not n components.
        InputError: a frequency given twice.
    """
    group = as_group(group, "line_drift")
    total = np.zeros(group.dim)
    seen: set[float] = set()
    for line in lines:
        if len(line.cosine) != group.dim:
            raise ShapeError(f"line_drift: a line has {len(line.cosine)} components, {group.name} has {group.dim}")
        if line.omega in seen:
            raise InputError(f"line_drift: two lines at omega = {line.omega:g}; add their amplitudes first")
        seen.add(line.omega)
        total += bracket(group.algebra, np.array(line.cosine), np.array(line.sine)) / (2 * line.omega)
    return total


def spectral_drift(group: GroupLike, omega: ArrayLike, density: ArrayLike) -> Array:
    """(n,) mean velocity caused by a stationary vibration with cross-spectral density S: the sum of `line_drift` made an integral.

    Args:
        group: object, catalogue name or file.
        omega: (k,) increasing positive angular frequencies. [rad/s]
        density: (k, n, n) Hermitian S_ij(omega), one-sided. [u unit^2 s / rad]

    Raises:
        ShapeError, NotFiniteError, InputError: naming the argument.
    """
    group = as_group(group, "spectral_drift")
    frequencies = np.asarray(omega, dtype=float)
    S: NDArray[Any] = np.asarray(density, dtype=complex)
    if frequencies.ndim != 1 or S.shape != (len(frequencies), group.dim, group.dim):
        raise ShapeError(
            f"spectral_drift: omega {frequencies.shape} and density {S.shape}; give (k,) and (k, {group.dim}, {group.dim})"
        )
    if not (np.all(np.isfinite(frequencies)) and np.all(np.isfinite(S))):
        raise NotFiniteError("spectral_drift: omega or density holds NaN or infinity")
    if len(frequencies) < 2 or frequencies[0] <= 0 or np.any(np.diff(frequencies) <= 0):
        raise InputError("spectral_drift: omega must hold two or more increasing positive frequencies")
    if not np.allclose(S, np.conj(np.swapaxes(S, 1, 2)), atol=1e-9 * float(np.max(np.abs(S), initial=1e-300))):
        raise InputError("spectral_drift: density is not Hermitian; S_ij is the mean of z_i conj(z_j)")
    integral = np.trapezoid(S.imag / frequencies[:, None, None], frequencies, axis=0)
    return np.asarray(np.einsum("ij,ijk->k", integral, group.algebra.structure_constants) / 2)
