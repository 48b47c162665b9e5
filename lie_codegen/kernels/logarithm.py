"""log(X) on its principal domain."""

from __future__ import annotations

from typing import Any

from lie_codegen.kernels.arithmetic import Arithmetic
from lie_codegen.kernels.dense_functions import logarithm
from lie_codegen.kernels.exponential_map import coordinates
from lie_codegen.kernels.group_derivation import GroupDerivation
from lie_codegen.kernels.linear import Vector


def log_coordinates(ops: Arithmetic, data: GroupDerivation, X: list[list[Any]]) -> Vector:
    """The x with exp(hat(x)) = X."""
    return coordinates(ops, data, logarithm(ops, X))
