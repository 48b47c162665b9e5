"""Tracking on the sphere S^n, the pointing device of Bullo and Murray, CIT-CDS 97-003, Lemma 5.1 with its signs mended."""

from __future__ import annotations

import random
from math import sqrt
from typing import Any

from lie_codegen.errors import InputError
from lie_codegen.exact.positive_matrix import positive_number
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.definition import kernel_factory
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.linear import Vector, dot, minus, plus, scaled
from lie_codegen.kernel.parameter import input_ports, parameter, sample_inputs, values_of


@kernel_factory(units={"k_p": "1/s^2", "k_d": "1/s"})
def sphere_law(n: int = 2, *, k_p: Any, k_d: Any, tunable: bool = False, name: str = "sphere_law") -> Kernel:
    """Tracking for nabla_{q'} q' = F on S^n: (q, q_dot, r, r_dot, r_ddot) -> (force, phi, W, W_dot).

    F = k_p pi_q r - k_d (q' - T r') + pi_q d/dt(T r'),  T r' = (q.r) r' - (q.r') r,  W = k_p (1 - q.r) + |q' - T
    r'|^2/2. Converges from every q(0) != -r(0) with k_p > |q'(0) - T r'(0)|^2/(2 (1 + q(0).r(0))).

    Args:
        n: dimension of the sphere; vectors have n + 1 entries.
        k_p: [1/s^2]; a number, or "input" for an input of that name.
        k_d: [1/s]; likewise.
        tunable: both are inputs.
        name: C identifier.

    Raises:
        InputError: n below 1, or a gain that is not positive.
    """
    if isinstance(n, bool) or not isinstance(n, int) or n < 1:
        raise InputError(f"a sphere has dimension 1, 2, ..., not {n!r}")
    gains = (
        parameter(Port("k_p", (), "1/s^2", description="stiffness"), k_p, positive_number, tunable=tunable),
        parameter(Port("k_d", (), "1/s", description="damping"), k_d, positive_number, tunable=tunable),
    )

    def body(ops: Arithmetic, q: Vector, v: Vector, r: Vector, w: Vector, a: Vector, *given: Any) -> tuple[Any, ...]:
        p, d = values_of(ops, gains, given)
        return _law(ops, p, d, q, v, r, w, a)

    size = n + 1
    return Kernel(
        name=name,
        namespace=f"s{n}",
        inputs=(
            Port("q", (size,), "", description="direction, of unit length"),
            Port("q_dot", (size,), "1/s", description="its velocity, orthogonal to q"),
            Port("r", (size,), "", description="reference, of unit length"),
            Port("r_dot", (size,), "1/s"),
            Port(
                "r_ddot", (size,), "1/s^2", description="second derivative in R^{n+1}; its part along r does not matter"
            ),
            *input_ports(gains),
        ),
        outputs=(
            Port("force", (size,), "1/s^2", description="tangent force F of nabla_q' q' = F"),
            Port("phi", (), "1/s^2", description="k_p (1 - q.r)"),
            Port("W", (), "1/s^2"),
            Port("W_dot", (), "1/s^3", description="-k_d |q' - T r'|^2"),
        ),
        body=body,
        formula="F = k_p pi_q r - k_d (q' - T r') + pi_q d/dt(T r'), T r' = (q.r) r' - (q.r') r",
        source="Bullo and Murray, CIT-CDS 97-003, Lemma 5.1, with T r' = (r x r') x q",
        sampler=lambda rng: (*_sample(rng, size), *sample_inputs(gains, rng)),
    )


def sphere_gain_bound(q: Any, q_dot: Any, r: Any, r_dot: Any) -> float:
    """The k_p above which Lemma 5.1 proves convergence from this state; infinite at q = -r.

    Args:
        q, q_dot: (n,) unit vector and its rate.
        r, r_dot: (n,) those of the reference.

    Raises:
        InputError: the vectors have different lengths.
    """
    import numpy as np

    q, v, r, w = (np.asarray(x, dtype=float) for x in (q, q_dot, r, r_dot))
    if not q.shape == v.shape == r.shape == w.shape:
        raise InputError(f"q, q_dot, r, r_dot have shapes {q.shape}, {v.shape}, {r.shape}, {w.shape}; they must agree")
    error = v - ((q @ r) * w - (q @ w) * r)
    room = 1 + float(q @ r)
    return float(error @ error) / (2 * room) if room > 0 else float("inf")


def _law(
    ops: Arithmetic, p: Scalar, d: Scalar, q: Vector, v: Vector, r: Vector, w: Vector, a: Vector
) -> tuple[Any, ...]:
    cosine = dot(q, r)
    transported = minus(scaled(cosine, w), scaled(dot(q, w), r))
    error = minus(v, transported)
    change = plus(scaled(dot(v, r), w), minus(scaled(cosine, a), scaled(dot(v, w) + dot(q, a), r)))
    pull = scaled(p, minus(r, scaled(cosine, q)))
    forward = minus(change, scaled(dot(q, change), q))
    force = plus(pull, scaled(-d, error), forward)
    # |q - r|^2/2 is 1 - q.r without its cancellation near the reference.
    gap = minus(q, r)
    phi = p * dot(gap, gap) / 2
    square = dot(error, error)
    return force, phi, phi + square / 2, -d * square


def _sample(rng: random.Random, size: int) -> tuple[Any, ...]:
    def unit() -> list[float]:
        x = [rng.gauss(0, 1) for _ in range(size)]
        length = sqrt(sum(e * e for e in x))
        return [e / length for e in x]

    def tangent(q: list[float]) -> list[float]:
        x = [rng.gauss(0, 1) for _ in range(size)]
        along = sum(a * b for a, b in zip(x, q, strict=True))
        return [a - along * b for a, b in zip(x, q, strict=True)]

    q, r = unit(), unit()
    return q, tangent(q), r, tangent(r), [rng.gauss(0, 1) for _ in range(size)]
