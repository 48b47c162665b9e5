"""The arguments of `lc.closed_loop`, read and checked: what is compiled, what are numbers, when things happen."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.control.curve_reference import CurveReference, curve_reference
from lie_codegen.control.loop_model import NOISE, SIGMAS
from lie_codegen.control.loop_ports import LoopLaw, moving_law, read_law
from lie_codegen.control.loop_times import error_goal, is_number, read_times, sampling
from lie_codegen.control.plants import GroupPlant, Plant, group_plant
from lie_codegen.control.reference_kernels import reference as make_reference
from lie_codegen.control.space_plants import named_plant
from lie_codegen.errors import InputError, ShapeError
from lie_codegen.groups.catalogue_load import as_group
from lie_codegen.groups.maps.admission import admitted
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.identifiers import shown
from lie_codegen.kernel.definition import plain
from lie_codegen.kernel.kernel import Kernel


@dataclass(frozen=True)
class LoopArguments:
    """What `closed_loop` was told.

    Attributes:
        model: arguments of `loop_model`.
        kind: which kernels are needed, of `loop_library.KINDS`.
        reference: or None.
        times: (k,) equally spaced.
        inertia: as given.
        numbers: limits, disturbance, sigma_X ..., bias that were given, by name.
        start: of own states, as the law and the observer say.
        sample: [s]; None for a law that acts continuously.
        delay: whole samples.
        step: [s] or None.
        parts: steps between two times, or between two samples, for a given step.
        rtol: for no step.
    """

    model: dict[str, Any]
    kind: str
    reference: Any
    times: Array
    inertia: Any
    numbers: dict[str, Any]
    start: dict[str, Any]
    sample: float | None
    delay: int
    step: float | None
    parts: int
    rtol: float


def loop_arguments(
    group: Any,
    *,
    law: Any,
    inertia: Any,
    reference: Any,
    t: ArrayLike,
    rtol: float | None,
    tolerance: float | None,
    step: float | None,
    sample: float | None,
    delay: float | None,
    noise: Any,
    limits: Any,
    disturbance: Any,
    external: Any,
    observer: Any,
    gains: Any,
    order: int | None = None,
) -> LoopArguments:
    """See `closed_loop`.

    Raises:
        InputError, ShapeError, NotFiniteError: naming the argument.
    """
    if gains is not None and not isinstance(gains, Mapping):
        raise InputError(f"closed_loop: gains is a mapping such as {{'k_p': 4}}, got {shown(gains)}")
    times = read_times(t)
    designed = None
    if law is not None and not isinstance(law, Kernel) and not hasattr(law, "kernel"):
        # here alone, for its mathematics is a fifth of what a loop of any other law would import
        from lie_codegen.control.vibrated_plant import vibrated
        from lie_codegen.mechanics.vibrational_feedback import VibrationalFeedback

        if isinstance(law, VibrationalFeedback):
            designed, law, period = vibrated(law)
            sample = period if sample is None else sample
    read, watching = read_law(law), read_law(observer, observer=True)
    read = _ordered(read, order)
    plant = _plant(group, read, inertia, gains) if designed is None else designed
    for port in (each for law in (read, watching) if law is not None for each in law.numbers):
        if port.name not in (gains or {}) and (port.name != "inertia" or inertia is None):
            raise InputError(
                f"closed_loop: {port.name} is an input of the law: give gains={{{port.name!r}: ...}}; were it a state z of the "
                "law, there would be an output z_dot or z_next"
            )
    moves = _reference(plant, reference)
    if read is not None:
        read = _following(read, plant, moves)
    numbers: dict[str, Any] = {}
    kinds, biased = _noise(noise, numbers, read, watching, plant)
    if limits is not None:
        numbers["limits"] = limits
    if callable(disturbance) and not isinstance(disturbance, Kernel):
        if external is not None:
            raise InputError("closed_loop: give a function as disturbance or as external, not both")
        disturbance, external = None, disturbance
    formulas = _disturbance(disturbance, numbers)
    told = sampling(times, step, sample, delay, (*kinds, *(["bias"] if biased else [])), watching)
    if read is None and (told[0] is not None or limits is not None or watching is not None):
        raise InputError("closed_loop: sample, delay, noise, limits and observer are of a law: give law=")
    goal = error_goal(rtol, tolerance, step)
    seconds, late = told
    parts = 1
    if step is not None:
        gap = float(times[1] - times[0]) if seconds is None else seconds
        parts = max(1, int(np.ceil(gap / step - 1e-9)))
    kind = "continuous" if seconds is None else "sampled" if step is not None and parts == 1 and not late else "held"
    model = {
        "plant": plant,
        "law": None if read is None else read.kernel,
        "directions": None if read is None else read.directions or None,
        "moving": moves is not None,
        "limited": limits is not None,
        "disturbance": formulas,
        "external": external,
        "noise": kinds,
        "biased": biased,
        "observer": None if watching is None else watching.kernel,
        "seen": None if watching is None else watching.directions or None,
    }
    start = {**(read.start if read is not None else {}), **(watching.start if watching is not None else {})}
    return LoopArguments(model, kind, moves, times, inertia, numbers, start, seconds, late, step, parts, goal)


def _ordered(law: LoopLaw | None, order: int | None) -> LoopLaw | None:
    """The law with the order that was told, where its ports do not say it.

    Raises:
        InputError: another order than 1 or 2, or than the one that the law's ports say.
    """
    if order is None or law is None:
        return law
    if order not in (1, 2) or isinstance(order, bool):
        raise InputError(f"closed_loop: order is 1 (the command is a velocity) or 2 (a force), got {shown(order)}")
    if law.order not in (None, order):
        meant = "a velocity" if law.order == 1 else "a force"
        raise InputError(f"closed_loop: order = {order}, and the law {law.kernel.name} commands {meant}")
    return replace(law, told=int(order))


def _plant(group: Any, law: LoopLaw | None, inertia: Any, gains: Mapping[str, Any] | None) -> Plant:
    if hasattr(group, "loop_plant"):
        made: Plant = group.loop_plant(inertia=inertia)
        return made
    kernel, order = (None, None) if law is None else (law.kernel, law.order)
    other = named_plant(group, kernel, inertia, order, gains)
    if other is not None:
        return other
    if group is None:
        if law is None:
            raise InputError(
                "closed_loop: no group; it takes a group (or the law of one), inertia, law, reference, X0, xi0, t"
            )
        group = law.kernel.namespace
    group = as_group(group, "closed_loop")
    if law is None or law.order == 2 or (law.order is None and inertia is not None):
        if inertia is None and law is not None:
            inertia = _designed_for(law.kernel)
        n, shape = group.dim, () if isinstance(inertia, str) else np.shape(inertia)
        if shape not in ((), (n,), (n, n)) and shape[1:] != (n, n):
            raise ShapeError(
                f"closed_loop: inertia has shape {shape}; give a number, ({n},), ({n}, {n}), or ({n}, {n}) for each of N loops: (N, {n}, {n})"
            )
        return group_plant(group, "input") if len(shape) == 3 else _known_plant(group, plain(inertia))
    if law.order is None:
        raise InputError(
            f"closed_loop: is {law.command.name} of the law {law.kernel.name} a velocity or a force? Name it omega or velocity, "
            "force or torque; or give order=, or inertia= of the body that it pushes"
        )
    return group_plant(group, order=1)


def _designed_for(law: Kernel) -> Any:
    """The inertia that a law was made with: unless told otherwise, it flies the body that it was designed for. None where it is an input."""
    inertia = law.definition.get("parameters", {}).get("inertia") if law.definition else None
    return None if isinstance(inertia, str) else inertia


@lru_cache(maxsize=64)
def _known_plant(group: MatrixGroup, inertia: Any) -> Plant:
    return group_plant(group, inertia)


def _reference(plant: Plant, reference: Any) -> Any:
    """A reference of the plant's group, made from what `lc.reference` takes."""
    if reference is None:
        return None
    group = getattr(plant, "group", None)
    if group is None:
        curve = reference if isinstance(reference, CurveReference) else _curve(plant, reference)
        if len(curve.r) != plant.ports[0].shape[0]:
            raise InputError(
                f"closed_loop: the reference has {len(curve.r)} coordinates, {plant.namespace} {plant.ports[0].shape[0]}"
            )
        return curve
    if np.shape(reference) == (group.degree, group.degree) and not isinstance(np.asarray(reference).flat[0], str):
        return make_reference(
            group, [0] * group.dim, start=admitted(group, np.asarray(reference), "closed_loop: reference").X
        )
    theirs = getattr(reference, "group", None)
    made = hasattr(reference, "definition") or not (
        isinstance(reference, list | tuple) or all(hasattr(reference, name) for name in ("X", "u", "duration"))
    )
    if theirs is not None and theirs != group:
        raise InputError(f"the reference is one of {theirs.name}, not of {group.name}")
    if not made:
        return make_reference(group, reference)
    if theirs is None:
        raise InputError(
            f"closed_loop: reference is what lc.reference makes, a plan, or formulas of t, one a component; got {shown(reference)}"
        )
    return reference


