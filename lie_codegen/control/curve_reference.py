"""References that are on no group: r(t) in R^n by formulas of t, with r' and r'' derived."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lie_codegen.control.reference_motion import formula_of_time
from lie_codegen.errors import InputError
from lie_codegen.exact.expression import time_symbol
from lie_codegen.identifiers import shown
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.definition import kernel_factory, record_factory
from lie_codegen.kernel.expressions import ExpressionEvaluator
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.saved import Saved
from lie_codegen.on_demand import sympy as sp

#: How far |r| may be from 1 for a reference on a sphere.
_UNIT = 1e-9


@dataclass(frozen=True, eq=False, repr=False)
class CurveReference(Saved):
    """r(t) in R^n.

    Attributes:
        r: (n) expressions of t.
        sphere: whether |r| = 1.
    """

    r: tuple[sp.Expr, ...]
    sphere: bool = False


@record_factory()
def curve_reference(formulas: Sequence[Any], sphere: bool = False) -> CurveReference:
    """A curve from texts or expressions of t.

    Raises:
        InputError: no formulas, a symbol other than t, or abs, whose velocity jumps.
        ExpressionError: a text outside the grammar, with the column.
    """
    if isinstance(formulas, str) or len(formulas) == 0:
        raise InputError(f"a reference is one formula of t a coordinate, got {shown(formulas)}")
    return CurveReference(tuple(formula_of_time(entry) for entry in formulas), bool(sphere))


@kernel_factory()
def curve_kernel(reference: CurveReference, name: str = "reference") -> Kernel:
    """t -> (r, r_dot, r_ddot)."""
    curves = [[sp.diff(entry, time_symbol(), order) if order else entry for entry in reference.r] for order in range(3)]

    def body(ops: Arithmetic, t: Scalar) -> tuple[Any, ...]:
        evaluate = ExpressionEvaluator(ops, {time_symbol(): t})
        return tuple([evaluate(entry) for entry in curve] for curve in curves)

    shape = (len(reference.r),)
    outputs = (Port("r", shape), Port("r_dot", shape, "1/s"), Port("r_ddot", shape, "1/s^2"))
    return Kernel(name, "curve", (Port("t", (), "s"),), outputs, body, "r and its derivatives", "exact derivatives")


def check_curve(reference: CurveReference, t0: float, t1: float, evaluate: Callable[[Any], Any]) -> None:
    """Refuses a curve that is not finite between t0 and t1, or off its sphere.

    Raises:
        InputError: naming the time.
    """
    times = np.linspace(t0, t1, 401)
    values = np.stack([np.asarray(each) for each in evaluate(times)])
    bad = ~np.all(np.isfinite(values), axis=(0, 2))
    if np.any(bad):
        raise InputError(f"the reference has no finite value at t = {times[np.argmax(bad)]:.9g}")
    if reference.sphere:
        length = np.linalg.norm(values[0], axis=1)
        worst = int(np.argmax(np.abs(length - 1)))
        if abs(length[worst] - 1) > _UNIT:
            raise InputError(
                f"the reference is a point of the unit sphere; at t = {times[worst]:.6g} its length is {length[worst]:.9g}"
            )
