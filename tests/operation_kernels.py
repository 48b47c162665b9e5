"""Kernels that exercise the code generator: every operation once, conditions as numbers, records of many sizes."""

from __future__ import annotations

from typing import Any

import casadi as ca

from lie_codegen.kernel.kernel import Kernel, Port

UNARY = {
    "NEG": lambda x: -x,
    "INV": lambda x: 1 / x,
    "TWICE": lambda x: 2 * x,
    "SQ": lambda x: x * x,
    "CONSTPOW": lambda x: ca.fabs(x) ** 2.5,
    "SQRT": lambda x: ca.sqrt(ca.fabs(x)),
    "EXP": ca.exp,
    "EXPM1": ca.expm1,
    "LOG": lambda x: ca.log(ca.fabs(x)),
    "LOG1P": lambda x: ca.log1p(ca.fabs(x)),
    "SIN": ca.sin,
    "COS": ca.cos,
    "TAN": ca.tan,
    "ASIN": lambda x: ca.asin(x / 10),
    "ACOS": lambda x: ca.acos(x / 10),
    "ATAN": ca.atan,
    "SINH": ca.sinh,
    "COSH": ca.cosh,
    "TANH": ca.tanh,
    "ASINH": ca.asinh,
    "ACOSH": lambda x: ca.acosh(1 + x * x),
    "ATANH": lambda x: ca.atanh(x / 10),
    "ERF": ca.erf,
    "FABS": ca.fabs,
    "FLOOR": ca.floor,
    "CEIL": ca.ceil,
    "SIGN": ca.sign,
    "NOT": lambda x: ca.logic_not(x),
}
BINARY = {
    "ADD": lambda x, y: x + y,
    "SUB": lambda x, y: x - y,
    "MUL": lambda x, y: x * y,
    "DIV": lambda x, y: x / y,
    "POW": lambda x, y: ca.power(ca.fabs(x), y),
    "ATAN2": ca.atan2,
    "HYPOT": ca.hypot,
    "FMOD": ca.fmod,
    "REMAINDER": ca.remainder,
    "COPYSIGN": ca.copysign,
    "FMIN": ca.fmin,
    "FMAX": ca.fmax,
    "LT": lambda x, y: x < y,
    "LE": lambda x, y: x <= y,
    "EQ": lambda x, y: x == y,
    "NE": lambda x, y: x != y,
    "AND": ca.logic_and,
    "OR": ca.logic_or,
    "IF_ELSE_ZERO": lambda x, y: ca.if_else(x < 0.5, y, 0),
    "SELECT": lambda x, y: ca.if_else(x < y, 1 / (x + 5), ca.sin(y)),
}


def every_operation() -> Kernel:
    def body(ops: Any, x: Any, y: Any) -> tuple[Any, ...]:
        return ([f(x) for f in UNARY.values()] + [f(x, y) for f in BINARY.values()],)

    size = len(UNARY) + len(BINARY)
    return Kernel("every", "toy", (Port("x", ()), Port("y", ())), (Port("z", (size,)),), body)


def mixed() -> Kernel:
    """Conditions as numbers, numbers as conditions, constants as outputs, unread inputs."""

    def body(ops: Any, x: Any, y: Any, unread: Any) -> tuple[Any, ...]:
        below = x[0] < y
        both = ca.logic_and(below, x[1] < y)
        return [below + 2 * both, ca.if_else(x[2], y, -y), ca.logic_not(x[2]), 3, ca.if_else(both, x[0], 0)], below

    ports = (Port("x", (3,)), Port("y", ()), Port("unread", (2, 2)))
    return Kernel("mixed", "toy", ports, (Port("z", (5,)), Port("below", ())), body)


def sizes() -> Kernel:
    """Records of many sizes at once."""

    def body(ops: Any, a: Any, b: Any, c: Any, d: Any) -> tuple[Any, ...]:
        total = sum(a) + sum(b)
        return [x + total for x in c], [[x - total for x in row] for row in d], [total * x for x in b]

    ports = (Port("a", (5,)), Port("b", (7,)), Port("c", (11,)), Port("d", (3, 6)))
    return Kernel("sizes", "toy", ports, (Port("e", (11,)), Port("f", (3, 6)), Port("g", (7,))), body)


def sided() -> Kernel:
    """Choices whose sides have roots, sines and divisions of their own: one within the other, a pair read outside, a shared part."""

    def body(ops: Any, x: Any) -> tuple[Any, ...]:
        size = x[0] * x[0] + x[1] * x[1]
        near, close = size < 1, x[1] < 0.5
        root = ca.sqrt(size)
        sine, cosine = ca.sin(root), ca.cos(root)
        far = sine / root + (1 - cosine) / (root * size)
        within = ca.if_else(close, ca.exp(x[1]) / (2 + ca.sin(x[0])), ca.sqrt(2 + x[0]) / (3 + ca.cos(x[1])))
        return [
            ca.if_else(near, 1 - size / 6, far),
            ca.if_else(near, size, sine),
            ca.if_else(near, within, ca.exp(x[0]) / root),
            ca.if_else(close, x[0], ca.if_else(near, ca.log(3 + x[0]) / (1 + ca.exp(x[1])), 2)),
            root * ca.if_else(near, 2, 3),
        ], near

    return Kernel("sided", "toy", (Port("x", (2,)),), (Port("z", (5,)), Port("near", ())), body)
