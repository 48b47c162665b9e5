"""Formulas as a list of steps in numbers: plain data that is kept in the cache and evaluated on arrays without SymPy."""

from __future__ import annotations

import operator
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.kernel.expressions import ExpressionEvaluator
from lie_codegen.kernel.numpy_arithmetic import NumpyArithmetic

#: What the arithmetics have by that name, beside + - * / and the sign.
_FUNCTIONS = (
    "sin", "cos", "tan", "exp", "log", "sqrt", "sinh", "cosh", "tanh", "acos", "asin", "atan", "atan2", "fabs",
)  # fmt: skip
_OPERATIONS: dict[str, Callable[..., Any]] = {
    **{name: getattr(operator, name) for name in ("add", "sub", "mul", "truediv", "neg")},
    **{name: getattr(NumpyArithmetic, name) for name in _FUNCTIONS},
}


@dataclass(frozen=True)
class FormulaProgram:
    """n formulas of some variables.

    Attributes:
        steps: ("number", (its value,)), or an operation and the places of its arguments: the variables have the first places,
            and every step the next one.
        results: (n,) the places of the formulas' values.
    """

    steps: tuple[tuple[str, tuple[Any, ...]], ...]
    results: tuple[int, ...]

    def __call__(self, *variables: ArrayLike) -> Array:
        """(...,) values of each variable -> (..., n)."""
        known: list[Any] = [np.asarray(value, dtype=float) for value in variables]
        shape = np.broadcast_shapes(*(value.shape for value in known))
        for name, arguments in self.steps:
            known.append(
                arguments[0] if name == "number" else _OPERATIONS[name](*(known[place] for place in arguments))
            )
        return np.stack([np.broadcast_to(known[place], shape) for place in self.results], axis=-1).astype(float)


def formula_program(expressions: Sequence[Any], variables: Sequence[Any]) -> FormulaProgram:
    """The steps of SymPy expressions in these symbols.

    Raises:
        ExpressionError: another symbol, or a function that generated code does not know.
    """
    recorder = _Recorder(len(variables))
    evaluate = ExpressionEvaluator(recorder, dict(zip(variables, recorder.variables, strict=True)))
    results = tuple(recorder.place(evaluate(each)) for each in expressions)
    return FormulaProgram(tuple(recorder.steps), results)


class _Recorder:
    """The arithmetic whose values are steps, each noted when it is asked for."""

    def __init__(self, count: int) -> None:
        self.variables = [_Step(self, place) for place in range(count)]
        self.steps: list[tuple[str, tuple[Any, ...]]] = []

    def __getattr__(self, name: str) -> Callable[..., _Step]:
        if name not in _FUNCTIONS:
            raise AttributeError(name)
        return partial(self.step, name)

    def constant(self, value: Any) -> float:
        return float(value)

    def step(self, name: str, *arguments: Any) -> _Step:
        places = tuple(map(self.place, arguments))
        return self._noted(name, places)

    def place(self, value: Any) -> int:
        """Where a value stands; a number becomes a step of its own."""
        return value.place if isinstance(value, _Step) else self._noted("number", (float(value),)).place

    def _noted(self, name: str, arguments: tuple[Any, ...]) -> _Step:
        self.steps.append((name, arguments))
        return _Step(self, len(self.variables) + len(self.steps) - 1)


@dataclass(frozen=True, eq=False)
class _Step:
    """A value that is known by its place."""

    recorder: _Recorder
    place: int

    def __add__(self, other: Any) -> _Step:
        return self.recorder.step("add", self, other)

    def __radd__(self, other: Any) -> _Step:
        return self.recorder.step("add", other, self)

    def __sub__(self, other: Any) -> _Step:
        return self.recorder.step("sub", self, other)

    def __rsub__(self, other: Any) -> _Step:
        return self.recorder.step("sub", other, self)

    def __mul__(self, other: Any) -> _Step:
        return self.recorder.step("mul", self, other)

    def __rmul__(self, other: Any) -> _Step:
        return self.recorder.step("mul", other, self)

    def __truediv__(self, other: Any) -> _Step:
        return self.recorder.step("truediv", self, other)

    def __rtruediv__(self, other: Any) -> _Step:
        return self.recorder.step("truediv", other, self)

    def __neg__(self) -> _Step:
        return self.recorder.step("neg", self)
