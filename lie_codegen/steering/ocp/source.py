"""A problem's data -> the C source of its solver: the model's functions around the one core."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from lie_codegen.codegen.opcodes import REALS, Target
from lie_codegen.codegen.tape import Tape, tape_of_function
from lie_codegen.codegen.templates import render, template_folder
from lie_codegen.codegen.views import KernelView, comment_lines, kernel_view
from lie_codegen.groups.maps.element_pattern import varying_entries
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.steering.ocp.model import ModelBuilder
from lie_codegen.steering.ocp.model_sizes import Model
from lie_codegen.steering.ocp.problem_data import QUADRATURES, ProblemData
from lie_codegen.steering.ocp.terms import name_of

CORE = "ocp_core.h"


@dataclass(frozen=True)
class SolverView:
    """What the templates see."""

    prefix: str
    group: str
    summary: tuple[str, ...]
    real: str
    is_complex: bool
    intervals: int
    step: str
    h: str
    dim: int
    q: int
    packed: int
    stored: int
    nx: int
    m: int
    full: int
    degree: int
    parameters: int
    path: int
    end_path: int
    end: int
    bytes: int
    second_order: bool
    plans: bool
    rk_a: tuple[str, ...]
    rk_b: tuple[str, ...]
    rk_inner: tuple[str, ...]
    rk_c: tuple[str, ...]
    node_c: tuple[str, ...]
    node_w: tuple[str, ...]
    lower: tuple[str, ...]
    upper: tuple[str, ...]
    packed_from: tuple[int, ...]
    needs_control: tuple[int, ...]
    durations: tuple[str, ...]
    kernels: tuple[KernelView, ...]


def solver_view(
    data: ProblemData, *, second_order: bool, plans: bool = True, real: str = "double"
) -> tuple[SolverView, Model]:
    """The view of a problem's solver, and its model.

    Args:
        data: the problem.
        second_order: with exact curvature, for planning; a loop needs none.
        plans: with `solve` beside `step`.
        real: "double" or "float".
    """
    target = REALS[real]
    model = ModelBuilder(data).build(second_order=second_order)
    sizes, group = model.sizes, data.group
    a, b, c = data.tableau
    nodes = QUADRATURES[data.quadrature]
    h = data.duration / data.intervals
    parts = 2 if group.is_complex else 1

    def literals(values: Any) -> tuple[str, ...]:
        return tuple(target.literal(float(value)) for value in values)

    view = SolverView(
        prefix=data.name,
        group=group.name,
        summary=tuple(line for text in summary(data) for line in comment_lines(text)),
        real=real,
        is_complex=group.is_complex,
        intervals=data.intervals,
        step=f"{h:.6g}",
        h=target.literal(h),
        dim=sizes.dim,
        q=sizes.q,
        packed=sizes.packed,
        stored=sizes.packed + sizes.q,
        nx=sizes.nx,
        m=sizes.m,
        full=group.degree**2 * parts,
        degree=group.degree,
        parameters=sizes.parameters,
        path=sizes.path,
        end_path=sizes.end_path,
        end=sizes.end_path + sizes.end,
        bytes=workspace_bytes(data, model, real),
        second_order=second_order,
        plans=plans,
        rk_a=literals(a),
        rk_b=literals(b),
        rk_inner=literals(data.inner_weights),
        rk_c=literals(c),
        node_c=literals(node for node, _ in nodes),
        node_w=literals(weight * h for _, weight in nodes),
        lower=literals(data.lower),
        upper=literals(data.upper),
        packed_from=tuple(
            parts * (group.degree * i + j) + part for i, j in varying_entries(group) for part in range(parts)
        ),
        needs_control=tuple(map(int, model.needs_control)) or (0,),
        durations=literals(data.free_duration or ()),
        kernels=tuple(_kernel(function, target) for function in model.functions),
    )
    return view, model


def summary(data: ProblemData) -> list[str]:
    """The problem in words, for comments and READMEs."""

    def listed(shapes: Any) -> str:
        return ", ".join(f"{name} {shape}" for name, shape in shapes) or "none"

    return [
        f"x = (X, z), z = {listed(data.states.shapes)}; controls {listed(data.inputs.shapes)}; "
        f"parameters {listed(data.parameters.shapes)}.",
        *[
            f"stage cost: {'|r|^2 / 2, r = ' if part.is_residual else ''}{name_of(part.term)}"
            for part in data.stage_cost
        ],
        *[
            f"terminal cost: {'|r|^2 / 2, r = ' if part.is_residual else ''}{name_of(part.term)}"
            for part in data.terminal_cost
        ],
        *[f"path: {name_of(each.term)} <= 0" for each in data.constraints],
        *[f"end: {name_of(each.term)} = 0" for each in data.terminal],
        f"quadrature {data.quadrature}, integrator {'one exponential, exact' if data.is_invariant else data.integrator}.",
    ]


def workspace_bytes(data: ProblemData, model: Model, real: str) -> int:
    """sizeof of the workspace, as the header lays it out."""
    s, N = model.sizes, data.intervals
    stored, nx, m = s.packed + s.q, s.nx, s.m
    numbers = 2 * ((N + 1) * stored + N * m) + N * m * nx + N * m + N * max(1, s.path)
    numbers += max(1, s.end_path + s.end) + nx * nx + nx + 5
    size = 8 if real == "double" else 4
    return -(-(numbers * size + 9 * 4) // size) * size


def render_solver(view: SolverView) -> dict[str, str]:
    """{file name: text}: header, model and core."""
    return {
        f"{view.prefix}.h": render("ocp_header.h.jinja", view=view),
        f"{view.prefix}.c": render("ocp_source.c.jinja", view=view),
        CORE: (template_folder() / CORE).read_text(encoding="utf-8"),
    }


def _kernel(function: Any, target: Target) -> KernelView:
    inputs = tuple(
        Port(function.name_in(i), () if function.name_in(i) == "t" else (function.numel_in(i),))
        for i in range(function.n_in())
    )
    outputs = tuple(Port(function.name_out(i), (function.numel_out(i),)) for i in range(function.n_out()))
    kernel = Kernel(function.name(), "ocp", inputs, outputs, lambda ops: ())
    return kernel_view(kernel, tape(function), target, in_parts=True)


def tape(function: Any) -> Tape:
    """The tape of one function."""
    return tape_of_function(function)


def operations(view: SolverView) -> dict[str, int]:
    """Statements of each function of the model."""
    return {
        kernel.name: len(kernel.statements) + sum(len(part.statements) for part in kernel.parts)
        for kernel in view.kernels
    }
