"""The systems on which the solver of open problems is measured: quadrotor, satellite with wheels, car, underwater vehicle."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from scipy.linalg import expm

import lie_codegen as lc

GRAVITY = 9.81
SO3, SE2, SE3 = lc.group("so3"), lc.group("se2"), lc.group("se3")


def kernel(name: str, inputs: dict[str, tuple[int, ...]], output: str, size: int, body: Any) -> lc.Kernel:
    """A kernel of one vector output, from a body that returns its entries."""
    ports = tuple(lc.Port(port, shape) for port, shape in inputs.items())
    return lc.Kernel(name, "test", ports, (lc.Port(output, (size,)),), lambda ops, *values: (body(ops, *values),))


def quadrotor(cylinders: int = 1, intervals: int = 30, **options: Any) -> Any:
    """World velocity v, thrust a mass and body rates; cylinders (x, y, radius) to be kept out of."""

    def velocity(_ops: Any, X: Any, v: Any, u: Any) -> Any:
        return [u[1], u[2], u[3], *(X[0][i] * v[0] + X[1][i] * v[1] + X[2][i] * v[2] for i in range(3))]

    def rate(_ops: Any, X: Any, u: Any) -> Any:
        return [X[0][2] * u[0], X[1][2] * u[0], X[2][2] * u[0] - GRAVITY]

    def attitude(X: Any, weight: float) -> Any:
        columns = [X[0][2], X[1][2], X[2][2] - 1, X[0][0] - 1, X[1][0], X[2][0]]
        return [weight * entry for entry in columns]

    def stage(_ops: Any, X: Any, v: Any, u: Any, target: Any) -> Any:
        offset = [2 * (X[i][3] - target[i]) for i in range(3)]
        rest = [0.15 * (u[0] - GRAVITY), 0.3 * u[1], 0.3 * u[2], 0.3 * u[3]]
        return [*offset, *(0.6 * entry for entry in v), *attitude(X, 0.3), *rest]

    def end(_ops: Any, X: Any, v: Any, target: Any) -> Any:
        return [*(6 * (X[i][3] - target[i]) for i in range(3)), *(2 * entry for entry in v), *attitude(X, 1)]

    def outside(_ops: Any, X: Any, cyl: Any) -> Any:
        rows = []
        for i in range(cylinders):
            x, y, r = cyl[3 * i : 3 * i + 3]
            rows.append((r * r - (X[0][3] - x) * (X[0][3] - x) - (X[1][3] - y) * (X[1][3] - y)) / (2 * r))
        return rows

    low, high = np.array([2, -6, -6, -6.0]), np.array([20, 6, 6, 6.0])
    settings: dict[str, Any] = {"quadrature": "left", "name": f"quad{cylinders}", **options}
    return lc.ocp(
        SE3,
        inputs={"u": 4},
        states={"v": 3},
        velocity=kernel("velocity", {"X": (4, 4), "v": (3,), "u": (4,)}, "xi", 6, velocity),
        rates={"v": kernel("rate", {"X": (4, 4), "u": (4,)}, "v_dot", 3, rate)},
        stage_cost=kernel("stage", {"X": (4, 4), "v": (3,), "u": (4,), "target": (3,)}, "residual", 16, stage),
        terminal_cost=kernel("end", {"X": (4, 4), "v": (3,), "target": (3,)}, "residual", 12, end),
        constraints=(kernel("cylinder", {"X": (4, 4), "cyl": (3 * cylinders,)}, "g", cylinders, outside),),
        bounds={"u": (low, high)},
        parameters={"target": (3,), "cyl": (3 * cylinders,)},
        duration=0.05 * intervals,
        intervals=intervals,
        **settings,
    )


def satellite(**options: Any) -> Any:
    """Three wheels of momentum h, J w' = -w x (J w + h) - u, h' = u; a cone that the body's first axis keeps out of."""
    J = (12.0, 10.0, 8.0)

    def rate(_ops: Any, w: Any, h: Any, u: Any) -> Any:
        L = [J[i] * w[i] + h[i] for i in range(3)]
        turn = [w[1] * L[2] - w[2] * L[1], w[2] * L[0] - w[0] * L[2], w[0] * L[1] - w[1] * L[0]]
        return [-(turn[i] + u[i]) / J[i] for i in range(3)]

    return lc.ocp(
        SO3,
        inputs={"u": 3},
        states={"w": 3, "h": 3},
        velocity="w",
        rates={"w": kernel("rate", {"w": (3,), "h": (3,), "u": (3,)}, "w_dot", 3, rate), "h": "u"},
        stage_cost=("0.3*(X - Rd)", "w", "0.5*u", "0.01*h"),
        terminal_cost=("0.1*h",),
        constraints=(
            f"X11*cone1 + X21*cone2 + X31*cone3 <= {math.cos(0.3)!r}",
            *(f"({sign}w{i} - 0.25)/0.1" for i in (1, 2, 3) for sign in ("", "-")),
            *(f"{sign}h{i} - 3" for i in (1, 2, 3) for sign in ("", "-")),
        ),
        terminal=("w", "X - Rd"),
        bounds=0.4,
        parameters={"Rd": (3, 3), "cone": (3,)},
        duration=20.0,
        intervals=40,
        quadrature="left",
        **{"name": "sat", **options},
    )


def car(**options: Any) -> Any:
    """Speed s and steering angle delta, wheelbase 2.5 m."""
    return lc.ocp(
        SE2,
        inputs={"u": 2},
        states={"s": (), "delta": ()},
        velocity=("s*tan(delta)/2.5", "s", "0"),
        rates={"s": "u1", "delta": "u2"},
        stage_cost=("0.3*u1", "u2", "0.1*s", "0.1*delta"),
        constraints=("s <= 3", "-s <= 3", "delta <= 0.6", "-delta <= 0.6"),
        terminal=("s", "delta"),
        target="goal",
        bounds=np.array([2.0, 1.0]),
        duration=6.0,
        intervals=60,
        quadrature="left",
        **{"name": "car", **options},
    )


def underwater(**options: Any) -> Any:
    """A rigid body with added mass, drag and buoyancy, in a current; six forces."""
    return lc.ocp(
        SE3,
        dynamics="second_order",
        inertia=np.array([1.2, 1.5, 1.8, 20.0, 25.0, 28.0]),
        drag=np.array([2.0, 2.0, 2.5, 10.0, 15.0, 18.0]),
        controls=SE3.labels,
        stage_cost=("X - goal", "0.5*xi", "0.05*u"),
        terminal_cost=("4*(X - goal)", "2*xi"),
        bounds=np.array([2, 2, 2, 15, 15, 15.0]),
        parameters={"goal": (4, 4)},
        duration=4.0,
        intervals=40,
        **{"name": "auv", **options},
    )


def rotation(w: Any) -> Any:
    """exp of a rotation vector."""
    return expm(SO3.hat(w))


def planar(theta: float, x: float, y: float) -> Any:
    """A planar pose."""
    c, s = math.cos(theta), math.sin(theta)
    return np.array([[c, -s, x], [s, c, y], [0, 0, 1]])


#: The published satellite: target attitude and axis of the cone.
SATELLITE = {"Rd": rotation((1.2, 0, 1.6)), "cone": np.array([0.6, 0.75, 0.2]) / np.linalg.norm([0.6, 0.75, 0.2])}
QUADROTOR = {"target": np.array([2.0, 0, 1]), "cyl": np.array([1.0, 0.05, 0.4])}
