"""What a law moves: a body or a velocity on a group, a point on a sphere, an arm in coordinates.

    group, order 2     X' = X hat(xi),  I xi' = ad*_xi I xi + f
    group, order 1     X' = X hat(u)
    sphere             q'' = F - |q'|^2 q  on |q| = 1;  order 1: q' = u - (q.u) q
    coordinates        M(q) q'' + C(q, q') q' + dV = F

A plant gives the loop its state, in the order configuration, velocity, and the rates of it under a command.
"""

from __future__ import annotations

import random
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.errors import InputError
from lie_codegen.exact.positive_matrix import positive_matrix
from lie_codegen.flow.product_step import Move
from lie_codegen.groups.catalogue_load import as_group
from lie_codegen.groups.derivation import derivation_of
from lie_codegen.groups.maps.element_pattern import pack, packed_size, unpack
from lie_codegen.groups.maps.matrices import GroupMatrices, matrix_port, random_element
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.identifiers import shown
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.definition import plain, record_factory
from lie_codegen.kernel.kernel import Port
from lie_codegen.kernel.linear import Matrix, Vector, constant_matrix, dot
from lie_codegen.kernel.parameter import INPUT, Parameter, parameter
from lie_codegen.kernel.plain_data import NoDefinitionError
from lie_codegen.mechanics.kernels import acceleration
from lie_codegen.mechanics.states import initial_states, split_states
from lie_codegen.runtime.records import find_record, store_record


class Plant(Protocol):
    """What a loop asks of a plant."""

    @property
    def namespace(self) -> str:
        """Prefix of the C symbols."""

    @property
    def order(self) -> int:
        """1: the command is a velocity; 2: a force."""

    @property
    def sizes(self) -> tuple[int, int, int]:
        """Doubles of the configuration, of the velocity, of the command."""

    @property
    def ports(self) -> tuple[Port, Port]:
        """The configuration and the velocity as a law reads them."""

    @property
    def moves(self) -> tuple[Move, ...]:
        """The groups among the parts of the configuration."""

    @property
    def numbers(self) -> tuple[Port, ...]:
        """Its numbers that are inputs."""

    def unpacked(self, flat: Sequence[Scalar]) -> tuple[Any, Vector]:
        """Configuration and velocity of the first entries of a state."""

    def closed(self, X: Any, v: Vector) -> Vector:
        """The entries again."""

    def parts(self, X: Any, v: Vector) -> tuple[list[Any], Vector]:
        """Elements of groups, and a vector, as `product_step` moves them."""

    def joined(self, elements: Sequence[Any], w: Vector) -> tuple[Any, Vector]:
        """Configuration and velocity of these."""

    def rates(
        self, ops: Arithmetic, t: Scalar, X: Any, v: Vector, command: Vector, numbers: Mapping[str, Any]
    ) -> tuple[list[Vector], Vector]:
        """Of the parts, under a command."""

    def landed(self, ops: Arithmetic, X: Any, v: Vector) -> tuple[Any, Vector]:
        """Brought back to where rounding and the step left it."""

    def disturbed(self, ops: Arithmetic, X: Any, shift: Vector) -> Any:
        """A measurement of X that is off by a small vector."""

    def starts(self, X0: ArrayLike | None, xi0: ArrayLike | None) -> tuple[Array, bool]:
        """(N, m) states, and whether several were given."""

    def split(self, states: Array) -> tuple[Array, Array]:
        """Configurations and velocities of (..., m) states."""

    def sample(self, rng: random.Random) -> list[float]:
        """Entries of an admissible state."""


