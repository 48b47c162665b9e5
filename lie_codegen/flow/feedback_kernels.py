"""The compiled kernels of a feedback: its rate, the product X exp(Theta) or X of the elements in short, its value."""

from __future__ import annotations

import random
from functools import lru_cache
from typing import Any

from lie_codegen.errors import InputError
from lie_codegen.flow.feedback_law import Feedback, feedback_body
from lie_codegen.flow.product_rate import Rates, product_rate, short_rate
from lie_codegen.flow.product_step import Move
from lie_codegen.flow.short_state import short_states
from lie_codegen.groups.derivation import derivation_of
from lie_codegen.groups.maps.element_pattern import pack, packed_size, unpack
from lie_codegen.groups.maps.matrices import matrix_port, random_element
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.groups.wei_norman.body import rate as wei_norman_rate
from lie_codegen.kernel.arithmetic import Arithmetic, FloatArithmetic, Scalar
from lie_codegen.kernel.definition import kernel_factory, plain
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.linear import Vector, scaled
from lie_codegen.kernel.plain_data import Definition, NoDefinitionError, made_from
from lie_codegen.runtime.build import build_kernels, defined_together
from lie_codegen.runtime.library import Library


@kernel_factory()
def feedback_rate(group: MatrixGroup, u: Any, reads: str, name: str = "feedback_rate") -> Kernel:
    """(X packed, y, t, eps) -> y': y = Theta, or (Theta, g) for a feedback of the coordinates g, g' = M(g) eps u(t, g).

    On groups of rotations and free entries (y, t, eps) -> y', with X itself in the place of Theta: `short_state`.
    """
    move, law, short = Move(group), feedback_body(group, u, reads), short_states([group])
    data = derivation_of(group).wei_norman
    size = (group.dim if short is None else short.size) + (group.dim if reads == "g" else 0)

    def of(ops: Arithmetic, eps: Scalar) -> Rates:
        def rates(time: Scalar, elements: list[Any], g: Vector) -> tuple[list[Vector], Vector]:
            xi = scaled(eps, law(ops, time, elements[0], g or None))
            return [xi], list(wei_norman_rate(ops, data, g, xi)) if g else []

        return rates

    def body(ops: Arithmetic, *given: Any) -> tuple[Any, ...]:
        *X, y, t, eps = given
        if short is not None:
            return (short_rate(ops, short, y, of(ops, eps), t),)
        return (product_rate(ops, [move], [unpack(group, X[0])], y, of(ops, eps), t),)

    def sampler(rng: random.Random) -> tuple[Any, ...]:
        X = random_element(group, data, rng)
        front = [] if short is None else short.lifted(FloatArithmetic(), [X])
        y = [*front, *(rng.uniform(-0.1, 0.1) for _ in range(size - len(front)))]
        return *([pack(group, X)] if short is None else []), y, rng.uniform(0, 1), 0.1

    ports: tuple[Port, ...] = (Port("y", (size,)), Port("t", (), "s"), Port("eps", ()))
    if short is None:
        ports = (Port("X", (packed_size(group),)), *ports)
    formula = "X' = X hat(eps u), y = (Theta, g), X = X_0 exp(Theta); or y = (X, g)"
    return Kernel(name, group.name, ports, (Port("y_dot", (size,)),), body, formula, "TR 93-59, (16), (17)", sampler)


@kernel_factory()
def feedback_move(group: MatrixGroup, name: str = "feedback_move") -> Kernel:
    """(X packed, Theta) -> X exp(Theta), packed; or (X in short) -> X packed."""
    move, size, short = Move(group), packed_size(group), short_states([group])
    if short is not None:
        kept = short
        express = lambda ops, y: (pack(group, kept.elements(y)[0]),)  # noqa: E731
        ports: tuple[Port, ...] = (Port("y", (short.size,)),)
        return Kernel(name, group.name, ports, (Port("X", (size,)),), express, "X(q)")
    body = lambda ops, X, theta: (pack(group, move(ops, unpack(group, X), theta)),)  # noqa: E731
    ports = (Port("X", (size,)), Port("theta", (group.dim,)))
    return Kernel(name, group.name, ports, (Port("X_next", (size,)),), body, "X exp(Theta)")


@kernel_factory()
def feedback_lift(group: MatrixGroup, name: str = "feedback_lift") -> Kernel:
    """(X packed) -> X in short.

    Raises:
        InputError: the group is of another kind.
    """
    short, size = short_states([group]), packed_size(group)
    if short is None:
        raise InputError(f"simulate({group.name}): its elements are not rotations with free entries beside")
    data = derivation_of(group).wei_norman
    body = lambda ops, X: (short.lifted(ops, [unpack(group, X)]),)  # noqa: E731
    sampler = lambda rng: (pack(group, random_element(group, data, rng)),)  # noqa: E731
    ports = (Port("X", (size,)),)
    return Kernel(name, group.name, ports, (Port("y", (short.size,)),), body, "q with X = X(q)", sampler=sampler)


@kernel_factory()
def feedback_value(group: MatrixGroup, u: Any, reads: str, name: str = "feedback_value") -> Kernel:
    """(t, X) -> u, or (t, g) -> u."""
    law = feedback_body(group, u, reads)

    def body(ops: Arithmetic, t: Scalar, where: Any) -> tuple[Any, ...]:
        return (law(ops, t, where, None) if reads == "X" else law(ops, t, None, list(where)),)

    place = matrix_port(group, "X") if reads == "X" else Port("g", (group.dim,))
    return Kernel(name, group.name, (Port("t", (), "s"), place), (Port("u", (group.dim,)),), body, "u")


def feedback_library(group: MatrixGroup, law: Feedback) -> Library:
    """The kernels of a feedback of texts or a Kernel, compiled; built once a process where its definition says what it is."""
    try:
        return _known(group, plain(law.u), law.reads)
    except NoDefinitionError:
        return _library(group, law.u, law.reads)


@lru_cache(maxsize=32)
def _known(group: MatrixGroup, u: Definition | tuple[str, ...], reads: str) -> Library:
    return _library(group, made_from(u), reads)


def _library(group: MatrixGroup, u: Any, reads: str) -> Library:
    kernels = [feedback_rate(group, u, reads), feedback_move(group), feedback_value(group, u, reads)]
    kernels += [feedback_lift(group)] if short_states([group]) is not None else []
    return build_kernels(lambda: kernels, namespace=group.name, definition=defined_together(kernels), fused=True)
