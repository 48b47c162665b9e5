"""A transmon of three levels in the frame of its drive: the Hamiltonians of its pulses, and velocities on SU(3)."""

from __future__ import annotations

import numpy as np

import lie_codegen as lc

LOWER = np.diag([1, np.sqrt(2)], 1)
HX, HY = (LOWER + LOWER.T) / 2, 1j * (LOWER.T - LOWER) / 2
ANHARMONIC = np.diag([0, 0, -1.9])


def velocity(H: np.ndarray) -> np.ndarray:
    """Of -i H on SU(3), by the Gell-Mann basis: traces of products."""
    basis = lc.group("su3").basis
    gram = np.real(np.einsum("iab,jba->ij", basis, basis))
    return np.linalg.solve(gram, np.real(np.einsum("iab,ba->i", basis, -1j * H)))
