"""Small kernels written by hand: every kind of port, branch and output that code generation must handle."""

from __future__ import annotations

import random
from typing import Any

from lie_codegen.kernel.complex_scalar import Complex
from lie_codegen.kernel.kernel import Kernel, Port


def _rate(ops: Any, g: Any, u: Any) -> tuple[Any, ...]:
    s, c = ops.sin(g[2]), ops.cos(g[2])
    first = (c * u[0] - s * u[1]) / ops.cos(g[1])
    return ([first, s * u[0] + c * u[1], u[2] - ops.sin(g[1]) * first],)


def _rate_sample(rng: random.Random) -> tuple[Any, ...]:
    return [rng.uniform(-1, 1) for _ in range(3)], [rng.uniform(-1, 1) for _ in range(3)]


def _exp(ops: Any, x: Any) -> tuple[Any, ...]:
    square = x[0] * x[0] + x[1] * x[1] + x[2] * x[2]
    small = ops.less(square, 1e-3)
    safe = ops.where(small, 1.0, square)
    angle = ops.sqrt(safe)
    a = ops.where(small, 1 - square / 6 * (1 - square / 20 * (1 - square / 42)), ops.sin(angle) / angle)
    b = ops.where(small, (1 - square / 12 * (1 - square / 30)) / 2, (1 - ops.cos(angle)) / safe)
    hat = [[0, -x[2], x[1]], [x[2], 0, -x[0]], [-x[1], x[0], 0]]
    twice = [[sum(hat[i][k] * hat[k][j] for k in range(3)) for j in range(3)] for i in range(3)]
    return ([[int(i == j) + a * hat[i][j] + b * twice[i][j] for j in range(3)] for i in range(3)],)


def _turn(ops: Any, U: Any, angle: Any) -> tuple[Any, ...]:
    phase = Complex(ops.cos(angle), ops.sin(angle))
    turned = [[phase * entry for entry in row] for row in U]
    return turned, turned[0][0] + turned[1][1], turned[0][0].re


def _step(ops: Any, x: Any, u: Any, h: Any) -> tuple[Any, ...]:
    after = [x[0] + h * x[1], x[1] - h * ops.sin(x[0]) + h * u]
    return after, after[1] * after[1] / 2 - ops.cos(after[0])


def _awkward(ops: Any, exp: Any, t0: Any, index: Any) -> tuple[Any, ...]:
    return ops.exp(exp) + t0 * index, t0 - index


RATE = Kernel(
    "rate",
    "toy",
    (Port("g", (3,), "rad"), Port("u", (3,), "rad/s", description="body velocity")),
    (Port("g_dot", (3,), "rad/s"),),
    _rate,
    "g' = M(g) u",
    "a text that ends */ the comment, ??/ and goes on \\",
    _rate_sample,
)
EXP = Kernel("exp", "toy", (Port("x", (3,)),), (Port("X", (3, 3)),), _exp, "X = exp(hat(x))")
TURN = Kernel(
    "turn",
    "toy",
    (Port("U", (2, 2), is_complex=True), Port("angle", ())),
    (Port("V", (2, 2), is_complex=True), Port("trace", (), is_complex=True), Port("part", ())),
    _turn,
    "V = e^{i angle} U",
)
STEP = Kernel(
    "step",
    "toy",
    (Port("x", (2,)), Port("u", ()), Port("h", ())),
    (Port("x_next", (2,)), Port("energy", ())),
    _step,
)
AWKWARD = Kernel(
    "awkward",
    "toy",
    (Port("exp", ()), Port("t0", ()), Port("index", ())),
    (Port("sin", ()), Port("lambda_", ())),
    _awkward,
)
CONSTANT = Kernel("constant", "toy", (), (Port("E", (2, 3)),), lambda ops: ([[1, 2, 3], [0.1, -0.5, 1e-300]],))
IGNORES = Kernel("ignores", "toy", (Port("a", (2,)), Port("b", ())), (Port("c", (2,)),), lambda ops, a, b: ([a[1], 0],))

KERNELS = (RATE, EXP, TURN, STEP, AWKWARD, CONSTANT, IGNORES)
