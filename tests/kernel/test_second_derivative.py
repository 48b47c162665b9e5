"""lc.gradient and lc.hessian in compiled C against second differences of 50 digits along the group."""

from __future__ import annotations

from typing import Any

import mpmath as mp
import numpy as np
import pytest
from kernel_calls import kernel
from multiprecision_kernels import DIGITS, combined, matrices, multiprecision

import lie_codegen as lc
from lie_codegen.errors import InputError

STEP = mp.mpf(10) ** -12  # second differences: right to 1e-24, rounded at 1e-26


@pytest.mark.parametrize("tangent", ["right", "left"])
@pytest.mark.parametrize(("name", "error"), [("so3", "so3_right"), ("se3", "se3_2")])
def test_of_an_error_function(name: str, error: str, tangent: str) -> None:
    group, basis = lc.group(name), matrices(lc.group(name))
    n = group.dim
    gains = {"so3": {"K_p": (4, 5, 6), "K_d": 6}, "se3": {"K_1": 8, "K_2": 8, "K_d": 9}}[name]
    law = lc.tracking_law(name, inertia=tuple(range(1, n + 1)), error=error, gains=gains)
    made = lc.hessian(law, "X", output="W", tangent=tangent), lc.gradient(law, "X", output="W", tangent=tangent)
    lib = lc.build(list(made))
    place = [port.name for port in law.outputs].index("W")
    exp = lc.build(name).exp
    values: list[Any] = [np.array(exp(np.linspace(0.3, -0.4, n))), np.linspace(0.1, 0.3, n)]
    values += [np.array(exp(np.linspace(-0.1, 0.2, n))), np.linspace(0.2, -0.1, n), np.linspace(0.1, 0.1, n)]
    with mp.workdps(DIGITS):
        rows = [(value * mp.mpf(1)).tolist() for value in (each.astype(object) for each in values)]
        X = mp.matrix(rows[0])

        def W(e: list[Any]) -> Any:
            moved = mp.expm(combined(basis, e))
            at = (X * moved if tangent == "right" else moved * X).tolist()
            return law.evaluate(multiprecision(), at, *rows[1:])[place]

        def shift(*pairs: tuple[int, int]) -> Any:
            e = [mp.mpf(0)] * n
            for j, sign in pairs:
                e[j] += sign * STEP
            return W(e)

        H = np.zeros((n, n))
        for i in range(n):
            for j in range(i + 1):
                corners = (
                    shift((i, 1), (j, 1)) + shift((i, -1), (j, -1)) - shift((i, 1), (j, -1)) - shift((i, -1), (j, 1))
                )
                H[i, j] = H[j, i] = float(corners / (4 * STEP**2))
        slope = [float((shift((i, 1)) - shift((i, -1))) / (2 * STEP)) for i in range(n)]
    np.testing.assert_allclose(getattr(lib, made[0].name)(*values), H, rtol=0, atol=1e-12)
    np.testing.assert_allclose(getattr(lib, made[1].name)(*values), slope, rtol=0, atol=1e-12)


def test_of_a_formula_with_a_pickle() -> None:
    def body(ops: Any, x: Any) -> tuple[Any, ...]:
        return (ops.sin(x[0]) * x[1] * x[1],)

    f = lc.Kernel("f", "demo", (lc.Port("x", (2,)),), (lc.Port("y", ()),), body)
    a, b = 0.3, -1.2
    expected = [[-np.sin(a) * b * b, 2 * np.cos(a) * b], [2 * np.cos(a) * b, 2 * np.sin(a)]]
    lib = lc.build([lc.hessian(f, "x"), lc.gradient(f, "x", name="slope")])
    np.testing.assert_allclose(lib.f_y_hessian_x([a, b]), expected, rtol=0, atol=1e-15)
    np.testing.assert_allclose(lib.slope([a, b]), [np.cos(a) * b * b, 2 * np.sin(a) * b], rtol=0, atol=1e-15)


def test_what_is_refused() -> None:
    with pytest.raises(InputError, match="no real scalar"):
        lc.hessian(kernel("so3", "log"), "X")
    with pytest.raises(InputError, match="takes a Kernel"):
        lc.gradient("so3", "X")  # type: ignore[arg-type]
    law = lc.tracking_law("so3", inertia=(1, 2, 3), error="so3_right", gains={"K_p": 4, "K_d": 6})
    with pytest.raises(InputError, match="give output="):
        lc.hessian(law, "X")
    with pytest.raises(InputError, match="no output 'V'"):
        lc.hessian(law, "X", output="V")
