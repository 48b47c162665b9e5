"""Four-phase area-rule steering in closed form (Leonard and Krishnaprasad, TR 93-59, section 5.2).

Two controls i, j whose bracket is [A_i, A_j] = c A_k. With desired coordinates of the second kind gd:
    phase 1  quarter period, in phase      g_i, g_j reach gd_i, gd_j
    phase 2  q periods, out of phase       each period encloses an area that moves g_k by c * area
    phase 3  quarter period, in phase      the controls come to rest
    phase 4  half period, in phase         undoes what phase 3 moved
Form "product" takes gd as coordinates of the second kind, (60): X(T) ~ exp(gd_i A_i) exp(gd_j A_j) exp(gd_k A_k) for
controls ordered so. Form "single" is the single-exponential design (66), X(T) ~ exp(gd_i A_i + gd_j A_j + gd_k A_k): gd is
the target's logarithm (on SO(3) its Euler parameters, (58)), the manoeuvre the same. Theorem 4 is printed for X(0) = I only;
exp(Z_0 + ...) holds from X(0) = exp(Z_0), Z_0 = O(eps), too, which is what phase 2 needs; phase 1 is then exact.
(62)-(65) as printed ask for 0 < psi < pi/2; right is sign(tan psi) = sign(c gd_i gd_j gd_k), with
q = gd_k / (pi c gd_i gd_j tan psi) a positive integer: choose q, then psi = atan(gd_k / (pi q c gd_i gd_j)).
"""

from __future__ import annotations

import math
import operator
import time
from dataclasses import dataclass
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.errors import NotOnGroupError, SteeringInputError
from lie_codegen.flow.logarithm import matrix_log
from lie_codegen.flow.second_kind_coordinates import second_kind
from lie_codegen.steering.closed_form.free_amplitude import LineAndCircles, free_amplitude
from lie_codegen.steering.plan import Controls, Plan, Status
from lie_codegen.steering.simulated_plan import simulated_plan
from lie_codegen.steering.task import Task
from lie_codegen.values import Value

_NEGLIGIBLE = 1e-12
#: Periods that the paper's loops may take unasked; where gd_i gd_j is small they take any number, at any speed.
_MOST_PERIODS = 16
_ON_GROUP = 1e-8
_FORMS = {"product": "coordinates of the second kind", "single": "coordinates of the logarithm"}


def four_phase(task: Task, *, q: int | None = None, form: str = "product", amplitude: str = "auto") -> Plan:
    """The four-phase manoeuvre.

    Args:
        task: two controls whose bracket is a multiple of one basis element; the target's coordinates must vanish on all
            others.
        q: number of area-making periods; None takes the integer next to |gd_k / (pi c gd_i gd_j)|, so that psi is near
            45 degrees. More periods are more accurate and cost more energy.
        form: "product", coordinates of the second kind, or "single", the logarithm.
        amplitude: "tied": the paper's, whose loops have the size of gd_i and gd_j; "free": a line, circles, a line back, for any target, see
            `free_amplitude`; "auto": the paper's, and the free one where gd_i gd_j = 0, or where the paper's would take more than 16 periods and none were
            asked for.

    Raises:
        SteeringInputError: where the scheme does not apply, with what to do instead.
    """
    started = time.perf_counter()
    i, j, k, constant = _bracket(task)
    if amplitude not in ("auto", "tied", "free"):
        raise SteeringInputError(f'four_phase: amplitude is "auto", "tied" or "free", got {amplitude!r}')
    gd = _desired(task, (i, j, k), form)
    loop = math.pi * constant * gd[i] * gd[j]
    flat = abs(constant * gd[i] * gd[j]) <= _NEGLIGIBLE  # loops of the size of gd_i and gd_j enclose nothing
    fast = q is None and abs(gd[k]) > _MOST_PERIODS * abs(loop)
    if amplitude == "free" or (amplitude == "auto" and (flat or fast)):
        return _free(task, (i, j, k), constant, gd, form, 1 if q is None else q, started)
    q = _periods(task, q, gd[k], constant * gd[i] * gd[j])
    psi = math.atan(gd[k] / (math.pi * q * constant * gd[i] * gd[j])) if gd[k] else 0.0
    period = task.duration / (q + 1)
    u = _controls(task, (i, j), (gd[i], gd[j]), psi, q, period)
    details = {
        "form": form,
        "gd": tuple(float(value) for value in gd),
        "q": q,
        "psi": psi,
        "period": period,
        "omega": 2 * math.pi / period,
        "switches": tuple(float(t) for t in u.breakpoints),
        "constant": constant,
    }
    seconds = {"plan": time.perf_counter() - started}
    return simulated_plan(task, "four_phase", u, details, seconds, solved=Status.SOLVED, otherwise=Status.APPROXIMATE)


