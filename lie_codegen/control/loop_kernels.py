"""The kernels of a closed loop: one continuous step; or, for a sampled law, the motion under a held command and the call of the law.

The state is the configuration and the velocity of the plant, then the law's own states; of a sampled loop also the own
states as the last call of the law used them, and the command that is held.
"""

from __future__ import annotations

import math
import random
from collections.abc import Mapping, Sequence
from typing import Any

from lie_codegen.control.loop_model import Loop, Own
from lie_codegen.control.loop_ports import seen_directions
from lie_codegen.control.plants import GroupPlant
from lie_codegen.flow.product_step import product_step
from lie_codegen.groups.maps.matrices import GroupMatrices
from lie_codegen.groups.matrix_pattern import RealMatrices
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.definition import kernel_factory
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.linear import Vector, dot, plus, scaled
from lie_codegen.kernel.saturation import saturated
from lie_codegen.on_demand import sympy as sp

_SOURCE = "Munthe-Kaas, BIT 38 (1998) 92; Bullo and Murray, CIT-CDS 97-003, (10)"


@kernel_factory()
def loop_step(loop: Loop, name: str = "loop_step") -> Kernel:
    """(state, t, h, X_d, xi_d, xi_d_dot, numbers) -> state: one RKMK4 step of plant and law together.

    The reference stands at t, t + h/2 and t + h in three rows, X_d flat. States of the law that jump do so where the step begins.
    """
    plant, extent = loop.plant, loop.extent(sampled=False)

    def body(ops: Arithmetic, state: Vector, t: Scalar, h: Scalar, *rest: Any) -> tuple[Any, ...]:
        X, v = plant.opened(state)
        own = loop.own(state)
        reference, numbers = loop.given(rest)
        stages = [loop.stage(reference, i) for i in range(3)] if reference else [{}] * 3
        if any(each.kind == "held" for each in own):
            values = called(ops, loop, X, v, own, {**stages[0], "time": t, "period": h}, numbers)
            own = [each.moved(values[each.rate]) if each.kind == "held" else each for each in own]

        def rates(stage: int, time: Scalar, elements: list[Any], w: Vector) -> tuple[list[Vector], Vector]:
            count = len(plant.moves)
            Y, eta = plant.joined(elements[:count], w[:moving])
            now = loop.replaced(own, elements[count:], w[moving:])
            turns, slope = plant.rates(ops, time, Y, eta, pushed(ops, time, Y, eta, now, stage), numbers)
            changed = [changes[each.name] for each in now if each.kind == "group"]
            return [*turns, *changed], [
                *slope,
                *(x for each in now if each.kind == "vector" for x in changes[each.name]),
            ]

        changes: dict[str, Any] = {}

        def pushed(ops: Arithmetic, time: Scalar, Y: Any, eta: Vector, now: list[Own], stage: int) -> Vector:
            command: Vector = [0] * plant.sizes[2]
            if loop.law is not None:
                values = called(ops, loop, Y, eta, now, {**stages[stage], "time": time, "period": h}, numbers)
                command = limited(ops, loop, values[COMMAND], numbers)
                changes.update({each.name: values[each.rate] for each in now if each.rate})
            return plus(command, loop.push(ops, time, Y, eta, numbers))

        elements, w = plant.parts(X, v)
        moving = len(w)
        turned = [each for each in own if each.kind == "group"]
        flat = [x for each in own if each.kind == "vector" for x in each.value]
        moves = [*plant.moves, *(plant.moves[0] for _ in turned)]
        ends, after = product_step(ops, moves, [*elements, *(each.value for each in turned)], [*w, *flat], rates, t, h)
        X, v = plant.landed(ops, *plant.joined(ends[: len(elements)], after[:moving]))
        own = loop.replaced(own, ends[len(elements) :], after[moving:])
        return ([*plant.closed(X, v), *(x for each in own for x in each.flat())],)

    return _kernel(
        loop,
        name,
        extent,
        loop.reference_ports(stages=3),
        body,
        "X' = X hat(xi), I xi' = ad*_xi I xi + f: one RKMK4 step",
    )


