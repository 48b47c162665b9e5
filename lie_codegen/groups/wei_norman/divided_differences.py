"""Divided differences of e^{x l} over exact nodes, real or complex, in any arithmetic: see `exact.newton_form`."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from lie_codegen.exact.newton_form import symmetric_sums
from lie_codegen.exact.numbers import Number
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.complex_scalar import Complex
from lie_codegen.kernel.structural_zeros import add, is_zero, product
from lie_codegen.on_demand import sympy as sp

#: Nodes this near to one another are one.
_EQUAL = 1e-20


class DividedDifferences:
    """f[l_i, ..., l_j] of f(l) = e^{x l}, each computed once."""

    def __init__(self, ops: Arithmetic, x: Scalar, nodes: Sequence[Number]) -> None:
        self.ops = ops
        self.x = x
        self.nodes = tuple(nodes)
        self._done: dict[tuple[int, int], Any] = {}

    def combined(self, weights: Sequence[Number]) -> Scalar:
        """The real part of sum_k weights_k f[l_0, ..., l_k]; what is exact and real is real."""
        total: Scalar = 0
        for k, weight in enumerate(weights):
            if weight == 0:
                continue
            re, im = (float(part) for part in sp.N(weight, 30).as_real_imag())
            value = self.difference(0, k)
            if isinstance(value, Complex):
                total = add(total, self._scaled(re, value.re))
                total = add(total, self._scaled(-im, value.im))
            else:
                total = add(total, self._scaled(re, value))
        return total

    def _scaled(self, weight: float, value: Scalar) -> Scalar:
        if weight == int(weight) and abs(weight) <= 1:
            return product(int(weight), value) if weight >= 0 else -value
        return self.ops.constant(weight) * value

    def difference(self, i: int, j: int) -> Any:
        """f[l_i, ..., l_j]; Complex unless all nodes of the run are real."""
        if (i, j) not in self._done:
            self._done[i, j] = self._compute(i, j)
        return self._done[i, j]

    def _compute(self, i: int, j: int) -> Any:
        ops, run = self.ops, self.nodes[i : j + 1]
        mean = sp.expand(sum(run, sp.S.Zero) / len(run))
        spread = max(float(abs(sp.N(node - mean, 30))) for node in run)
        near = self._series(run, mean)
        # Equal nodes may be written differently, as radicals are: thirty digits then leave some 1e-31. The series serves every |x| < 1/spread.
        if spread < _EQUAL:
            return near
        gap = complex(sp.N(sp.expand(run[-1] - run[0]), 30))
        far = _minus(self.difference(i + 1, j), self.difference(i, j - 1))
        if gap.imag:
            far = Complex.of(far) * Complex(*(ops.constant(part) for part in ((1 / gap).real, (1 / gap).imag)))
        else:
            far = (
                ops.constant(1 / gap.real) * far
                if not isinstance(far, Complex)
                else far * Complex(ops.constant(1 / gap.real), 0)
            )
        small = ops.less(self.x * self.x, ops.constant(spread**-2))
        if isinstance(near, Complex) or isinstance(far, Complex):
            near, far = Complex.of(near), Complex.of(far)
            return Complex(ops.where(small, near.re, far.re), ops.where(small, near.im, far.im))
        return ops.where(small, near, far)

    def _series(self, run: Sequence[Number], mean: Number) -> Any:
        """x^k e^{x mean} sum_j h_j x^j/(k + j)!, by Horner's rule; the sums are real where the run is its own conjugate."""
        ops, k = self.ops, len(run) - 1
        parts: list[Scalar] = []
        sums = symmetric_sums(run, mean)
        for side in range(2):
            coefficients = [(h.real, h.imag)[side] / math.factorial(k + j) for j, h in enumerate(sums)]
            while coefficients and coefficients[-1] == 0:
                coefficients.pop()
            value: Scalar = 0
            for coefficient in reversed(coefficients):
                value = product(value, self.x)
                value = value + ops.constant(coefficient) if not is_zero(value) else ops.constant(coefficient)
            parts.append(value)
        for _ in range(k):
            parts = [product(part, self.x) for part in parts]
        rate, frequency = sp.expand(mean).as_real_imag()
        growth = 1 if rate == 0 else ops.exp(ops.constant(rate) * self.x)
        parts = [product(part, growth) for part in parts]
        if frequency == 0:
            return parts[0] if is_zero(parts[1]) else Complex(*parts)
        angle = ops.constant(frequency) * self.x
        return Complex(*parts) * Complex(ops.cos(angle), ops.sin(angle))


def _minus(a: Any, b: Any) -> Any:
    if isinstance(a, Complex) or isinstance(b, Complex):
        return Complex.of(a) - Complex.of(b)
    return a - b
