"""The steering solver of a group as a C package of its own: {path: text}, the same bytes for the same group."""

from __future__ import annotations

import math
import random
from collections.abc import Sequence
from dataclasses import dataclass

from lie_codegen.algebra.controllability import require_controllable
from lie_codegen.codegen.opcodes import c_literal
from lie_codegen.codegen.templates import render
from lie_codegen.groups.derivation import derivation_of
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.groups.wei_norman.body import product_exp
from lie_codegen.kernel.arithmetic import FloatArithmetic
from lie_codegen.kernel.complex_scalar import Complex
from lie_codegen.kernel.kernel import Kernel
from lie_codegen.steering.shooting.lie_poisson import transport
from lie_codegen.steering.shooting.source import PROBLEM, render_steering, steering_view
from lie_codegen.steering.shooting.stack import LANES, stack_bytes, workspace_bytes
from lie_codegen.steering.shooting.views import SteeringView

_VECTORS = 8
_STEPS, _ROWS = 8, 8
_EXAMPLE = (0.1, 0.05, math.pi / 40)
_DURATION = 24.0


@dataclass(frozen=True)
class SteeringVector:
    """A target that one extremal reaches, and what that extremal costs: the solver may not need more.

    Attributes:
        mu0: its costate at t = 0.
        target: the target as doubles, row-major.
        cost: int |u|^2 dt.
    """

    mu0: tuple[float, ...]
    target: tuple[float, ...]
    cost: float


def render_steering_package(group: MatrixGroup, controls: Sequence[str | int], folder: str = "") -> dict[str, str]:
    """The package, its paths below `folder`.

    Raises:
        UncontrollableError: with the growth vector and the missing directions.
        InputError: an unknown or repeated control.
    """
    report = require_controllable(group.algebra, controls)
    view = steering_view(group, report.controls, report.depth)
    vectors = make_vectors(group, view)
    sources = render_steering(view)
    shown = [
        {
            "mu0": [c_literal(x) for x in vector.mu0],
            "target": [c_literal(x) for x in vector.target],
            "cost": c_literal(vector.cost),
        }
        for vector in vectors
    ]
    sizes = (("lanes", LANES), ("one", 1))
    stack = {name: stack_bytes(view, lanes) for name, lanes in sizes}
    stack |= {f"small_{name}": stack_bytes(view, lanes, in_workspace=True) for name, lanes in sizes}
    context = {
        "view": view,
        "vectors": shown,
        "example": _example(group),
        "duration": _DURATION,
        "stack": stack,
        "workspace": {name: workspace_bytes(view, lanes) for name, lanes in sizes},
    }
    tree = {
        f"include/{view.prefix}.h": sources[f"{view.prefix}.h"],
        f"src/{view.prefix}.c": sources[f"{view.prefix}.c"],
        f"src/{PROBLEM}": sources[PROBLEM],
        "CMakeLists.txt": render("steering_CMakeLists.txt.jinja", **context),
        "example.c": render("steering_example.c.jinja", **context),
        "test_vectors.csv": render("steering_vectors.csv.jinja", vectors=vectors),
        "README.md": render("steering_README.md.jinja", **context),
    }
    return {f"{folder}/{path}" if folder else path: text for path, text in tree.items()}


def make_vectors(group: MatrixGroup, view: SteeringView) -> tuple[SteeringVector, ...]:
    """Extremals of small costates, integrated to rounding; seeded by the name alone."""
    rng = random.Random(view.prefix)
    kernel = transport(group, view.controls)
    vectors = []
    for _ in range(_VECTORS):
        mu0 = tuple(rng.uniform(-1.5, 1.5) for _ in range(group.dim))
        packed = _endpoint(kernel, view, mu0)
        target = [0.0] * view.full_size
        for row in range(group.degree):
            target[(view.full_size // group.degree) * row + (2 if group.is_complex else 1) * row] = 1.0
        for place, value in zip(view.varying, packed, strict=True):
            target[place] = value
        vectors.append(SteeringVector(mu0, tuple(target), sum(mu0[i] ** 2 for i in view.controls)))
    return tuple(vectors)


def _endpoint(kernel: Kernel, view: SteeringView, mu0: Sequence[float]) -> list[float]:
    """X(1), packed, by the extrapolated midpoint rule of the C solver, in Python floats."""
    n, size = view.dim, len(view.identity)
    y = [*mu0, *map(float, view.identity)]

    def rate(state: list[float]) -> list[float]:
        u = [state[i] for i in view.controls]
        mu_rate, X_rate = kernel.evaluate(FloatArithmetic(), u, state[:n], state[n:])
        return [float(value) for value in (*mu_rate, *X_rate)]

    for _ in range(_STEPS):
        table: list[list[float]] = []
        for row in range(1, _ROWS + 1):
            step = 1.0 / _STEPS / (2 * row)
            before, here = y, [a + step * b for a, b in zip(y, rate(y), strict=True)]
            for _ in range(2 * row - 1):
                before, here = here, [a + 2 * step * b for a, b in zip(before, rate(here), strict=True)]
            table.append(here)
            for column in range(row - 2, -1, -1):
                factor = 1.0 / ((row / (column + 1)) ** 2 - 1.0)
                table[column] = [
                    fine + factor * (fine - coarse)
                    for fine, coarse in zip(table[column + 1], table[column], strict=True)
                ]
        y = table[0]
    return y[n : n + size]


def _example(group: MatrixGroup) -> list[str]:
    """Phi(0.1, 0.05, pi/40, 0.1, ...): on SO(3) the satellite manoeuvre of TR 93-59, section 5.2."""
    g = [_EXAMPLE[k % len(_EXAMPLE)] for k in range(group.dim)]
    matrix = product_exp(FloatArithmetic(), derivation_of(group).wei_norman, g)
    entries = [Complex.of(entry) for row in matrix for entry in row]
    numbers = [part for entry in entries for part in ((entry.re, entry.im) if group.is_complex else (entry.re,))]
    return [c_literal(float(value)) for value in numbers]
