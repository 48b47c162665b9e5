"""A closed loop as data: plant, law, observer, and what disturbs them; the kernels of `loop_kernels` are made from it."""

from __future__ import annotations

import random
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

from lie_codegen.control.disturbance import ForceBody, disturbance_body
from lie_codegen.control.loop_ports import LoopLaw, LoopPort, read_law
from lie_codegen.control.plants import GroupPlant, Plant
from lie_codegen.errors import InputError
from lie_codegen.flow.product_step import Move
from lie_codegen.groups.maps.element_pattern import pack, packed_size, unpack
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.definition import record_factory
from lie_codegen.kernel.kernel import Kernel, Port, uniform_sample
from lie_codegen.kernel.linear import Vector, plus, scaled

#: What noise may be put on, in the order in which its numbers are drawn.
NOISE = ("X", "xi", "u", "y")
#: The number of a loop that is the standard deviation of each.
SIGMAS = {kind: f"sigma_{kind}" for kind in NOISE}


@dataclass(frozen=True)
class Own:
    """A state of the law or of the observer, in a step: its value as the kernel reads it."""

    name: str
    kind: str
    rate: str
    value: Any
    plant: Plant
    element: bool

    def flat(self) -> Vector:
        """Its entries in the state."""
        if self.element and isinstance(self.plant, GroupPlant):
            return list(pack(self.plant.group, self.value))
        if isinstance(self.value, list) and self.value and isinstance(self.value[0], list):
            return [x for row in self.value for x in row]
        return list(self.value) if isinstance(self.value, list | tuple) else [self.value]

    def moved(self, value: Any) -> Own:
        """Another value."""
        return replace(self, value=value)

    def advanced(self, ops: Arithmetic, move: Move | None, rate: Any, h: Scalar) -> Own:
        """The value a period later, its rate being held; a state that jumps takes the new value."""
        if self.kind == "held":
            return self.moved(rate)
        if self.kind == "group" and move is not None:
            return self.moved(move(ops, self.value, scaled(h, rate)))
        if not isinstance(self.value, list | tuple):
            return self.moved(self.value + h * rate)
        return self.moved(plus(self.value, scaled(h, rate)))


