"""Rates of W = W_total + eps d phi . xi_e: the theorem's, by suprema one by one, and the pointwise one, by one eigenvalue problem a place.

Theorem 4.2, its matrices mended:  P = (1/2)[[2, eps/sqrt b_2], [., 1]],
                                   Q = [[eps/b_1, -eps (k_2 + V t)/(2 sqrt b_2)], [., k_1 - eps h]],   dW <= -lambda W, Q >= lambda P

Pointwise, z = (sqrt phi, xi_e), g = d phi/sqrt phi:  W = z^T P z,  dW/dt = -z^T Q z with
    P(E) = [[1, eps g^T/2], [., I/2]],   Q(E, nu) = [[eps g^T I^-1 g, eps g^T C/2], [., K_d - eps H_s]],
    C = I^-1 K_d - I^-1 N_nu - M_nu,   H_s = sym(H + I^-1 d phi . N_2),   M_nu e_b = [nu, e_b] - A_b nu,
from I xi_e' = -d phi - K_d xi_e + N_nu xi_e + N_2(xi_e, xi_e); M_nu vanishes for the right transport, where E' = E hat(xi_e).

Where the law shortens its damping, f_D = -s K_d xi_e with least <= s <= 1, K_d is s K_d in Q. Q is affine in s and its least eigenvalue relative
to P concave, so the least over s is at an end: both are looked at. In the theorem's Q k_1 belongs to the least s, k_2 to s = 1.

    W_total(t) <= k W_total(0) exp(-lambda t),  k = (1 + c)/(1 - c),  c = eps/sqrt(2 b_2), as |eps d phi . xi_e| <= c W_total.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.control.certificate_constants import Metric
from lie_codegen.control.level_search import LevelSearch, Places
from lie_codegen.on_demand import scipy

#: Turns of the exchange at most, and places that it remembers.
_EXCHANGES, _KEPT = 12, 40


@dataclass(frozen=True)
class Rate:
    """A rate with the eps at which it holds, and the overshoot k."""

    epsilon: float
    rate: float
    k: float


def overshoot_of(epsilon: float, b_2: float) -> float:
    """k."""
    c = epsilon / np.sqrt(2 * b_2)
    return float((1 + c) / (1 - c)) if c < 1 else float("inf")


def largest_epsilon(b_2: float, overshoot: float | None) -> float:
    """Where P stays positive, or k at the bound that was asked for."""
    whole = float(np.sqrt(2 * b_2))
    return whole if overshoot is None else whole * (overshoot - 1) / (overshoot + 1)


@dataclass(frozen=True)
class TheoremNumbers:
    """What Theorem 4.2 needs: b_1, b_2, h, t, the extreme values k_1, k_2 of K_d over I, and V."""

    b_1: float
    b_2: float
    h: float
    t: float
    k_1: float
    k_2: float
    V: float

    def P(self, epsilon: float, sign: float = 1.0) -> Array:
        """P_up, or with sign -1 P_low, which proves positivity alone."""
        off = sign * epsilon / np.sqrt(self.b_2)
        return np.array([[2, off], [off, 1]]) / 2

    def Q(self, epsilon: float) -> Array:
        """Q."""
        off = -epsilon * (self.k_2 + self.V * self.t) / (2 * np.sqrt(self.b_2))
        return np.array([[epsilon / self.b_1, off], [off, self.k_1 - epsilon * self.h]])

    def rate(self, epsilon: float) -> float:
        """The least generalised eigenvalue of (Q, P_up)."""
        P, Q = self.P(epsilon), self.Q(epsilon)
        return float(_least(P[None], Q[None])[0])

    def best(self, overshoot: float | None = None) -> Rate:
        """The largest rate."""
        high = largest_epsilon(self.b_2, overshoot)
        found = scipy.optimize.minimize_scalar(
            lambda e: -self.rate(e), bounds=(0, high), method="bounded", options={"xatol": 1e-12}
        )
        epsilon = float(found.x)
        return Rate(epsilon, self.rate(epsilon), overshoot_of(epsilon, self.b_2))


def _least(P: Array, Q: Array) -> Array:
    """(N,) least generalised eigenvalues; minus infinity where P is not positive."""
    values, vectors = np.linalg.eigh(P)
    good = values[:, 0] > 1e-13 * values[:, -1]
    half = vectors / np.sqrt(np.where(good[:, None], values, 1))[:, None, :]
    return np.where(good, np.linalg.eigvalsh(np.swapaxes(half, 1, 2) @ Q @ half)[:, 0], -np.inf)


def _peak(value: Callable[[float], float], high: float) -> float:
    """Where a unimodal function is largest on (0, high], by golden section."""
    ratio, low, top = (np.sqrt(5) - 1) / 2, 0.0, high
    a, b = top - ratio * (top - low), low + ratio * (top - low)
    at_a, at_b = value(a), value(b)
    while top - low > 1e-9 * high:
        if at_a >= at_b:
            top, b, at_b = b, a, at_a
            a = top - ratio * (top - low)
            at_a = value(a)
        else:
            low, a, at_a = a, b, at_b
            b = low + ratio * (top - low)
            at_b = value(b)
    middle = (low + top) / 2
    return float(high if value(high) >= value(middle) else middle)


class PointwiseRate:
    """lambda(eps) of one loop on one level."""

    def __init__(
        self, search: LevelSearch, metric: Metric, K_d: Array, feedforward: str, b_2: float, least: float = 1.0
    ) -> None:
        """`least`: the smallest share of the damping that the law ever gives."""
        self.search, self.metric, self.K_d, self.feedforward, self.b_2 = search, metric, K_d, feedforward, b_2
        self.shares = (1.0,) if least == 1 else (least, 1.0)
        self.seeds = search.places[:0]

    def rates(self, epsilon: float, places: Places) -> Array:
        """(N,) the least generalised eigenvalue at each place."""
        each = [_least(*self.matrices(epsilon, places, share * self.K_d)) for share in self.shares]
        return np.asarray(np.min(each, axis=0))

    def matrices(self, epsilon: float, places: Places, K_d: Array) -> tuple[Array, Array]:
        """P and Q at the places, (N, n + 1, n + 1)."""
        metric, n = self.metric, self.search.n
        found = self.search.samples.at(places.X, places.X_d)
        g = found.slope / np.sqrt(found.phi)[:, None]
        raised = found.slope @ metric.inverse
        linear, quadratic = self._feedforward(places)
        H = found.hessian + np.einsum("abc,nc->nab", quadratic, raised)
        C = metric.inverse @ K_d - metric.inverse @ linear - self._turned(places)
        P, Q = np.zeros((2, len(g), n + 1, n + 1))
        P[:, 0, 0] = 1
        P[:, 0, 1:] = P[:, 1:, 0] = epsilon * g / 2
        P[:, 1:, 1:] = metric.I / 2
        Q[:, 0, 0] = epsilon * np.einsum("na,ab,nb->n", g, metric.inverse, g)
        Q[:, 0, 1:] = Q[:, 1:, 0] = epsilon * np.einsum("na,nab->nb", g, C) / 2
        Q[:, 1:, 1:] = K_d - epsilon * (H + np.swapaxes(H, 1, 2)) / 2
        return P, Q

    def at(self, epsilon: float, starts: int = 3) -> float:
        """The least rate at this eps over the level; places where it was least before are tried again."""
        value, place = self.search.tracked(lambda places: self.rates(epsilon, places), self.seeds[:2], starts)
        self.seeds = place.before(self.seeds[:_KEPT])
        return value

    def best(self, overshoot: float | None = None) -> Rate:
        """The largest of these, by exchange: the best eps for the places found so far, then the worst place for that eps, in turn.

        At fixed places it is min over z of z^T Q z/z^T P z, quotients of functions affine in eps, so unimodal: the first half is a plain search.
        """
        high = largest_epsilon(self.b_2, overshoot) * (0.999 if overshoot is None else 1)
        # Far from the origin, as on SE(n) with phi not left-invariant, the best eps is a small part of the largest.
        grid = high * np.concatenate([np.geomspace(1e-4, 0.04, 8), np.linspace(0.05, 1, 20)])
        coarse = [self._least(float(e), self.search.places) for e in grid]
        epsilon = float(grid[int(np.argmax(coarse))])
        tried: dict[float, float] = {}
        for turn in range(_EXCHANGES):
            tried[epsilon] = self.at(epsilon, starts=4 if turn == 0 else 1)
            better = _peak(lambda e: self._least(e, self.seeds), high)
            best = max(tried, key=lambda e: tried[e])
            if self._least(better, self.seeds) - tried[best] <= 1e-6 * abs(tried[best]):
                # Beside a kink another place is the worst: looked for with more starts before it is believed.
                tried[best] = self.at(best, starts=6)
                better = _peak(lambda e: self._least(e, self.seeds), high)
                if self._least(better, self.seeds) - tried[best] <= 1e-6 * abs(tried[best]):
                    break
            epsilon = better
        best = max(tried, key=lambda e: tried[e])
        rate = min(tried[best], self.at(best, starts=6))
        return Rate(best, rate, overshoot_of(best, self.b_2))

    def _least(self, epsilon: float, places: Places) -> float:
        return float(np.min(self.rates(epsilon, places)))

    def _feedforward(self, places: Places) -> tuple[Array, Array]:
        """N_nu, (N, n, n) acting on xi_e, and N_2[a, b] = the part that is quadratic in xi_e, lowered, (n, n, n)."""
        metric, nu = self.metric, places.nu
        if self.feedforward == "levi_civita":  # N = -I nabla_xi xi_e
            lowered = metric.nabla @ metric.I
            return -np.einsum("abc,na->ncb", lowered, nu), -lowered
        own = metric.coadjoint  # ad*_(xi_e) I xi: the part quadratic in xi_e of all other feedforwards
        if self.feedforward == "right":  # + I [xi_e, nu]
            turn = np.einsum("abc,na->ncb", metric.coadjoint, nu)
            return np.asarray(turn + np.einsum("bad,dc,na->ncb", metric.bracket, metric.I, nu)), own
        return np.asarray(np.einsum("bac,na->ncb", metric.coadjoint, nu)), own

    def _turned(self, places: Places) -> Array:
        """M_nu, (N, n, n): what the motion of the reference does to d phi beside moving E."""
        samples, nu = self.search.samples, places.nu
        n = self.search.n
        transport = samples.pair.transport
        if transport == "right" or not self.search.speed:
            return np.zeros((1, n, n))
        turn = np.einsum("abc,na->ncb", self.metric.bracket, nu)
        if transport == "left":
            return np.asarray(turn)
        P, rates = samples.transport(places.X, places.X_d)
        xi_d = np.linalg.solve(P, nu[..., None])[..., 0]
        return np.asarray(turn - np.einsum("nbca,na->ncb", rates, xi_d))
