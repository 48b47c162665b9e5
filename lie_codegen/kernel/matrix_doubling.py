"""exp(M), (e^M - 1)/M and M/(e^M - 1) of matrices of any size and norm: scaling and doubling, in NumPy and as CasADi Functions.

    A = 2^-s M with |A| <= 1/8,  P = sum_j A^j/(j + 1)!,  E = exp(A) - 1 = A P,  then s times
    exp         E <- 2 E + E^2
    jacobian    P <- P + P E/2 and E <- 2 E + E^2, for (e^{2t} - 1)/(2t) = (e^t - 1)/t (1 + (e^t - 1)/2)
    inverse     H <- H + Y H^{-1} Y and Y <- 2 Y from Y = A/2 and H = P^{-1} + Y, for h(2y) = h(y) + y^2/h(y) of h(y) = y coth y; then H - Y

s is what the norm asks for, and more halvings than the eigenvalues need do no harm: E, not exp, is doubled, and keeps its digits where it is
small. h is never near a pole that the result is not near, for y = k pi i implies 2 y = 2 k pi i. (With Y^2 H^{-1} what does not commute with
Y, as rounding errors, would grow by |Y| in each step, as in Newton's iteration for a square root; Y H^{-1} Y is even in them.) Where all of exp
is small, 1 + E cancels, and exp(M) = e^m exp(M - m) with m the mean of the eigenvalues does not. NaN beyond |M| = 2^52 (2^23 in floats), where
no digit of an angle is known. templates/far_routine.c.jinja is the same in C. Higham, Functions of Matrices (2008), chapter 10, for scaling.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.on_demand import casadi as ca

#: With norms up to 1/8 the first term left out is 8^-12/13! = 2e-21.
RADIUS, TERMS = 0.125, 12
MOST = 2.0**52
#: In single precision: 8^-7/8! = 1e-11.
MOST_SINGLE, TERMS_SINGLE = 2.0**23, 7
#: An exponential that is smaller was 1 + E with E near -1: it is found anew, with the mean of its eigenvalues as a factor.
_SMALL = 0.5
#: Halvings from 2^52 down to 1/8.
_MOST_DOUBLINGS = 55


def doubled(kind: str, M: Array, leading: int) -> Array:
    """exp(M), (e^M - 1) M^-1 ("jacobian") or M/(e^M - 1) ("inverse"); whether exp is small is seen in its first `leading` rows and columns."""
    with np.errstate(all="ignore"):
        value = _grown(kind, M)
        if kind == "exp" and np.max(np.abs(value[:leading, :leading])) < _SMALL:
            mean = float(np.trace(M)) / len(M)
            value = np.exp(mean) * _grown(kind, M - mean * np.eye(len(M)))
    return value


def _grown(kind: str, M: Array) -> Array:
    norm = float(np.max(np.sum(np.abs(M), axis=1)))
    if not norm <= MOST:
        return np.full_like(M, np.nan)
    doublings = max(0, int(np.ceil(np.log2(norm / RADIUS)))) if norm > 0 else 0
    A, one = M * 2.0**-doublings, np.eye(len(M))
    return _STEPS[kind](A, _series(A, one, lambda a, b: a @ b), one, doublings)


def _series(A: Any, one: Any, product: Callable[[Any, Any], Any]) -> Any:
    P = one
    for k in range(TERMS + 1, 1, -1):
        P = product(A, P) / k + one
    return P


def _exp(A: Array, P: Array, one: Array, doublings: int) -> Array:
    E = A @ P
    for _ in range(doublings):
        E = 2 * E + E @ E
    return E + one


def _jacobian(A: Array, P: Array, one: Array, doublings: int) -> Array:
    E = A @ P
    for _ in range(doublings):
        P = P + P @ E / 2
        E = 2 * E + E @ E
    return P


def _inverse(A: Array, P: Array, one: Array, doublings: int) -> Array:
    half = A / 2
    H = _solved(P, one) + half
    for _ in range(doublings):
        H = H + half @ _solved(H, half)
        half = 2 * half
    return H - half


_STEPS = {"exp": _exp, "jacobian": _jacobian, "inverse": _inverse}


def _solved(a: Array, b: Array) -> Array:
    """a^{-1} b; NaN where a is singular, as at a pole."""
    try:
        return np.asarray(np.linalg.solve(a, b))
    except np.linalg.LinAlgError:
        return np.full_like(b, np.nan)


def doubling_graph(kind: str, table: Array, rows: int, start: int, columns: int) -> Any:
    """x -> rows 0 .. rows - 1 of `columns` columns from `start`, row by row, of the function of the square matrix whose columns are table x.

    A CasADi Function of its own, which CasADi differentiates to any order.
    """
    m = math.isqrt(len(table))
    x = ca.MX.sym("x", table.shape[1])
    M = ca.reshape(ca.mtimes(ca.sparsify(ca.DM(table)), x), m, m)
    grown = _grown_graph(kind, m)
    value = grown(M)
    if kind == "exp":
        N = ca.MX.sym("M", m, m)
        mean = ca.trace(N) / m
        shifted = ca.Function("shifted", [N], [ca.exp(mean) * grown(N - mean * ca.DM.eye(m))])
        small = ca.mmax(ca.fabs(value[:rows, :rows])) < _SMALL
        value = ca.Function.if_else("whole", shifted, grown)(small, M)
    return ca.Function("far", [x], [ca.vec(value[:rows, start : start + columns].T)])


def _grown_graph(kind: str, m: int) -> Any:
    """As many doublings as ever there are, those that are not asked for the identity."""
    M = ca.MX.sym("M", m, m)
    norm = ca.mmax(ca.sum2(ca.fabs(M)))
    doublings = ca.fmax(0, ca.ceil(ca.log(norm / RADIUS) / math.log(2)))
    A = M * 2**-doublings
    one = ca.MX.eye(m)
    P = _series(A, one, ca.mtimes)
    states = [ca.solve(P, one, "qr") + A / 2, A / 2] if kind == "inverse" else [A @ P, P][: 1 + (kind == "jacobian")]
    start = ca.vertcat(*[ca.vec(state) for state in states], doublings)
    end = _doubling(kind, m, len(states)).fold(_MOST_DOUBLINGS)(start)
    first, last = (ca.reshape(end[k * m * m : (k + 1) * m * m], m, m) for k in (0, len(states) - 1))
    value = {"exp": first + one, "jacobian": last, "inverse": first - last}[kind]
    return ca.Function("grown", [M], [ca.densify(ca.if_else(norm <= MOST, value, math.nan))])


def _doubling(kind: str, m: int, count: int) -> Any:
    """(matrices, doublings that are left) after one more, or as they are where none is left."""
    state = ca.MX.sym("state", count * m * m + 1)
    E, other = (ca.reshape(state[k * m * m : (k + 1) * m * m], m, m) for k in (0, count - 1))
    if kind == "inverse":
        moved = [E + other @ ca.solve(E, other, "qr"), 2 * other]
    else:
        moved = [2 * E + E @ E, other + other @ E / 2][:count]
    after = ca.vertcat(*[ca.vec(each) for each in moved], state[-1] - 1)
    choice = ca.Function.if_else(
        "choice", ca.Function("more", [state], [after]), ca.Function("enough", [state], [state])
    )
    return ca.Function("doubling", [state], [choice(state[-1] > 0, state)])