def _free(task: Task, axes: tuple[int, int, int], constant: float, gd: Any, form: str, q: int, started: float) -> Plan:
    """A line, q circles of the amplitude that is needed, a line back."""
    i, j, k = axes
    q = _periods(task, q, 0.0, 1.0)
    # as coordinates of the second kind: exp(x_i A_i + x_j A_j + x_k A_k) has its product's k-th one less by c x_i x_j / 2
    last = gd[k] - (constant * gd[i] * gd[j] / 2 if form == "single" else 0.0)
    goal = (float(gd[i]), float(gd[j]))
    a, side = free_amplitude(goal, float(last / constant + gd[i] * gd[j] / 2), q)
    law = LineAndCircles(task.group.dim, (i, j), goal, a, side, q, task.duration)
    details = {
        "form": form,
        "amplitude": a,
        "side": side,
        "gd": tuple(float(value) for value in gd),
        "q": q,
        "switches": law.switches,
        "constant": constant,
        "winner": "four phases with free amplitude",
    }
    seconds = {"plan": time.perf_counter() - started}
    u = Controls(law, [t for t in law.switches if 0 < t < task.duration])
    return simulated_plan(task, "four_phase", u, details, seconds, solved=Status.SOLVED, otherwise=Status.APPROXIMATE)


def average(plan: Plan, t: Array) -> Array:
    """(k, n) the second-order average of a four-phase plan: eps u-tilde, and the area as a ramp.

    g-double-bar of Theorem 3 and Corollary 2 of the paper, interval by interval; of form "single" Z-double-bar of Theorem 4.
    """
    info = plan.details
    i, j, k, _ = _bracket_of(plan)
    t1, t2 = info["switches"][0], info["switches"][1]
    g = np.zeros((len(t), plan.group.dim))
    g[:, [i, j]] = integrals(plan, t)
    g[:, k] = info["gd"][k] * np.clip((t - t1) / (t2 - t1), 0, 1)
    return g


def integrals(plan: Plan, t: Array) -> Array:
    """(k, 2) the integrals eps u-tilde of the two controls, (64) and (65)."""
    info = plan.details
    i, j, _, _ = _bracket_of(plan)
    t1, t2, t3 = info["switches"]
    w, psi = info["omega"], info["psi"]
    phase = [t <= t1, t <= t2, t <= t3]
    tail = 1.5 + 0.5 * np.cos(w * (t - t3))
    columns = []
    for gd, shift in ((info["gd"][i], 0.0), (info["gd"][j], psi)):
        loop = 1 + math.tan(shift) + np.sin(w * (t - t1) - shift) / math.cos(shift)
        columns.append(gd * np.select(phase, [1 - np.cos(w * t), loop, 1 + np.sin(w * (t - t2))], tail))
    return np.stack(columns, axis=-1)


def _bracket_of(plan: Plan) -> tuple[int, int, int, float]:
    i, j = (plan.group.labels.index(label) for label in plan.controls)
    [(k, value)] = plan.group.algebra.bracket({i: 1}, {j: 1}).items()
    return i, j, k, float(value)


