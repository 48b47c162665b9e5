"""A continuous loop as a rate, for integrators that choose their steps.

In general (X, y, t, numbers) -> y', and X exp(Theta): X holds the varying entries of all group elements, of the plant and of the law's own
states; y = (Theta of each, velocity, own vectors). On groups of rotations and free entries (y, t, numbers) -> y': y = (the elements as
quaternions and the entries beside them, velocity, own vectors), and between y and X go `loop_lift` and `loop_settle`.
"""

from __future__ import annotations

import random
from collections.abc import Callable, Sequence
from typing import Any

from lie_codegen.control.loop_call import COMMAND, called, limited
from lie_codegen.control.loop_model import Loop
from lie_codegen.control.plants import GroupPlant
from lie_codegen.control.reference_kernels import motion_kernel
from lie_codegen.errors import InputError
from lie_codegen.flow.product_rate import Rates, product_rate, short_rate
from lie_codegen.flow.product_step import Move
from lie_codegen.flow.short_state import ShortStates, short_states
from lie_codegen.groups.maps.element_pattern import pack, packed_size, unpack
from lie_codegen.kernel.arithmetic import Arithmetic, FloatArithmetic, Scalar
from lie_codegen.kernel.definition import kernel_factory
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.linear import Vector, plus


def has_rate(loop: Loop) -> bool:
    """Whether the loop is a smooth rate on groups: no state that jumps, no law that asks for the length of the step."""
    jumps = any(each.kind == "held" for each in loop.own_ports)
    asks = loop.law is not None and loop.law.has("period")
    return isinstance(loop.plant, GroupPlant) and loop.observer is None and not jumps and not asks


def moves_of(loop: Loop) -> tuple[Move, ...]:
    """Of the plant, then of the own states that are group elements."""
    own = [each for each in loop.own_ports if each.kind == "group"]
    mine = loop.own_move if own else None
    return (*loop.plant.moves, *([] if mine is None else [mine] * len(own)))


def columns(loop: Loop) -> tuple[list[int], list[int]]:
    """Which entries of a state are those of group elements, and which are vectors, in the order of X and of y."""
    size, speed, _ = loop.plant.sizes
    elements, vectors, place = list(range(size)), list(range(size, size + speed)), size + speed
    for each in loop.own_ports:
        own = loop.own_size(each.port)
        (elements if each.kind == "group" else vectors).extend(range(place, place + own))
        place += own
    return elements, vectors


def short_of(loop: Loop) -> ShortStates | None:
    """The elements of the loop as quaternions and what stands beside them; None where a group is not of that kind."""
    return short_states([move.group for move in moves_of(loop)])


def pair_kernels(loop: Loop, reference: Any = None) -> list[Kernel]:
    """What the pair 8(5,3) integrates the loop with, in the shorter form where there is one."""
    if short_of(loop) is None:
        return [loop_rate(loop, reference), loop_settle(loop)]
    return [short_loop_rate(loop, reference), short_loop_settle(loop), loop_lift(loop)]


@kernel_factory()
def loop_rate(loop: Loop, reference: Any = None, name: str = "loop_rate") -> Kernel:
    """(X, y, t, numbers) -> y'; the reference is evaluated at t within."""
    moves, numbers = moves_of(loop), loop.number_ports(noisy=False)
    turns = sum(move.group.dim for move in moves)
    packed, vectors = columns(loop)
    size, extent = turns + len(vectors), len(packed) + len(vectors)
    rates = _rates(loop, reference)

    def body(ops: Arithmetic, X: Vector, y: Vector, t: Scalar, *rest: Any) -> tuple[Any, ...]:
        given = dict(zip((port.name for port in numbers), rest, strict=True))
        return (product_rate(ops, moves, _unpacked(moves, X), y, rates(ops, given), t),)

    def sampler(rng: random.Random) -> tuple[Any, ...]:
        state = loop.sample(rng, extent)
        y = [*(rng.uniform(-0.3, 0.3) for _ in range(turns)), *(state[i] for i in vectors)]
        return [state[i] for i in packed], y, rng.uniform(0, 1), *(loop.sampled_port(rng, port) for port in numbers)

    return Kernel(
        name=name, namespace=loop.plant.namespace,
        inputs=(
            Port("X", (len(packed),), description="varying entries of the group elements where the step began"),
            Port("y", (size,), description="Theta, then velocities and the law's own vectors"), Port("t", (), "s"), *numbers,
        ),
        outputs=(Port("y_dot", (size,)),), body=body,
        formula="Theta' = dexp^-1(xi), I xi' = ad*_xi I xi + f at X exp(Theta)",
        source="Bullo and Murray, CIT-CDS 97-003, (10)", sampler=sampler,
    )  # fmt: skip


