"""Ways downhill of an error function: to where it is least, and whether they end at the reference."""

from __future__ import annotations

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.control.error_samples import ErrorSamples, basis_scales
from lie_codegen.groups.matrix_group import MatrixGroup


def descend(samples: ErrorSamples, E: Array, floor: float = -np.inf, steps: int = 300) -> tuple[Array, Array]:
    """(N, d, d) places downhill from E, and phi there: steepest descent in the metric of the basis, its step found by trial."""
    scale = basis_scales(samples.group) ** 2
    phi, slope = samples.first(E)
    length = 0.1 / np.maximum(1e-12, np.sqrt(np.einsum("ni,i,ni->n", slope, scale, slope)))
    for _ in range(steps):
        step = -length[:, None] * slope * scale
        moved = samples.moved(E, step)
        with np.errstate(all="ignore"):
            new_phi, new_slope = samples.first(moved)
        gain = np.einsum("ni,ni->n", slope, step)
        better = np.isfinite(new_phi) & (new_phi <= phi + 0.3 * gain)
        E = np.where(better[:, None, None], moved, E)
        phi, slope = np.where(better, new_phi, phi), np.where(better[:, None], new_slope, slope)
        length = np.where(better, 1.6 * length, length / 2)
        if np.any(phi < floor) or np.all(np.abs(gain) < 1e-15 * (1 + np.abs(phi))):
            break
    return E, phi


def leads_home(samples: ErrorSamples, X: Array, value: float, index: int) -> bool:
    """Whether a way downhill from a critical point ends at the reference."""
    scale = basis_scales(samples.group)
    here = samples.at(X[None])
    values, vectors = np.linalg.eigh((here.hessian[0] + here.hessian[0].T) / 2 * scale * scale[:, None])
    if values[0] >= 0 or index == 0:
        return False
    down = vectors[:, values < -1e-6 * np.max(np.abs(values))] * scale[:, None]
    rng = np.random.default_rng(0)
    many = down.T if index == 1 else np.vstack([down.T, rng.normal(size=(4, down.shape[1])) @ down.T])
    starts = samples.moved(np.broadcast_to(X, (2 * len(many), *X.shape)), 1e-2 * np.vstack([many, -many]))
    _, phi = descend(samples, starts, steps=600)
    return bool(np.any(phi < 1e-6 * value))


def comes_home(samples: ErrorSamples, E: Array) -> bool:
    """Whether the way downhill from E ends at the reference, so that E lies in its component of every level above phi(E)."""
    start = float(samples.first(E[None])[0][0])
    _, phi = descend(samples, E[None], steps=600)
    return bool(phi[0] < 1e-6 * max(start, 1e-300))


def place(group: MatrixGroup, E: Array) -> str:
    """A configuration in words."""
    if group.name == "so3" or (
        (group.degree, group.dim) == (3, 3) and not group.is_complex and np.allclose(E.T @ E, np.eye(3), atol=1e-9)
    ):
        angle = np.arccos(np.clip((np.trace(E) - 1) / 2, -1, 1))
        symmetric = (E + E.T) / 2 - np.cos(angle) * np.eye(3)
        axis = np.linalg.eigh(symmetric)[1][:, -1] if angle > 1e-6 else np.array([1.0, 0, 0])
        odd = np.array([E[2, 1] - E[1, 2], E[0, 2] - E[2, 0], E[1, 0] - E[0, 1]])
        turned = axis @ odd if abs(axis @ odd) > 1e-6 else axis[np.argmax(np.abs(axis))]
        axis = axis * np.sign(turned)
        return f"a turn by {np.degrees(angle):.6g} degrees about ({', '.join(f'{a + 0.0:.3g}' for a in np.round(axis, 9))})"
    rows = "; ".join(" ".join(f"{np.real_if_close(z):.4g}" for z in row) for row in E)
    return f"X_d^-1 X = [{rows}]"
