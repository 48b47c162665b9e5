"""The functions of a stage -> the C source of a nonlinear program whose intervals are all alike."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from lie_codegen.codegen.tape import tape_of_function
from lie_codegen.codegen.templates import render
from lie_codegen.codegen.views import KernelView, kernel_view
from lie_codegen.kernel.kernel import Kernel, Port

#: The calls behind each function that CasADi's solvers ask for; nlp_grad only for f and g at the solution, the multipliers of
#: the bounds and of the parameters are not asked for.
_CALLS: Mapping[str, str] = {
    "f": "if (res[{0}] != NULL) objective(arg[0], arg[1], res[{0}]);",
    "g": "if (res[{0}] != NULL) constraints(arg[0], arg[1], res[{0}]);",
    "grad_f_x": "if (res[{0}] != NULL) gradient_of_objective(arg[0], arg[1], res[{0}]);",
    "jac_g_x": "if (res[{0}] != NULL) slopes(arg[0], arg[1], NULL, res[{0}]);",
    "hess_gamma_x_x": "if (res[{0}] != NULL) curvature(arg[0], arg[1], arg[2], arg[3], res[0], res[{0}]);",
    "grad_gamma_p": "if (res[2] != NULL || res[3] != NULL) return 1;",
    "triu_hess_gamma_x_x": "if (res[{0}] != NULL) curvature(arg[0], arg[1], arg[2], arg[3], NULL, res[{0}]);",
}
#: What each solver calls them with.
_FUNCTIONS: Mapping[str, Mapping[str, tuple[tuple[str, ...], tuple[str, ...]]]] = {
    "fatrop": {
        "nlp": (("x", "p"), ("f", "g")),
        "nlp_grad": (("x", "p", "lam_f", "lam_g"), ("f", "g", "grad_gamma_x", "grad_gamma_p")),
        "nlp_f": (("x", "p"), ("f",)),
        "nlp_g": (("x", "p"), ("g",)),
        "nlp_grad_f": (("x", "p"), ("grad_f_x",)),
        "nlp_jac_g": (("x", "p"), ("g", "jac_g_x")),
        "nlp_hess_l": (("x", "p", "lam_f", "lam_g"), ("grad_gamma_x", "hess_gamma_x_x")),
    },
    "ipopt": {
        "nlp": (("x", "p"), ("f", "g")),
        "nlp_grad": (("x", "p", "lam_f", "lam_g"), ("f", "g", "grad_gamma_x", "grad_gamma_p")),
        "nlp_f": (("x", "p"), ("f",)),
        "nlp_g": (("x", "p"), ("g",)),
        "nlp_grad_f": (("x", "p"), ("f", "grad_f_x")),
        "nlp_jac_g": (("x", "p"), ("g", "jac_g_x")),
        "nlp_hess_l": (("x", "p", "lam_f", "lam_g"), ("triu_hess_gamma_x_x",)),
    },
}
_PATTERN_OF = {
    "x": "pattern_x",
    "p": "pattern_p",
    "f": "pattern_f",
    "g": "pattern_g",
    "grad_f_x": "pattern_x",
    "grad_gamma_x": "pattern_x",
    "grad_gamma_p": "pattern_p",
    "lam_f": "pattern_f",
    "lam_g": "pattern_g",
    "jac_g_x": "pattern_slopes",
    "hess_gamma_x_x": "pattern_curvature",
    "triu_hess_gamma_x_x": "pattern_curvature",
}


@dataclass(frozen=True)
class Condition:
    """What holds at the nodes of one kind.

    Attributes:
        name: prefix of its C functions.
        number: its place among the kinds.
        rows: how many conditions.
        columns: where each column of the Jacobian's nonzeros starts, and their number.
        row_indices: the rows of the nonzeros.
        curve_places: where its second derivatives go among those of its stage.
    """

    name: str
    number: int
    rows: int
    columns: tuple[int, ...]
    row_indices: tuple[int, ...]
    curve_places: tuple[int, ...]


@dataclass(frozen=True)
class Layout:
    """The shape of the program.

    Attributes:
        title: for the first comment.
        solver: "fatrop" or "ipopt".
        intervals, stage, width, parameters: numbers of intervals, of variables of a stage without and with r, of parameters.
        kind_of, goal_of: for each node its kind, and where its goal is among the parameters.
        columns, row_indices: nonzeros of the Jacobian of `next`.
        curve: (columns, rows) of the second derivatives of a stage with an interval.
        last_curve: the same of the last stage, which has none.
        kinds: the conditions.
    """

    title: str
    solver: str
    intervals: int
    stage: int
    width: int
    parameters: int
    kind_of: tuple[int, ...]
    goal_of: tuple[int, ...]
    columns: tuple[int, ...]
    row_indices: tuple[int, ...]
    curve: tuple[tuple[int, ...], tuple[int, ...]]
    last_curve: tuple[tuple[int, ...], tuple[int, ...]]
    kinds: tuple[Condition, ...]


@dataclass(frozen=True)
class FunctionView:
    """One function of CasADi's interface."""

    name: str
    inputs: tuple[tuple[str, str], ...]
    outputs: tuple[tuple[str, str], ...]
    calls: tuple[str, ...]


