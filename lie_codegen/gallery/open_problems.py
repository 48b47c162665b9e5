"""Five open problems, each stated in under thirty lines: quadrotor, satellite, parking, underwater vehicle, qubit."""

from __future__ import annotations

import math

import numpy as np

from lie_codegen.groups.catalogue_load import group
from lie_codegen.steering.ocp.front import ocp
from lie_codegen.steering.ocp.problem import OptimalControlProblem


def quadrotor() -> OptimalControlProblem:
    """Thrust a mass u1 and body rates u2..u4, world velocity v; kept out of a cylinder (x, y, radius)."""
    return ocp(
        group("se3"),
        inputs={"u": 4},
        states={"v": 3},
        velocity=("u2", "u3", "u4", *(f"X1{i}*v1 + X2{i}*v2 + X3{i}*v3" for i in (1, 2, 3))),
        rates={"v": ("X13*u1", "X23*u1", "X33*u1 - 9.81")},
        stage_cost=(
            *("2*(X14 - target1)", "2*(X24 - target2)", "2*(X34 - target3)", "0.6*v"),
            *("0.3*X13", "0.3*X23", "0.3*(X33 - 1)", "0.3*(X11 - 1)", "0.3*X21", "0.3*X31"),
            *("0.15*(u1 - 9.81)", "0.3*u2", "0.3*u3", "0.3*u4"),
        ),
        terminal_cost=(
            *("6*(X14 - target1)", "6*(X24 - target2)", "6*(X34 - target3)", "2*v"),
            *("X13", "X23", "X33 - 1", "X11 - 1", "X21", "X31"),
        ),
        constraints=("(cyl3^2 - (X14 - cyl1)^2 - (X24 - cyl2)^2)/(2*cyl3)",),
        bounds=(np.array([2, -6, -6, -6.0]), np.array([20, 6, 6, 6.0])),
        parameters={"target": 3, "cyl": 3},
        duration=1.5,
        intervals=30,
        quadrature="left",
        name="quadrotor",
    )


def satellite() -> OptimalControlProblem:
    """Three wheels of momentum h turn it; its star tracker, the first axis, keeps 0.3 rad from the sun."""
    momentum = ("(12*w1 + h1)", "(10*w2 + h2)", "(8*w3 + h3)")
    turn = [f"w{j + 1}*{momentum[k]} - w{k + 1}*{momentum[j]}" for j, k in ((1, 2), (2, 0), (0, 1))]
    return ocp(
        group("so3"),
        inputs={"u": 3},
        states={"w": 3, "h": 3},
        velocity="w",
        rates={"w": tuple(f"(-({turn[i]}) - u{i + 1})/{inertia}" for i, inertia in enumerate((12, 10, 8))), "h": "u"},
        stage_cost=("0.3*(X - Rd)", "w", "0.5*u", "0.01*h"),
        terminal_cost=("0.1*h",),
        constraints=(
            f"X11*sun1 + X21*sun2 + X31*sun3 <= {math.cos(0.3)!r}",
            *(f"({sign}w{i} - 0.25)/0.1" for i in (1, 2, 3) for sign in ("", "-")),
        ),
        terminal=("w",),
        target="Rd",
        bounds=0.4,
        parameters={"sun": 3},
        duration=20.0,
        intervals=40,
        quadrature="left",
        name="satellite",
    )


def parking() -> OptimalControlProblem:
    """A car of wheelbase 2.5 m: acceleration u1, steering rate u2; from rest to rest in the goal's pose."""
    return ocp(
        group("se2"),
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
        name="parking",
    )


def underwater() -> OptimalControlProblem:
    """Kirchhoff's equations with added mass, and drag relative to a current c of the sea; three torques and one thrust."""
    stream = [f"{drag}*(X1{i}*c1 + X2{i}*c2 + X3{i}*c3)" for i, drag in ((1, 8), (2, 25), (3, 25))]
    return ocp(
        group("se3"),
        dynamics="second_order",
        inertia=np.array([1.2, 3.0, 3.0, 20.0, 30.0, 30.0]),
        drag=np.array([2.0, 3.0, 3.0, 8.0, 25.0, 25.0]),
        force=("0", "0", "0", *stream),
        inputs={"u": 4},
        allocation=np.eye(6)[:, :4],
        stage_cost=("0.5*(X - goal)", "0.3*xi", "0.05*u1", "0.05*u2", "0.05*u3", "0.01*u4"),
        terminal_cost=("5*(X - goal)", "xi"),
        bounds=(np.array([-3, -3, -3, -40.0]), np.array([3, 3, 3, 40.0])),
        parameters={"goal": (4, 4), "c": 3},
        duration=8.0,
        intervals=60,
        name="underwater",
    )


def qubit() -> OptimalControlProblem:
    """A gate by two quadratures of a drive of at most 1 rad/s, with a detuning of 0.3 rad/s, in the least effort."""
    return ocp(
        group("su2"),
        controls=("sx", "sy"),
        drift=(0, 0, 0.3),
        stage_cost="norm2(u)/2",
        target="gate",
        bounds=1.0,
        duration=4.0,
        intervals=40,
        name="qubit",
    )
