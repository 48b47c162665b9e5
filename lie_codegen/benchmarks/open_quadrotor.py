"""The quadrotor of the comparison of open optimal control: for lc.ocp as kernels, for CasADi written out anew in matrices."""

from __future__ import annotations

from typing import Any

import casadi as ca
import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.groups.catalogue_load import group
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.steering.ocp.front import ocp
from lie_codegen.steering.ocp.problem import OptimalControlProblem

#: (tasks, 12): target and three cylinders (x, y, radius).
Tasks = Array

INTERVALS, STEP, CYLINDERS = 30, 0.05, 3
GRAVITY = 9.81
HOVER = np.array([GRAVITY, 0, 0, 0])
LOW, HIGH = np.array([2, -6, -6, -6.0]), np.array([20, 6, 6, 6.0])
#: Weights: position, velocity, attitude, thrust, rates; at the end position, velocity, attitude.
_STAGE, _END = (2.0, 0.6, 0.3, 0.15, 0.3), (6.0, 2.0, 1.0)


def tasks(count: int, seed: int) -> Tasks:
    """Random targets behind cylinders that touch neither each other, nor the start, nor the target."""
    rng = np.random.default_rng(seed)
    rows: list[Array] = []
    while len(rows) < count:
        target = np.array([rng.uniform(1.5, 2.5), rng.uniform(-1, 1), rng.uniform(0.5, 1.5)])
        discs: list[Array] = []
        while len(discs) < CYLINDERS:
            disc = np.array([rng.uniform(0.4, 2), rng.uniform(-1, 1), rng.uniform(0.1, 0.3)])
            clear = [np.hypot(*(disc[:2] - p)) > disc[2] + 0.2 for p in (np.zeros(2), target[:2])]
            clear += [np.hypot(*(disc[:2] - other[:2])) > disc[2] + other[2] + 0.1 for other in discs]
            if all(clear):
                discs.append(disc)
        rows.append(np.concatenate([target, *discs]))
    return np.array(rows)


def quadrotor() -> OptimalControlProblem:
    """For lc.ocp; states X and the velocity v in the world's axes, controls thrust a mass and body rates."""

    def velocity(_ops: Any, X: Any, v: Any, u: Any) -> Any:
        return ([u[1], u[2], u[3], *(X[0][i] * v[0] + X[1][i] * v[1] + X[2][i] * v[2] for i in range(3))],)

    def rate(_ops: Any, X: Any, u: Any) -> Any:
        return ([X[0][2] * u[0], X[1][2] * u[0], X[2][2] * u[0] - GRAVITY],)

    def stage(_ops: Any, X: Any, v: Any, u: Any, target: Any) -> Any:
        return (_residual(_columns(X), v, target, _STAGE, u),)

    def end(_ops: Any, X: Any, v: Any, target: Any) -> Any:
        return (_residual(_columns(X), v, target, _END),)

    def cylinder(_ops: Any, X: Any, cyl: Any) -> Any:
        return (_inside([X[0][3], X[1][3]], cyl),)

    def made(name: str, inputs: dict[str, tuple[int, ...]], output: str, size: int, body: Any) -> Kernel:
        ports = tuple(Port(each, shape) for each, shape in inputs.items())
        return Kernel(name, "bench", ports, (Port(output, (size,)),), body)

    X, v, u, target = (4, 4), (3,), (4,), (3,)
    return ocp(
        group("se3"),
        inputs={"u": 4},
        states={"v": 3},
        velocity=made("velocity", {"X": X, "v": v, "u": u}, "xi", 6, velocity),
        rates={"v": made("rate", {"X": X, "u": u}, "v_dot", 3, rate)},
        stage_cost=made("stage", {"X": X, "v": v, "u": u, "target": target}, "residual", 16, stage),
        terminal_cost=made("end", {"X": X, "v": v, "target": target}, "residual", 12, end),
        constraints=(made("cylinder", {"X": X, "cyl": (9,)}, "g", CYLINDERS, cylinder),),
        bounds={"u": (LOW, HIGH)},
        parameters={"target": 3, "cyl": 9},
        duration=INTERVALS * STEP,
        intervals=INTERVALS,
        quadrature="left",
        name="bench_quadrotor",
    )


def _columns(X: Any) -> tuple[Any, Any, Any]:
    """First and third axis of the body, and the position."""
    return [X[i][0] for i in range(3)], [X[i][2] for i in range(3)], [X[i][3] for i in range(3)]


def _residual(axes: tuple[Any, Any, Any], v: Any, target: Any, weights: tuple[float, ...], u: Any = None) -> list[Any]:
    first, third, place = axes
    rows = [weights[0] * (place[i] - target[i]) for i in range(3)] + [weights[1] * v[i] for i in range(3)]
    rows += [weights[2] * entry for entry in (third[0], third[1], third[2] - 1, first[0] - 1, first[1], first[2])]
    if u is not None:
        rows += [weights[3] * (u[0] - GRAVITY), *(weights[4] * u[i] for i in (1, 2, 3))]
    return rows