@kernel_factory()
def loop_motion(loop: Loop, name: str = "loop_motion") -> Kernel:
    """(state, t, h, numbers) -> state: one RKMK4 step of the plant under the command that the state holds."""
    extent = loop.extent(sampled=True)

    def body(ops: Arithmetic, state: Vector, t: Scalar, h: Scalar, *rest: Any) -> tuple[Any, ...]:
        _, numbers = loop.given(rest, moving=False)
        X, v = moved(ops, loop, state, t, h, numbers)
        return ([*loop.plant.closed(X, v), *state[sum(loop.plant.sizes[:2]) :]],)

    return _kernel(loop, name, extent, (), body, "one RKMK4 step under a held command")


@kernel_factory()
def loop_control(loop: Loop, name: str = "loop_control") -> Kernel:
    """(state, t, h, X_d, xi_d, xi_d_dot, numbers, noise) -> state: the law, called at t; h is the time to its next call."""
    extent = loop.extent(sampled=True)

    def body(ops: Arithmetic, state: Vector, t: Scalar, h: Scalar, *rest: Any) -> tuple[Any, ...]:
        reference, numbers = loop.given(rest)
        X, v = loop.plant.opened(state)
        return (controlled(ops, loop, state, X, v, t, h, reference, numbers),)

    return _kernel(loop, name, extent, loop.reference_ports(stages=1), body, "the law at a sample", noisy=True)


@kernel_factory()
def loop_sample(loop: Loop, name: str = "loop_sample") -> Kernel:
    """(state, t, h, X_d, xi_d, xi_d_dot, numbers, noise) -> state: the motion from t to t + h, then the law there.

    The reference and the noise are those at t + h.
    """
    extent = loop.extent(sampled=True)

    def body(ops: Arithmetic, state: Vector, t: Scalar, h: Scalar, *rest: Any) -> tuple[Any, ...]:
        reference, numbers = loop.given(rest)
        X, v = moved(ops, loop, state, t, h, numbers)
        return (controlled(ops, loop, state, X, v, t + h, h, reference, numbers),)

    return _kernel(loop, name, extent, loop.reference_ports(stages=1), body, "a held step, then the law", noisy=True)


@kernel_factory()
def loop_outputs(loop: Loop, name: str = "loop_outputs") -> Kernel:
    """(state, t, h, X_d, xi_d, xi_d_dot, numbers) -> the outputs of the law at a state, and last its command within the limits."""
    extent, law = loop.extent(sampled=False), loop.law
    if law is None:
        raise ValueError("a loop without a law has no outputs")

    def body(ops: Arithmetic, state: Vector, t: Scalar, h: Scalar, *rest: Any) -> tuple[Any, ...]:
        reference, numbers = loop.given(rest)
        X, v = loop.plant.opened(state)
        now = {**(loop.stage(reference, None) if reference else {}), "time": t, "period": h}
        values = called(ops, loop, X, v, loop.own(state), now, numbers)
        return *(values[port.name] for port in law.kernel.outputs), limited(ops, loop, values[COMMAND], numbers)

    made = _kernel(loop, name, extent, loop.reference_ports(stages=1), body, law.kernel.formula)
    # a law may call its own command u
    name_of_acting = "u_acting" if any(port.name == "u" for port in (*made.inputs, *law.kernel.outputs)) else "u"
    outputs = (
        *law.kernel.outputs,
        Port(name_of_acting, law.command.shape, law.command.units, description="the command, within limits"),
    )
    return Kernel(made.name, made.namespace, made.inputs, outputs, body, made.formula, made.source, made.sampler)


#: Under this name `called` returns the command, which is no output of the law where the velocity of the reference is added.
COMMAND = ""


