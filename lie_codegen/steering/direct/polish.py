"""Stage 3: from constant pieces to controls that are linear between nodes, and to the end that the true system must reach.

The optimal controls of an energy are continuous (the clipped costate), so that linear pieces cost 1e-5 above the continuum where
constant ones cost up to 1 %. Nodes double until the cost stands still. The programme's flow is an approximation of fourth
order: the true system is flown, and the goal moved by what it misses, until it does not.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.steering.direct.assemble import Manoeuvre, constant_pieces, linear_pieces
from lie_codegen.steering.direct.inputs import Drive, Inputs
from lie_codegen.steering.direct.magnus_flow import end_reached
from lie_codegen.steering.direct.programme import Machine, Programme, Settings
from lie_codegen.steering.direct.search import once_more, restored

_ROUNDS = 6
_STILL = 1e-5
_MOST_NODES = 384
#: Steps of the descent on each grid, and the dimension above which the grids end earlier.
_ITERATIONS, _SMALL = 60, 8


@dataclass(frozen=True, eq=False)
class Flown:
    """Inputs that the true system has followed.

    Attributes:
        inputs: the controls.
        X: (d, d) where the true system ends.
        miss: |L X' R - value| there, X' = X after the free motions.
        free: the free motions, from the left and from the right.
    """

    inputs: Inputs
    X: Array = field(repr=False)
    miss: float
    free: tuple[Array, Array] = field(repr=False)


def as_inputs(task: Manoeuvre, u: Array, linear: bool) -> Inputs:
    """Controls (S, m) of a programme as inputs of the system's own time."""
    own = task.own(u)
    pieces = len(own) - 1 if linear else len(own)
    knots = np.linspace(0.0, task.duration, pieces + 1)
    made = Inputs.linear(knots, own) if linear else Inputs.constant(knots, own)
    return made.reversed() if task.system.right else made


def flown(task: Manoeuvre, u: Array, variant: int, linear: bool) -> Flown:
    """Where the controls (S, m) of a programme really lead."""
    inputs = as_inputs(task, u, linear)
    X = end_reached(Drive(task.system, inputs))
    left, right = task.free_motions(u)
    end = task.end
    miss = end.left @ left @ X @ right @ end.right - end.values[variant]
    return Flown(inputs, X, float(np.linalg.norm(miss)), (left, right))


def corrected(
    task: Manoeuvre, machine: Machine, programme: Programme, u: Array, variant: int, linear: bool, settings: Settings
) -> tuple[Array, Flown]:
    """The controls, restored until the true system is at the goal, to rounding where that is possible.

    The programme ends at X D where the true system ends at X: it is asked for the goal with R replaced by D^-1 R.
    """
    goal = task.goal(np.array([variant]))
    best_u, best = u, flown(task, u, variant, linear)
    shifted = goal
    for _ in range(_ROUNDS):
        if best.miss <= 1e-12 * max(1.0, float(np.max(np.abs(task.end.values)))):
            break
        claimed, true = _ends(task, programme, best_u, best)
        shifted = replace(goal, right=np.linalg.solve(claimed, true) @ goal.right)
        u, _ = restored(machine, programme, shifted, best_u, settings)
        now = flown(task, u, variant, linear)
        if not now.miss < best.miss:
            break
        best_u, best = u, now
    return best_u, best


def _ends(task: Manoeuvre, programme: Programme, u: Array, now: Flown) -> tuple[Array, Array]:
    """Where the programme ends by its own account, and where it should say it does: both of the left-invariant chain."""
    from lie_codegen.steering.direct.chain import end

    system = task.system
    true = now.free[0] @ now.X @ now.free[1]
    if system.right:
        true = true @ np.linalg.inv(system.start)
    return end(programme, u[None])[0], true


def polished(
    task: Manoeuvre, machine: Machine, u: Array, variant: int, cost: float, settings: Settings
) -> tuple[Array, Programme, int]:
    """Node values of linear controls (S, m), their programme and pieces, from constant pieces (S, m)."""
    before, after = task.free_slots
    own = task.own(u)
    pieces = len(own)
    values = np.concatenate([own[:1], (own[1:] + own[:-1]) / 2, own[-1:]])
    speed = _speed(task, own)
    goal = task.goal(np.array([variant]))
    settings = replace(settings, relative=1e-9, descend_iterations=min(_ITERATIONS, settings.descend_iterations))
    most = _MOST_NODES if task.system.group.dim <= _SMALL else _MOST_NODES // 3
    last = np.inf
    while True:
        programme = linear_pieces(task, pieces, speed)
        start = np.concatenate([u[:before], values, u[len(u) - after :]])
        found, residual = once_more(machine, programme, goal, start, settings)
        now = as_inputs(task, found, True).integral_of_squares(task.weights)
        if not residual <= 1e-8:
            raise PolishError
        # what is left above the continuum is about a seventh of the last gain
        if abs(last - now) <= 7 * _STILL * now or 2 * pieces > most:
            return found, programme, pieces
        last, u = now, found
        own = task.own(found)
        values = np.empty((2 * pieces + 1, task.controls))
        values[::2], values[1::2] = own, (own[1:] + own[:-1]) / 2
        pieces *= 2


def refined(
    task: Manoeuvre, machine: Machine, u: Array, variant: int, times: int, settings: Settings
) -> tuple[Array, Programme]:
    """Constant pieces cut into `times` and descended again: for fuel, whose optimum is bang, off, bang."""
    before, after = task.free_slots
    own = np.repeat(task.own(u), times, axis=0)
    programme = constant_pieces(task, len(own))
    start = np.concatenate([u[:before], own, u[len(u) - after :]])
    found, _ = once_more(machine, programme, task.goal(np.array([variant])), start, settings)
    return found, programme


class PolishError(ArithmeticError):
    """Linear controls did not keep to the goal; the constant pieces stand."""


def _speed(task: Manoeuvre, own: Array) -> float:
    """Norm of the velocity along the pieces, at most."""
    t = (np.arange(len(own)) + 0.5) * task.duration / len(own)
    velocity = task.system.velocity(t, own)
    return float(np.max(np.linalg.norm(task.system.group.hat(velocity), axis=(1, 2))))
