"""A torque on a body as plain data, and its formula over any arithmetic."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

from numpy.typing import ArrayLike

from lie_codegen.exact.expression import time_symbol
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.expressions import ExpressionEvaluator
from lie_codegen.kernel.kernel import Kernel
from lie_codegen.kernel.saved import Saved
from lie_codegen.on_demand import sympy as sp
from lie_codegen.rigid_body.plates import Plates
from lie_codegen.rigid_body.rotation_formulas import cross

#: What formulas of a torque may read.
STATE = (*(f"X{i}{j}" for i in (1, 2, 3) for j in (1, 2, 3)), "w1", "w2", "w3", "t")
#: A direction as a function of time that is no formula.
Function = Callable[[float], ArrayLike]


@dataclass(frozen=True, eq=False, repr=False)
class Torque(Saved):
    """A torque in body axes.

    Attributes:
        kind: which of `lc.torque`.
        direction: three expressions in t, a function of t, or None.
        numbers: what else it is made of.
        plates: of solar pressure and drag.
    """

    kind: str
    direction: Any
    numbers: Mapping[str, Any] = field(default_factory=dict)
    plates: Plates | None = None

    @property
    def is_function(self) -> bool:
        """Whether the direction is a Python function of t, which C asks for at each step."""
        return callable(self.direction)

    @property
    def is_driven(self) -> bool:
        """Whether the torque depends on time."""
        kernel = self.numbers.get("kernel")
        if kernel is not None:
            return any(port.name == "t" for port in kernel.inputs)
        read = self.numbers["formulas"] if self.kind == "formula" else self.direction
        return self.is_function or any(symbol.name == "t" for each in read for symbol in each.free_symbols)

    @property
    def unit(self) -> bool:
        """Whether only the direction counts, the size being in the pressure."""
        return self.plates is not None

    def direction_at(self, ops: Arithmetic, t: Scalar) -> list[Scalar]:
        """The three components at time t, of unit length where only the direction counts."""
        evaluate = ExpressionEvaluator(ops, {time_symbol(): t})
        return self.scaled(ops, [evaluate(each) for each in self.direction])

    def scaled(self, ops: Arithmetic, d: Sequence[Scalar]) -> list[Scalar]:
        """Of unit length where only the direction counts."""
        if not self.unit:
            return list(d)
        size = ops.sqrt(d[0] * d[0] + d[1] * d[1] + d[2] * d[2])
        return [each / size for each in d]

    def smooth(
        self, ops: Arithmetic, J: Sequence[Sequence[Scalar]], X: Any, omega: Any, d: Sequence[Scalar], t: Scalar
    ) -> list[Scalar]:
        """N in body axes, but of plates, at body to inertial X; d is the direction (or the field), inertial."""
        if self.kind == "formula":
            return self._formula(ops, X, omega, t)
        b = [X[0][i] * d[0] + X[1][i] * d[1] + X[2][i] * d[2] for i in range(3)]
        if self.kind == "gravity_gradient":
            square = b[0] * b[0] + b[1] * b[1] + b[2] * b[2]
            # b is not of unit length here: 3 mu / r^5 r x J r
            scale = ops.constant(3 * self.numbers["mu"]) / (square * square * ops.sqrt(square))
            Jb = [sum(a * c for a, c in zip(row, b, strict=True)) for row in J]
            return [scale * each for each in cross(b, Jb)]
        if self.kind == "eddy_current":
            M = self.numbers["M"]
            induced = cross(omega, b)
            moment = [sum(ops.constant(M[i][j]) * induced[j] for j in range(3)) for i in range(3)]
            return cross(moment, b)
        return cross([ops.constant(m) for m in self.numbers["m"]], b)

    def _formula(self, ops: Arithmetic, X: Any, omega: Any, t: Scalar) -> list[Scalar]:
        kernel = self.numbers.get("kernel")
        if kernel is not None:
            known = {"X": [list(row) for row in X], "omega": list(omega), "t": t}
            inputs = [
                known[port.name] if port.name in known else _constants(ops, self.numbers["parameters"][port.name])
                for port in kernel.inputs
            ]
            return list(kernel.evaluate(ops, *inputs)[0])
        values = [*(X[i][j] for i in range(3) for j in range(3)), *omega, t]
        symbols = [sp.Symbol(name, real=True) for name in STATE]
        evaluate = ExpressionEvaluator(ops, dict(zip(symbols, values, strict=True)))
        return [evaluate(each) for each in self.numbers["formulas"]]

    @property
    def key(self) -> tuple[str, Kernel | None]:
        """What determines the kernels: a text, and the kernel of one's own, which its text would not tell from another."""
        own = None if self.plates is None else [getattr(self.plates, n).tolist() for n in Plates.__dataclass_fields__]
        numbers = {name: value for name, value in self.numbers.items() if name != "kernel"}
        direction = "function" if self.is_function else self.direction
        return f"{self.kind} {direction} {numbers} {own}", self.numbers.get("kernel")


def _constants(ops: Arithmetic, value: Any) -> Any:
    return [_constants(ops, each) for each in value] if isinstance(value, list) else ops.constant(value)
