"""Kernels of the torque-free rotation: prepare (once a motion) and at (at any time)."""

from __future__ import annotations

import math
import random
from collections.abc import Sequence
from functools import cache
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.averaging.phase_routine import no_tangent
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.definition import kernel_factory
from lie_codegen.kernel.elliptic import DEPTH, jacobi, ladder, phase, sn_cn_dn
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.numpy_arithmetic import NumpyArithmetic
from lie_codegen.kernel.routine import Routine, call_routine
from lie_codegen.rigid_body.rotation_formulas import (
    about_third,
    apply,
    frame_of,
    multiply,
    shape_at,
    shortest_arc,
    sine_series,
    squares_of,
    transpose,
)

NAMESPACE = "free_rotation"
#: Phases on half a period (33 of them differ), and terms of the series: attitude to 1e-13 for k to .9999.
NODES, TERMS = 64, 31
_SOURCE = "Benson and Scheeres, J. Guidance Control Dynamics 44 (2021), with the shortest-arc section"

_AXES = (Port("moments", (3,), "kg m^2", description="principal moments, increasing"),
         Port("axes", (3, 3), "1", description="their directions in the user's axes, by columns, det +1"))  # fmt: skip
#: What `prepare` gives and `at` takes.
MOTION = (
    Port("frame", (3, 3), "1", description="C(H/L), inertial"),
    Port("paper", (3, 3), "1", description="P: the axes of the formulas by columns, in the user's axes"),
    Port("inertia", (3,), "kg m^2", description="moments along them; the second is the middle one"),
    Port("L", (), "N m s"),
    Port("r", (3,), "1"),
    Port("k", (), "1", description="modulus"),
    Port("phi", (), "1", description="phase at the start"),
    Port("Lambda", (), "1/s", description="rate of the phase; one nutation is 1 / |Lambda|"),
    Port("alpha", (), "rad", description="uniform part of the angle of precession, at the start"),
    Port("m", (), "rad/s", description="its mean rate"),
    Port("b", (TERMS,), "rad", description="coefficients of its periodic part"),
    Port("mode", (), "1", description="1: circles the largest moment (SAM), 0: the smallest (LAM)"),
)


@cache
def precession_routine() -> Routine:
    """(k, r3, c) -> mean of 1 - c / (1 + r3 dn) and the coefficients of cos(4 pi n phi)."""

    def moduli(ops: Arithmetic, k: Scalar) -> tuple[Any, ...]:
        return (list(ladder(ops, k).moduli),)

    def dn(ops: Arithmetic, below: Any, phi: Scalar) -> tuple[Any, ...]:
        return (sn_cn_dn(ops, phi, below)[2],)

    below = Port("moduli", (DEPTH,))
    helpers = (
        Kernel("precession_moduli", NAMESPACE, (Port("k", ()),), (below,), moduli),
        Kernel("precession_dn", NAMESPACE, (below, Port("phi", ())), (Port("dn", ()),), dn),
    )
    cosines = tuple(repr(math.cos(2 * math.pi * j / NODES)) for j in range(NODES))
    settings = (("nodes", NODES), ("terms", TERMS), ("cosines", cosines), ("depth", DEPTH),
                ("moduli", helpers[0].symbol), ("dn", helpers[1].symbol))  # fmt: skip

    def twin(values: Sequence[float]) -> Array:
        ops = NumpyArithmetic()
        samples = 1 - values[2] / (
            1 + values[1] * jacobi(ops, np.arange(NODES) / (2 * NODES), ladder(ops, np.float64(values[0]))).dn
        )
        waves = np.fft.rfft(samples)[: TERMS + 1].real / NODES
        return np.concatenate([waves[:1], 2 * waves[1:]])

    return Routine("free_rotation_precession", 3, TERMS + 1, "precession.c.jinja", settings, helpers, twin, no_tangent)


@kernel_factory()
def free_rotation_kernels(namespace: str = NAMESPACE) -> tuple[Kernel, ...]:
    """prepare(moments, axes, X, omega) -> the motion, and at(motion, t) -> (X, omega), of any body.

    Args:
        namespace: prefix of the C symbols.
    """
    X, omega = (
        Port("X", (3, 3), "1", description="body to inertial"),
        Port("omega", (3,), "rad/s", description="body axes"),
    )
    time = Port("t", (), "s", description="since the start")
    return (
        Kernel("prepare", namespace, (*_AXES, X, omega), MOTION, prepare, "H = X J omega and T -> k, K, mean precession and its series",
               _SOURCE, _sample),
        Kernel("at", namespace, (*MOTION[:-1], time), (X, omega), at, "X = C(H/L) Rz(alpha) A(l) P^T, l = (r1 cn, -r2 sn, r3 dn)",
               _SOURCE, _sample_motion),
    )  # fmt: skip


