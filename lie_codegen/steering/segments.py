"""A chain of manoeuvres: a straight part, then one circle for each pair of controls, in turn."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lie_codegen.errors import SteeringError
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.simulation.flow import simulate
from lie_codegen.simulation.metric import matrix_log
from lie_codegen.steering.plan import Controls
from lie_codegen.steering.seeds import loop_areas

Array = NDArray[Any]

_NEGLIGIBLE = 1e-9
_ITERATIONS = 40


@dataclass(frozen=True)
class Chain:
    """The straight part x and the signed areas, one a pair of controls; unit time in equal parts.

    Attributes:
        group, controls: the system; controls are positions.
        straight: (m,) displacement of the straight part.
        pairs: of positions among the controls.
        areas: (pairs,).
    """

    group: MatrixGroup
    controls: tuple[int, ...]
    straight: Array
    pairs: tuple[tuple[int, int], ...]
    areas: Array

    @staticmethod
    def towards(group: MatrixGroup, controls: tuple[int, ...], x: Array) -> Chain:
        """The chain that reaches the coordinates x to second order; only pairs that are needed."""
        pairs, areas = loop_areas(group, controls, x)
        useful = [k for k, pair in enumerate(pairs) if _closes(group, controls, pair)]
        return Chain(group, controls, x[list(controls)], tuple(pairs[k] for k in useful), areas[useful])

    def loops(self) -> Iterator[tuple[tuple[int, int], float]]:
        """((position, position), area) of each loop."""
        for (a, b), area in zip(self.pairs, self.areas, strict=True):
            yield (self.controls[a], self.controls[b]), float(area)

    def controls_over(self, duration: float) -> Controls:
        """u(t): the straight part, then the circles r (cos, sin), each starting and ending at the origin of its plane."""
        parts = 1 + len(self.pairs)
        span = duration / parts

        def evaluate(t: Array) -> Array:
            u = np.zeros((len(t), self.group.dim))
            part = np.minimum((t / span).astype(int), parts - 1)
            straight = part == 0
            u[np.ix_(straight, list(self.controls))] = self.straight / span
            for number, ((a, b), area) in enumerate(zip(self.pairs, self.areas, strict=True), start=1):
                now = part == number
                angle = 2 * np.pi * (t[now] / span - number)
                speed = 2 * np.pi / span * np.sqrt(abs(area) / np.pi)
                u[now, self.controls[a]] = -speed * np.sin(angle)
                u[now, self.controls[b]] = np.sign(area) * speed * np.cos(angle)
            return u

        return Controls(evaluate, span * np.arange(1, parts))

    def end(self) -> Array:
        """(d, d) where the true system ends."""
        return np.asarray(simulate(self.group, self.controls_over(1.0), t=[0.0, 1.0], tolerance=1e-12).X[-1])

    def retuned(self, target: Array) -> Chain:
        """The chain, straight part and areas changed, that ends at the target exactly.

        Raises:
            SteeringError: if Gauss-Newton, damped, does not converge.
        """
        chain, gap = self, self._gap(target)
        damping = 1e-3
        for _ in range(_ITERATIONS):
            if np.max(np.abs(gap)) < 1e-12:
                return chain
            J = chain._slopes(target)
            step = np.linalg.solve(J.T @ J + damping**2 * np.eye(J.shape[1]), -J.T @ gap)
            trial = chain._moved(step)
            trial_gap = trial._gap(target)
            if np.linalg.norm(trial_gap) < np.linalg.norm(gap):
                chain, gap, damping = trial, trial_gap, damping * 0.1
            else:
                damping = max(damping * 5, 1e-8)
        if np.max(np.abs(gap)) < 1e-9:
            return chain
        raise SteeringError(
            f"steer({self.group.name}): the chain of loops cannot be retuned to the target (misses by {np.linalg.norm(gap):.2g}); "
            "use method='optimal', or exact=False with method='feedback'"
        )

    def _moved(self, step: Array) -> Chain:
        m = len(self.controls)
        return replace(self, straight=self.straight + step[:m], areas=self.areas + step[m:])

    def _gap(self, target: Array) -> Array:
        relative = np.linalg.solve(target, self.end())
        gap, off = matrix_log(self.group, relative)
        return gap if off <= 1e-6 else self.group.project(relative - np.eye(self.group.degree))

    def _slopes(self, target: Array) -> Array:
        """Central differences; the derivative by an area near zero is taken away from it, where it is smooth."""
        size = len(self.straight) + len(self.areas)
        h = 1e-5
        columns = []
        for k in range(size):
            e = np.zeros(size)
            e[k] = h
            columns.append((self._moved(e)._gap(target) - self._moved(-e)._gap(target)) / (2 * h))
        return np.array(columns).T


def _closes(group: MatrixGroup, controls: tuple[int, ...], pair: tuple[int, int]) -> bool:
    row = group.algebra.structure_constants[controls[pair[0]], controls[pair[1]]]
    free = [k for k in range(group.dim) if k not in controls]
    return bool(np.any(np.abs(row[free]) > _NEGLIGIBLE))
