"""Kinematic reduction: products of exponentials of decoupling fields, followed exactly by torques from rest to rest.

Where <Y_a : Y_a> = d_ab Y_b lies in the span of the Y, xi = s'(t) a Y_a is a motion under u = s'' a b_a + (s' a)^2 d_ab b_b / 2 for any s. With the cubic
s = 3 x^2 - 2 x^3 a primitive of length T_i costs K_i / T_i^3; the durations of least sum are T_i ~ K_i^(1/4), the sum (sum_i K_i^(1/4))^4 / T^3. Of one axis alone
K_i = 12 (J_i a_i)^2.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise, product

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.errors import SteeringError
from lie_codegen.exact.counts import seeded
from lie_codegen.flow.batched_exponential import expm
from lie_codegen.flow.logarithm import matrix_log
from lie_codegen.mechanics.virtual_actuation import VirtualActuation
from lie_codegen.values import Value

_STARTS, _ITERATIONS, _SETTLED, _MOST_WORDS = 6, 60, 1e-12, 200


@dataclass(frozen=True, eq=False, repr=False)
class Primitives(Value):
    """u(t) of a sequence of primitives, (k,) times -> (k, n): plain data.

    Attributes:
        body: forces and inertia.
        word: the force of each primitive; amounts: how far each goes.
        ends: (L + 1,) times.
    """

    body: VirtualActuation
    word: tuple[int, ...]
    amounts: Array
    ends: Array

    def inputs(self, t: Array) -> Array:
        """(k, m) u^a."""
        place = np.clip(np.searchsorted(self.ends, t, side="right") - 1, 0, len(self.word) - 1)
        lengths = np.diff(self.ends)[place]
        x = (t - self.ends[place]) / lengths
        first, second = 6 * x * (1 - x) / lengths, 6 * (1 - 2 * x) / lengths**2
        which, amount = np.array(self.word)[place], self.amounts[place]
        u = (amount * first)[:, None] ** 2 / 2 * self.body.compensation[which]
        u[np.arange(len(t)), which] += amount * second
        return np.asarray(u)

    def __call__(self, t: Array) -> Array:
        """(k,) times -> (k, n)."""
        return np.asarray(self.inputs(t) @ self.body.forces)


def primitives(body: VirtualActuation, target: Array, duration: float, seed: int = 0) -> tuple[Primitives, float]:
    """The cheapest sequence found, and its cost int |u|^2.

    Raises:
        SteeringError: no word of decoupling fields was found to reach the target.
    """
    best: tuple[float, Primitives] | None = None
    rng = seeded(seed, "primitives")
    for length in (body.group.dim, body.group.dim + 2):
        for word in _words(body.decoupling, length):
            for _ in range(_STARTS):
                amounts = _solved(body, word, target, rng.normal(scale=0.7, size=length))
                if amounts is None:
                    continue
                keep = np.abs(amounts) > 1e-12
                if not np.any(keep):
                    continue
                short = tuple(w for w, k in zip(word, keep, strict=True) if k)
                sizes = np.array([price(body, w, a) for w, a in zip(short, amounts[keep], strict=True)]) ** 0.25
                cost = float(np.sum(sizes) ** 4 / duration**3)
                if best is None or cost < best[0] * (1 - 1e-9):
                    ends = np.concatenate([[0.0], np.cumsum(sizes) / np.sum(sizes) * duration])
                    ends[-1] = duration
                    best = cost, Primitives(body, short, amounts[keep], ends)
        if best is not None:
            return best[1], best[0]
    names = ", ".join(body.names[a] for a in body.decoupling) or "none"
    raise SteeringError(
        f"symmetric_product: no sequence of primitives (decoupling fields: {names}) was found that reaches the target"
    )


def price(body: VirtualActuation, which: int, amount: float) -> float:
    """K of a primitive: its cost over unit time."""
    x, w = np.polynomial.legendre.leggauss(12)
    x, w = (x + 1) / 2, w / 2
    u = (amount * 6 * x * (1 - x))[:, None] ** 2 / 2 * body.compensation[which]
    u[:, which] += amount * 6 * (1 - 2 * x)
    return float(w @ np.sum((u @ body.forces) ** 2, axis=1))


def _words(fields: tuple[int, ...], length: int) -> Iterator[tuple[int, ...]]:
    count = 0
    for word in product(fields, repeat=length):
        if all(a != b for a, b in pairwise(word)):
            yield word
            count += 1
            if count >= _MOST_WORDS:
                return


def _solved(body: VirtualActuation, word: tuple[int, ...], target: Array, amounts: Array) -> Array | None:
    """Newton on log(target^-1 exp(a_1 Y) ... exp(a_L Y)) = 0; X^-1 dX/da_i = Ad(what follows, inverted) Y_i."""
    group = body.group
    hats = group.hat(body.lifts[list(word)])
    for _ in range(_ITERATIONS):
        steps = expm(amounts[:, None, None] * hats)
        after = np.eye(group.degree, dtype=steps.dtype)
        columns = []
        for i in range(len(word) - 1, -1, -1):
            columns.append(group.project(np.linalg.solve(after, hats[i] @ after)))
            after = steps[i] @ after
        log, off = matrix_log(group, np.linalg.solve(target, after))
        if not np.all(np.isfinite(log)) or off > 1e-6:
            return None
        if np.linalg.norm(log) <= _SETTLED:
            return amounts
        change = np.linalg.lstsq(np.array(columns[::-1]).T, -log, rcond=1e-8)[0]
        amounts = amounts + change * min(1.0, 1.0 / max(1e-300, float(np.linalg.norm(change))))
    return None
