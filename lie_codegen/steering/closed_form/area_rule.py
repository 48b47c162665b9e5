"""method="area_rule": Fourier controls of least energy by the averaged endpoint, then retuned to hit the target exactly."""

from __future__ import annotations

import operator
import time
from collections.abc import Callable
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.errors import SteeringError, SteeringInputError
from lie_codegen.on_demand import scipy
from lie_codegen.steering.closed_form.averaged_end import TABULATED, averaged_end
from lie_codegen.steering.closed_form.chain import Chain
from lie_codegen.steering.closed_form.fourier import Family
from lie_codegen.steering.constraints import limits
from lie_codegen.steering.plan import Controls, Plan, Status, Stretched
from lie_codegen.steering.seeds import coordinates, seed_controls
from lie_codegen.steering.shooting.extremals import SOLVED
from lie_codegen.steering.shooting.shooter import shooter
from lie_codegen.steering.simulated_plan import simulated_plan
from lie_codegen.steering.task import Task
from lie_codegen.values import Value

_SAMPLES = 65
_SHARP = 1e-13
_FINE = 16
_TRIED = 3
_MOST_ORDER = 8
_MOMENTS = 2
_AGREEING = 3
_EQUAL = 1e-6
_FAR = 1e3


def area_rule(
    task: Task, *, harmonics: int = 2, order: int = 2, bounds: Any = None, exact: bool = True, starts: int = 8
) -> Plan:
    """Fourier controls of least energy whose averaged endpoint is the target, then retuned.

    minimise int |u|^2 subject to int U + 1/2 int [U~, U] = log(target): the second-order area rule in its single-exponential
    form, a small quadratic program with quadratic constraints; to a higher order p the constraint has the terms of p
    controls too (`averaged_end`). Retuning then solves the same problem with the true endpoint instead of the averaged one.
    The controls are periodic: they end as they begin.

    Args:
        task: the task.
        harmonics: K; at least one for each bracket that is needed.
        order: of averaging, p; the error without retuning is of order p + 1 in the size of the controls.
        bounds: of the controls, as in "transcription", at 65 samples.
        exact: retune to the target; else the plan is approximate, to second order of averaging.
        starts: phases of the first guess that are tried.

    Raises:
        SteeringInputError: about an option; controls that need deeper brackets than the order sees, with exact=False.
        SteeringError: no member of the family reaches the target.
    """
    started = time.perf_counter()
    where = f"steer({task.group.name}): area_rule"
    for name, value in (("harmonics", harmonics), ("starts", starts)):
        if operator.index(value) < 1:
            raise SteeringInputError(f"{where}: {name} must be at least 1, got {value}")
    if not 2 <= operator.index(order) <= _MOST_ORDER:
        raise SteeringInputError(f"{where}: order must be between 2 and {_MOST_ORDER}, got {order}")
    if task.report.depth >= order and not exact:
        raise SteeringInputError(
            f"{where}: averaging of order {order} sees {order - 1} nested brackets, these controls need {task.report.depth} "
            f"(growth vector {task.report.growth}); use order={task.report.depth + 1}, exact=True or method='optimal'"
        )
    family = Family(task.group, task.controls, harmonics)
    low, high = (each * task.duration for each in limits(task.group, task.controls, bounds, f"{where}: bounds"))
    x = coordinates(task.group, task.target)
    s = np.linspace(0, 1, _SAMPLES)
    first = seed_controls(task.group, task.controls, task.report.depth, x, starts, _SAMPLES)
    averaged, averaged_energy = _averaged_members(
        task, family, x, order, [family.fitted(u, s) for u in first], low, high
    )
    best = averaged[0] if averaged and not exact else None
    tried = averaged[:_TRIED] or [family.fitted(u, s) for u in _optimum(task, s, first)]
    # The averaged model only lands near the target: from its optima least energy is sought again under the exact endpoint, which Newton then meets.
    for c in tried if exact else ():
        c = _least_energy(family, c, lambda c: _exact_gap(family, task, c), low, high)
        c, off = _restored(family, task, c)
        if off < 1e-9 and (best is None or _energy(family, c) < _energy(family, best)):
            best = c
    if best is None:
        raise SteeringError(
            f"{where}: none of {starts} starts met the target with {harmonics} harmonics; try more harmonics or starts, wider "
            "bounds, or method='optimal'"
        )
    coefficients = best.reshape(family.shape) / task.duration
    gap, _ = _averaged_gap(family, x, order, best)
    details = {
        "winner": "Fourier controls" + (", retuned" if exact else ", averaged"),
        "coefficients": coefficients,
        "harmonics": harmonics,
        "order": order,
        "averaged_miss": float(np.linalg.norm(gap)),
        "averaged_energy": averaged_energy / task.duration,
        "optimality": "least energy within this family of controls, the best of the starts tried",
    }
    seconds = {"solve": time.perf_counter() - started}
    end = Status.SOLVED if exact else Status.APPROXIMATE
    otherwise = Status.NOT_CONVERGED if exact else Status.APPROXIMATE
    return simulated_plan(
        task, "area_rule", _controls(task, family, best), details, seconds, solved=end, otherwise=otherwise
    )


