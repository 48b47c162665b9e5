"""One call of a law within a loop: what it is given, with noise, what it gives, within the limits, and its own states one period on."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

from lie_codegen.control.loop_model import SIGMAS, Loop, Own
from lie_codegen.control.loop_ports import seen_directions
from lie_codegen.control.plants import GroupPlant
from lie_codegen.groups.derivation import derivation_of
from lie_codegen.groups.maps.matrices import GroupMatrices
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.linear import Vector, dot, plus, scaled
from lie_codegen.kernel.saturation import saturated
from lie_codegen.on_demand import sympy as sp

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
    *,
    within: bool = False,
) -> dict[str, Any]:
    """What the law gives; X_d, xi_d and xi_d_dot are in `now` where there is a reference, `seen` is y where it was measured.

    With `within` all elements are known to be of the group, and the law is spared a look at each.
    """
    law, plant = loop.law, loop.plant
    if law is None:
        return {}
    given = {**numbers, **{each.name: each.value for each in own}, **now, "velocity": v}
    E_inverse, offset = None, None
    given["configuration"] = X
    if loop.by_error and isinstance(plant, GroupPlant):
        # Ad_{E^-1} xi_d: with it and u = law(E), E' = E hat(law(E)), whatever the reference does.
        given["configuration"], E, E_inverse = plant.relative(ops, now["X_d"], X)
        matrices = GroupMatrices(ops, derivation_of(plant.group).real)
        offset = matrices.Ad(E_inverse, E, now["xi_d"])
    if law.directions and isinstance(plant, GroupPlant):
        if seen is None:
            inverse = plant.inverse(ops, X) if E_inverse is None else E_inverse
            seen = seen_directions(ops, plant.group, inverse, law.directions)
        y = next(each.port for each in law.ports if each.kind == "direction")
        given["direction"] = seen if len(y.shape) == 2 else seen[0]
    values = law.values(ops, given, within=within)
    command = values[law.command.name]
    return {**values, COMMAND: command if offset is None else plus(command, offset)}


def limited(ops: Arithmetic, loop: Loop, command: Vector, numbers: Mapping[str, Any]) -> Vector:
    """min(max(u, -limit), limit), component by component."""
    return saturated(ops, command, numbers["limits"] if loop.limited else None)


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
    seen = seen_outputs(ops, loop, measured, normals.get("y"))
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


def seen_outputs(ops: Arithmetic, loop: Loop, X: Any, noise: Vector | None) -> Any:
    """y, with its noise; directions of rotations are brought back to their length. None where nothing is seen, or by the error."""
    directions = loop.directions
    if not directions or not isinstance(loop.plant, GroupPlant) or (loop.by_error and noise is None):
        return None
    rows = seen_directions(ops, loop.plant.group, loop.plant.inverse(ops, X), directions)
    if noise is None:
        return rows
    found, place = [], 0
    rotations = (
        all(orthogonal for _, orthogonal in derivation_of(loop.plant.group).real.blocks)
        and not loop.plant.group.is_complex
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
        found.append([sigma * x for sigma, x in zip(numbers[SIGMAS[kind]], row[:size], strict=True)])
    return found
