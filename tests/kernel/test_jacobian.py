"""lc.jacobian in compiled C against differences of 50 digits (mpmath), and lc.casadi_function in a problem of the user's own."""

from __future__ import annotations

import pickle
from collections.abc import Callable
from typing import Any

import casadi as ca
import mpmath as mp
import numpy as np
import pytest
from kernel_calls import kernel
from multiprecision_kernels import DIGITS, combined, components, matrices, multiprecision, slopes

import lie_codegen as lc
from lie_codegen.errors import InputError, ShapeError


def start(n: int) -> np.ndarray:
    return np.linspace(-0.4, 0.5, n)


@pytest.mark.parametrize("name", ["so3", "se3", "su2"])
def test_exp(name: str) -> None:
    group, basis, x = lc.group(name), matrices(lc.group(name)), start(lc.group(name).dim)
    lib = lc.build(lc.jacobian(kernel(name, "exp"), "x", output="X", tangent="right"))
    with mp.workdps(DIGITS):
        expected = slopes(
            lambda e: list(mp.expm(combined(basis, [a + b for a, b in zip(map(mp.mpf, x), e, strict=True)]))), group.dim
        )
    assert np.allclose(lib.exp_X_by_x(x), expected, rtol=0, atol=1e-12)


@pytest.mark.parametrize(("name", "tangent"), [
    ("so3", "right"), ("so3", "left"), ("se3", "right"), ("se3", "left"), ("su2", "right"), ("su2", "left"), ("so5", "right"),
])  # fmt: skip
def test_log(name: str, tangent: str) -> None:
    group, basis, x = lc.group(name), matrices(lc.group(name)), start(lc.group(name).dim)
    made = lc.jacobian(kernel(name, "log"), "X", output="x", tangent=tangent)
    lib = lc.build(made)
    with mp.workdps(DIGITS):
        X = mp.expm(combined(basis, x))

        def log(e: Any) -> Any:
            moved = mp.expm(combined(basis, e))
            return components(basis, mp.logm(X * moved if tangent == "right" else moved * X))

        expected = slopes(log, group.dim)
        element = np.array(X.tolist(), dtype=complex)
    found = getattr(lib, made.name)(element if group.is_complex else element.real)
    assert np.allclose(found, expected, rtol=0, atol=1e-12)


@pytest.mark.parametrize("name", ["so3", "se3", "su2"])
def test_wei_norman_rate(name: str) -> None:
    group, basis = lc.group(name), matrices(lc.group(name))
    n = group.dim
    g, u = start(n), np.linspace(0.3, -0.7, n)
    lib = lc.build([lc.jacobian(kernel(name, "wei_norman_rate"), port, output="g_dot") for port in ("g", "u")])

    def rate(g: Any, u: Any) -> Any:
        """The body velocity of a product of exponentials, column by column, solved for g'."""
        columns = []
        for i in range(n):
            tail = mp.eye(group.degree)
            for k in range(i + 1, n):
                tail = tail * mp.expm(basis[k] * g[k])
            columns.append(list(components(basis, mp.inverse(tail) * basis[i] * tail)))
        return mp.lu_solve(mp.matrix(columns).T, mp.matrix(u))

    with mp.workdps(DIGITS):
        g0, u0 = [mp.mpf(c) for c in g], [mp.mpf(c) for c in u]
        by_g = slopes(lambda e: rate([a + b for a, b in zip(g0, e, strict=True)], u0), n)
        by_u = slopes(lambda e: rate(g0, [a + b for a, b in zip(u0, e, strict=True)]), n)
    assert np.allclose(lib.wei_norman_rate_g_dot_by_g(g, u), by_g, rtol=0, atol=1e-12)
    assert np.allclose(lib.wei_norman_rate_g_dot_by_u(g, u), by_u, rtol=0, atol=1e-12)


def law() -> lc.Kernel:
    return lc.tracking_law("so3", inertia=(1, 2, 3), error="so3_right", gains={"K_p": (4, 5, 6), "K_d": 6})


@pytest.mark.parametrize("port", ["X", "X_d", "xi"])
def test_tracking_law(port: str) -> None:
    """The law itself in 50 digits, moved along X exp(hat e)."""
    group, basis = lc.group("so3"), matrices(lc.group("so3"))
    made = [lc.jacobian(law(), port, output=output) for output in ("force", "W")]
    lib = lc.build(made)
    R, R_d = (np.array(lc.build("so3").exp(x)) for x in ([0.3, -0.2, 0.5], [-0.1, 0.4, 0.2]))
    values = {"X": R, "xi": [0.2, 0.1, -0.4], "X_d": R_d, "xi_d": [0.5, -0.3, 0.1], "xi_d_dot": [0.1, 0.2, 0.3]}
    with mp.workdps(DIGITS):

        def moved(output: int) -> Callable[[Any], Any]:
            def f(e: Any) -> Any:
                inputs = {key: np.array(value, dtype=object) * mp.mpf(1) for key, value in values.items()}
                if port == "xi":
                    inputs[port] = inputs[port] + np.array(e)
                else:
                    inputs[port] = inputs[port] @ np.array(mp.expm(combined(basis, e)).tolist())
                result = law().evaluate(multiprecision(), *[value.tolist() for value in inputs.values()])[output]
                return result if isinstance(result, list) else [result]

            return f

        outputs = [each.name for each in law().outputs]
        force, W = (slopes(moved(outputs.index(name)), group.dim) for name in ("force", "W"))
    assert np.allclose(getattr(lib, made[0].name)(*values.values()), force, rtol=0, atol=1e-12)
    assert np.allclose(getattr(lib, made[1].name)(*values.values()), W[0], rtol=0, atol=1e-12)


