"""A body on a manifold in a closed loop: steps in R^N, taken back onto c(q) = 0 after each."""

from __future__ import annotations

import random
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.control.space_plants import SpacePlant
from lie_codegen.errors import InputError
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.definition import record_factory
from lie_codegen.kernel.kernel import Port
from lie_codegen.kernel.linear import Vector, plus

#: How far X0 may be from the manifold, as elements of a group from theirs.
_NEAR = 1e-5


class Point(Protocol):
    """A place on a manifold, in one arithmetic."""

    def acceleration(self, v: Vector, force: Vector) -> Vector:
        """q'' under a force."""

    def tangent(self, x: Vector) -> Vector:
        """The part of x along the manifold."""

    def returned(self) -> Vector:
        """The place one Newton step nearer to c(q) = 0."""


class Space(Protocol):
    """A manifold, as a plant sees it."""

    @property
    def name(self) -> str:
        """C identifier."""

    @property
    def size(self) -> int:
        """N."""

    def at(self, ops: Arithmetic, q: Vector) -> Any:
        """Its place q, a `Point`."""

    def projected(self, q: Array) -> Array | None:
        """The point of it that is near q."""

    def along(self, q: Array, x: Array) -> Array:
        """The part of x that is tangent at q."""

    def places(self, count: int, rng: np.random.Generator) -> Array:
        """Points of it."""


@dataclass(frozen=True)
class ManifoldPlant(SpacePlant):
    """See the module; `space` is the manifold."""

    space: Any = None

    @property
    def ports(self) -> tuple[Port, Port]:
        return Port("q", (self.size,)), Port("q_dot", (self.size,))

    def landed(self, ops: Arithmetic, X: Any, v: Vector) -> tuple[Any, Vector]:
        """Back on the manifold, from which a step strays by h^5."""
        point: Point = self.space.at(ops, X)
        return point.returned(), point.tangent(v) if v else v

    def disturbed(self, ops: Arithmetic, X: Any, shift: Vector) -> Any:
        moved: Point = self.space.at(ops, plus(X, self.space.at(ops, X).tangent(shift)))
        return moved.returned()

    def starts(self, X0: ArrayLike | None, xi0: ArrayLike | None) -> tuple[Array, bool]:
        if X0 is None:
            raise InputError(f"closed_loop: give X0=, a point of the manifold {self.name}")
        states, many = super().starts(X0, xi0)
        for state in states:
            q = self.space.projected(state[: self.size])
            if q is None or np.max(np.abs(q - state[: self.size])) > _NEAR * max(1.0, float(np.max(np.abs(q)))):
                raise InputError(
                    f"closed_loop: X0 = {np.round(state[: self.size], 6).tolist()} is not on the manifold {self.name}"
                )
            v = self.space.along(q, state[self.size :])
            if np.max(np.abs(v - state[self.size :])) > _NEAR * max(1.0, float(np.max(np.abs(v)))):
                raise InputError(f"closed_loop: xi0 is not tangent to the manifold {self.name} at X0")
            state[: self.size], state[self.size :] = q, v
        return states, many

    def sample(self, rng: random.Random) -> list[float]:
        draw = np.random.default_rng(rng.randrange(2**31))
        q = self.space.places(1, draw)[0]
        return [*q.tolist(), *self.space.along(q, draw.normal(size=self.size)).tolist()]


@record_factory()
def manifold_plant(space: Any) -> ManifoldPlant:
    """The plant of a manifold of `lc.manifold`."""

    def acceleration(ops: Arithmetic, t: Scalar, q: Vector, v: Vector, command: Vector) -> Vector:
        point: Point = space.at(ops, q)
        return point.acceleration(v, command)

    return ManifoldPlant(space.name, space.size, space.size, 2, acceleration, False, space)