@dataclass(frozen=True)
class NlpView:
    """What the template sees."""

    title: str
    intervals: int
    stage: int
    width: int
    most_rows: int
    most_entries: int
    curve_entries: int
    last_curve_entries: int
    kind_of: tuple[int, ...]
    goal_of: tuple[int, ...]
    interval_columns: tuple[int, ...]
    kinds: tuple[Condition, ...]
    last: int
    kernels: tuple[KernelView, ...]
    patterns: Mapping[str, tuple[int, ...]]
    functions: tuple[FunctionView, ...]


def render_nlp(layout: Layout, functions: Sequence[Any]) -> str:
    """The C source.

    Args:
        layout: the shape.
        functions: CasADi SX functions with dense columns, named interval_cost, interval_steepness, interval_value,
            interval_slope, interval_curve, and <kind>_value, <kind>_slope, <kind>_curve of every kind with rows.
    """
    view = NlpView(
        title=layout.title,
        intervals=layout.intervals,
        stage=layout.stage,
        width=layout.width,
        most_rows=max(1, *(kind.rows for kind in layout.kinds)),
        most_entries=max(1, len(layout.row_indices), *(len(kind.row_indices) for kind in layout.kinds)),
        curve_entries=len(layout.curve[1]),
        last_curve_entries=len(layout.last_curve[1]),
        kind_of=layout.kind_of,
        goal_of=layout.goal_of,
        interval_columns=layout.columns,
        kinds=layout.kinds,
        last=layout.kind_of[-1],
        kernels=tuple(_kernel(function) for function in functions),
        patterns=_patterns(layout),
        functions=tuple(_function(name, *ports) for name, ports in _FUNCTIONS[layout.solver].items()),
    )
    return render("nlp_source.c.jinja", view=view)


def _kernel(function: Any) -> KernelView:
    inputs = tuple(Port(function.name_in(i), (function.numel_in(i),)) for i in range(function.n_in()))
    outputs = tuple(Port(function.name_out(i), (function.numel_out(i),)) for i in range(function.n_out()))
    kernel = Kernel(function.name(), "nlp", inputs, outputs, lambda ops: ())
    return kernel_view(kernel, tape_of_function(function))


def _function(name: str, inputs: Sequence[str], outputs: Sequence[str]) -> FunctionView:
    return FunctionView(
        name,
        tuple((each, _PATTERN_OF[each]) for each in inputs),
        tuple((each, _PATTERN_OF[each]) for each in outputs),
        tuple(_CALLS[each].format(place) for place, each in enumerate(outputs) if each in _CALLS),
    )


def _patterns(layout: Layout) -> dict[str, tuple[int, ...]]:
    """Sparsity patterns in CasADi's compressed form: (rows, columns, column starts, row indices), 1 for a dense column."""
    N, stage, width = layout.intervals, layout.stage, layout.width
    count = N * width + stage
    starts, rows, curve_starts, curve_rows = [0], [], [0], []
    row = before = 0
    for k in range(N + 1):
        kind = layout.kinds[layout.kind_of[k]]
        own = stage if k < N else 0
        for j in range(width if k < N else stage):
            if k > 0 and j < stage:
                rows.append(before + j)
            if k < N:
                rows += [row + i for i in layout.row_indices[layout.columns[j] : layout.columns[j + 1]]]
            columns, entries = layout.curve if k < N else layout.last_curve
            curve_rows += [k * width + i for i in entries[columns[j] : columns[j + 1]]]
            rows += [row + own + i for i in kind.row_indices[kind.columns[j] : kind.columns[j + 1]]]
            starts.append(len(rows))
            curve_starts.append(len(curve_rows))
        before = row
        row += own + kind.rows
    return {
        "pattern_x": (count, 1, 1),
        "pattern_p": (layout.parameters, 1, 1),
        "pattern_f": (1, 1, 1),
        "pattern_g": (row, 1, 1),
        "pattern_slopes": (row, count, *starts, *rows),
        "pattern_curvature": (count, count, *curve_starts, *curve_rows),
    }
