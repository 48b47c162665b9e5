"""Mechanical systems shared by the tests of Lagrangian and vibrational mechanics."""

from __future__ import annotations

from lie_codegen.mechanics.lagrangian import lagrangian_system
from lie_codegen.mechanics.routh import routh_reduce

DUMBBELL = "drho^2 + e^2*dth^2 + 2*e^2*dth*dnu + e^2*dnu^2 + rho^2*dnu^2 + (2 - e^2/rho^2*(1 - 3*cos(th)^2))/rho"


def pendulum(**kinds):
    return lagrangian_system(
        coordinates=("th",),
        lagrangian="m*l^2*dth^2/2 - m*g*l*cos(th)",
        forces={"th": "m*l*sin(th)*u"},
        dissipation="c*m*l^2*dth^2/2",
        parameters={"m": 1, "g": 9.81, "l": 1, "c": 0.2, **kinds},
    )


def cart():
    return lagrangian_system(
        coordinates=("th", "x"),
        lagrangian="(M+m)*dx^2/2 + m*l*cos(th)*dx*dth + m*l^2*dth^2/2 - m*g*l*cos(th)",
        forces={"th": "u"},
        parameters={"M": 2, "m": 1, "l": "1/2", "g": 9.81},
    )


def arm():
    return lagrangian_system(
        coordinates=("a", "b"),
        lagrangian="(i1 + i2 + 2*h*cos(b))*da^2/2 + (i2 + h*cos(b))*da*db + i2*db^2/2 - g1*cos(a) - g2*cos(a+b)",
        forces={"a": "u - 10*a - 3*a_dot", "b": "w"},
        dissipation="c*db^2/2",
        parameters={"i1": 2, "i2": 0.5, "h": 0.7, "g1": 10, "g2": 3, "c": 0.1},
    )


def dumbbell(momentum="p"):
    full = lagrangian_system(
        coordinates=("rho", "th", "nu"), lagrangian=DUMBBELL, forces={"th": "2*e*u"}, parameters={"e": "0.05"}
    )
    return routh_reduce(full, momentum={"nu": momentum})


def spherical():
    """A spherical pendulum on a vertically shaken pivot: two degrees of freedom, the azimuth cyclic."""
    return lagrangian_system(
        coordinates=("th", "ph"),
        lagrangian="m*l^2*(dth^2 + sin(th)^2*dph^2)/2 - m*g*l*cos(th)",
        forces={"th": "m*l*sin(th)*u"},
        parameters={"m": 1, "l": 1, "g": 9.81},
    )
