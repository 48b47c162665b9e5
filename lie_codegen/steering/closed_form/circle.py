"""method="circle": two controls that turn at a constant rate, the least energy within the area rule.

To second order of averaging X(T) = exp(int u_1 A_1 + int u_2 A_2 + area [A_1, A_2]). Of all plane curves with a given chord and
area, arcs of circles are the shortest (Dido's problem: with a multiplier theta on the area u' = theta R(pi / 2) u), and
driven at constant speed the cheapest: with R the rotation of the plane, unit time,

    u(s) = r R(theta s + phi) e_1,     chord = 2 r / theta sin(theta / 2) R(phi + theta / 2) e_1,
    area between arc and chord = r^2 (theta - sin theta) / (2 theta^2),
    area / |chord|^2 = (theta - sin theta) / (8 sin^2(theta / 2)),   |theta| <= 2 pi;

a target without a chord takes the full circle, theta = +-2 pi, r^2 = 4 pi |area|, at any phase. The energy is r^2 / T.
"""

from __future__ import annotations

import operator
import time
from dataclasses import dataclass

import numpy as np

from lie_codegen.algebra.lie_algebra import LieAlgebra
from lie_codegen.arrays import Array
from lie_codegen.errors import SteeringError, SteeringInputError
from lie_codegen.on_demand import scipy
from lie_codegen.steering.closed_form.endpoint import approach, flow_end, sharpen
from lie_codegen.steering.plan import Controls, Plan, Status, Stretched
from lie_codegen.steering.seeds import coordinates
from lie_codegen.steering.simulated_plan import simulated_plan
from lie_codegen.steering.task import Task
from lie_codegen.values import Value

_NEGLIGIBLE = 1e-12
_ROUNDING = 1e-28
_ARRIVED = 1e-3
_EXACT = 1e-11
_STEPS = 32
_TURN = np.array([[0.0, -1.0], [1.0, 0.0]])


def circle(task: Task, *, exact: bool = True, starts: int = 8) -> Plan:
    """Controls that turn at a constant rate: the cheapest for the averaged endpoint, then retuned.

    Three numbers (r, theta, phi), three coordinates of the target: with `exact` they are solved for so that the true endpoint is
    the target. Where the bracket's costate is conserved (`turns_extremals`: H(3), SO(3), SU(2), SL(2) with a compact
    bracket) these are Pontryagin's extremals, and the cheapest of them is the minimum of the energy.

    Args:
        task: two controls on a group of three dimensions, with a bracket outside their span.
        exact: retune; else the plan is approximate, to second order of averaging.
        starts: first guesses that are retuned; the cheapest result wins.

    Raises:
        SteeringInputError: other controls; starts below 1.
        SteeringError: no start can be retuned to the target.
    """
    started = time.perf_counter()
    group = task.group
    if operator.index(starts) < 1:
        raise SteeringInputError(f"steer({group.name}): circle: starts must be at least 1, got {starts}")
    if task.report.growth != (2, 3):
        names = ", ".join(group.labels[i] for i in task.controls)
        raise SteeringInputError(
            f"steer({group.name}): the circle law is for two controls whose bracket fills three dimensions, {names} have growth "
            f"vector {task.report.growth}; use method='loops' or 'optimal'"
        )
    guesses = _guesses(task, starts)
    turn, met = _retuned(task, guesses) if exact else (guesses[0], 0)
    extremal = turns_extremals(group.algebra, task.controls)
    details = {
        "winner": "the circle law" + (", retuned" if exact else ""),
        "r": float(np.hypot(turn[0], turn[1])) / task.duration,
        "theta": float(turn[2]),
        "phi": float(np.arctan2(turn[1], turn[0])),
        "starts": len(guesses),
        "met": met,
        "extremal": extremal,
        "optimality": (
            f"an extremal of the energy, the cheapest of {len(guesses)} starts; that nothing is cheaper is likely, not proved"
            if exact and extremal
            else "least energy within the averaged model"
        ),
    }
    seconds = {"solve": time.perf_counter() - started}
    if extremal:
        details["costate"] = _costate(task, turn) / task.duration
    end = Status.SOLVED if exact else Status.APPROXIMATE
    otherwise = Status.NOT_CONVERGED if exact else Status.APPROXIMATE
    u = _controls(task, turn)
    return simulated_plan(task, "circle", u, details, seconds, solved=end, otherwise=otherwise, accuracy=1e-13)


def _retuned(task: Task, guesses: list[Array]) -> tuple[Array, int]:
    """The cheapest circle that hits the target, and how many of the guesses came near it."""

    def end(x: Array, refine: int) -> tuple[Array, Array]:
        return _end(task, x, refine)

    near = [approach(task.group, task.target, guess, end) for guess in guesses]
    met = sorted((x for x, off in near if off < _ARRIVED), key=lambda x: float(np.hypot(x[0], x[1])))
    for x in met:
        turn, off = sharpen(task.group, task.target, x, end)
        if off < _EXACT:
            return turn, len(met)
    raise SteeringError(
        f"steer({task.group.name}): no circle of {len(guesses)} starts can be retuned to the target (the nearest misses by "
        f"{min(off for _, off in near):.2g}); use method='optimal', or exact=False with method='feedback'"
    )


