"""method="loops": a chain of elementary manoeuvres in closed form, one for each bracket that is needed, then retuned."""

from __future__ import annotations

import time

from lie_codegen.errors import SteeringError, SteeringInputError
from lie_codegen.flow.logarithm import matrix_log
from lie_codegen.on_demand import scipy
from lie_codegen.steering.closed_form.chain import Chain
from lie_codegen.steering.closed_form.segments import FigureEight, Loop
from lie_codegen.steering.plan import Plan, Status
from lie_codegen.steering.seeds import coordinates
from lie_codegen.steering.simulated_plan import simulated_plan
from lie_codegen.steering.task import Task

_DEEPEST = 2
_EXACT = 1e-11
_ROUNDS = (2, 3, 4, 6, 8, 12, 16, 24, 32)
_ON_GROUP = 1e-8


def loops(task: Task, *, exact: bool = True) -> Plan:
    """A straight part, a circle for each bracket, a figure of eight for each bracket of brackets, one after the other.

    To lowest order X(T) = exp(x) prod_p exp(a_p [A_i, A_j]) prod_q exp(M_q [a_q, [a_q, b_q]]) with areas a_p and area moments M_q
    (`segments`). With `exact` the straight part, the areas and the moments are solved for so that the true endpoint is the
    target; where that has no solution near by, the target's root of order 2, 3, ... is reached, and the whole driven as
    often: small enough targets always have one, so that any target with a logarithm is reached. One round more than needed
    is tried as well: it is often cheaper for a large target.

    Args:
        task: controls whose brackets and brackets of brackets fill the algebra.
        exact: retune; else the plan is approximate.

    Raises:
        SteeringInputError: controls that need deeper brackets.
        SteeringError: the chain cannot be retuned.
    """
    started = time.perf_counter()
    group = task.group
    if task.report.depth > _DEEPEST:
        raise SteeringInputError(
            f"steer({group.name}): loops and figures of eight make brackets and brackets of brackets, these controls need "
            f"{task.report.depth} nested (growth vector {task.report.growth}); use method='optimal'"
        )
    chain = Chain.towards(group, task.controls, coordinates(group, task.target))
    if exact:
        chain = _retuned(task, chain)
    labels = [group.labels[i] for i in task.controls]
    driven = list(chain.parts())
    details = {
        "winner": "a straight part and loops" + (", retuned" if exact else ""),
        "straight": driven[0][1],
        "areas": {f"{labels[p.pair[0]]}, {labels[p.pair[1]]}": float(x[0]) for p, x in driven if isinstance(p, Loop)},
        "moments": {_named(p, labels): float(x[0]) for p, x in driven if isinstance(p, FigureEight)},
        "rounds": chain.repeats,
        "chain": chain,
    }
    seconds = {"solve": time.perf_counter() - started}
    end = Status.SOLVED if exact else Status.APPROXIMATE
    otherwise = Status.NOT_CONVERGED if exact else Status.APPROXIMATE
    u = chain.controls_over(task.duration)
    return simulated_plan(task, "loops", u, details, seconds, solved=end, otherwise=otherwise, accuracy=1e-13)


def _retuned(task: Task, chain: Chain) -> Chain:
    group = task.group
    found, off = chain.retuned(task.target)
    best = found if off < _EXACT else None
    x, miss = matrix_log(group, task.target)
    for rounds in _ROUNDS if miss < _ON_GROUP else ():
        root = scipy.linalg.expm(group.hat(x / rounds))
        found, off = Chain.towards(group, task.controls, x / rounds).repeated(rounds).retuned(root)
        hit = found if off < _EXACT / rounds else None
        if best is not None:
            return best if hit is None or best.energy <= hit.energy else hit
        best = hit
    if best is not None:
        return best
    raise SteeringError(
        f"steer({group.name}): the chain of loops cannot be retuned to the target (misses by {off:.2g}); use method='optimal', "
        "or exact=False with method='feedback'"
    )


def _named(eight: FigureEight, labels: list[str]) -> str:
    """ "a, [a, b]" in the controls' labels."""
    a = " ".join(f"{weight:+.4g} {label}" for weight, label in zip(eight.a, labels, strict=True) if weight)
    b = " ".join(f"{weight:+.4g} {label}" for weight, label in zip(eight.b, labels, strict=True) if weight)
    return f"[{a}, [{a}, {b}]]"
