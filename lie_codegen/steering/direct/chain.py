"""The end of a chain of exponentials and its exact derivative by every control, in numpy, many lanes at once."""

from __future__ import annotations

import math

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.flow.batched_exponential import expm
from lie_codegen.steering.direct.programme import Goal, Programme


def linearise(programme: Programme, goal: Goal, u: Array) -> tuple[Array, Array, Array]:
    """Residual r (L, q), reduced residual (L, n) and its derivative J (L, n, S m) at controls u (L, S, m)."""
    lanes, slots, m = u.shape
    E, dE = factors(programme, u)
    r, reduced, rows = by_factors(programme, goal, E, dE)
    J = np.zeros((slots, lanes, rows.shape[1], m))
    moving = np.moveaxis(rows, 2, 0)
    for k, (slot, (p_k, q_k)) in enumerate(zip(programme.slot, programme.share, strict=True)):
        J[slot] += p_k * moving[k]
        if q_k != 0:
            J[slot + 1] += q_k * moving[k]
    return r, reduced, np.moveaxis(J, 0, 2).reshape(lanes, -1, slots * m)


def factors(programme: Programme, u: Array) -> tuple[Array, Array]:
    """The exponentials E (L, K, d, d) at controls u (L, S, m), and their derivatives (L, K, m, d, d) by what drives each."""
    return exponentials(*_exponents(programme, u))


def _exponents(programme: Programme, u: Array) -> tuple[Array, Array]:
    """What the exponentials are of, (L, K, d, d), and the directions (L, K, m, d, d) in which controls move it."""
    p = programme
    entry = np.broadcast_to(p.entry, (len(u), p.entry.shape[1]))
    b = p.directions[entry]
    driven = p.share[:, :1] * u[:, p.slot] + p.share[:, 1:] * u[:, np.minimum(p.slot + 1, u.shape[1] - 1)]
    moved = driven[:, :, None] @ b.reshape(*driven.shape, -1)
    return p.drifts[entry] + moved.reshape(b[:, :, 0].shape), b


def by_factors(programme: Programme, goal: Goal, E: Array, dE: Array) -> tuple[Array, Array, Array]:
    """Residual r (L, q), reduced residual (L, n) and how that changes with each of the factors, (L, n, K, m)."""
    K, d = E.shape[1], E.shape[-1]
    before, after = np.empty_like(E), np.empty_like(E)
    X = np.broadcast_to(programme.start, E[:, 0].shape).astype(E.dtype)
    for k in range(K):
        before[:, k] = X
        X = X @ E[:, k]
    tail = np.broadcast_to(np.eye(d), X.shape).astype(E.dtype)
    for k in range(K - 1, -1, -1):
        after[:, k] = tail
        tail = E[:, k] @ tail
    # dX/du_k = E_1 .. E_k-1 (dE_k/du_k) E_k+1 .. E_K: with the products from both ends one matrix product a control
    moved = (goal.left @ before)[:, :, None] @ dE @ (after @ goal.right)[:, :, None]
    r, reduce = residual(programme.basis, goal, X)
    moved = _following(goal, goal.left @ X @ goal.right, moved)[1]
    slopes = flat(moved)
    rows = slopes.reshape(len(slopes), -1, slopes.shape[-1]) @ np.swapaxes(reduce, 1, 2)
    rows = np.moveaxis(rows.reshape(*slopes.shape[:3], -1), 3, 1)
    return r, (reduce @ r[..., None])[..., 0], rows


def residual(basis: Array, goal: Goal, X: Array) -> tuple[Array, Array]:
    """The residual (L, q) and (L, n, q) rows that reduce it: an orthonormal basis of what motions of X change.

    With D = dr/dx (q, n) along X hat(x) and D'D = L L', the rows are L^-1 D'.
    """
    here = goal.left @ X @ goal.right
    slopes = (goal.left @ X)[:, None] @ basis @ goal.right
    value, slopes = _following(goal, here, slopes)
    D = flat(slopes)
    gram = D @ np.swapaxes(D, 1, 2)
    n = gram.shape[1]
    # motions that the goal leaves free change nothing: without the shift the factor would not exist
    gram = gram + (1e-13 * np.trace(gram, axis1=1, axis2=2) / n + 1e-300)[:, None, None] * np.eye(n)
    return flat(here - value), np.linalg.solve(np.linalg.cholesky(gram), D)


