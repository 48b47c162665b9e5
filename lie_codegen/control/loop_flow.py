"""A continuous loop as a vector field in the entries of its state, with its derivative along directions of the tangent space.

    X' = X hat(xi),  xi' and the law's own states as the law says;   tangent: X hat(eta), left-trivialised

For what needs the linearised flow over a long time, as Floquet multipliers; motions alone go by `loop_rate`.
"""

from __future__ import annotations

import random
from collections.abc import Sequence
from typing import Any

from lie_codegen.control.loop_model import Loop
from lie_codegen.control.loop_rate import columns, loop_rate, moves_of
from lie_codegen.groups.derivation import derivation_of
from lie_codegen.groups.maps.element_pattern import pack, packed_size, unpack
from lie_codegen.groups.maps.matrices import GroupMatrices
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.definition import kernel_factory
from lie_codegen.kernel.dual import DualArithmetic, tangent_of
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.linear import Vector, matmul


@kernel_factory()
def loop_flow(loop: Loop, reference: Any = None) -> tuple[Kernel, ...]:
    """rate (state, t, numbers), variational (state and its derivative along the tangent space by rows, ...), tangent (state).

    The derivative has one column for each left-trivialised direction at the start: Theta of each group element, then the
    velocities and the law's own vectors.
    """
    moves, numbers = moves_of(loop), loop.number_ports(noisy=False)
    packed, vectors = columns(loop)
    size, turns = len(packed) + len(vectors), sum(move.group.dim for move in moves)
    count, along = turns + len(vectors), loop_rate(loop, reference)

    def carried(ops: Arithmetic, state: Vector, speeds: Vector) -> Vector:
        """The rate of the state with those left-trivialised speeds."""
        result: Vector = [0] * size
        elements, place, first = [state[i] for i in packed], 0, 0
        for move in moves:
            group, width = move.group, packed_size(move.group)
            matrices = GroupMatrices(ops, derivation_of(group).real)
            X = matrices.read(unpack(group, elements[first : first + width]))
            rate = matmul(X, matrices.hat(speeds[place : place + group.dim]))
            for i, entry in zip(packed[first : first + width], pack(group, matrices.write(rate)), strict=True):
                result[i] = entry
            place, first = place + group.dim, first + width
        for i, entry in zip(vectors, speeds[turns:], strict=True):
            result[i] = entry
        return result

    def field(ops: Arithmetic, state: Vector, t: Scalar, rest: Sequence[Any]) -> Vector:
        # where the step begins Theta = 0, and the rate of Theta is the velocity itself
        y = [*([ops.constant(0)] * turns), *(state[i] for i in vectors)]
        return carried(ops, state, along.evaluate(ops, [state[i] for i in packed], y, t, *rest)[0])

    def rate(ops: Arithmetic, state: Vector, t: Scalar, *rest: Any) -> tuple[Any, ...]:
        return (field(ops, state, t, rest),)

    def variational(ops: Arithmetic, state: Vector, t: Scalar, *rest: Any) -> tuple[Any, ...]:
        y, moved = state[:size], []
        dual = DualArithmetic(ops)
        for j in range(count):
            column = [state[size + count * i + j] for i in range(size)]
            point = [dual.variable(value, {0: slope}) for value, slope in zip(y, column, strict=True)]
            moved.append([tangent_of(value, 0, dual.level) for value in field(dual, point, t, rest)])
        return ([*field(ops, y, t, rest), *(moved[j][i] for i in range(size) for j in range(count))],)

    def tangent(ops: Arithmetic, state: Vector) -> tuple[Any, ...]:
        units = [[ops.constant(int(i == j)) for i in range(count)] for j in range(count)]
        found = [carried(ops, state, unit) for unit in units]
        return ([[found[j][i] for j in range(count)] for i in range(size)],)

    def sample(rng: random.Random) -> tuple[Any, ...]:
        return loop.sample(rng, size), rng.uniform(0, 1), *(loop.sampled_port(rng, port) for port in numbers)

    def sample_columns(rng: random.Random) -> tuple[Any, ...]:
        state, *rest = sample(rng)
        return [*state, *(rng.uniform(-1, 1) for _ in range(size * count))], *rest

    state, whole, time = Port("state", (size,)), size + size * count, Port("t", (), "s")
    long = Port("state", (whole,), description="the state, then its derivative by rows")
    space, source = loop.plant.namespace, "Bullo and Murray, CIT-CDS 97-003, (10)"
    return (
        Kernel("rate", space, (state, time, *numbers), (Port("state_dot", (size,)),), rate, "X' = X hat(xi), xi'", source, sample),
        Kernel("variational", space, (long, time, *numbers), (Port("state_dot", (whole,)),), variational,
               "the same, and its derivative along the columns", source, sample_columns),
        Kernel("tangent", space, (state,), (Port("L", (size, count)),), tangent, "X hat(A_a), left-trivialised", source,
               lambda rng: sample(rng)[:1]),
    )  # fmt: skip