def circle_law(chord: Array, area: float) -> Array:
    """(r cos phi, r sin phi, theta) of the arc with this chord, (2,), and this area between arc and chord; unit time."""
    length = float(np.hypot(*chord))
    size = abs(area)
    if size <= _NEGLIGIBLE * length**2:
        return np.array([*chord, 0.0])
    if length**2 <= _ROUNDING * size:
        return np.array([2 * np.sqrt(np.pi * size), 0.0, np.copysign(2 * np.pi, area)])

    def excess(theta: float) -> float:
        return float((theta - np.sin(theta)) * length**2 - 8 * size * np.sin(theta / 2) ** 2)

    # Up to half a circle area / |chord|^2 lies between theta/12 and theta/8, beyond it is larger: a quarter of what theta/12 gives is
    # below the root, and at the full circle, where the chord vanishes, `excess` is positive.
    shallow = 12 * size / length**2
    theta = float(scipy.optimize.brentq(excess, min(shallow, np.pi) / 4, 2 * np.pi, xtol=1e-15))
    # towards the full circle the chord shrinks and no longer tells the radius; the area does
    radius = length / (2 * np.sin(theta / 2)) if theta < np.pi else np.sqrt(2 * size / (theta - np.sin(theta)))
    theta = float(np.copysign(theta, area))
    phi = np.arctan2(chord[1], chord[0]) - theta / 2
    r = radius * abs(theta)
    return np.array([r * np.cos(phi), r * np.sin(phi), theta])


def turns_extremals(algebra: LieAlgebra, controls: tuple[int, ...]) -> bool:
    """Whether the circle law solves Pontryagin's equations for the energy: whether <mu, [A_1, A_2]> is conserved.

    With B = [A_1, A_2] it changes at the rate sum_i u_i <mu, [B, A_i]>, u_i = <mu, A_i>: zero for all mu if and only if
    [B, A_1] = k A_2 and [B, A_2] = -k A_1.
    """
    c = algebra.structure_constants
    i, j = controls
    B = c[i, j]
    first, second = B @ c[:, i], B @ c[:, j]
    k = first[j]
    expected = np.zeros((2, algebra.dim))
    expected[0, j], expected[1, i] = k, -k
    return bool(np.allclose([first, second], expected, rtol=0, atol=1e-12 * max(1.0, float(np.max(np.abs(c))))))


def _guesses(task: Task, starts: int) -> list[Array]:
    """The circle law of the target's coordinates; then with its phase turned, then the other way round."""
    i, j = task.controls
    x = coordinates(task.group, task.target)
    bracket = task.group.algebra.structure_constants[i, j]
    [k] = [m for m in range(task.group.dim) if m not in task.controls]
    area = float(x[k] / bracket[k])
    first = circle_law(x[[i, j]] - area * bracket[[i, j]], area)
    guesses = [first]
    if not np.any(
        np.einsum("k,kij->ij", bracket, task.group.algebra.structure_constants)
    ):  # central: averaging is exact
        return guesses
    for number in range(1, starts):
        phase = 2 * np.pi * number / starts
        turned = np.array([[np.cos(phase), -np.sin(phase)], [np.sin(phase), np.cos(phase)]]) @ first[:2]
        theta = first[2] if number % 2 else -np.copysign(2 * np.pi - abs(first[2]), first[2])
        guesses.append(np.array([*turned, theta]))
    return guesses


def _costate(task: Task, x: Array) -> Array:
    """mu(0) of the extremal, unit time: <mu, A_i> = u_i(0), and <mu, [A_1, A_2]> = theta from u' = theta (-u_2, u_1)."""
    i, j = task.controls
    rows = np.eye(task.group.dim)[[i, j]]
    rows = np.vstack([rows, task.group.algebra.structure_constants[i, j]])
    return np.asarray(np.linalg.solve(rows, x))


def _arc(x: Array, s: Array) -> Array:
    """(k, 2) u."""
    angle = x[2] * s
    cos, sin = np.cos(angle), np.sin(angle)
    return np.stack([x[0] * cos - x[1] * sin, x[0] * sin + x[1] * cos], axis=-1)


def _end(task: Task, x: Array, refine: int) -> tuple[Array, Array]:
    size = float(np.hypot(x[0], x[1])) + abs(float(x[2]))
    steps = _STEPS * int(np.clip(size / 8, 1, 64))
    X, s, carried = flow_end(task.group, task.controls, lambda s: _arc(x, s), steps, refine)
    cos, sin = np.cos(x[2] * s), np.sin(x[2] * s)
    turning = s[:, None] * _arc(x, s) @ _TURN.T
    slopes = np.stack([np.stack([cos, sin], -1), np.stack([-sin, cos], -1), turning], axis=-1)
    return X, np.einsum("kin,kip->np", carried, slopes)


@dataclass(frozen=True, eq=False, repr=False)
class Arc(Value):
    """Two controls that turn at a constant rate over unit time."""

    x: Array

    def __call__(self, s: Array) -> Array:
        """(k,) -> (k, 2)."""
        return _arc(self.x, s)


def _controls(task: Task, x: Array) -> Controls:
    return Controls(Stretched(task.group.dim, tuple(task.controls), Arc(x), task.duration), ())
