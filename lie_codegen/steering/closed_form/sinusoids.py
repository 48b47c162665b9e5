"""method="sinusoids": chained systems by sinusoids of growing order, exactly (Murray and Sastry, IEEE Trans. Automatic Control 38 (1993) 700).

Two controls A, B with [A, B] = e_3, [A, e_3] = e_4, ..., all other brackets zero. With X = exp(x A) exp(sum_k y_k e_k), e_2 = B,

    x' = u_1,   y_2' = u_2,   y_(k+1)' = -u_1 y_k:

a straight line brings x and y_2 to their goals; then u_1 = a sin wt, u_2 = b cos kwt over one period moves y_(k+2) by
(-a / 2w)^k (b / k!) 2 pi / w, nothing below it, and what is above it as well: hence from the lowest bracket up, each loop's effect
on the higher ones being taken along. Of all a^k b that do it a^2 = k b^2 costs least.
"""

from __future__ import annotations

import math
import time
from dataclasses import dataclass
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.errors import NotOnGroupError, SteeringInputError
from lie_codegen.flow.second_kind_coordinates import second_kind
from lie_codegen.kernel.runge_kutta import propagators
from lie_codegen.steering.plan import Controls, Plan, Status
from lie_codegen.steering.simulated_plan import simulated_plan
from lie_codegen.steering.task import Task

_STEPS = 4096
_TINY = 1e-13


@dataclass(frozen=True)
class LineAndSinusoids:
    """The controls as plain data.

    Attributes:
        dim, positions: n, and the positions of A and B.
        line: displacement of x and y_2 in the first phase.
        loops: (a, b, k) of each further phase.
        phase: length of a phase, s.
    """

    dim: int
    positions: tuple[int, int]
    line: tuple[float, float]
    loops: tuple[tuple[float, float, int], ...]
    phase: float

    def __call__(self, t: Array) -> Array:
        """(k,) times -> (k, n)."""
        u = np.zeros((len(t), self.dim))
        number = np.clip((t / self.phase).astype(int), 0, len(self.loops))
        angle = 2 * np.pi * (t / self.phase - number)
        for which, position in enumerate(self.positions):
            u[:, position] = self.line[which] / self.phase
        for row, (a, b, k) in enumerate(self.loops, start=1):
            now = number == row
            u[now, self.positions[0]] = a * np.sin(angle[now])
            u[now, self.positions[1]] = b * np.cos(k * angle[now])
        return u


def sinusoids(task: Task) -> Plan:
    """The exact plan of a line and one sinusoid for each bracket.

    Raises:
        SteeringInputError: not two controls of a chained system.
    """
    started = time.perf_counter()
    first, second, chain = _chain(task)
    x, y = _coordinates(task, first, chain)
    phase = task.duration / len(chain)  # a line, and a loop for each bracket
    w = 2 * math.pi / phase
    now = _flown(np.zeros(len(y)), lambda s: x / phase, lambda s: y[0] / phase, phase)
    loops = []
    for k in range(1, len(y)):
        want = float(y[k] - now[k])
        effect = (-1 / (2 * w)) ** k / math.factorial(k) * 2 * math.pi / w  # of a^k b
        product = want / effect
        b = math.copysign((abs(product) / k ** (k / 2)) ** (1 / (k + 1)), product)
        a = math.sqrt(k) * abs(b)
        loops.append((a, b, k))
        if abs(want) > _TINY:
            now = _flown(now, lambda s, a=a: a * np.sin(w * s), lambda s, b=b, k=k: b * np.cos(k * w * s), phase)
    law = LineAndSinusoids(task.group.dim, (first, second), (float(x), float(y[0])), tuple(loops), phase)
    details = {
        "winner": "sinusoids",
        "loops": law.loops,
        "chain": tuple(task.group.labels[position] for position, _ in chain),
        "discretisation": "none: closed form, exact",
    }
    u = Controls(law, phase * np.arange(1, len(loops) + 1))
    seconds = {"plan": time.perf_counter() - started}
    return simulated_plan(task, "sinusoids", u, details, seconds, solved=Status.SOLVED, otherwise=Status.APPROXIMATE)


def _chain(task: Task) -> tuple[int, int, list[tuple[int, float]]]:
    """Positions of A and B, and (position, factor) with e_k = factor times the basis element, e_2 first."""
    if len(task.controls) == 2:
        for first, second in (task.controls, task.controls[::-1]):
            chain = _chain_of(task, first, second)
            if chain is not None:
                return first, second, chain
    raise SteeringInputError(
        f"sinusoids needs two controls A, B of {task.group.name} whose brackets [A, B], [A, [A, B]], ... are the other basis elements, "
        "with no other bracket; use method='loops', 'optimal' or 'direct'"
    )


def _chain_of(task: Task, first: int, second: int) -> list[tuple[int, float]] | None:
    c = task.group.algebra.structure_constants
    n = task.group.dim
    chain = [(second, 1.0)]
    while len(chain) < n:
        position, factor = chain[-1]
        row = factor * c[first, position]
        inside = np.flatnonzero(row)
        if len(inside) != 1:
            break
        chain.append((int(inside[0]), float(row[inside[0]])))
    others = [position for position, _ in chain]
    covers = sorted([first, *others]) == list(range(n)) and not np.any(c[first, others[-1]])
    return chain if covers and not np.any(c[np.ix_(others, others)]) else None


def _coordinates(task: Task, first: int, chain: list[tuple[int, float]]) -> tuple[float, Array]:
    """x and y_2, y_3, ... of the target."""
    labels = task.group.labels
    order = [labels[first], *(labels[position] for position, _ in chain)]
    try:
        g = second_kind(task.group.reorder(order), task.target)
    except NotOnGroupError as error:
        raise SteeringInputError(f"sinusoids: {error}; use method='optimal'") from None
    return float(g[0]), np.array([value / factor for value, (_, factor) in zip(g[1:], chain, strict=True)])


def _flown(y: Array, u1: Any, u2: Any, phase: float) -> Array:
    """The chain's coordinates after one phase, by Runge-Kutta steps; u1 and u2 of an array of times are smooth there."""
    s, n = np.linspace(0.0, phase, 2 * _STEPS + 1), len(y)
    A = np.zeros((len(s), n + 1, n + 1))  # of (y, 1)
    A[:, 0, n] = u2(s)
    A[:, range(1, n), range(n - 1)] = -np.reshape(u1(s), (-1, 1))
    parts = propagators(A, phase / _STEPS)
    while len(parts) > 1:  # two neighbours at a time, the later on the left
        even = len(parts) // 2 * 2
        parts = np.concatenate([parts[1:even:2] @ parts[:even:2], parts[even:]])
    return np.asarray((parts[0] @ np.append(y, 1.0))[:n])