def called(
    ops: Arithmetic,
    loop: Loop,
    X: Any,
    v: Vector,
    own: Sequence[Own],
    now: Mapping[str, Any],
    numbers: Mapping[str, Any],
    seen: Any = None,
) -> dict[str, Any]:
    """What the law gives; X_d, xi_d and xi_d_dot are in `now` where there is a reference, `seen` is y where it was measured."""
    law, plant = loop.law, loop.plant
    if law is None:
        return {}
    given = {**numbers, **{each.name: each.value for each in own}, **now, "velocity": v}
    E_inverse, offset = None, None
    given["configuration"] = X
    if loop.by_error and isinstance(plant, GroupPlant):
        # Ad_{E^-1} xi_d: with it and u = law(E), E' = E hat(law(E)), whatever the reference does.
        given["configuration"], E, E_inverse = plant.relative(ops, now["X_d"], X)
        matrices = GroupMatrices(ops, RealMatrices(plant.group))
        offset = matrices.Ad(E_inverse, E, now["xi_d"])
    if law.directions and isinstance(plant, GroupPlant):
        if seen is None:
            inverse = plant.inverse(ops, X) if E_inverse is None else E_inverse
            seen = seen_directions(ops, plant.group, inverse, law.directions)
        y = next(each.port for each in law.ports if each.kind == "direction")
        given["direction"] = seen if len(y.shape) == 2 else seen[0]
    values = law.values(ops, given)
    command = values[law.command.name]
    return {**values, COMMAND: command if offset is None else plus(command, offset)}


def limited(ops: Arithmetic, loop: Loop, command: Vector, numbers: Mapping[str, Any]) -> Vector:
    """min(max(u, -limit), limit), component by component."""
    return saturated(ops, command, numbers["limits"] if loop.limited else None)


def moved(
    ops: Arithmetic, loop: Loop, state: Vector, t: Scalar, h: Scalar, numbers: Mapping[str, Any]
) -> tuple[Any, Vector]:
    """Configuration and velocity after a step under the held command."""
    plant = loop.plant
    X, v = plant.opened(state)
    command = list(state[-plant.sizes[2] :])

    def rates(stage: int, time: Scalar, elements: list[Any], w: Vector) -> tuple[list[Vector], Vector]:
        Y, eta = plant.joined(elements, w)
        return plant.rates(ops, time, Y, eta, plus(command, loop.push(ops, time, Y, eta, numbers)), numbers)

    elements, w = plant.parts(X, v)
    return plant.landed(ops, *plant.joined(*product_step(ops, plant.moves, elements, w, rates, t, h)))


def controlled(
    ops: Arithmetic,
    loop: Loop,
    state: Vector,
    X: Any,
    v: Vector,
    t: Scalar,
    h: Scalar,
    reference: Sequence[Any],
    numbers: Mapping[str, Any],
) -> Vector:
    """The state after a call of the law: own states one period on, and the new command."""
    plant, own, size = loop.plant, loop.own(state), plant_size(loop)
    now = {**(loop.stage(reference, None) if reference else {}), "time": t, "period": h}
    normals = dict(zip(loop.noise, _normals(ops, loop, numbers), strict=True))
    felt = _plus_noise(v, normals.get("xi"), numbers.get("bias"))
    measured = X if "X" not in normals else plant.disturbed(ops, X, normals["X"])
    seen = _seen(ops, loop, measured, normals.get("y"))
    watching = {each.name: each for each in own if loop.observer is not None and each.name in loop.observer_states}
    if loop.observer is None:
        values = called(ops, loop, measured, felt, own, now, numbers, seen)
    else:
        X_hat, bias = watching["X_hat"].value, watching.get("bias")
        rate = felt if bias is None else plus(felt, scaled(-1, bias.value))
        mine = [each for each in own if each.name not in watching]
        values = called(ops, loop, X_hat, rate, mine, now, numbers, None)
    command = limited(ops, loop, values[COMMAND], numbers)
    if loop.observer is not None:
        # A body whose velocity is commanded turns as it is told over the coming period: that is what its gyro reads.
        gyro = felt if plant.order == 2 else _plus_noise(command, normals.get("xi"), numbers.get("bias"))
        given = {**numbers, **{each.name: each.value for each in own}, **now, "velocity": gyro, "direction": seen}
        values |= loop.observer.values(ops, given)
    after = [each.advanced(ops, loop.own_move, values[each.rate], h) for each in own]
    used = [
        new if each.kind == "held" and each.name not in watching else each for each, new in zip(own, after, strict=True)
    ]
    acting = command if "u" not in normals else plus(command, normals["u"])
    return [*plant.closed(X, v), *(x for each in (*after, *used) for x in each.flat()), *acting][:size]