@dataclass(frozen=True)
class GroupPlant:
    """A body (order 2) or a velocity (order 1) on a matrix group.

    Attributes:
        group: the group.
        order: 1 or 2.
        inertia: for order 2, plain data as in a definition, or "input".
    """

    group: MatrixGroup
    order: int
    inertia: Any = None

    @property
    def namespace(self) -> str:
        return self.group.name

    @cached_property
    def metric(self) -> Parameter | None:
        """The inertia, exact."""
        if self.order == 1:
            return None
        return parameter(_inertia_port(self.group.dim), self.inertia, read_inertia(self.group.dim))

    @cached_property
    def sizes(self) -> tuple[int, int, int]:
        n = self.group.dim
        return packed_size(self.group), n if self.order == 2 else 0, n

    @cached_property
    def ports(self) -> tuple[Port, Port]:
        return matrix_port(self.group, "X"), Port("xi", (self.group.dim,))

    @cached_property
    def moves(self) -> tuple[Move, ...]:
        return (Move(self.group),)

    @cached_property
    def numbers(self) -> tuple[Port, ...]:
        if self.inertia != INPUT:
            return ()
        port = _inertia_port(self.group.dim)
        return port, Port("inertia_inverse", port.shape)

    def unpacked(self, flat: Sequence[Scalar]) -> tuple[Any, Vector]:
        size, speed, _ = self.sizes
        return unpack(self.group, flat[:size]), list(flat[size : size + speed])

    def closed(self, X: Any, v: Vector) -> Vector:
        return [*pack(self.group, X), *v]

    def parts(self, X: Any, v: Vector) -> tuple[list[Any], Vector]:
        return [X], v

    def joined(self, elements: Sequence[Any], w: Vector) -> tuple[Any, Vector]:
        return elements[0], w

    def rates(
        self, ops: Arithmetic, t: Scalar, X: Any, v: Vector, command: Vector, numbers: Mapping[str, Any]
    ) -> tuple[list[Vector], Vector]:
        if self.order == 1:
            return [command], []
        return [v], acceleration(ops, self.group, *self.body(ops, numbers), v, command)

    def body(self, ops: Arithmetic, numbers: Mapping[str, Any]) -> tuple[Matrix, Matrix]:
        """I and its inverse."""
        if self.metric is None or self.metric.value is None:
            return numbers["inertia"], numbers["inertia_inverse"]
        return constant_matrix(ops, self.metric.value), constant_matrix(ops, self.metric.value.inv())

    def landed(self, ops: Arithmetic, X: Any, v: Vector) -> tuple[Any, Vector]:
        return X, v

    def disturbed(self, ops: Arithmetic, X: Any, shift: Vector) -> Any:
        return self.moves[0](ops, X, shift)

    def relative(self, ops: Arithmetic, X_d: Any, X: Any) -> tuple[Any, Matrix, Matrix]:
        """The error E = X_d^-1 X as a law reads it, and E and its inverse as real matrices."""
        matrices = GroupMatrices(ops, derivation_of(self.group).real)
        inverse = matrices.inverse(matrices.read(X_d))
        E = _product(inverse, matrices.read(X))
        return matrices.write(E), E, matrices.inverse(E)

    def inverse(self, ops: Arithmetic, X: Any) -> Matrix:
        """X^-1, a real matrix."""
        matrices = GroupMatrices(ops, derivation_of(self.group).real)
        return matrices.inverse(matrices.read(X))

    def starts(self, X0: ArrayLike | None, xi0: ArrayLike | None) -> tuple[Array, bool]:
        if self.order == 1 and xi0 is not None:
            raise InputError(
                "closed_loop: xi0 is given, but this law commands the velocity: the loop has none of its own"
            )
        states, many = initial_states(self.group, X0, xi0)
        return (states if self.order == 2 else np.ascontiguousarray(states[:, : self.sizes[0]])), many

    def split(self, states: Array) -> tuple[Array, Array]:
        X, xi = split_states(self.group, states[..., : sum(self.sizes[:2])])
        return X, xi

    def sample(self, rng: random.Random) -> list[float]:
        """Entries of a state."""
        flat = pack(self.group, random_element(self.group, derivation_of(self.group).wei_norman, rng))
        return [*flat, *(rng.uniform(-1, 1) for _ in range(self.sizes[1]))]


def _product(a: Matrix, b: Matrix) -> Matrix:
    return [[dot(row, column) for column in zip(*b, strict=True)] for row in a]


def read_inertia(size: int) -> Any:
    """(value, name) -> an exact symmetric positive definite matrix."""
    return lambda value, name: positive_matrix(value, size, name)


@record_factory(group=as_group)
def group_plant(group: Any, inertia: Any = None, order: int = 2) -> GroupPlant:
    """A body of this inertia (a number, a diagonal, a matrix, or "input"), or for order 1 a velocity that is commanded.

    Raises:
        InputError: the inertia is missing or not symmetric positive definite.
    """
    if order == 1:
        return GroupPlant(group, 1)
    if inertia is None:
        raise InputError(f"closed_loop: the law commands a force: give inertia= of the body on {group.name}")
    try:
        given = plain(inertia)
    except NoDefinitionError:
        raise InputError(f"closed_loop: inertia is {shown(inertia)}; give numbers") from None
    # One that was found symmetric and positive definite before, in this process or another, is so.
    source = [group.dim, given]
    if given != INPUT and find_record("inertia", source) is None:
        parameter(_inertia_port(group.dim), inertia, read_inertia(group.dim))
        store_record("inertia", source, True)
    return GroupPlant(group, 2, given)


def _inertia_port(n: int) -> Port:
    return Port("inertia", (n, n), description="of the body, symmetric")
