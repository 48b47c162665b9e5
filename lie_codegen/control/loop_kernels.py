"""The kernels of a closed loop: one continuous step; or, for a sampled law, the motion under a held command and the call of the law.

The state is the configuration and the velocity of the plant, then the law's own states; of a sampled loop also the own
states as the last call of the law used them, and the command that is held.
"""

from __future__ import annotations

import random
from collections.abc import Mapping
from typing import Any

from lie_codegen.control.loop_call import COMMAND, called, controlled, limited
from lie_codegen.control.loop_model import Loop, Own
from lie_codegen.flow.product_step import product_step
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.definition import kernel_factory
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.linear import Vector, plus

_SOURCE = "Munthe-Kaas, BIT 38 (1998) 92; Bullo and Murray, CIT-CDS 97-003, (10)"


@kernel_factory()
def loop_step(loop: Loop, name: str = "loop_step") -> Kernel:
    """(state, t, h, X_d, xi_d, xi_d_dot, numbers) -> state: one RKMK4 step of plant and law together.

    The reference stands at t, t + h/2 and t + h in three rows, X_d flat. States of the law that jump do so where the step begins.
    """
    plant, extent = loop.plant, loop.extent(sampled=False)

    def body(ops: Arithmetic, state: Vector, t: Scalar, h: Scalar, *rest: Any) -> tuple[Any, ...]:
        X, v = plant.unpacked(state)
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

        # The law is called once a stage: `pushed` leaves the rates of its own states here, and `rates` takes them up after it.
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
        X, v = loop.plant.unpacked(state)
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
        X, v = loop.plant.unpacked(state)
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


def moved(
    ops: Arithmetic, loop: Loop, state: Vector, t: Scalar, h: Scalar, numbers: Mapping[str, Any]
) -> tuple[Any, Vector]:
    """Configuration and velocity after a step under the held command."""
    plant = loop.plant
    X, v = plant.unpacked(state)
    command = list(state[-plant.sizes[2] :])

    def rates(stage: int, time: Scalar, elements: list[Any], w: Vector) -> tuple[list[Vector], Vector]:
        Y, eta = plant.joined(elements, w)
        return plant.rates(ops, time, Y, eta, plus(command, loop.push(ops, time, Y, eta, numbers)), numbers)

    elements, w = plant.parts(X, v)
    return plant.landed(ops, *plant.joined(*product_step(ops, plant.moves, elements, w, rates, t, h)))


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
