"""The same kernels in C: values, first and second derivatives against 66-digit arithmetic, and C against the interpreter.

A second-order kernel is the kernel's own body over dual numbers of dual numbers, so that the derivatives are generated C too.
"""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np
import pytest
from angle_grid import ANGLES, point, relative_error
from kernel_calls import call, kernel, load
from multiprecision import oracle, value_and_derivatives

import lie_codegen as lc
from lie_codegen.kernel.arithmetic import Arithmetic
from lie_codegen.kernel.complex_scalar import Complex
from lie_codegen.kernel.dual import DualArithmetic, tangent_of, value_of
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.runtime.compiler import find_compilers
from lie_codegen.runtime.library import Library

GROUPS = ("so3", "su2", "se3", "sl2")
pytestmark = pytest.mark.skipif(not find_compilers(), reason="no C compiler")


def second_order(kernel: Kernel) -> Kernel:
    """(x, u, v) -> (f, Df u, D^2 f (u, v)), all flat."""
    n = kernel.inputs[0].shape[0]
    size = kernel.outputs[0].size

    def body(ops: Arithmetic, x: Any, u: Any, v: Any) -> tuple[Any, ...]:
        inner = DualArithmetic(ops)
        outer = DualArithmetic(inner)
        place = [outer.variable(inner.variable(a, {0: b}), {0: c}) for a, b, c in zip(x, u, v, strict=True)]
        [rows] = kernel.evaluate(outer, place)
        entries = [entry for row in rows for entry in row]
        if kernel.outputs[0].is_complex:
            entries = [part for z in entries for part in (Complex.of(z).re, Complex.of(z).im)]
        values = [value_of(value_of(entry, 2)) for entry in entries]
        first = [tangent_of(value_of(entry, 2)) for entry in entries]
        second = [tangent_of(tangent_of(entry, 0, 2)) for entry in entries]
        return values, first, second

    outputs = tuple(Port(name, (size,)) for name in ("f", "f_u", "f_uv"))
    return Kernel(f"{kernel.name}_2", kernel.namespace, tuple(Port(c, (n,)) for c in "xuv"), outputs, body)


@cache
def second_order_library(name: str) -> Library:
    return lc.build([second_order(kernel(name, k)) for k in ("exp", "ljac", "ljac_inv")])


@pytest.mark.parametrize("kernel_name", ["exp", "ljac", "ljac_inv"])
@pytest.mark.parametrize("name", GROUPS)
def test_values_and_derivatives_in_C(name: str, kernel_name: str) -> None:
    library = second_order_library(name)
    assert library.compiled
    rng = np.random.default_rng(17)
    exact = oracle(load(name), kernel_name)
    for angle in ANGLES[:: 2 if name == "se3" else 1]:
        if name == "sl2" and "inv" in kernel_name and angle > 2.9:
            angle = 2.9
        x = point(name, angle, rng)
        u, v = rng.normal(size=(2, x.size))
        expected = value_and_derivatives(exact, x, u, v)
        for order, (a, b) in enumerate(zip(library[f"{kernel_name}_2"](x, u, v), expected, strict=True)):
            assert relative_error(a, b) < 1e-13, f"derivative {order} at angle {angle}"


@pytest.mark.parametrize("name", GROUPS)
def test_compiled_kernels_equal_the_interpreter(name: str) -> None:
    library = lc.build(load(name))
    rng = np.random.default_rng(23)
    for angle in ANGLES:
        x = point(name, angle, rng)
        X = call(name, "exp", x)
        np.testing.assert_allclose(library.exp(x), X, rtol=0, atol=2e-15 * np.max(np.abs(X)))
        # Near the angle pi the logarithm of sl2 multiplies a rounding by 1e3.
        tolerance = 1e-12 if name == "sl2" else 2e-15
        np.testing.assert_allclose(library.log(X), call(name, "log", X), rtol=0, atol=tolerance)
        np.testing.assert_allclose(library.Ad(X), call(name, "Ad", X), rtol=0, atol=2e-14 * np.max(np.abs(X)) ** 2)
        for jacobian in ("ljac", "rjac"):
            expected = call(name, jacobian, x)
            np.testing.assert_allclose(library[jacobian](x), expected, rtol=0, atol=2e-15 * np.max(np.abs(expected)))
    samples = np.array([point(name, angle, rng) for angle in ANGLES])
    batch = library.exp.batch(x=samples)
    np.testing.assert_allclose(batch, [library.exp(x) for x in samples], rtol=0, atol=1e-14 * np.max(np.abs(batch)))
