"""A steering problem as the search sees it: a chain of exponentials with controls in slots, bounds, a goal.

    X = X0 E_1 ... E_K,   E_k = exp(a_k + sum_i (p_k u[s_k, i] + q_k u[s_k + 1, i]) b_ki)

The drift a_k and the directions b_ki are multiplied by the length of the piece beforehand, and come from a table of which
exponential k takes row entry[k]: one row for a constant system, one for each exponential where controls depend on time, one for
each letter of a word of arcs. Piecewise constant controls have p = 1, q = 0; controls that are linear between nodes have two
weights. One slot may drive several exponentials.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

from lie_codegen.arrays import Array


@dataclass(frozen=True, eq=False)
class Goal:
    """Where the chain must end, one goal a lane: left X right = value, or e^(i f) value with any f.

    Attributes:
        left, right: (p, d) and (d, s).
        value: (lanes, p, s).
        free_phase: whether any phase f will do.
    """

    left: Array
    right: Array
    value: Array
    free_phase: bool = False


@dataclass(frozen=True, eq=False)
class Programme:
    """The chain and what its controls may be.

    Attributes:
        basis: (n, d, d) of the algebra.
        start: (d, d) X0.
        drifts, directions: (rows, d, d) and (rows, m, d, d), the table.
        entry: (lanes or 1, K) the row of each exponential.
        slot: (K,) the slot s_k.
        share: (K, 2) the weights p_k, q_k.
        low, high: (S, m) bounds, infinite where there are none.
        weight: (S, m) of the objective; zero for what costs nothing.
        mass: (S,) length of each slot, in units of the usual one.
    """

    basis: Array
    start: Array
    drifts: Array
    directions: Array
    entry: Array
    slot: Array
    share: Array
    low: Array
    high: Array
    weight: Array
    mass: Array


@dataclass(frozen=True)
class Settings:
    """Of the search.

    Attributes:
        fuel: whether the objective is sum w |u| instead of 1/2 sum w u^2; with durations as controls it is the time.
        reach_iterations, descend_iterations: most steps of a lane in each stage.
        enough: residual at which a lane has arrived.
        damping: of the first step towards the goal, relative to the mean of the normal matrix.
        wanted: lanes, of those that run side by side, that must arrive before the others are left where they are.
        relative: gain of the objective, relative to it, below which a lane is done.
    """

    fuel: bool = False
    reach_iterations: int = 150
    descend_iterations: int = 150
    enough: float = 1e-12
    damping: float = 1e-2
    relative: float = 1e-8
    wanted: int = 1000


@dataclass(frozen=True, eq=False)
class Reached:
    """What a search found, lane by lane.

    Attributes:
        u: (lanes, S, m) controls.
        size: (lanes,) residual at the goal.
        cost: (lanes,) objective; of a descent only.
        multipliers: (lanes, n) of the reduced residual; of a descent only.
        used: (lanes,) iterations.
        phase: (lanes,) rad by which the ends are ahead of the values of a goal with a free phase; of reaching only.
    """

    u: Array
    size: Array
    cost: Array
    multipliers: Array
    used: Array
    phase: Array


class Machine(Protocol):
    """What searches: compiled C, or numpy."""

    compiled: bool

    def reach(self, programme: Programme, goal: Goal, u: Array, settings: Settings) -> Reached:
        """From any controls (lanes, S, m) towards the goal, within the bounds."""

    def descend(self, programme: Programme, goal: Goal, u: Array, settings: Settings) -> Reached:
        """From controls that reach the goal to cheaper ones that do."""

    def linearise(self, programme: Programme, goal: Goal, u: Array) -> tuple[Array, Array, Array]:
        """Residuals (lanes,), their reduced coordinates (lanes, n) and derivatives (lanes, n, S m) at u."""


def chosen(programme: Programme, goal: Goal, lanes: Array) -> tuple[Programme, Goal]:
    """The programme and goal of some of the lanes."""
    if len(programme.entry) > 1:
        programme = replace(programme, entry=programme.entry[lanes])
    return programme, replace(goal, value=goal.value[lanes])
