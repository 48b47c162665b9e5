"""The averaged motion of a tumbling body: start at the mean, one compiled run to each event, osculating values beside it."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.errors import InputError
from lie_codegen.rigid_body.free_rotation import FreeRotation, rotation_about
from lie_codegen.rigid_body.resonances import resonances_met
from lie_codegen.rigid_body.separatrix import event_of
from lie_codegen.rigid_body.torus_map import small_divisors
from lie_codegen.rigid_body.tumbling_body import BodyAxes, TumblingBody
from lie_codegen.rigid_body.tumbling_kernels import MARGIN
from lie_codegen.rigid_body.tumbling_run import TumblingRun
from lie_codegen.runtime.ode import EVENT, REACHED, integrate
from lie_codegen.runtime.ode_field import Field

#: |N| Tn / L beyond which an average over the free motion says little.
LARGEST_TORQUE = 0.1
_LOUD, _MOST_CROSSINGS = 0.01, 8


@dataclass(frozen=True)
class Wishes:
    """How an averaged run is made.

    Attributes:
        start: "mean" or "osculating".
        sign: of H along the new axis beyond the separatrix; None stops there.
        force: also where the torque is too large for an average.
        nodes: phases of the averages; 0 by k.
        rtol: of the integration.
        osculating: also give phases and osculating values.
    """

    start: str
    sign: int | None
    force: bool
    nodes: int
    rtol: float
    osculating: bool


def mean_motion(model: TumblingBody, free: FreeRotation, t: Array, wishes: Wishes) -> TumblingRun:
    """The averaged run from the start of a free motion, at increasing times.

    Raises:
        InputError: it starts at the separatrix, or the torque is too large and not forced.
    """
    axes, y = model.start(free)
    k = float(free.k)
    if k >= MARGIN:
        raise InputError(f"tumbling_average: k = {k:.6f} is at the separatrix (margin {MARGIN}); use .direct")
    W, largest = model.periodic(axes, y, t[0])
    ratio = largest / (abs(float(free.motion["Lambda"])) * float(free.motion["L"]))
    if ratio > LARGEST_TORQUE and not wishes.force:
        raise InputError(
            f"tumbling_average: the torque turns H by {ratio:.3g} in one nutation (|N| Tn / L, at most {LARGEST_TORQUE}): an "
            "average over the free motion says little; use .direct, or force=True"
        )
    dropped: list[tuple[int, int]] = []
    remark = ""
    if wishes.start == "mean":
        dropped = small_divisors(float(free.motion["Lambda"]), float(free.motion["m"]))
        mean = y.copy()
        mean[:4] -= W
        if modulus(axes, mean[None])[0] < MARGIN:
            y = mean
        else:  # NaN or beyond: the periodic part is larger than the motion it belongs to
            remark = "; the torque is too large for the map: started at the osculating point"
    run = _piece(model, axes, y, t, wishes, ratio, dropped)
    run = replace(run, status=run.status + remark) if remark else run
    for _ in range(_MOST_CROSSINGS if wishes.sign is not None else 0):
        if run.event is None or run.event.kind != "separatrix" or not run.status.startswith("separatrix"):
            break
        rest = t[t > run.event.t]
        if not len(rest):
            break
        X, omega = run.event.continuations[f"{wishes.sign:+d}"]
        axes, y = model.start(rotation_about(model.principal, X, omega))
        more = _piece(model, axes, y, np.concatenate([[run.event.t], rest]), wishes, ratio, dropped)
        run = _joined(run, more)
    return run


def squared_modulus(inertia: Array, square: Any, D: Any) -> Any:
    """k^2 of motions with L^2 = `square` and D = L^2 - 2 I3 T, about axes with these moments (18); outside [0, 1) there is none."""
    I1, I2, I3 = inertia.tolist()
    return (I1 - I2) * I3 * D / ((I2 - I3) * (square * (I1 - I3) - I1 * D))


def modulus(axes: BodyAxes, y: Array) -> Array:
    """(n,) k of mean states (n, 6); NaN where there is no such motion."""
    square = np.einsum("ij,ij->i", y[:, :3], y[:, :3])
    with np.errstate(invalid="ignore", divide="ignore"):
        k: Array = np.sqrt(squared_modulus(axes.inertia, square, y[:, 3]))
    return k + 0.0  # no negative zero at pure spin


def _piece(
    model: TumblingBody, axes: BodyAxes, y: Array, t: Array, wishes: Wishes, ratio: float, dropped: list[tuple[int, int]]
) -> TumblingRun:  # fmt: skip
    size, scale, rtol = len(y), float(np.sqrt(y[:3] @ y[:3])), wishes.rtol
    constants = {"paper": axes.paper, "inertia": axes.inertia, "nodes": float(wishes.nodes)}
    rate = model.field("slow_rate", size, "y", {**constants, "carry": float(wishes.osculating)})
    ends = Field(model.library["ends"], size, time=None, constants={"inertia": axes.inertia, "least": 1e-9 * scale})
    # the phases drive nothing: they are carried along and never shorten a step
    atol = np.array([scale * rtol] * 3 + [scale**2 * rtol, np.inf, np.inf])
    motion = integrate(rate, y, t[0], t[-1], rtol=rtol, atol=atol, events=ends, directions=(-1, -1))
    kept = t[t <= motion.t[-1]]
    found = motion.at(kept)
    H, D = found[:, :3], found[:, 3]
    event, status = None, "ok"
    if motion.status == EVENT:
        event = event_of(model, axes, motion)
        status = event.kind
    elif motion.status != REACHED:
        status = f"the averaged system has no solution beyond t = {motion.t[-1]:.9g}"
    resonances = resonances_met(model, axes, motion, rate)
    loud = [each for each in resonances if each.harmonic > _LOUD]
    if loud:
        listed = ", ".join(f"{each.n1}:{each.n2} at t = {each.t:.6g}" for each in loud[:4])
        status += f"; resonance {listed}"
    square = np.einsum("ij,ij->i", H, H)
    energy = (square - D) / (2 * axes.inertia[2])
    phi, alpha, full_H, full_energy = np.full(len(kept), np.nan), np.full(len(kept), np.nan), H, energy
    if wishes.osculating:
        phi, alpha = found[:, 4], found[:, 5]
        wave = np.array(
            [model.periodic(axes, state, float(moment))[0] for moment, state in zip(kept, found, strict=True)]
        )
        full_H = H + wave[:, :3]
        full_energy = (np.sum(full_H**2, axis=1) - (D + wave[:, 3])) / (2 * axes.inertia[2])
    return TumblingRun(
        kept, H, energy, square / (2 * energy), modulus(axes, found), phi, alpha, full_H, full_energy,
        (axes.mode,) * len(kept), status, event, resonances, tuple(dropped), ratio, motion.evaluations,
        model.state_at(axes, found[-1], float(kept[-1])),
    )  # fmt: skip


def _joined(a: TumblingRun, b: TumblingRun) -> TumblingRun:
    """Two pieces as one run; the second begins with the moment of the event, which is dropped."""
    names = ("t", "H", "energy", "dynamic_inertia", "k", "phi", "alpha", "osculating_H", "osculating_energy")
    columns: dict[str, Any] = {name: np.concatenate([getattr(a, name), getattr(b, name)[1:]]) for name in names}
    left = "" if a.event is None else f"; continued beyond the separatrix at t = {a.event.t:.6g}"
    return replace(
        a, **columns, mode=(*a.mode, *b.mode[1:]), status=b.status + left, event=b.event if b.event is not None else a.event,
        resonances=a.resonances + b.resonances, evaluations=a.evaluations + b.evaluations, end=b.end,
    )  # fmt: skip
