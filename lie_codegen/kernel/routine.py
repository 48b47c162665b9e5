"""Routine: a function with loops and branches that a kernel body may call, where a straight line cannot say it.

Jacobi sweeps, a Schur form or a search on a lattice end when their numbers say so; unrolled over `where` they would cost their worst case
always, and their derivative would be that of the sweeps. A routine is plain C with a twin in NumPy and its own derivative:

    C         text of a template, a static function `name(const double *in, double *out)`, before the kernels that call it
    floats    `evaluate`, without a compiler
    CasADi    a call inside the expression, differentiated by `tangent`
    duals     `tangent`
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

from lie_codegen.arrays import Array
from lie_codegen.errors import CodegenError
from lie_codegen.identifiers import check_identifier
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.kernel import Kernel

#: tangent(ops, inputs, outputs, input rates) -> output rates.
Tangent = Callable[[Arithmetic, Sequence[Scalar], Sequence[Scalar], Sequence[Scalar]], list[Scalar]]


@dataclass(frozen=True)
class Routine:
    """A function from doubles to doubles.

    Two routines of equal name and settings are equal: the settings say all that their helpers and their twin depend on.

    Attributes:
        name: C identifier, unique to its settings.
        inputs, outputs: numbers of doubles.
        template: the template of its C text.
        settings: what the template sees beside the name: (name, plain data) pairs.
        helpers: kernels that its C text calls, printed before it as static functions.
        evaluate: its twin.
        tangent: its derivative, in any arithmetic, from inputs and outputs.
        single: settings that are others in single precision; None: the routine computes in double whatever the package does.
        graph: it as a CasADi Function of one column to one column, where it has such a form: CasADi then runs it without Python and
            differentiates it to any order.
    """

    name: str
    inputs: int
    outputs: int
    template: str
    settings: tuple[tuple[str, Any], ...]
    helpers: tuple[Kernel, ...] = field(compare=False)
    evaluate: Callable[[Sequence[float]], Sequence[float] | Array] = field(compare=False)
    tangent: Tangent = field(compare=False)
    single: tuple[tuple[str, Any], ...] | None = None
    graph: Callable[[], Any] | None = field(default=None, compare=False)

    def __post_init__(self) -> None:
        check_identifier(self.name, "routine name")


def call_routine(ops: Any, routine: Routine, values: Sequence[Scalar], when: Any = None) -> list[Scalar]:
    """The routine's outputs; where the condition `when` does not hold it is not run and they are zeros.

    Raises:
        CodegenError: the arithmetic has no routines, as exact expressions have none.
    """
    method = getattr(ops, "call", None)
    if method is None:
        raise CodegenError(f"{routine.name} is a loop: it has no form in {type(ops).__name__}")
    result: list[Scalar] = method(routine, list(values), when)
    return result


class Where:
    """An arithmetic in which routines run only where a condition holds."""

    def __init__(self, ops: Any, condition: Any) -> None:
        self._ops = ops
        self._condition = condition

    def __getattr__(self, name: str) -> Any:
        return getattr(self._ops, name)

    def call(self, routine: Routine, values: Sequence[Scalar], when: Any = None) -> list[Scalar]:
        """The routine where both conditions hold."""
        both = self._condition if when is None else self._ops.where(self._condition, when, 0)
        return call_routine(self._ops, routine, values, both)
