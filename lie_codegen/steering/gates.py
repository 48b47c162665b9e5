"""Gates as goals: a unitary matrix up to its phase, on the whole space or on some levels of it (the others are leakage)."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.errors import NotOnGroupError, ShapeError, SteeringInputError
from lie_codegen.flow.elements import group_element
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.steering.end import End, element_end

#: A gate that is nearer to a unitary one (printed with a few digits) counts as that one.
_UNITARY = 1e-5


def gate_end(group: MatrixGroup, given: ArrayLike, levels: Sequence[int] | None, where: str) -> End:
    """The end where X, or its block of some levels, is a gate up to a phase.

    Raises:
        SteeringInputError: a group of real matrices, or levels that it does not have.
        ShapeError, NotOnGroupError: about the gate.
    """
    gate = np.array(given, dtype=complex)
    d, none = group.degree, np.zeros((0, group.dim))
    if not group.is_complex:
        raise SteeringInputError(
            f"{where}: UpToPhase needs a group of complex matrices (su2, su4 ...), not {group.name}"
        )
    kept = tuple(range(d)) if levels is None else _kept(levels, d, where)
    gate = _unitary(gate, len(kept), where)
    if len(kept) < d:
        return _block_end(group, gate, kept, where)
    whole = _whole_phase(group)
    if whole is not None:
        return element_end(group, gate[None], none, whole[None])
    phases = (-np.angle(np.linalg.det(gate)) + 2 * np.pi * np.arange(d)) / d
    elements = np.exp(1j * phases)[:, None, None] * gate
    if group.dim < d * d - 1:
        fits = [_fits(group, element, where) for element in elements]
        if not any(fits):
            raise NotOnGroupError(f"{where}: no phase takes the gate into the group {group.name}")
        phases, elements = phases[fits], elements[fits]
    turns = tuple(float(phase) for phase in np.mod(phases, 2 * np.pi))
    return element_end(group, elements, none, none, turns)


@lru_cache(maxsize=64)
def _whole_phase(group: MatrixGroup) -> Array | None:
    """(n,) coordinates of i times the identity, where the algebra has it."""
    phase = 1j * np.eye(group.degree)
    whole = group.project(phase)
    return whole if np.allclose(group.hat(whole), phase, atol=1e-12) else None


def _fits(group: MatrixGroup, element: Array, where: str) -> bool:
    try:
        group_element(group, element, where)
    except NotOnGroupError:
        return False
    return True


def _unitary(gate: Array, size: int, where: str) -> Array:
    """The unitary matrix that a gate printed with a few digits means."""
    if gate.shape != (size, size):
        raise ShapeError(f"{where}: UpToPhase holds a matrix of shape {gate.shape}; give ({size}, {size})")
    # the nearest unitary matrix is the unitary factor of the polar form
    left, sizes, right = np.linalg.svd(gate)
    off = float(np.max(np.abs(sizes - 1)))
    if off > _UNITARY:
        raise NotOnGroupError(
            f"{where}: UpToPhase needs a unitary matrix; the singular values of the one given differ from 1 by {off:.2g}"
        )
    return np.asarray(left @ right)


def _kept(levels: Sequence[int], d: int, where: str) -> tuple[int, ...]:
    """The levels, checked."""
    whole = [level for level in levels if isinstance(level, int | np.integer) and 0 <= level < d]
    if not whole or len(set(whole)) < len(list(levels)):
        raise SteeringInputError(
            f"{where}: levels of UpToPhase are different whole numbers from 0 to {d - 1}, got {levels!r}"
        )
    return tuple(int(level) for level in whole)


def _block_end(group: MatrixGroup, gate: Array, levels: tuple[int, ...], where: str) -> End:
    """X = e^(i f) gate on the levels, any unitary matrix on the others: the coset T H, H the motions that give the levels one common
    phase and stay apart on the others. No population has left the levels then.
    """
    d = group.degree
    inside = np.ix_(levels, levels)
    others = [level for level in range(d) if level not in levels]
    away = np.array(group.basis)
    for A in away:
        A[inside] -= np.trace(A[inside]) / len(levels) * np.eye(len(levels))
        A[np.ix_(others, others)] = 0
    rows = away.reshape(group.dim, -1)
    _, sizes, directions = np.linalg.svd(np.hstack([rows.real, rows.imag]).T, full_matrices=True)
    free = directions[int(np.sum(sizes > 1e-10 * max(1.0, float(sizes[0])))) :]
    element = np.eye(d, dtype=complex)
    element[inside] = gate
    # the determinant goes to a level outside, which the goal does not care about
    element[others[0], others[0]] = 1 / np.linalg.det(gate)
    element = group_element(group, element, where)
    return element_end(group, element[None], np.zeros((0, group.dim)), free, levels=levels)