def _curve(plant: Plant, reference: Any) -> CurveReference:
    if not isinstance(reference, list | tuple):
        raise InputError(
            f"closed_loop: the reference of {plant.namespace} is one formula of t a coordinate, got {shown(reference)}"
        )
    return curve_reference(reference, sphere=bool(getattr(plant, "sphere", False)))


def _following(law: LoopLaw, plant: Plant, reference: Any) -> LoopLaw:
    """The law as it goes with a reference, or without."""
    name = law.kernel.name
    if reference is None:
        if law.has("reference"):
            raise InputError(f"the law {name} tracks: give it a reference")
        return law
    if plant.order == 2:
        law = moving_law(law)
    if not law.has("reference") and (plant.order == 2 or not isinstance(plant, GroupPlant)):
        raise InputError(
            f"closed_loop: the law {name} reads no reference: its inputs are {', '.join(p.name for p in law.ports)}; leave "
            "reference= away, or give a law that reads X_d, xi_d, xi_d_dot"
        )
    return law


def _noise(
    noise: Any, numbers: dict[str, Any], law: LoopLaw | None, observer: LoopLaw | None, plant: Plant
) -> tuple[tuple[str, ...], bool]:
    if noise is None:
        return (), False
    known = (*NOISE, "bias")
    if not isinstance(noise, Mapping):
        raise InputError(
            f"closed_loop: noise is a mapping such as {{'X': 0.01, 'xi': 0.001, 'u': 0}}, got {shown(noise)}"
        )
    unknown = [str(name) for name in noise if name not in known]
    if unknown:
        raise InputError(f"closed_loop: no noise on {', '.join(unknown)}; it goes on {', '.join(known)}")
    sees = (observer if observer is not None else law) is not None and (
        (observer is not None and observer.has("direction")) or (law is not None and law.has("direction"))
    )
    if "y" in noise and not sees:
        raise InputError("closed_loop: noise on y, which neither the law nor an observer reads")
    if plant.order == 1 and observer is None and {"xi", "bias"} & set(noise):
        raise InputError("closed_loop: noise on xi, which a loop whose law commands the velocity does not measure")
    for name, value in noise.items():
        numbers["bias" if name == "bias" else SIGMAS[name]] = value
    return tuple(kind for kind in NOISE if kind in noise), "bias" in noise


def _disturbance(disturbance: Any, numbers: dict[str, Any]) -> Any:
    """What is compiled: formulas, a kernel, or "input" for constants, which go to the numbers."""
    if disturbance is None or isinstance(disturbance, Kernel):
        return disturbance
    if isinstance(disturbance, str):
        raise InputError(f"closed_loop: disturbance is one formula a component, got the text {shown(disturbance)}")
    listed = isinstance(disturbance, Sequence) and all(isinstance(each, str) or is_number(each) for each in disturbance)
    if listed and any(isinstance(each, str) for each in disturbance):
        return tuple(each if isinstance(each, str) else float(each) for each in disturbance)
    try:
        numbers["disturbance"] = np.asarray(disturbance, dtype=float)
    except (TypeError, ValueError):
        raise InputError(
            f"closed_loop: disturbance is formulas of t, X and xi, one a component, constants, or a Kernel; got {shown(disturbance)}"
        ) from None
    return "input"