@kernel_factory()
def short_loop_rate(loop: Loop, reference: Any = None, name: str = "loop_rate") -> Kernel:
    """(y, t, numbers) -> y' with the elements in y; the reference is evaluated at t within.

    Raises:
        InputError: a group of the loop is of another kind.
    """
    states, numbers = _short(loop), loop.number_ports(noisy=False)
    vectors, rates = columns(loop)[1], _rates(loop, reference)
    size = states.size + len(vectors)

    def body(ops: Arithmetic, y: Vector, t: Scalar, *rest: Any) -> tuple[Any, ...]:
        given = dict(zip((port.name for port in numbers), rest, strict=True))
        return (short_rate(ops, states, y, rates(ops, given), t),)

    def sampler(rng: random.Random) -> tuple[Any, ...]:
        return (
            _sampled_short(loop, states, rng),
            rng.uniform(0, 1),
            *(loop.sampled_port(rng, port) for port in numbers),
        )

    return Kernel(
        name=name, namespace=loop.plant.namespace,
        inputs=(
            Port("y", (size,), description="elements in short, then velocities and the law's own vectors"), Port("t", (), "s"), *numbers
        ),
        outputs=(Port("y_dot", (size,)),), body=body, formula="q' = q (0, w)/2, X' = X hat(xi), I xi' = ad*_xi I xi + f",
        source="Bullo and Murray, CIT-CDS 97-003, (10)", sampler=sampler,
    )  # fmt: skip


def _rates(loop: Loop, reference: Any) -> Callable[[Arithmetic, dict[str, Any]], Rates]:
    """The velocities of the elements and the rates of the vectors, in an arithmetic, of given numbers."""
    extent = loop.extent(sampled=False)
    follows = motion_kernel(reference) if loop.moving else None
    plant, own = loop.plant, loop.own([0] * extent)

    def of(ops: Arithmetic, given: dict[str, Any]) -> Rates:
        def rates(time: Scalar, elements: list[Any], w: Vector) -> tuple[list[Vector], Vector]:
            now: dict[str, Any] = {"time": time}
            if follows is not None:
                now |= dict(zip(("X_d", "xi_d", "xi_d_dot"), follows.evaluate(ops, time), strict=True))
            count, speed = len(plant.moves), plant.sizes[1]
            Y, eta = plant.joined(elements[:count], w[:speed])
            mine = loop.replaced(own, elements[count:], w[speed:])
            command: Vector = [0] * plant.sizes[2]
            changes: dict[str, Any] = {}
            if loop.law is not None:
                # elements are of their groups to what a step leaves away
                values = called(ops, loop, Y, eta, mine, now, given, within=True)
                command = limited(ops, loop, values[COMMAND], given)
                changes = {each.name: values[each.rate] for each in mine if each.rate}
            push = plus(command, loop.push(ops, time, Y, eta, given))
            turned, slope = plant.rates(ops, time, Y, eta, push, given)
            flat = [x for each in mine if each.kind == "vector" for x in _entries(changes[each.name])]
            return [*turned, *(changes[each.name] for each in mine if each.kind == "group")], [*slope, *flat]

        return rates

    return of


