"""A group and its controls -> the C source of the shooting solver."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from lie_codegen.codegen.opcodes import C99_FORMS, Target, c_literal
from lie_codegen.codegen.tape import Tape, tape_of
from lie_codegen.codegen.templates import render, template_folder
from lie_codegen.codegen.views import comment_lines, kernel_view
from lie_codegen.groups.maps.element_pattern import packed_size, varying_entries
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernel.kernel import Kernel
from lie_codegen.steering.shooting.bracket_lengths import bracket_lengths
from lie_codegen.steering.shooting.defaults import Defaults
from lie_codegen.steering.shooting.lie_poisson import shooting_kernels
from lie_codegen.steering.shooting.stack import LANES as VECTOR
from lie_codegen.steering.shooting.stack import workspace_bytes
from lie_codegen.steering.shooting.views import LaneKernel, SteeringView, Store

#: A vector of doubles, one start a lane.
LANES = Target("V", {op: C99_FORMS[op] for op in ("ADD", "SUB", "MUL", "DIV", "NEG", "INV", "TWICE", "SQ")}, c_literal)
#: The header that the source includes.
PROBLEM = "steering_problem.h"


def steering_view(group: MatrixGroup, controls: tuple[int, ...], depth: int) -> SteeringView:
    """The view of the solver of one group and its controls (positions); depth as `Controllability.depth`."""
    pairs, areas = loop_areas(group, controls)
    positions = varying_entries(group)
    steps = 16 if depth <= 1 else 32
    d, parts = group.degree, 2 if group.is_complex else 1
    return SteeringView(
        prefix=f"{group.name}_steer",
        title=group.name,
        labels=tuple(group.labels[i] for i in controls),
        dim=group.dim,
        degree=d,
        is_complex=group.is_complex,
        size=packed_size(group),
        full_size=d * d * parts,
        controls=controls,
        identity=tuple("1.0" if i == j and part == 0 else "0.0" for i, j in positions for part in range(parts)),
        varying=tuple(parts * (d * i + j) + part for i, j in positions for part in range(parts)),
        first=tuple(a for a, _ in pairs),
        second=tuple(b for _, b in pairs),
        areas=tuple(tuple(c_literal(float(value)) for value in row) for row in areas),
        cosines=tuple(c_literal(math.cos(math.pi * k / steps)) for k in range(2 * steps)),
        wave_size=c_literal(0.5 * depth if depth > 1 else 0.5),
        lengths=bracket_lengths(group, controls),
        depth=depth,
        seed_steps=steps,
        relaxations=40 if depth > 1 else 20,
        is_deep=depth > 1,
        quiet_rounds=1 if depth <= 1 else 0,
        kernels=tuple(_lane_kernel(kernel) for kernel in shooting_kernels(group, controls)),
        defaults=Defaults.of(group.dim, depth),
    )


def loop_areas(group: MatrixGroup, controls: Sequence[int]) -> tuple[tuple[tuple[int, int], ...], NDArray[np.float64]]:
    """Pairs of controls, and the (pairs, n) matrix from coordinates to the areas of their loops (least squares)."""
    pairs = tuple(combinations(range(len(controls)), 2))
    free = [k for k in range(group.dim) if k not in controls]
    areas = np.zeros((len(pairs), group.dim))
    if pairs and free:
        c = group.algebra.structure_constants
        columns = np.array([c[controls[a], controls[b]][free] for a, b in pairs]).T
        areas[:, free] = np.where(np.abs(inverse := np.linalg.pinv(columns)) > 1e-14, inverse, 0.0)
    return pairs, areas


def render_steering(view: SteeringView) -> dict[str, str]:
    """The header of the solver, what it solves, and its source, the same for every group: {file name: text}."""
    workspace = {"lanes": workspace_bytes(view, VECTOR), "one": workspace_bytes(view, 1)}
    return {
        f"{view.prefix}.h": render("steering_header.h.jinja", view=view, workspace=workspace),
        PROBLEM: render("steering_problem.h.jinja", view=view),
        f"{view.prefix}.c": (template_folder() / "steering_core.c").read_text(encoding="utf-8"),
    }


def _lane_kernel(kernel: Kernel) -> LaneKernel:
    tape = tape_of(kernel)
    view = kernel_view(kernel, tape, LANES)
    scalars = {port.parameter for port in view.inputs if port.by_value}
    return LaneKernel(
        name=kernel.name,
        formula=comment_lines(kernel.formula),
        inputs=tuple(port.parameter for port in view.inputs if port.parameter not in scalars),
        outputs=tuple(port.parameter for port in view.outputs),
        unused=view.unused,
        statements=view.statements,
        stores=tuple(
            Store(store.parameter, store.entry, store.value, literal)
            for store, literal in zip(view.stores, _literals(tape), strict=True)
        ),
    )


def _literals(tape: Tape) -> list[bool]:
    return [tape.statements[index].op == "CONST" for port in tape.outputs for index in port]
