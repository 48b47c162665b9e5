"""u(t) from formulas in the closed grammar."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.errors import InputError, ShapeError
from lie_codegen.exact.budget import current_budget
from lie_codegen.exact.expression import FORMULA_FUNCTIONS, parse_expression, time_symbol
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernel.formula_program import FormulaProgram, formula_program
from lie_codegen.on_demand import sympy as sp
from lie_codegen.runtime.formula_input import FormulaInput
from lie_codegen.runtime.records import recalled
from lie_codegen.signals.parametric_input import ParametricInput
from lie_codegen.signals.periodic_input import PeriodicInput


@dataclass(frozen=True)
class TextInput:
    """Formulas of t, called with (...,) times: (..., n).

    Attributes:
        program: the steps that evaluate them.
        formula: what compiled loops evaluate themselves, where the formulas are sums and products of sines and cosines of any
            rates; else None.
    """

    program: FormulaProgram
    formula: FormulaInput | None

    def __call__(self, t: ArrayLike) -> Array:
        return self.program(t)

    def as_formula(self, start: float, end: float) -> FormulaInput | None:
        """The same at all times."""
        return self.formula


def formula_input(group: MatrixGroup, texts: Sequence[str]) -> TextInput:
    """u(t) -> (n,), vectorised, from one formula of t for each basis element.

    Raises:
        ShapeError: not one formula for each basis element.
        ExpressionError: a text outside the grammar, with the column.
    """
    if len(texts) != group.dim:
        raise ShapeError(
            f"{group.name}: {len(texts)} formulas given, one for each of {', '.join(group.labels)} is needed"
        )
    # texts that were read before are known by their record, and need no SymPy
    return recalled("formulas of time", [list(texts), repr(current_budget())], TextInput, lambda: _read(texts))


def _read(texts: Sequence[str]) -> TextInput:
    names = {"t": time_symbol(), "pi": sp.pi}
    expressions = [parse_expression(text, names, FORMULA_FUNCTIONS) for text in texts]
    return TextInput(formula_program(expressions, [time_symbol()]), _series(texts) or _waves(texts))


def _series(texts: Sequence[str]) -> FormulaInput | None:
    """The formulas as a Fourier series, None where they are none."""
    try:
        return PeriodicInput(tuple(texts)).as_formula(0, 1)
    except InputError:
        return None


def _waves(texts: Sequence[str]) -> FormulaInput | None:
    """The formulas as sums of sines and cosines of incommensurate rates, None where they are none."""
    return ParametricInput(tuple(texts), ()).as_formula(0, 1)