def _averaged_members(
    task: Task, family: Family, x: Array, order: int, first: list[Array], low: Array, high: Array
) -> tuple[list[Array], float]:
    """The members that meet x by averaging, cheapest first, without repetitions of equal energy; the least energy.

    No more guesses are tried once enough of them led to the cheapest.
    """
    if task.report.depth >= order:
        return [], np.inf
    if task.report.depth == _MOMENTS:
        first = [_superposed(task, family, x), *first]
    elif order > 2:
        first = _averaged_members(task, family, x, 2, first, low, high)[0][:_TRIED] or first
    enough = _AGREEING if order <= TABULATED else 1
    found: list[Array] = []
    for guess in first:
        c = _least_energy(family, guess, lambda c: _averaged_gap(family, x, order, c), low, high)
        if np.max(np.abs(_averaged_gap(family, x, order, c)[0])) < 1e-8:
            found.append(c)
        energies = np.array([_energy(family, each) for each in found])
        if np.sum(energies < (1 + _EQUAL) * np.min(energies, initial=np.inf)) >= enough:
            break
    found.sort(key=lambda c: _energy(family, c))
    repeated = [_energy(family, b) < (1 + _EQUAL) * _energy(family, a) for a, b in pairwise(found)]
    distinct = [c for c, again in zip(found, [False, *repeated], strict=False) if not again]
    return distinct, _energy(family, found[0]) if found else np.inf


def _superposed(task: Task, family: Family, x: Array) -> Array:
    """The segments of the chain of `loops`, all at once: the closed form as a first guess."""
    s = np.linspace(0, 1, _SAMPLES)
    chain = Chain.towards(task.group, task.controls, x)
    return family.fitted(np.sum([segment.velocity(size, s) for segment, size in chain.parts()], axis=0), s)


def _optimum(task: Task, s: Array, otherwise: Array) -> list[Array]:
    """Samples of the exact optimum, to be fitted, where averaging sees too little; else the given guesses."""
    solver = shooter(task.group, task.controls)
    found = solver.solve(task.target)
    return [solver.extremal(found.mu0[0]).control(s)] if found.status[0] == SOLVED else list(otherwise)


def _energy(family: Family, c: Array) -> float:
    return float(np.sum(family.energy_weights * c * c))


def _averaged_gap(family: Family, x: Array, order: int, c: Array) -> tuple[Array, Array]:
    value, slope = family.averaged(c) if order == 2 else averaged_end(family, c, order)
    return value - x, slope


def _exact_gap(family: Family, task: Task, c: Array, refine: int = 1) -> tuple[Array, Array]:
    """vee of the projection of target^-1 X(1) - I, and its derivative by c; far off where the flow leaves double precision."""
    group = task.group
    lost = np.full(group.dim, _FAR), np.zeros((group.dim, len(c)))
    if not np.all(np.isfinite(c)):
        return lost
    try:
        with np.errstate(all="ignore"):
            X, slope = family.exact(c, refine)
            relative = np.linalg.solve(task.target, X)
            gap, J = group.project(relative - np.eye(group.degree)), group.project(relative @ group.basis).T @ slope
    except np.linalg.LinAlgError:
        return lost
    return (gap, J) if np.all(np.isfinite(J)) else lost


def _least_energy(
    family: Family, c: Array, gap: Callable[[Array], tuple[Array, Array]], low: Array, high: Array
) -> Array:
    """Sequential quadratic programming with exact gradients."""
    weights = family.energy_weights
    last = _Last(gap)
    constraints: list[dict[str, Any]] = [{"type": "eq", "fun": lambda c: last(c)[0], "jac": lambda c: last(c)[1]}]
    waves = family.waves(np.linspace(0, 1, _SAMPLES))
    for number, (least, most) in enumerate(zip(low, high, strict=True)):
        if np.isfinite(least) or np.isfinite(most):
            row = np.zeros((_SAMPLES, *family.shape))
            row[:, number] = waves
            A = row.reshape(_SAMPLES, -1)
            for offset, matrix in ((most, -A), (-least, A)):
                if np.isfinite(offset):
                    constraints.append(
                        {"type": "ineq", "fun": lambda c, o=offset, M=matrix: o + M @ c, "jac": lambda c, M=matrix: M}
                    )
    result = scipy.optimize.minimize(
        lambda c: (float(weights @ (c * c)), 2 * weights * c),
        c,
        jac=True,
        method="SLSQP",
        constraints=constraints,
        options={"maxiter": 100, "ftol": 1e-12},
    )
    return np.asarray(result.x)


class _Last:
    """A function of c that remembers its last value: SLSQP asks for value and derivative one after the other."""

    def __init__(self, function: Callable[[Array], tuple[Array, Array]]) -> None:
        self._function = function
        self._c = np.zeros(0)
        self._value = (self._c, self._c)

    def __call__(self, c: Array) -> tuple[Array, Array]:
        if not np.array_equal(c, self._c):
            self._c, self._value = c.copy(), self._function(c)
        return self._value


def _restored(family: Family, task: Task, c: Array) -> tuple[Array, float]:
    """Newton's method, least change in energy norm, on the true endpoint; what is left of the gap."""
    scale = 1 / np.sqrt(family.energy_weights)
    gap, slope = _exact_gap(family, task, c, _FINE)
    for _ in range(8):
        if np.max(np.abs(gap)) < _SHARP:
            break
        c = c - scale * np.linalg.lstsq(slope * scale, gap, rcond=1e-9)[0]
        gap, slope = _exact_gap(family, task, c, _FINE)
    return c, float(np.max(np.abs(gap)))


@dataclass(frozen=True, eq=False, repr=False)
class FourierSeries(Value):
    """Fourier controls over unit time by their coefficients."""

    family: Family
    c: Array

    def __call__(self, s: Array) -> Array:
        """(k,) -> (k, m)."""
        return self.family.evaluate(self.c, s)


def _controls(task: Task, family: Family, c: Array) -> Controls:
    return Controls(Stretched(task.group.dim, tuple(task.controls), FourierSeries(family, c), task.duration), ())
