"""u(t) from formulas in the closed grammar."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from lie_codegen.errors import InputError, ShapeError
from lie_codegen.exact.expression import FORMULA_FUNCTIONS, parse_expression
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernel.expressions import ExpressionEvaluator
from lie_codegen.kernel.numpy_arithmetic import NumpyArithmetic
from lie_codegen.on_demand import sympy as sp
from lie_codegen.signals.formula_tables import fourier_table
from lie_codegen.signals.parametric_input import ParametricInput
from lie_codegen.signals.periodic_input import PeriodicInput


def formula_input(
    group: MatrixGroup, texts: Sequence[str]
) -> PeriodicInput | ParametricInput | Callable[[Any], NDArray[np.float64]]:
    """u(t) -> (n,), vectorised, from one formula of t for each basis element.

    Where the formulas are sums and products of sines and cosines, what compiled loops evaluate themselves: a PeriodicInput
    if their rates are commensurate, else a ParametricInput without parameters.

    Raises:
        ShapeError: not one formula for each basis element.
        ExpressionError: a text outside the grammar, with the column.
    """
    if len(texts) != group.dim:
        raise ShapeError(
            f"{group.name}: {len(texts)} formulas given, one for each of {', '.join(group.labels)} is needed"
        )
    found = _series(texts) or _waves(texts)
    if found is not None:
        return found
    t = sp.Symbol("t", real=True)
    expressions = [parse_expression(text, {"t": t, "pi": sp.pi}, FORMULA_FUNCTIONS) for text in texts]

    def u(time: Any) -> NDArray[np.float64]:
        times = np.asarray(time, dtype=float)
        evaluate = ExpressionEvaluator(NumpyArithmetic(), {t: times})
        return np.stack([np.broadcast_to(evaluate(each), times.shape) for each in expressions], axis=-1).astype(float)

    return u


def _waves(texts: Sequence[str]) -> ParametricInput | None:
    """The formulas as sums of sines and cosines of any rates, None where they are none."""
    found = ParametricInput(tuple(texts), ())
    return None if found.waves is None else found


def _series(texts: Sequence[str]) -> PeriodicInput | None:
    """The formulas as a Fourier series, None where they are none."""
    try:
        found = PeriodicInput(tuple(texts))
    except InputError:
        return None
    return None if fourier_table(found.waveform, found.dim) is None else found