def test_entries_and_a_batch() -> None:
    lib = lc.build([lc.jacobian(kernel("su2", "inverse"), "X", tangent="entries"), kernel("su2", "exp")])
    X = np.array([lib.exp(x) for x in ([0.1, 0.2, 0.3], [0.0, 0.0, 0.0])])
    found = np.array([lib.inverse_X_inverse_by_X_entries(each) for each in X])
    assert found.shape == (2, 4, 8)
    # on SU(2) the group's inverse is the conjugate transpose: linear over the reals
    rng = np.random.default_rng(0)
    Z = rng.normal(size=(2, 2)) + 1j * rng.normal(size=(2, 2))
    for each in found:
        assert np.allclose(each @ Z.ravel().view(float), Z.conj().T.ravel(), atol=1e-12)
    so3 = lc.build([lc.jacobian(kernel("so3", "log"), "X"), kernel("so3", "exp")])
    xs = np.random.default_rng(1).uniform(-1, 1, (7, 3))
    many = so3.log_x_by_X_right.batch(np.array([so3.exp(x) for x in xs]))
    assert np.allclose(many, [so3.log_x_by_X_right(so3.exp(x)) for x in xs], rtol=0, atol=1e-15)


def test_the_hessian_is_the_jacobian_of_the_gradient() -> None:
    def body(ops: Any, x: Any) -> tuple[Any, ...]:
        return (ops.sin(x[0]) * x[1] * x[1],)

    f = lc.Kernel("f", "demo", (lc.Port("x", (2,)),), (lc.Port("y", ()),), body)
    hessian = lc.jacobian(lc.jacobian(f, "x", name="gradient"), "x", name="hessian")
    a, b = 0.3, -1.2
    expected = [[-np.sin(a) * b * b, 2 * np.cos(a) * b], [2 * np.cos(a) * b, 2 * np.sin(a)]]
    assert np.allclose(lc.build(hessian).hessian([a, b]), expected, rtol=0, atol=1e-15)


def test_a_derivative_is_a_value() -> None:
    made = lc.jacobian(law(), "X", output="force", tangent="left")
    assert made.definition is not None
    assert pickle.loads(pickle.dumps(made)) == made
    assert made != lc.jacobian(law(), "X", output="force", tangent="right", name=made.name)


def test_no_derivative_off_the_group() -> None:
    lib = lc.build(lc.jacobian(lc.attitude_law("p"), "X", output="omega"))
    assert np.all(np.isnan(lib.attitude_p_omega_by_X_right(np.diag([1.0, 1.0, -1.0]))))
    assert np.allclose(lib.attitude_p_omega_by_X_right(np.eye(3)), -np.eye(3), rtol=0, atol=1e-15)


def test_what_is_refused() -> None:
    log = kernel("so3", "log")
    with pytest.raises(InputError, match="there are X"):
        lc.jacobian(log, "Y")
    with pytest.raises(InputError, match="right, left, entries"):
        lc.jacobian(log, "X", tangent="body")
    with pytest.raises(InputError, match="give output="):
        lc.jacobian(law(), "X")
    with pytest.raises(ShapeError, match="no element of se3"):
        lc.jacobian(log, "X", group="se3")
    tunable = lc.tracking_law("so3", inertia="input", error="so3_right", gains={"K_p": 4, "K_d": 6})
    with pytest.raises(InputError, match="no element of so3"):
        lc.jacobian(tunable, "inertia", output="force")
    with pytest.raises(InputError, match="takes a Kernel"):
        lc.casadi_function("so3")  # type: ignore[arg-type]


def test_casadi_shapes_and_values() -> None:
    for name in ("se3", "su2"):
        group, lib = lc.group(name), lc.build(name)
        f = lc.casadi_function(kernel(name, "compose"))
        X, Y = (np.asarray(lib.exp(scale * start(group.dim))) for scale in (1, -0.7))
        seen = [np.ascontiguousarray(each).view(float) for each in (X, Y, X @ Y)]
        assert f.name_in() == ["X", "Y"]
        assert f.size_in("X") == seen[0].shape
        assert np.allclose(np.array(f(X=seen[0], Y=seen[1])["Z"]), seen[2], rtol=0, atol=1e-15)


def test_a_pose_fit_in_opti() -> None:
    """Of points seen in the body frame, with CasADi's own derivatives; the guide's example."""
    exp = lc.casadi_function(kernel("se3", "exp"))
    truth = np.array([0.3, -0.5, 0.2, 1.0, 2.0, -1.0])
    points = np.random.default_rng(3).normal(size=(3, 8))
    pose = np.array(lc.build("se3").exp(truth))
    seen = pose[:3, :3] @ points + pose[:3, 3:]
    opti = ca.Opti()
    x = opti.variable(6)
    X = exp(x)
    opti.minimize(ca.sumsqr(X[:3, :3] @ points + ca.repmat(X[:3, 3], 1, 8) - seen))
    opti.solver("ipopt", {"print_time": False}, {"print_level": 0, "sb": "yes"})
    assert np.allclose(opti.solve().value(x), truth, rtol=0, atol=1e-7)
