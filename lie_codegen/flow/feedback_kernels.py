"""The compiled kernels of a feedback: its rate, the product X exp(Theta), its value."""

from __future__ import annotations

import random
from functools import lru_cache
from typing import Any

from lie_codegen.flow.feedback_law import Feedback, feedback_body
from lie_codegen.flow.product_rate import product_rate
from lie_codegen.flow.product_step import Move
from lie_codegen.groups.derivation import derivation_of
from lie_codegen.groups.maps.element_pattern import pack, packed_size, unpack
from lie_codegen.groups.maps.matrices import matrix_port, random_element
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.groups.wei_norman.body import rate as wei_norman_rate
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.definition import kernel_factory, plain
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.linear import Vector, scaled
from lie_codegen.kernel.plain_data import Definition, NoDefinitionError, made_from
from lie_codegen.runtime.build import build_kernels, defined_together
from lie_codegen.runtime.library import Library


@kernel_factory()
def feedback_rate(group: MatrixGroup, u: Any, reads: str, name: str = "feedback_rate") -> Kernel:
    """(X packed, y, t, eps) -> y': y = Theta, or (Theta, g) for a feedback of the coordinates g, g' = M(g) eps u(t, g)."""
    move, law = Move(group), feedback_body(group, u, reads)
    data, size = derivation_of(group).wei_norman, group.dim * (2 if reads == "g" else 1)

    def body(ops: Arithmetic, X: Vector, y: Vector, t: Scalar, eps: Scalar) -> tuple[Any, ...]:
        def rates(time: Scalar, elements: list[Any], g: Vector) -> tuple[list[Vector], Vector]:
            xi = scaled(eps, law(ops, time, elements[0], g or None))
            return [xi], list(wei_norman_rate(ops, data, g, xi)) if g else []

        return (product_rate(ops, [move], [unpack(group, X)], y, rates, t),)

    def sampler(rng: random.Random) -> tuple[Any, ...]:
        flat = pack(group, random_element(group, data, rng))
        return flat, [rng.uniform(-0.1, 0.1) for _ in range(size)], rng.uniform(0, 1), 0.1

    ports = (Port("X", (packed_size(group),)), Port("y", (size,)), Port("t", (), "s"), Port("eps", ()))
    formula = "X' = X hat(eps u), y = (Theta, g), X = X_0 exp(Theta)"
    return Kernel(name, group.name, ports, (Port("y_dot", (size,)),), body, formula, "TR 93-59, (16), (17)", sampler)


@kernel_factory()
def feedback_move(group: MatrixGroup, name: str = "feedback_move") -> Kernel:
    """(X packed, Theta) -> X exp(Theta), packed."""
    move, size = Move(group), packed_size(group)
    body = lambda ops, X, theta: (pack(group, move(ops, unpack(group, X), theta)),)  # noqa: E731
    ports = (Port("X", (size,)), Port("theta", (group.dim,)))
    return Kernel(name, group.name, ports, (Port("X_next", (size,)),), body, "X exp(Theta)")


@kernel_factory()
def feedback_value(group: MatrixGroup, u: Any, reads: str, name: str = "feedback_value") -> Kernel:
    """(t, X) -> u, or (t, g) -> u."""
    law = feedback_body(group, u, reads)

    def body(ops: Arithmetic, t: Scalar, where: Any) -> tuple[Any, ...]:
        return (law(ops, t, where, None) if reads == "X" else law(ops, t, None, list(where)),)

    place = matrix_port(group, "X") if reads == "X" else Port("g", (group.dim,))
    return Kernel(name, group.name, (Port("t", (), "s"), place), (Port("u", (group.dim,)),), body, "u")


def feedback_library(group: MatrixGroup, law: Feedback) -> Library:
    """The three kernels of a feedback of texts or a Kernel, compiled; built once a process where its definition says what it is."""
    try:
        return _known(group, plain(law.u), law.reads)
    except NoDefinitionError:
        return _library(group, law.u, law.reads)


@lru_cache(maxsize=32)
def _known(group: MatrixGroup, u: Definition | tuple[str, ...], reads: str) -> Library:
    return _library(group, made_from(u), reads)


def _library(group: MatrixGroup, u: Any, reads: str) -> Library:
    kernels = [feedback_rate(group, u, reads), feedback_move(group), feedback_value(group, u, reads)]
    return build_kernels(lambda: kernels, namespace=group.name, definition=defined_together(kernels))