def _bracket(task: Task) -> tuple[int, int, int, float]:
    labels = task.group.labels
    if len(task.controls) != 2:
        names = ", ".join(labels[i] for i in task.controls)
        raise SteeringInputError(
            f"four_phase needs exactly two controls, {len(task.controls)} given ({names}); use method='optimal'"
        )
    i, j = task.controls
    row = task.group.algebra.bracket({i: 1}, {j: 1})
    if len(row) != 1 or next(iter(row)) in (i, j):
        image = " + ".join(f"({value}) {labels[m]}" for m, value in row.items()) or "0"
        raise SteeringInputError(
            f"four_phase needs [{labels[i]}, {labels[j]}] to be a multiple of one other basis element; it is {image}; "
            "use method='optimal'"
        )
    [(k, value)] = row.items()
    return i, j, k, float(value)


def _desired(task: Task, allowed: tuple[int, ...], form: str) -> Any:
    gd = _coordinates(task, form)
    others = [m for m in range(task.group.dim) if m not in allowed and abs(gd[m]) > _NEGLIGIBLE]
    if others:
        names = ", ".join(f"{task.group.labels[m]} = {gd[m]:.6g}" for m in others)
        raise SteeringInputError(f"four_phase cannot move {names} ({_FORMS[form]} of the target); use method='optimal'")
    return gd


def _coordinates(task: Task, form: str) -> Array:
    """Of the target, of the kind the form asks for."""
    if form not in _FORMS:
        raise SteeringInputError(f"four_phase: form must be {' or '.join(_FORMS)}, got {form!r}")
    if form == "single":
        x, off = matrix_log(task.group, task.target)
        if off > _ON_GROUP:
            raise SteeringInputError(
                'four_phase: the target has no logarithm near by; use form="product" or method="optimal"'
            )
        return x
    try:
        return second_kind(task.group, task.target)
    except NotOnGroupError as error:
        raise SteeringInputError(f"four_phase: {error}; use method='optimal'") from None


def _periods(task: Task, q: int | None, wanted: float, loop: float) -> int:
    """The number of periods; refuses where no loop of these controls encloses an area."""
    labels = [task.group.labels[m] for m in task.controls]
    if abs(loop) <= _NEGLIGIBLE:
        raise SteeringInputError(
            f"four_phase: the target's coordinates along {labels[0]} and {labels[1]} must both be non-zero (their product "
            f"is {loop:.3g}): the loop's area is proportional to it; use amplitude='free', method='optimal', or go through a "
            "via point with both non-zero"
        )
    if q is None:
        return max(1, round(abs(wanted / (math.pi * loop))))
    try:
        count = operator.index(q)
    except TypeError:
        count = 0
    if count < 1:
        raise SteeringInputError(f"four_phase: q must be a positive integer (a number of periods), got {q!r}")
    return count


@dataclass(frozen=True, eq=False, repr=False)
class FourPhases(Value):
    """(62)-(63): a quarter of a sine, loops, a quarter of a cosine, and half a period back."""

    n: int
    positions: tuple[int, int]
    sizes: tuple[float, float]
    psi: float
    w: float
    ends: tuple[float, float, float]

    def __call__(self, t: Array) -> Array:
        """(k,) times -> (k, n)."""
        w, (t1, t2, t3) = self.w, self.ends
        phase = [t <= t1, t <= t2, t <= t3]
        values = np.zeros((len(t), self.n))
        for position, size, shift in zip(self.positions, self.sizes, (0.0, self.psi), strict=True):
            loop = np.cos(w * (t - t1) - shift) / math.cos(shift)
            pieces = [np.sin(w * t), loop, np.cos(w * (t - t2))]
            values[:, position] = size * w * np.select(phase, pieces, -0.5 * np.sin(w * (t - t3)))
        return values


def _controls(
    task: Task, positions: tuple[int, int], gd: tuple[float, float], psi: float, q: int, period: float
) -> Controls:
    """(62)-(63)."""
    w = 2 * math.pi / period
    t1 = period / 4
    t2 = t1 + q * period
    t3 = t2 + period / 4

    return Controls(FourPhases(task.group.dim, positions, gd, psi, w, (t1, t2, t3)), [t1, t2, t3])
