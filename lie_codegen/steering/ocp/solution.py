"""What a derivative of a solution is taken from."""

from __future__ import annotations

from typing import Protocol

from lie_codegen.arrays import Array
from lie_codegen.steering.ocp.problem_data import ProblemData


class Solution(Protocol):
    """The plan's own data; see `OptimalPlan`."""

    @property
    def problem(self) -> ProblemData: ...

    @property
    def X(self) -> Array: ...

    @property
    def z(self) -> Array: ...

    @property
    def u(self) -> Array: ...

    @property
    def gain(self) -> Array: ...

    @property
    def value_hessian(self) -> Array: ...

    @property
    def multipliers(self) -> Array: ...

    @property
    def end_multipliers(self) -> Array: ...

    @property
    def penalty(self) -> float: ...

    @property
    def parameters(self) -> Array: ...
