"""The loops of a step: one trajectory, many, or of many only what is left at the end."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from contextlib import nullcontext
from typing import Any, Protocol

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.codegen.signature import Signature, is_step, python_field
from lie_codegen.errors import InputError, ShapeError
from lie_codegen.identifiers import shown
from lie_codegen.kernel.kernel import Port
from lie_codegen.runtime.arguments import bind, checked, dtype_of, named_results, outputs_for, sequences, unshared
from lie_codegen.runtime.arguments_scan import Strides, loops
from lie_codegen.runtime.backend import Backend
from lie_codegen.runtime.patience import progress
from lie_codegen.runtime.threads import CALLS, in_parts, step_pieces, stopped


class Step(Protocol):
    """What a loop needs to know of a compiled kernel."""

    name: str
    inputs: tuple[Port, ...]
    outputs: tuple[Port, ...]
    signature: Signature
    backend: Backend


#: How an output behind the state is reduced -> (its number in C, what it is of no step).
REDUCTIONS = {"sum": (1, 0.0), "max": (2, -np.inf), "min": (3, np.inf), "last": (4, np.nan)}


def check_loop(step: Step, form: str, n: Any, every: Any) -> None:
    """The kernel can be iterated, and n is a number of steps.

    Raises:
        InputError: saying what does not fit.
    """
    if not is_step(step.inputs, step.outputs):
        raise InputError(f"{step.name}.{form}: the first output is not of the shape of the first input")
    for name, value, least in (("n", n, 0), ("every", every, 1)):
        if isinstance(value, bool) or not isinstance(value, (int, np.integer)) or value < least:
            raise InputError(f"{step.name}.{form}: {name} is an integer of at least {least}, given {value!r}")
    if n % every:
        raise InputError(f"{step.name}.{form}: n = {n} is no multiple of every = {every}")


def _of_states(step: Step) -> Signature:
    """The signature of what a loop returns; `dataclasses.replace` takes as long as a short loop."""
    whole = step.signature
    return Signature(whole.name, whole.symbol, whole.inputs, whole.outputs[:1], real=whole.real)


def scan(step: Step, args: Sequence[Any], named: Mapping[str, Any], n: int, every: int, out: Any) -> Array:
    """`Compiled.scan`."""
    check_loop(step, "scan", n, every)
    start, *rest = bind(step.signature, args, named)
    state = checked(step.name, step.inputs[0], start, step.signature.real)
    arrays, strides, count = sequences(step.signature, rest, "steps", step.inputs[1:])
    if count is not None and count != n:
        raise ShapeError(f"{step.name}.scan: inputs have {count} steps, n = {n}")
    (trajectory,) = outputs_for(_of_states(step), out, (int(n) // int(every) + 1,))
    arrays = [state, *arrays]
    if out is not None:
        arrays = unshared(arrays, [trajectory])
    if int(n) <= CALLS:
        step.backend.scan(int(n), int(every), arrays, [0, *strides], trajectory)
        return trajectory
    trajectory[0] = state
    for first, steps, kept in step_pieces(int(n), int(every), CALLS):
        made = np.empty((steps // kept + 1, *trajectory.shape[1:]), trajectory.dtype)
        mine = [
            state,
            *(a[first : first + steps] if stride else a for a, stride in zip(arrays[1:], strides, strict=True)),
        ]
        step.backend.scan(steps, kept, mine, [0, *strides], made)
        state = made[-1].copy()
        if (first + steps) % int(every) == 0:
            place = (first + steps) // int(every)
            trajectory[place - len(made) + 2 : place + 1] = made[1:]
    return trajectory


def scan_batch(
    step: Step, args: Sequence[Any], named: Mapping[str, Any], n: int, every: int, out: Any, threads: int
) -> Array:
    """`Compiled.scan_batch` with its trajectories."""
    check_loop(step, "scan_batch", n, every)
    arrays, strides, count = loops(step.signature, bind(step.signature, args, named), int(n))
    port = step.outputs[0]
    (trajectories,) = outputs_for(_of_states(step), out, (count, int(n) // int(every) + 1))
    if out is not None:
        arrays = unshared(arrays, [trajectories])

    def some(start: int, stop: int) -> None:
        mine = _of_trajectories(arrays, strides, start, stop)
        if int(n) * (stop - start) <= 2 * CALLS:
            step.backend.scan_batch(stop - start, int(n), int(every), mine, strides, trajectories[start:stop])
            return
        trajectories[start:stop, 0] = mine[0]
        for first, steps, kept in step_pieces(int(n), int(every), max(1, CALLS // (stop - start))):
            made = np.empty((stop - start, steps // kept + 1, *port.shape), trajectories.dtype)
            step.backend.scan_batch(stop - start, steps, kept, _from_step(mine, strides, first), strides, made)
            mine[0] = np.ascontiguousarray(made[:, -1])
            if stopped():
                return
            if (first + steps) % int(every) == 0:
                place = (first + steps) // int(every)
                trajectories[start:stop, place - made.shape[1] + 2 : place + 1] = made[:, 1:]

    with progress("scan_batch") if count * int(n) > CALLS else nullcontext():
        in_parts(some, count, threads, int(n))
    return trajectories


def scan_reduced(
    step: Step, args: Sequence[Any], named: Mapping[str, Any], n: int, reduce: Mapping[str, str], threads: int
) -> Any:
    """`Compiled.scan_batch` with `reduce`: nothing along the way is stored."""
    check_loop(step, "scan_batch", n, 1)
    how = list(_ways(step, reduce))
    if len(how) == 1:  # a step that tells nothing beside its state: its loop with no other state stored
        states = scan_batch(step, args, named, n, int(n) or 1, None, threads)[:, -1]
        return named_results(f"{step.name}_reduced", (python_field(step.outputs[0].name),))(
            np.ascontiguousarray(states)
        )
    arrays, strides, count = loops(step.signature, bind(step.signature, args, named), int(n))
    port, real = step.outputs[0], step.signature.real
    states = np.empty((count, *port.shape), dtype_of(port, real))
    states[...] = arrays[0]
    kept = {
        k: np.full((count, *each.shape), REDUCTIONS[reduce[each.name]][1], dtype_of(each, real))
        for k, each in enumerate(step.outputs)
        if how[k]
    }

    def some(start: int, stop: int) -> None:
        mine = _of_trajectories(arrays, strides, start, stop)
        mine[0] = states[start:stop]
        moves = [(port.size, 0), *strides[1:]]
        outputs = [states[start:stop], *(kept[k][start:stop] if how[k] else None for k in range(1, len(how)))]
        for first, steps, _ in step_pieces(int(n), int(n) or 1, max(1, CALLS // max(1, stop - start))):
            step.backend.reduce(stop - start, steps, _from_step(mine, strides, first), moves, how, outputs)
            if stopped():
                return

    with progress("scan_batch") if count * int(n) > CALLS else nullcontext():
        in_parts(some, count, threads, int(n))
    fields = tuple(python_field(step.outputs[k].name) for k in (0, *kept))
    return named_results(f"{step.name}_reduced", fields)(states, *kept.values())


def _ways(step: Step, reduce: Mapping[str, str]) -> Iterator[int]:
    others = {each.name: each for each in step.outputs[1:]}
    if not isinstance(reduce, Mapping):
        raise InputError(f"{step.name}.scan_batch: reduce= is {{output: reduction}}, given {shown(reduce)}")
    for name, way in reduce.items():
        if name not in others:
            known = ", ".join(others) or "it has none"
            raise InputError(
                f"{step.name}.scan_batch: reduce= takes outputs behind the state ({known}), given {shown(name)}"
            )
        if not isinstance(way, str) or way not in REDUCTIONS or (others[name].is_complex and way in ("max", "min")):
            ways = [each for each in REDUCTIONS if not (others[name].is_complex and each in ("max", "min"))]
            raise InputError(f"{step.name}.scan_batch: {name} is reduced by {', '.join(ways)}; given {shown(way)}")
    for each in step.outputs:
        yield REDUCTIONS[reduce[each.name]][0] if each.name in others and each.name in reduce else 0


def _of_trajectories(arrays: Sequence[Array], strides: Sequence[Strides], start: int, stop: int) -> list[Array]:
    return [array if lane == 0 else array[start:stop] for array, (lane, _) in zip(arrays, strides, strict=True)]


def _from_step(arrays: Sequence[Array], strides: Sequence[Strides], first: int) -> list[Array]:
    """Each trajectory has its entries of all steps in a row: their place moves on, their strides stay."""
    return [
        array if k == 0 or not step else array.reshape(-1)[first * step // (2 if array.dtype.kind == "c" else 1) :]
        for k, (array, (_, step)) in enumerate(zip(arrays, strides, strict=True))
    ]
