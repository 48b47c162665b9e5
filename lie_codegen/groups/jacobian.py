"""lc.jacobian: the exact derivative of a kernel, as a kernel.

CasADi's own derivative of a `Routine` (a logarithm by a loop) cannot be printed as C. Here the body runs in dual numbers, one
tangent a column, and what comes out is an ordinary body: it builds, batches, generates C and may be differentiated again.

    right      column j:  d/de f(X exp(e A_j))  at e = 0
    left       column j:  d/de f(exp(e A_j) X)
    entries    column j:  the entry j of the port, row by row; a complex entry counts as (re, im)
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from lie_codegen.errors import InputError
from lie_codegen.groups.catalogue_load import GroupLike, as_group
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.groups.port_tangents import acting_group, derivative_rows, entry_rates, group_rates, moving
from lie_codegen.kernel.arithmetic import Arithmetic
from lie_codegen.kernel.definition import kernel_factory
from lie_codegen.kernel.dual import DualArithmetic
from lie_codegen.kernel.kernel import Kernel, Port

_TANGENTS = ("right", "left", "entries")


def _read_group(value: GroupLike | None) -> MatrixGroup | None:
    return None if value is None else as_group(value, "jacobian")


@kernel_factory(group=_read_group)
def jacobian(
    kernel: Kernel,
    port: str,
    *,
    output: str | None = None,
    tangent: str = "right",
    group: GroupLike | None = None,
    name: str | None = None,
) -> Kernel:
    """The derivative of one output of a kernel by one of its inputs: the same inputs -> d<output>_d<port>.

        right    D f(X) e_j = d/de f(X exp(e A_j)),   left    D f(X) e_j = d/de f(exp(e A_j) X)    at e = 0

    Exact (dual numbers, no differences), a Kernel like any other; NaN where the output is. A row for each entry of the output,
    row by row, a column for each direction; the gradient (n,) of a scalar output; complex entries where the output has them.
    The derivative of a gradient is the Hessian.

    Args:
        kernel: any kernel.
        port: the input. A vector or scalar one gets its plain Jacobian, whatever `tangent`.
        output: the output; None if there is only one.
        tangent: for a matrix input: "right" or "left", n columns, where it is an element of the group; "entries", a column for each
            entry of any matrix, (re, im) for a complex one.
        group: of that input; None for the group that the kernel was made for, by its definition or its namespace.
        name: C identifier; <kernel>_<output>_by_<port>, with _right, _left or _entries for a matrix, if None.

    Raises:
        InputError: no such port or tangent; no group is known; the matrix is no element of it, as an inertia.
        ShapeError: the matrices of the group have another size.
    """
    if not isinstance(kernel, Kernel):
        raise InputError(f"jacobian takes a Kernel, got {type(kernel).__name__}; those of a group: lc.group_kernels")
    if tangent not in _TANGENTS:
        raise InputError(f"tangent {tangent!r} is not known; choose one of {', '.join(_TANGENTS)}")
    place = _place(kernel, kernel.inputs, port, "input")
    if output is None and len(kernel.outputs) > 1:
        names = ", ".join(each.name for each in kernel.outputs)
        raise InputError(f"kernel {kernel.symbol} has several outputs; give output=, one of {names}")
    result = _place(kernel, kernel.outputs, output or kernel.outputs[0].name, "output")
    source, target = kernel.inputs[place], kernel.outputs[result]
    is_element = len(source.shape) == 2 and tangent != "entries"
    acting = acting_group(kernel, place, group, tangent) if is_element else None
    columns = acting.dim if acting else source.size

    def body(ops: Arithmetic, *arguments: Any) -> tuple[Any, ...]:
        dual = DualArithmetic(ops)
        value = arguments[place]
        rates = group_rates(ops, acting, value, tangent) if acting else entry_rates(source, value)
        moved = moving(dual, source, value, rates)
        found = kernel.evaluate(dual, *arguments[:place], moved, *arguments[place + 1 :])[result]
        rows = derivative_rows(ops, dual, target, found, columns)
        return (rows if target.shape else rows[0],)

    shape = (math.prod(target.shape), columns) if target.shape else (columns,)
    suffix = f"_{tangent}" if len(source.shape) == 2 else ""
    direction = {"right": "X exp(e A_j)", "left": "exp(e A_j) X"}[tangent] if acting else "each entry"
    return Kernel(
        name=name or f"{kernel.name}_{target.name}_by_{port}{suffix}",
        namespace=kernel.namespace,
        inputs=kernel.inputs,
        outputs=(Port(f"d{target.name}_d{port}", shape, is_complex=target.is_complex, description="derivative"),),
        body=body,
        formula=f"derivative of {target.name} by {port} along {direction}; {kernel.formula}",
        source=kernel.source,
        sampler=kernel.sample,
    )


def _place(kernel: Kernel, ports: Sequence[Port], name: str, what: str) -> int:
    names = [port.name for port in ports]
    if name not in names:
        raise InputError(f"kernel {kernel.symbol} has no {what} {name!r}; there are {', '.join(names)}")
    return names.index(name)
