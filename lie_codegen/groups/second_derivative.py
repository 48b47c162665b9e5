"""lc.gradient and lc.hessian: the first two derivatives of a scalar output, as kernels."""

from __future__ import annotations

from fractions import Fraction
from typing import Any

from lie_codegen.errors import InputError
from lie_codegen.groups.catalogue_load import GroupLike, as_group
from lie_codegen.groups.jacobian import jacobian
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernel.arithmetic import Arithmetic
from lie_codegen.kernel.definition import kernel_factory
from lie_codegen.kernel.kernel import Kernel, Port


def _read_group(value: GroupLike | None) -> MatrixGroup | None:
    return None if value is None else as_group(value, "hessian")


def gradient(
    kernel: Kernel,
    port: str,
    *,
    output: str | None = None,
    tangent: str = "right",
    group: GroupLike | None = None,
    name: str | None = None,
) -> Kernel:
    """The derivative (n,) of a scalar output by one input, as `jacobian` gives it: the same inputs -> d<output>_d<port>.

    Args:
        kernel, port, tangent, group, name: as in `jacobian`.
        output: the real scalar output, the first if not given.

    Raises:
        InputError: the output is no real scalar; otherwise as `jacobian`.
        ShapeError: as `jacobian`.
    """
    _require_scalar(kernel, output, "gradient")
    return jacobian(kernel, port, output=output, tangent=tangent, group=group, name=name)


@kernel_factory(group=_read_group)
def hessian(
    kernel: Kernel,
    port: str,
    *,
    output: str | None = None,
    tangent: str = "right",
    group: GroupLike | None = None,
    name: str | None = None,
) -> Kernel:
    """The second derivative (n, n) of a scalar output by one input: the same inputs -> d2<output>_d<port>2.

        right    H_ij = d^2/(de_i de_j) f(X exp(e_1 A_1 + ... + e_n A_n))    at e = 0,     left with the exponential before X

    Symmetric: half the sum of both orders of differentiation, which differ by the derivative along [A_i, A_j]. Newton's
    method takes the step -H^{-1} gradient in these coordinates. A vector input, and "entries", get the plain Hessian.

    Args:
        kernel, port, output, tangent, group: as `jacobian`.
        name: C identifier; <kernel>_<output>_hessian_<port>, with the tangent for a matrix, if None.

    Raises:
        InputError: the output is no real scalar; otherwise as `jacobian`.
        ShapeError: as `jacobian`.
    """
    target = _require_scalar(kernel, output, "hessian")
    slope = jacobian(kernel, port, output=target.name, tangent=tangent, group=group)
    curvature = jacobian(slope, port, tangent=tangent, group=group)
    source = next(each for each in kernel.inputs if each.name == port)
    size = curvature.outputs[0].shape[0]
    half = Fraction(1, 2)

    def body(ops: Arithmetic, *arguments: Any) -> tuple[Any, ...]:
        (rows,) = curvature.evaluate(ops, *arguments)
        mean = [[ops.constant(half) * (rows[i][j] + rows[j][i]) for j in range(i)] for i in range(size)]
        return ([[rows[i][i] if i == j else mean[max(i, j)][min(i, j)] for j in range(size)] for i in range(size)],)

    suffix = f"_{tangent}" if len(source.shape) == 2 else ""
    return Kernel(
        name=name or f"{kernel.name}_{target.name}_hessian_{port}{suffix}",
        namespace=kernel.namespace,
        inputs=kernel.inputs,
        outputs=(Port(f"d2{target.name}_d{port}2", (size, size), description="second derivative, symmetric"),),
        body=body,
        formula=f"second derivative of {target.name} by {port}; {kernel.formula}",
        source=kernel.source,
        sampler=kernel.sample,
    )


def _require_scalar(kernel: Any, output: str | None, where: str) -> Port:
    if not isinstance(kernel, Kernel):
        raise InputError(f"{where} takes a Kernel, got {type(kernel).__name__}; those of a group: lc.group_kernels")
    names = ", ".join(each.name for each in kernel.outputs)
    if output is None and len(kernel.outputs) > 1:
        raise InputError(f"kernel {kernel.symbol} has several outputs; give output=, one of {names}")
    found = next((each for each in kernel.outputs if output in (None, each.name)), None)
    if found is None:
        raise InputError(f"kernel {kernel.symbol} has no output {output!r}; there are {names}")
    if found.shape or found.is_complex:
        raise InputError(
            f"{where}: {found.name} of {kernel.symbol} is no real scalar, its shape is {found.shape}; take lc.jacobian"
        )
    return found
