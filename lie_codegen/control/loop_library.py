"""What a closed loop runs on: its compiled step, law and reference, and the numbers that are their inputs."""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.control.reference_kernels import reference_kernel
from lie_codegen.control.reference_motion import Reference
from lie_codegen.control.second_order_step import ForceBody, law_parameters, second_order_step
from lie_codegen.errors import InputError, NotFiniteError, ShapeError
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernel.definition import Definition, made_from, plain
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.runtime.build import build_kernels, defined_together
from lie_codegen.runtime.library import Library


def loop_library(
    group: MatrixGroup, inertia: Any, law: Kernel | None, reference: Reference | None, external: ForceBody | None
) -> Library:
    """second_order_step, the law and the reference, compiled.

    What follows from definitions is built once a process and known by them; a further force is a Python function, which
    may have changed since, so with it everything is derived again.
    """
    definition = getattr(reference, "definition", None)
    if (
        external is None
        and (law is None or law.definition is not None)
        and (reference is None or definition is not None)
    ):
        return _defined(group.definition, plain(inertia), law, definition)
    return _library(group, inertia, law, reference, external)


@lru_cache(maxsize=64)
def _defined(group: Definition, inertia: Any, law: Kernel | None, reference: Definition | None) -> Library:
    return _library(made_from(group), inertia, law, None if reference is None else made_from(reference), None)


def _library(
    group: MatrixGroup, inertia: Any, law: Kernel | None, reference: Reference | None, external: ForceBody | None
) -> Library:
    kernels = [second_order_step(group, inertia, external, law=law)]
    kernels += [law] if law is not None else []
    kernels += [reference_kernel(reference)] if reference is not None else []
    return build_kernels(lambda: kernels, namespace=group.name, definition=defined_together(kernels))


def loop_numbers(
    group: MatrixGroup, inertia: Any, law: Kernel | None, gains: Mapping[str, ArrayLike]
) -> tuple[dict[str, Array], dict[str, Array], int | None]:
    """The inputs of the step and of the law by name, and the number of loops that they are for; None for one.

    Raises:
        InputError: a number is missing, unknown or not positive; an inertia is not symmetric positive definite.
        ShapeError: an array fits neither one loop nor several, or two arrays are for different numbers of loops.
    """
    n = group.dim
    ports = {port.name: port for port in (law_parameters(law) if law is not None else ())}
    unknown = [name for name in gains if name not in ports]
    if unknown:
        has = ", ".join(ports) or "none"
        raise InputError(f"closed_loop: the law has no input {', '.join(unknown)}; its numbers that are inputs: {has}")
    many = np.ndim(inertia) == 3 if not isinstance(inertia, str) else False
    step: dict[str, Array] = {}
    body = Port("inertia", (n, n))
    if many:
        metric = checked(body, inertia)
        step = {"inertia": metric, "inertia_inverse": np.ascontiguousarray(np.linalg.inv(metric))}
    numbers: dict[str, Array] = {}
    for name, port in ports.items():
        if name in gains:
            numbers[name] = checked(port, gains[name])
        elif name == "inertia" and port.shape == (n, n) and inertia is not None:
            numbers[name] = step.get("inertia", _single(inertia, n))
        else:
            raise InputError(f"closed_loop: {name} is an input of the law: give gains={{{name!r}: ...}}")
    if many and "inertia" in gains:
        raise InputError("closed_loop: the inertia is one a loop already; the law takes that of the body")
    step.update({name: value for name, value in numbers.items() if name not in step})
    counts = {len(v) for name, v in step.items() if v.ndim > len(ports.get(name, body).shape)}
    if len(counts) > 1:
        raise ShapeError(f"closed_loop: inertia and gains are for different numbers of loops: {sorted(counts)}")
    return step, numbers, counts.pop() if counts else None


def _single(inertia: Any, n: int) -> Array:
    """A number, a diagonal or a matrix as a matrix."""
    value = np.asarray(inertia, dtype=float)
    return value * np.eye(n) if value.ndim == 0 else np.diag(value) if value.ndim == 1 else value


def checked(port: Port, value: ArrayLike) -> Array:
    """The values of a number, one or one a loop: positive, or symmetric and positive definite.

    Raises:
        ShapeError, NotFiniteError, InputError: naming the first that is not.
    """
    array = np.array(value, dtype=float, order="C")  # ascontiguousarray would make a number an array of one
    ranks = (len(port.shape), len(port.shape) + 1)
    if array.ndim not in ranks or array.shape[array.ndim - len(port.shape) :] != port.shape:
        raise ShapeError(f"closed_loop: {port.name} has shape {array.shape}; give {port.shape} or (N, *{port.shape})")
    if not np.all(np.isfinite(array)):
        raise NotFiniteError(f"closed_loop: {port.name} holds NaN or infinity")
    if len(port.shape) == 2:
        least = np.linalg.eigvalsh((array + np.swapaxes(array, -1, -2)) / 2)[..., 0]
        skew = np.max(np.abs(array - np.swapaxes(array, -1, -2)), axis=(-1, -2))
        bad = (least <= 0) | (skew > 1e-12 * np.max(np.abs(array), axis=(-1, -2)))
        wanted = "symmetric positive definite"
    else:
        bad, wanted = array <= 0, "positive"
    if np.any(bad):
        first = int(np.flatnonzero(bad)[0])
        where = f" of loop {first}" if array.ndim == ranks[1] else ""
        raise InputError(f"closed_loop: {port.name}{where} is not {wanted}")
    return array


def several(start: Array, loops: int) -> Array:
    """(N, m) initial states for that many loops.

    Raises:
        ShapeError: there are several already, and not as many.
    """
    if len(start) not in (1, loops):
        raise ShapeError(f"closed_loop: {len(start)} initial states for {loops} inertias or gains")
    return np.ascontiguousarray(np.broadcast_to(start, (loops, start.shape[1])))
