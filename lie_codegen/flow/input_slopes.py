"""Derivatives of X(T) in what an input consists of, named parameters or samples, by reverse passes."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.flow.magnus.norms import gram_of
from lie_codegen.flow.magnus.reverse import pullback
from lie_codegen.flow.magnus.tangents import NODES
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.signals.parametric_input import ParametricInput
from lie_codegen.signals.sampled_input import SampledInput

#: Derivatives of u at nodes that are held at once.
_MOST_VALUES = 2**22
_AT = NODES + 0.5

Differentiable = ParametricInput | SampledInput


def slopes_along(
    group: MatrixGroup, u: Differentiable, parameters: Mapping[str, float], length: float, steps: int, covectors: Array
) -> Array:
    """Re tr(C^H hat(eta_p)) for every entry p of the input, eta_p = X(T)^-1 dX(T)/dp.

    Args:
        group, u, parameters, length: of the flow over [0, length].
        steps: at least so many, as those of the run; none straddles a jump.
        covectors: (c, d, d) C.

    Returns:
        (c, m) of m parameters, (c, *values.shape) of samples.
    """
    starts, lengths = _steps(np.asarray(u.breakpoints, dtype=float), length, steps)
    if isinstance(u, SampledInput):
        values = u.formula.values(starts, lengths, _AT)
    else:
        t = starts[:, None] + lengths[:, None] * _AT
        values = u(t.ravel(), **parameters).reshape(*t.shape, group.dim)
    on_values = [pullback(group, values, lengths, C) for C in covectors]
    if isinstance(u, SampledInput):
        return np.array([_on_samples(u, starts, lengths, each) for each in on_values])
    return _on_parameters(u, parameters, starts, lengths, np.array(on_values))


def dual_basis(group: MatrixGroup) -> Array:
    """(n, d, d) C_i with Re tr(C_i^H hat(x)) = x_i."""
    return np.asarray(np.einsum("ij,jab->iab", np.linalg.inv(gram_of(group)), np.asarray(group.basis)))


def _steps(breaks: Array, length: float, steps: int) -> tuple[Array, Array]:
    """Starts and lengths of at least so many steps over [0, length], equal between breakpoints."""
    ends = np.concatenate([[0.0], np.unique(breaks[(breaks > 0) & (breaks < length)]), [length]])
    counts = np.maximum(np.ceil(np.diff(ends) * steps / length * (1 - 1e-12)), 1).astype(int)
    h = np.repeat(np.diff(ends) / counts, counts)
    inside = np.arange(len(h)) - np.repeat(np.cumsum(counts) - counts, counts)
    return np.repeat(ends[:-1], counts) + inside * h, h


def _on_parameters(
    u: ParametricInput, named: Mapping[str, float], starts: Array, lengths: Array, slopes: Array
) -> Array:
    """(c, m): the slopes on the values of u, times the derivatives of those, block by block."""
    m, n = len(u.parameters), u.dim
    total = np.zeros((len(slopes), m))
    block = max(1, _MOST_VALUES // (len(_AT) * n * (m + 1)))
    for first in range(0, len(starts), block):
        part = slice(first, first + block)
        t = (starts[part, None] + lengths[part, None] * _AT).ravel()
        total += np.einsum("cti,tpi->cp", slopes[:, part].reshape(len(slopes), len(t), n), u.derivatives(t, **named))
    return total


def _on_samples(u: SampledInput, starts: Array, lengths: Array, slopes: Array) -> Array:
    """As u.values: a value at fraction x of a piece is (1 - x) of its left end and x of its right one."""
    times, values = np.asarray(u.times), np.asarray(u.values)
    pieces = len(times) - 1
    piece = np.searchsorted(times, starts + lengths / 2, side="right") - 1
    held = np.clip(piece, 0, pieces - 1)
    on = np.zeros_like(values)
    if u.between == "constant":
        np.add.at(on, held, slopes.sum(axis=1))
        return on
    x = (starts[:, None] + lengths[:, None] * _AT - times[held, None]) / np.diff(times)[held, None]
    # before the first and after the last time u keeps its value there
    x = np.where((piece < 0)[:, None], 0.0, np.where((piece >= pieces)[:, None], 1.0, x))
    np.add.at(on, held, np.einsum("kg,kgi->ki", 1 - x, slopes))
    np.add.at(on, held + 1, np.einsum("kg,kgi->ki", x, slopes))
    return on