@kernel_factory()
def loop_settle(loop: Loop, name: str = "loop_settle") -> Kernel:
    """(X, Theta) -> X exp(Theta), element by element."""
    moves = moves_of(loop)
    turns, packed = sum(move.group.dim for move in moves), columns(loop)[0]

    def body(ops: Arithmetic, X: Vector, theta: Vector) -> tuple[Any, ...]:
        after, place = [], 0
        for move, element in zip(moves, _unpacked(moves, X), strict=True):
            after += pack(move.group, move(ops, element, list(theta[place : place + move.group.dim])))
            place += move.group.dim
        return (after,)

    def sampler(rng: random.Random) -> tuple[Any, ...]:
        state = loop.sample(rng, loop.extent(sampled=False))
        return [state[i] for i in packed], [rng.uniform(-0.3, 0.3) for _ in range(turns)]

    return Kernel(
        name=name, namespace=loop.plant.namespace, inputs=(Port("X", (len(packed),)), Port("theta", (turns,))),
        outputs=(Port("X_next", (len(packed),)),), body=body, formula="X exp(Theta)", source="", sampler=sampler,
    )  # fmt: skip


@kernel_factory()
def short_loop_settle(loop: Loop, name: str = "loop_settle") -> Kernel:
    """Elements in short -> the varying entries of all."""
    states, moves, packed = _short(loop), moves_of(loop), columns(loop)[0]

    def body(ops: Arithmetic, y: Vector) -> tuple[Any, ...]:
        elements = zip(moves, states.elements(y), strict=True)
        return ([x for move, element in elements for x in pack(move.group, element)],)

    return Kernel(
        name=name, namespace=loop.plant.namespace, inputs=(Port("y", (states.size,)),), outputs=(Port("X", (len(packed),)),),
        body=body, formula="X(q)", source="", sampler=lambda rng: (_sampled_short(loop, states, rng)[: states.size],),
    )  # fmt: skip


@kernel_factory()
def loop_lift(loop: Loop, name: str = "loop_lift") -> Kernel:
    """The varying entries of all elements -> the elements in short."""
    states, moves, packed = _short(loop), moves_of(loop), columns(loop)[0]

    def body(ops: Arithmetic, X: Vector) -> tuple[Any, ...]:
        return (states.lifted(ops, _unpacked(moves, X)),)

    def sampler(rng: random.Random) -> tuple[Any, ...]:
        state = loop.sample(rng, loop.extent(sampled=False))
        return ([state[i] for i in packed],)

    return Kernel(
        name=name, namespace=loop.plant.namespace, inputs=(Port("X", (len(packed),)),), outputs=(Port("y", (states.size,)),),
        body=body, formula="q with X = X(q)", source="Shepperd, J. Guidance and Control 1 (1978) 223", sampler=sampler,
    )  # fmt: skip


def _short(loop: Loop) -> ShortStates:
    states = short_of(loop)
    if states is None:
        raise InputError(
            f"closed_loop({loop.plant.namespace}): its elements are not rotations with free entries beside"
        )
    return states


def _sampled_short(loop: Loop, states: ShortStates, rng: random.Random) -> list[float]:
    """Elements in short and vectors of an admissible state."""
    packed, vectors = columns(loop)
    state = loop.sample(rng, len(packed) + len(vectors))
    elements = _unpacked(moves_of(loop), [state[i] for i in packed])
    return [*states.lifted(FloatArithmetic(), elements), *(state[i] for i in vectors)]


def _unpacked(moves: Sequence[Move], X: Vector) -> list[Any]:
    elements, place = [], 0
    for move in moves:
        size = packed_size(move.group)
        elements.append(unpack(move.group, X[place : place + size]))
        place += size
    return elements


def _entries(value: Any) -> list[Scalar]:
    if not isinstance(value, list | tuple):
        return [value]
    return [x for each in value for x in _entries(each)]
