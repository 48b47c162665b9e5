"""What a closed loop runs on: its compiled kernels, and the numbers that are their inputs."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.control.loop_kernels import loop_control, loop_motion, loop_outputs, loop_sample, loop_step
from lie_codegen.control.loop_model import SIGMAS, Loop, loop_model
from lie_codegen.control.loop_rate import has_rate, pair_kernels
from lie_codegen.control.positive_batch import clear_inverses
from lie_codegen.control.reference_kernels import motion_kernel
from lie_codegen.errors import InputError, NotFiniteError, ShapeError
from lie_codegen.identifiers import shown
from lie_codegen.kernel.definition import plain
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.plain_data import Definition, NoDefinitionError, made_from
from lie_codegen.runtime.build import build_kernels, defined_together
from lie_codegen.runtime.library import Library

#: Which kernels a loop needs: continuous, sampled at every step, or sampled with several steps between two calls.
KINDS = {
    "continuous": (loop_step,),
    "sampled": (loop_control, loop_sample),
    "held": (loop_control, loop_motion),
}


def loop_library(loop: Mapping[str, Any], reference: Any, kind: str) -> tuple[Loop, Library]:
    """The loop of these arguments of `loop_model`, and its kernels with the reference, compiled.

    The kind is one of `KINDS`, or "adaptive": a rate where the loop has one, else as "continuous".

    What follows from definitions is built once a process and known by them; a further force is a Python function, which
    may have changed since, so with it everything is derived again.
    """
    moves = getattr(reference, "definition", None)
    if loop.get("external") is None and (reference is None or moves is not None):
        try:
            return _defined(plain(loop), moves, kind)
        except NoDefinitionError:  # a law written by hand
            pass
    return _made(loop, reference, kind)


@lru_cache(maxsize=64)
def _defined(loop: Definition, reference: Definition | None, kind: str) -> tuple[Loop, Library]:
    arguments = {name: made_from(value) for name, value in loop.items()}
    return _made(arguments, None if reference is None else made_from(reference), kind)


def _made(loop: Mapping[str, Any], reference: Any, kind: str) -> tuple[Loop, Library]:
    model = loop_model(**loop)
    adaptive = kind == "adaptive" and has_rate(model)
    kernels: list[Kernel] = [make(model) for make in KINDS["continuous" if kind == "adaptive" else kind]]
    if adaptive:
        kernels = pair_kernels(model, reference)
    kernels += [loop_outputs(model)] if model.law is not None else []
    if reference is not None:
        kernels.append(motion_kernel(reference))
    library = build_kernels(
        lambda: kernels, namespace=model.plant.namespace, definition=defined_together(kernels), fused=adaptive
    )
    return model, library


def loop_numbers(
    loop: Loop, inertia: Any, gains: Mapping[str, ArrayLike], others: Mapping[str, ArrayLike]
) -> tuple[dict[str, Array], int | None]:
    """The numbers of a loop that are inputs by name, and the number of loops that they are for; None for one.

    Args:
        loop: the loop.
        inertia: as `closed_loop` takes it.
        gains: of the law and the observer.
        others: limits, disturbance, sigma_X ..., bias: of one loop or, with an axis in front, of several.

    Raises:
        InputError: a number is missing, unknown or not positive; an inertia is not symmetric positive definite.
        ShapeError: an array fits neither one loop nor several, or two arrays are for different numbers of loops.
    """
    ports = {port.name: port for port in loop.number_ports(noisy=True) if port.name != "noise"}
    body = {port.name: port for port in loop.plant.numbers}
    of_law = {p.name: p for law in (loop.law, loop.observer) if law is not None for p in law.numbers}
    # of a law that somebody wrote down nobody says which of its numbers are gains
    free = {
        p.name
        for law in (loop.law, loop.observer)
        if law is not None and law.kernel.definition is None
        for p in law.numbers
    }
    unknown = [name for name in gains if name not in of_law]
    if unknown:
        has = ", ".join(of_law) or "none"
        raise InputError(f"closed_loop: the law has no input {', '.join(unknown)}; its numbers that are inputs: {has}")
    if body and "inertia" in gains:
        raise InputError("closed_loop: the inertia is one a loop already; the law takes that of the body")
    numbers: dict[str, Array] = {}
    if body:
        metric, inverse = _checked(body["inertia"], inertia)
        numbers = {"inertia": metric, "inertia_inverse": np.linalg.inv(metric) if inverse is None else inverse}
    for name, port in of_law.items():
        if name in numbers:
            continue
        if name in gains:
            numbers[name] = checked(port, gains[name], positive=not port.any_sign and name not in free)
        else:
            numbers[name] = _single(inertia, port.shape[0])
    numbers |= {name: spread(ports[name], value) for name, value in others.items()}
    counts = {len(value) for name, value in numbers.items() if value.ndim > len(ports[name].shape)}
    if len(counts) > 1:
        raise ShapeError(f"closed_loop: inertia and gains are for different numbers of loops: {sorted(counts)}")
    return numbers, counts.pop() if counts else None


def spread(port: Port, value: ArrayLike) -> Array:
    """A number for all components, one a component, or (N, components) for N loops.

    Raises:
        ShapeError, InputError, NotFiniteError: naming it.
    """
    noise = next((kind for kind, name in SIGMAS.items() if name == port.name), None)
    what = port.name if noise is None else f"noise[{noise!r}]"
    try:
        array = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        raise InputError(
            f"closed_loop: {what} is {shown(value)}; give a number, {port.shape} or (N, {port.shape[0]})"
        ) from None
    if not np.all(np.isfinite(array)) and port.name != "limits":
        raise NotFiniteError(f"closed_loop: {what} holds NaN or infinity")
    if array.ndim == 1 and len(array) not in (1, port.shape[0]):
        array = array[:, None]  # one a loop, of all components
    if array.ndim > 2 or (array.ndim and array.shape[-1] not in (1, port.shape[0])):
        raise ShapeError(
            f"closed_loop: {what} has shape {array.shape}; give a number, {port.shape} or (N, {port.shape[0]})"
        )
    if noise is not None and np.any(array < 0):
        raise InputError(f"closed_loop: {what} is negative; it is a standard deviation")
    if port.name == "limits" and not np.all(array > 0):
        raise InputError("closed_loop: limits must be positive: the largest magnitude of each component of the command")
    return np.ascontiguousarray(np.broadcast_to(array, (*array.shape[:-1], *port.shape)))


def _single(inertia: Any, n: int) -> Array:
    """A number, a diagonal or a matrix as a matrix."""
    value = np.asarray(inertia, dtype=float)
    return value * np.eye(n) if value.ndim == 0 else np.diag(value) if value.ndim == 1 else value


def _taken(port: Port) -> str:
    """The shapes of a number of a loop: its own, and one a loop."""
    sides = "".join(f", {n}" for n in port.shape)
    return f"{port.shape or 'a number'}, or one for each of N loops: (N{sides or ','})"


def checked(port: Port, value: ArrayLike, *, positive: bool = True) -> Array:
    """The values of a number, one or one a loop: positive, or symmetric and positive definite, if that is wanted.

    Raises:
        ShapeError, NotFiniteError, InputError: naming the first that is not.
    """
    return _checked(port, value, positive=positive)[0]


def _checked(port: Port, value: ArrayLike, *, positive: bool = True) -> tuple[Array, Array | None]:
    """The same, and the inverses of matrices where looking at them found these."""
    try:
        array = np.array(value, dtype=float, order="C")  # ascontiguousarray would make a number an array of one
    except (TypeError, ValueError, OverflowError):
        raise InputError(f"closed_loop: {port.name} is {shown(value)}; give {_taken(port)}") from None
    ranks = (len(port.shape), len(port.shape) + 1)
    if array.ndim not in ranks or array.shape[array.ndim - len(port.shape) :] != port.shape:
        raise ShapeError(f"closed_loop: {port.name} has shape {array.shape}; give {_taken(port)}")
    if not np.all(np.isfinite(array)):
        raise NotFiniteError(f"closed_loop: {port.name} holds NaN or infinity")
    if not positive:
        return array, None
    inverses = clear_inverses(array) if array.ndim == 3 and len(port.shape) == 2 else None
    if inverses is not None:
        return array, inverses
    if len(port.shape) == 2:
        least = np.linalg.eigvalsh((array + np.swapaxes(array, -1, -2)) / 2)[..., 0]
        skew = np.max(np.abs(array - np.swapaxes(array, -1, -2)), axis=(-1, -2))
        bad = (least <= 0) | (skew > 1e-12 * np.max(np.abs(array), axis=(-1, -2)))
        wanted = "symmetric positive definite"
    else:
        bad, wanted = np.any(array <= 0, axis=tuple(range(array.ndim - len(port.shape), array.ndim))), "positive"
    if np.any(bad):
        first = int(np.flatnonzero(bad)[0])
        where = f" of loop {first}" if array.ndim == ranks[1] else ""
        raise InputError(f"closed_loop: {port.name}{where} is not {wanted}")
    return array, None


def several(start: Array, many: bool, loops: int | None, runs: Any) -> tuple[Array, bool]:
    """(N, m) initial states for as many loops as the numbers and `runs` ask for, and whether there are several.

    Raises:
        ShapeError: two numbers of loops. InputError: runs is no positive integer.
    """
    if runs is not None and (isinstance(runs, bool) or not isinstance(runs, int | np.integer) or runs < 1):
        raise InputError(f"closed_loop: runs is a positive integer, given {shown(runs)}")
    if loops is not None and runs is not None and loops != runs:
        raise ShapeError(f"closed_loop: {runs} runs, and inertia, gains or noise for {loops} loops")
    wanted = loops if loops is not None else runs
    if wanted is None:
        return start, many
    if len(start) not in (1, wanted):
        raise ShapeError(f"closed_loop: {len(start)} initial states for {wanted} inertias or gains")
    return np.ascontiguousarray(np.broadcast_to(start, (int(wanted), start.shape[1]))), True
