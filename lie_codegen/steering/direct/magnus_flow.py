"""Where controls really lead: an own integration of the system, which stops at every breakpoint, to accept or refuse a plan by.

On each piece X' = X hat(a(t)) is followed by Magnus steps of order six on three Gauss points (Blanes, Casas and Ros, BIT 40 (2000) 434,
with the signs of a velocity that acts from the right); the steps are halved until the states agree.
"""

from __future__ import annotations

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.flow.batched_exponential import expm
from lie_codegen.flow.magnus.exponent import GAUSS, from_gauss
from lie_codegen.steering.direct.inputs import Drive

_AGREE = 1e-13
_MOST = 256


def end_reached(drive: Drive) -> Array:
    """(d, d) where the true system ends under the inputs of `drive`, drift included."""
    if not _one_exponential(drive):
        return np.asarray(states_reached(drive)[1][-1])
    inputs, system = drive.inputs, drive.system
    now = np.zeros(1)
    a = system.drift.at(now) + inputs.first @ system.directions_at(now)[0]
    E = expm(system.group.hat(np.diff(inputs.knots)[:, None] * a))
    # neighbours are multiplied side by side: six products of arrays for 48 pieces, not 48 of matrices
    while len(E) > 1:
        pairs = E[: len(E) - len(E) % 2].reshape(-1, 2, *E.shape[1:])
        first, second = (1, 0) if system.right else (0, 1)
        E = np.concatenate([pairs[:, first] @ pairs[:, second], E[2 * len(pairs) :]])
    return np.asarray(E[0] @ system.start if system.right else system.start @ E[0])


def states_reached(drive: Drive, parts: int = 1) -> tuple[Array, Array]:
    """Times (K parts + 1,) and states (K parts + 1, d, d) under the inputs of `drive`, drift included."""
    knots = drive.inputs.knots
    if _one_exponential(drive):
        return _states(drive, knots, parts, 1)
    steps, (t, before) = 1, _states(drive, knots, parts, 1)
    while True:
        steps *= 2
        _, after = _states(drive, knots, parts, steps)
        scale = max(1.0, float(np.max(np.abs(after))))
        off = float(np.max(np.abs(after - before)))
        # the difference is the error of the coarser run; that of the finer one is 2^6 times smaller
        if not off > 64 * _AGREE * scale or steps >= _MOST:
            return t, after
        before = after


def _one_exponential(drive: Drive) -> bool:
    """Whether the velocity is constant on each piece, so that one exponential of it is exact."""
    return drive.system.steady and bool(np.all(drive.inputs.first == drive.inputs.last))


def _exponentials(drive: Drive, t: Array, h: Array) -> Array:
    """exp(h a) of the velocities a that hold from t on, as they act on X."""
    sampled = Drive(drive.system, drive.inputs, True)
    return expm(drive.system.group.hat(h[:, None] * sampled(t)))


def _states(drive: Drive, knots: Array, parts: int, steps: int) -> tuple[Array, Array]:
    """States at every part of every piece, `steps` Magnus steps a part."""
    system, exact = drive.system, _one_exponential(drive)
    inner = np.arange(parts * steps) / (parts * steps)
    t0 = (knots[:-1, None] + np.diff(knots)[:, None] * inner).ravel()
    h = np.repeat(np.diff(knots) / (parts * steps), parts * steps)
    if exact:
        E = _exponentials(drive, t0, h)
        E = np.swapaxes(E, 1, 2) if system.right else E
    else:
        sampled = Drive(system, drive.inputs, True)
        a = [system.group.hat(h[:, None] * sampled(t0 + c * h)) for c in GAUSS]
        if system.right:
            a = [np.swapaxes(each, 1, 2) for each in a]
        E = expm(from_gauss(_reversed_commutator, *a))
    X = np.asarray(system.start, dtype=E.dtype)
    X = X.T if system.right else X
    states = [X]
    for k, step in enumerate(E, start=1):
        X = X @ step
        if k % steps == 0:
            states.append(X)
    found = np.array(states)
    return np.append(t0[::steps], knots[-1]), np.swapaxes(found, 1, 2) if system.right else found


def _reversed_commutator(x: Array, y: Array) -> Array:
    return np.asarray(y @ x - x @ y)