def prepare(ops: Arithmetic, moments: Any, axes: Any, X: Any, omega: Any) -> tuple[Any, ...]:
    """The motion through (X, omega)."""
    zero, one = ops.constant(0), ops.constant(1)
    w = apply(transpose(axes), omega)
    momentum = [m * r for m, r in zip(moments, w, strict=True)]
    square = sum(p * p for p in momentum)
    short = ops.less(moments[1] * sum(p * r for p, r in zip(momentum, w, strict=True)), square)

    def pick(a: Scalar, b: Scalar) -> Scalar:
        return ops.where(short, a, b)

    # SAM circles the largest moment, LAM the smallest; the sign of the first column makes det P = 1, a turn about it l3 > 0
    inertia = [pick(moments[0], moments[2]), moments[1], pick(moments[2], moments[0])]
    ordered = [[pick(row[0], -row[2]), row[1], pick(row[2], row[0])] for row in axes]
    along = ordered[0][2] * omega[0] + ordered[1][2] * omega[1] + ordered[2][2] * omega[2]
    sign = ops.where(ops.less(along, zero), -one, one)
    P = [[row[0], sign * row[1], sign * row[2]] for row in ordered]
    L = ops.sqrt(square)
    l = [i * v / L for i, v in zip(inertia, apply(transpose(P), omega), strict=True)]  # noqa: E741
    first, third = squares_of(inertia, l)
    shape = shape_at(ops, inertia, L, first, third)
    steps = ladder(ops, shape.k)
    I1, I2, I3 = inertia
    ratio = ops.sqrt(I1 * (I2 - I3) / (I2 * (I1 - I3)))  # r1 / r2, which r1 = r2 = 0 does not tell
    phi = phase(ops, -ratio * l[1], l[0], l[2] / shape.r[2], steps)
    series = call_routine(ops, precession_routine(), [shape.k, shape.r[2], shape.c])
    rate = shape.rate / (4 * steps.K)
    pi = 4 * ops.atan(one)
    unit = L / I3
    b = [unit * a / (4 * pi * (n + 1) * rate) for n, a in enumerate(series[1:])]
    turned = multiply(X, P)
    C = frame_of(ops, apply(turned, l))
    R = multiply(multiply(transpose(C), turned), transpose(shortest_arc(l)))
    alpha = ops.atan2(R[1][0] - R[0][1], R[0][0] + R[1][1]) - sine_series(ops, b, phi)
    return C, P, inertia, L, list(shape.r), shape.k, phi, rate, alpha, unit * series[0], b, pick(one, zero)


def at(
    ops: Arithmetic, frame: Any, paper: Any, inertia: Any, L: Any, r: Any, k: Any, phi: Any, rate: Any, alpha: Any, m: Any, b: Any, t: Any
) -> tuple[Any, ...]:  # fmt: skip
    """X and omega at time t: one evaluation whatever t is."""
    now = phi + rate * t
    elliptic = jacobi(ops, now, ladder(ops, k))
    l = [r[0] * elliptic.cn, -r[1] * elliptic.sn, r[2] * elliptic.dn]  # noqa: E741
    angle = alpha + m * t + sine_series(ops, b, now)
    X = multiply(multiply(frame, about_third(ops, angle, shortest_arc(l))), transpose(paper))
    return X, apply(paper, [L * c / i for c, i in zip(l, inertia, strict=True)])


def _sample(rng: random.Random) -> tuple[Any, ...]:
    def turn() -> list[list[float]]:
        a, b = rng.uniform(-3, 3), rng.uniform(-3, 3)
        z = [[math.cos(a), -math.sin(a), 0.0], [math.sin(a), math.cos(a), 0.0], [0.0, 0.0, 1.0]]
        x = [[1.0, 0.0, 0.0], [0.0, math.cos(b), -math.sin(b)], [0.0, math.sin(b), math.cos(b)]]
        return [[sum(z[i][k] * x[k][j] for k in range(3)) for j in range(3)] for i in range(3)]

    axes = turn()
    along = [rng.uniform(-0.3, 0.3), rng.uniform(-0.3, 0.3), rng.choice((-1, 1)) * rng.uniform(0.8, 1.2)]
    if rng.random() < 0.5:
        along.reverse()
    omega = [sum(row[k] * along[k] for k in range(3)) for row in axes]
    return [rng.uniform(2.5, 3), rng.uniform(3.5, 4), rng.uniform(4.5, 5)], axes, turn(), omega


def _sample_motion(rng: random.Random) -> tuple[Any, ...]:
    from lie_codegen.kernel.arithmetic import FloatArithmetic

    return *prepare(FloatArithmetic(), *_sample(rng))[:-1], rng.uniform(0, 5)