@dataclass(frozen=True)
class Loop:
    """See `loop_model`."""

    plant: Plant
    law: LoopLaw | None
    moving: bool
    limited: bool
    disturbance: Any
    external: ForceBody | None
    noise: tuple[str, ...]
    biased: bool
    observer: LoopLaw | None

    @property
    def by_error(self) -> bool:
        """Whether the law reads no reference, and is given X_d^-1 X in the place of X."""
        return self.moving and self.law is not None and not self.law.has("reference")

    @cached_property
    def steady(self) -> bool:
        """Whether nothing in it is known to read the time: no reference, no force but a constant one, no law with an input t."""
        timed = any(law.has("time") for law in (self.law, self.observer) if law is not None)
        return not (self.moving or timed or self.external is not None) and self.disturbance in (None, "input")

    @cached_property
    def own_ports(self) -> tuple[LoopPort, ...]:
        """States of the law, then of the observer."""
        return tuple(each for law in (self.law, self.observer) if law is not None for each in law.states)

    @property
    def observer_states(self) -> frozenset[str]:
        """Names of those of the observer."""
        return frozenset(each.name for each in self.observer.states) if self.observer is not None else frozenset()

    @cached_property
    def directions(self) -> tuple[tuple[Any, ...], ...]:
        """The c of what is seen, y = X^-1 c."""
        watching = self.observer if self.observer is not None else self.law
        return watching.directions if watching is not None else ()

    @cached_property
    def own_move(self) -> Move | None:
        """Of states on the group."""
        return self.plant.moves[0] if self.plant.moves else None

    def is_element(self, port: Port) -> bool:
        """Whether a state is an element of the group, kept by its varying entries."""
        return isinstance(self.plant, GroupPlant) and port.shape == (self.plant.group.degree,) * 2

    def own_size(self, port: Port) -> int:
        """Doubles of a state in the state of the loop."""
        element = self.is_element(port) and isinstance(self.plant, GroupPlant)
        return packed_size(self.plant.group) if element and isinstance(self.plant, GroupPlant) else port.size

    def extent(self, sampled: bool) -> int:
        """Doubles of the state."""
        place, speed, command = self.plant.sizes
        own = sum(self.own_size(each.port) for each in self.own_ports)
        return place + speed + (2 * own + command if sampled else own)

    def own(self, state: Sequence[Scalar]) -> list[Own]:
        """The own states in a state."""
        place, found = sum(self.plant.sizes[:2]), []
        for each in self.own_ports:
            size = self.own_size(each.port)
            flat = list(state[place : place + size])
            place += size
            element = self.is_element(each.port)
            value: Any = flat if each.port.shape else flat[0]
            if element and isinstance(self.plant, GroupPlant):
                value = unpack(self.plant.group, flat)
            elif len(each.port.shape) == 2:
                width = each.port.shape[1]
                value = [flat[i : i + width] for i in range(0, len(flat), width)]
            found.append(Own(each.name, each.kind, each.rate, value, self.plant, element))
        return found

    def replaced(self, own: Sequence[Own], elements: Sequence[Any], flat: Sequence[Scalar]) -> list[Own]:
        """The own states with those that a step moves taken from what it gives."""
        rest, place, found = list(elements), 0, []
        for each in own:
            if each.kind == "group":
                found.append(each.moved(rest.pop(0)))
            elif each.kind == "vector":
                size = len(each.value)
                found.append(each.moved(list(flat[place : place + size])))
                place += size
            else:
                found.append(each)
        return found

    def push(self, ops: Arithmetic, t: Scalar, X: Any, v: Vector, numbers: Mapping[str, Any]) -> Vector:
        """The disturbance and the further force, beside the command."""
        total: Vector = [0] * self.plant.sizes[2]
        if self.external is not None:
            total = plus(total, self.external(ops, t, X, v))
        if self.disturbance == "input":
            return plus(total, numbers["disturbance"])
        if self.disturbance is not None:
            total = plus(total, disturbance_body(self.plant, self.disturbance)(ops, t, X, v))
        return total

    def reference_ports(self, stages: int) -> tuple[Port, ...]:
        """X_d, xi_d, xi_d_dot: at one time, or at three in rows."""
        if not self.moving:
            return ()
        element, velocity = self.plant.ports
        if stages == 1:
            X_d = Port("X_d", element.shape, is_complex=element.is_complex, description="reference")
            return X_d, Port("xi_d", velocity.shape), Port("xi_d_dot", velocity.shape)
        size = element.shape[0] * element.shape[1] if len(element.shape) == 2 else element.shape[0]
        when = "at t, t + h/2, t + h"
        return (
            Port("X_d", (3, size), is_complex=element.is_complex, description=f"reference {when}, row by row"),
            Port("xi_d", (3, *velocity.shape), description=f"its velocity {when}"),
            Port("xi_d_dot", (3, *velocity.shape), description=f"the rate of that {when}"),
        )

    def stage(self, reference: Sequence[Any], row: int | None) -> dict[str, Any]:
        """The reference at one of three times, or at the only one (None)."""
        X_d, xi_d, rate = reference if row is None else (each[row] for each in reference)
        shape = self.plant.ports[0].shape
        if row is not None and len(shape) == 2:
            X_d = [list(X_d[shape[1] * i : shape[1] * (i + 1)]) for i in range(shape[0])]
        return {"X_d": X_d, "xi_d": xi_d, "xi_d_dot": rate}

    @cached_property
    def noise_sizes(self) -> tuple[int, ...]:
        """Components of each kind of noise."""
        n = self.plant.ports[1].shape[0]
        seen = sum(len(c) for c in self.directions)
        sizes = {"X": n, "xi": n, "u": self.plant.sizes[2], "y": seen}
        return tuple(sizes[kind] for kind in self.noise)

    @property
    def noise_width(self) -> int:
        """Uniform numbers a sample: whole blocks of four for each kind."""
        return sum(-(-size // 4) * 4 for size in self.noise_sizes)

    def number_ports(self, noisy: bool) -> tuple[Port, ...]:
        """All numbers that are inputs: of the body, the law, the observer; limits, a constant disturbance, noise."""
        ports = {port.name: port for port in self.plant.numbers}
        for law in (self.law, self.observer):
            ports |= {port.name: port for port in (law.numbers if law is not None else ()) if port.name not in ports}
        command = (self.plant.sizes[2],)
        if self.limited:
            ports["limits"] = Port("limits", command, description="largest magnitude of the command")
        if self.disturbance == "input":
            ports["disturbance"] = Port("disturbance", command, description="constant, beside the command")
        if noisy:
            for kind, size in zip(self.noise, self.noise_sizes, strict=True):
                ports[SIGMAS[kind]] = Port(SIGMAS[kind], (size,), description=f"standard deviation of {kind}")
            if self.biased:
                ports["bias"] = Port("bias", self.plant.ports[1].shape, description="of the measured velocity")
            if self.noise:
                ports["noise"] = Port("noise", (self.noise_width,), description="uniform in (0, 1)")
        return tuple(ports.values())

    def given(self, rest: Sequence[Any], moving: bool = True) -> tuple[Sequence[Any], dict[str, Any]]:
        """The reference and the numbers of a kernel's inputs behind state, t and h."""
        reference, numbers = (rest[:3], rest[3:]) if self.moving and moving else ((), rest)
        names = [port.name for port in self.number_ports(noisy=True)]
        return reference, dict(zip(names, numbers, strict=False))

    def sample(self, rng: random.Random, extent: int) -> list[float]:
        """Entries of an admissible state."""
        state = list(self.plant.sample(rng))
        for each in self.own(state + [0.5] * extent):
            value = list(self.plant.sample(rng))[: len(each.flat())] if each.element else each.flat()
            state += [float(x) for x in value]
        return [*state, *state[sum(self.plant.sizes[:2]) :], *([0.1] * extent)][:extent]

    def sampled_port(self, rng: random.Random, port: Port) -> Any:
        """An admissible value of a reference or a number."""
        if port.name == "X_d":
            X, _ = self.plant.unpacked(self.plant.sample(rng))
            if port.shape == self.plant.ports[0].shape:
                return X
            return [[x for row in X for x in row] if isinstance(X[0], list) else list(X) for _ in range(3)]
        if len(port.shape) == 2 and port.shape[0] == port.shape[1] and port.name not in ("xi_d", "xi_d_dot"):
            return [[float(i == j) for j in range(port.shape[1])] for i in range(port.shape[0])]
        value = uniform_sample(port, rng)
        if port.name in ("xi_d", "xi_d_dot"):
            return value
        return [0.5 + 0.4 * x for x in value] if port.shape else 1 + value / 2


@record_factory()
def loop_model(
    plant: Plant,
    law: Kernel | None = None,
    *,
    directions: Any = None,
    moving: bool = False,
    limited: bool = False,
    disturbance: Any = None,
    external: ForceBody | None = None,
    noise: Sequence[str] = (),
    biased: bool = False,
    observer: Kernel | None = None,
    seen: Any = None,
) -> Loop:
    """The loop of a plant under a law.

    Args:
        plant: what moves.
        law: the kernel of the law; None for none.
        directions: the c of its y = X^-1 c, where its definition does not say them.
        moving: whether there is a reference.
        limited: whether there are limits, then an input.
        disturbance: beside the command: formulas of (t, X, xi), a Kernel, or "input" for a constant one that is an input.
        external: the same as a Python function over any arithmetic.
        noise: on which of `NOISE` there is some; the standard deviations are inputs.
        biased: whether the measured velocity has a constant offset, then an input.
        observer: the kernel of the observer.
        seen: the c of what the observer sees.

    Raises:
        InputError: as `read_law`; an observer without a state X_hat, or two states of one name.
    """
    read, watching = read_law(law, directions=directions), read_law(observer, directions=seen, observer=True)
    if watching is not None and "X_hat" not in [each.name for each in watching.states]:
        raise InputError(
            f"closed_loop: the observer {watching.kernel.name} has no state X_hat beside an output X_hat_next"
        )
    names = [state.name for each in (read, watching) if each is not None for state in each.states]
    if len(set(names)) < len(names):
        raise InputError(f"closed_loop: law and observer have states of the same name: {', '.join(sorted(names))}")
    return Loop(plant, read, moving, limited, disturbance, external, tuple(noise), biased, watching)