def _following(goal: Goal, here: Array, slopes: Array) -> tuple[Array, Array]:
    """What X is compared with (L, p, s), and how fast the difference changes where X does as slopes (L, ..., p, s)."""
    if not goal.free_phase:
        return goal.value, slopes
    # |X - e^(i phi) U| is least at the phase of <U, X>; as X moves that phase turns too, at `rate`, and so does what X is compared with
    overlap = np.sum(np.conj(goal.value) * here, axis=(1, 2))
    value = (overlap / np.abs(overlap))[:, None, None] * goal.value
    between = tuple(range(1, slopes.ndim - 2))
    rate = np.imag(
        np.sum(np.expand_dims(np.conj(goal.value), between) * slopes, axis=(-2, -1)) / np.expand_dims(overlap, between)
    )
    return value, slopes - 1j * rate[..., None, None] * np.expand_dims(value, between)


def flat(matrices: Array) -> Array:
    """(..., p, s) -> (..., q): real and imaginary parts of the entries side by side."""
    rows = matrices.reshape(*matrices.shape[:-2], -1)
    return np.concatenate([rows.real, rows.imag], axis=-1) if np.iscomplexobj(rows) else rows


def exponentials(a: Array, b: Array) -> tuple[Array, Array]:
    """exp(a) (..., d, d) and its derivatives (..., m, d, d) along b: by eigenvectors where a is skew-Hermitian, else by a series."""
    if np.array_equal(a, -np.conj(np.swapaxes(a, -1, -2))):
        return _unitary(a, b)
    return _by_series(a, b)


def _unitary(a: Array, b: Array) -> tuple[Array, Array]:
    """With a = V diag(i w) V^H: exp(a) = V diag(e^(i w)) V^H, and along b the entries of V^H b V by the divided differences of exp
    (Daleckii and Krein), e^(i (w_j + w_k) / 2) sinc((w_j - w_k) / 2), which equal w leave alone."""
    w, V = np.linalg.eigh(-1j * a)
    back = np.conj(np.swapaxes(V, -1, -2))
    E = (V * np.exp(1j * w)[..., None, :]) @ back
    turn = np.exp(0.5j * w)
    apart = np.sinc((w[..., :, None] - w[..., None, :]) / (2 * np.pi))
    differences = turn[..., :, None] * turn[..., None, :] * apart
    inner = back[..., None, :, :] @ b @ V[..., None, :, :]
    dE = V[..., None, :, :] @ (differences[..., None, :, :] * inner) @ back[..., None, :, :]
    if np.iscomplexobj(a) or np.iscomplexobj(b):
        return E, dE
    return E.real.copy(), dE.real.copy()


def _by_series(a: Array, b: Array) -> tuple[Array, Array]:
    """Taylor's polynomial by Horner's rule, then squarings."""
    size = float(np.max(np.sum(np.abs(a), axis=-2), initial=0.0))
    halvings = max(0, math.ceil(math.log2(size / 1.5))) if size > 1.5 else 0
    a, b = a / 2**halvings, b / 2**halvings
    terms = degree(size / 2**halvings)
    d = a.shape[-1]
    eye = np.eye(d)
    E = np.broadcast_to(eye, a.shape) + a / terms
    dE = b / terms
    wide = a[..., None, :, :]
    for j in range(terms - 1, 0, -1):
        dE = (b @ E[..., None, :, :] + wide @ dE) / j
        E = eye + a @ E / j
    for _ in range(halvings):
        dE = E[..., None, :, :] @ dE + dE @ E[..., None, :, :]
        E = E @ E
    return E, dE


def degree(size: float) -> int:
    """Terms after which Taylor's series of exp is exact to rounding for matrices of that norm."""
    left, j = size, 1
    while left > 1e-17 and j < 40:
        j += 1
        left *= size / j
    return max(2, j)


def phase_ahead(programme: Programme, goal: Goal, u: Array) -> Array:
    """(L,) the phase of <value, left X right> at the end of controls u, zero where the goal leaves none free."""
    if not goal.free_phase:
        return np.zeros(len(u))
    here = goal.left @ end(programme, u) @ goal.right
    return np.asarray(np.angle(np.sum(np.conj(goal.value) * here, axis=(1, 2))))


def end(programme: Programme, u: Array) -> Array:
    """X (L, d, d) at the end of the chain."""
    E = expm(_exponents(programme, u)[0])
    X = np.broadcast_to(programme.start, E[:, 0].shape)
    for k in range(E.shape[1]):
        X = X @ E[:, k]
    return np.asarray(X)