def _inside(place: Any, discs: Any) -> list[Any]:
    """How deep in each cylinder, in metres near its surface."""
    rows: list[Array] = []
    for i in range(CYLINDERS):
        dx, dy, r = place[0] - discs[3 * i], place[1] - discs[3 * i + 1], discs[3 * i + 2]
        rows.append((r * r - dx * dx - dy * dy) / (2 * r))
    return rows


def program() -> tuple[dict[str, Any], Array, Array, tuple[Array, Array], list[bool]]:
    """The nonlinear program: its expressions, bounds of variables, bounds of conditions, and which are equalities.

    Stage by stage (R row by row, p, v, u), conditions x_{k+1} = F(x_k, u_k) and then the cylinders: the order that fatrop asks for.
    """
    p = ca.SX.sym("p", 3 + 3 * CYLINDERS)
    target, discs = ca.vertsplit(p[:3]), ca.vertsplit(p[3:])
    variables, conditions, low, high, least, most, equal = [], [], [], [], [], [], []
    cost: Any = 0
    first = np.concatenate([np.eye(3).ravel(), np.zeros(6)])
    x = ca.SX.sym("x0", 15)
    for k in range(INTERVALS + 1):
        last = k == INTERVALS
        variables.append(x)
        low.append(first if k == 0 else np.full(15, -np.inf))
        high.append(first if k == 0 else np.full(15, np.inf))
        R, place, v = ca.reshape(x[:9], 3, 3).T, ca.vertsplit(x[9:12]), ca.vertsplit(x[12:15])
        axes = (ca.vertsplit(R[:, 0]), ca.vertsplit(R[:, 2]), place)
        if not last:
            u = ca.SX.sym(f"u{k}", 4)
            variables.append(u)
            low.append(LOW)
            high.append(HIGH)
            following = ca.SX.sym(f"x{k + 1}", 15)
            conditions.append(following - _step(x, u))
            least.append(np.zeros(15))
            most.append(np.zeros(15))
            equal += [True] * 15
            cost += STEP * ca.sumsqr(ca.vertcat(*_residual(axes, v, target, _STAGE, ca.vertsplit(u)))) / 2
        if k > 0:
            conditions.append(ca.vertcat(*_inside(place, discs)))
            least.append(np.full(CYLINDERS, -np.inf))
            most.append(np.zeros(CYLINDERS))
            equal += [False] * CYLINDERS
        if last:
            cost += ca.sumsqr(ca.vertcat(*_residual(axes, v, target, _END))) / 2
        else:
            x = following
    nlp = {"x": ca.vertcat(*variables), "p": p, "f": cost, "g": ca.vertcat(*conditions)}
    limits = np.concatenate(least), np.concatenate(most)
    return nlp, np.concatenate(low), np.concatenate(high), limits, equal


def _step(x: Any, u: Any) -> Any:
    """RKMK4 on SE(3) and RK4 of v, in matrices: theta' = dexpinv_theta(xi) to the second bracket."""
    X = ca.vertcat(ca.horzcat(ca.reshape(x[:9], 3, 3).T, x[9:12]), ca.SX([[0, 0, 0, 1]]))
    v = x[12:15]

    def slope(theta: Any, change: Any) -> tuple[Any, Any]:
        moved = X @ _exp(theta)
        R, speed = moved[:3, :3], v + change
        xi = ca.vertcat(u[1:4], R.T @ speed)
        once = _bracket(theta, xi)
        return xi + once / 2 + _bracket(theta, once) / 12, R[:, 2] * u[0] - ca.vertcat(0, 0, GRAVITY)

    k1, f1 = slope(ca.SX.zeros(6), ca.SX.zeros(3))
    k2, f2 = slope(STEP / 2 * k1, STEP / 2 * f1)
    k3, f3 = slope(STEP / 2 * k2, STEP / 2 * f2)
    k4, f4 = slope(STEP * k3, STEP * f3)
    end = X @ _exp(STEP / 6 * (k1 + 2 * k2 + 2 * k3 + k4))
    return ca.vertcat(ca.vec(end[:3, :3].T), end[:3, 3], v + STEP / 6 * (f1 + 2 * f2 + 2 * f3 + f4))


def _bracket(a: Any, b: Any) -> Any:
    """[(w, v), (w', v')] = (w x w', w x v' - w' x v)."""
    return ca.vertcat(ca.cross(a[:3], b[:3]), ca.cross(a[:3], b[3:]) - ca.cross(b[:3], a[3:]))


def _exp(x: Any) -> Any:
    """exp of (w, v) by Taylor polynomials in the squared angle."""
    w, z = x[:3], ca.dot(x[:3], x[:3])
    W = ca.skew(w)
    a = b = c = ca.SX(0)
    for m in range(9, -1, -1):  # a = sin t / t, b = (1 - cos t) / t^2, c = (t - sin t) / t^3, z = t^2, by Horner
        a = 1 - z * a / ((2 * m + 2) * (2 * m + 3))
        b = 1 - z * b / ((2 * m + 3) * (2 * m + 4))
        c = 1 - z * c / ((2 * m + 4) * (2 * m + 5))
    b, c = b / 2, c / 6
    R = ca.SX.eye(3) + a * W + b * (W @ W)
    V = ca.SX.eye(3) + b * W + c * (W @ W)
    return ca.vertcat(ca.horzcat(R, V @ x[3:]), ca.SX([[0, 0, 0, 1]]))