def plant_size(loop: Loop) -> int:
    """Doubles of the state of a sampled loop."""
    return loop.extent(sampled=True)


def _plus_noise(v: Vector, noise: Vector | None, bias: Vector | None) -> Vector:
    return plus(*[each for each in (v, noise, bias) if each is not None])


def _seen(ops: Arithmetic, loop: Loop, X: Any, noise: Vector | None) -> Any:
    """y, with its noise; directions of rotations are brought back to their length. None where nothing is seen, or by the error."""
    directions = loop.directions
    if not directions or not isinstance(loop.plant, GroupPlant) or (loop.by_error and noise is None):
        return None
    rows = seen_directions(ops, loop.plant.group, loop.plant.inverse(ops, X), directions)
    if noise is None:
        return rows
    found, place = [], 0
    rotations = (
        all(orthogonal for _, orthogonal in RealMatrices(loop.plant.group).blocks) and not loop.plant.group.is_complex
    )
    for row, c in zip(rows, directions, strict=True):
        off = plus(row, noise[place : place + len(row)])
        place += len(row)
        if rotations and len(c) == loop.plant.group.degree:
            length = ops.constant(sp.sqrt(sum((entry**2 for entry in c), sp.S.Zero)))
            off = scaled(length / ops.sqrt(dot(off, off)), off)
        found.append(off)
    return found


def _normals(ops: Arithmetic, loop: Loop, numbers: Mapping[str, Any]) -> list[Vector]:
    """Gaussian vectors by Box and Muller, of the standard deviations among the numbers, one a kind of noise."""
    found, place = [], 0
    turn = ops.constant(2 * math.pi)
    for kind, size in zip(loop.noise, loop.noise_sizes, strict=True):
        row: Vector = []
        for pair in range(place, place + size, 2):
            length = ops.sqrt(-2 * ops.log(numbers["noise"][pair]))
            angle = turn * numbers["noise"][pair + 1]
            row += [length * ops.cos(angle), length * ops.sin(angle)]
        place += -(-size // 4) * 4
        found.append([sigma * x for sigma, x in zip(numbers[f"sigma_{kind}"], row[:size], strict=True)])
    return found


def _kernel(
    loop: Loop,
    name: str,
    extent: int,
    reference: tuple[Port, ...],
    body: Any,
    formula: str,
    noisy: bool = False,
) -> Kernel:
    numbers = loop.number_ports(noisy=noisy)

    def sampler(rng: random.Random) -> tuple[Any, ...]:
        state = loop.sample(rng, extent)
        return (
            state,
            rng.uniform(0, 1),
            rng.uniform(0.01, 0.05),
            *(loop.sampled_port(rng, port) for port in (*reference, *numbers)),
        )

    return Kernel(
        name=name,
        namespace=loop.plant.namespace,
        inputs=(
            Port("state", (extent,), description="configuration, velocity, states of the law (and the held command)"),
            Port("t", (), "s"),
            Port("h", (), "s"),
            *reference,
            *numbers,
        ),
        outputs=(Port("state_next", (extent,)),),
        body=body,
        formula=formula,
        source=_SOURCE,
        sampler=sampler,
    )
