"""Theorem 4.2 as it stands: tracking on any manifold, with the user's error function and transport map.

    e = q' - T r',   F = P^T (-d_1 phi - K_d e) + M P (d_q(T r').q' + d_r(T r').r' + T r'' + Gamma(q', T r')) + P^T S e
    W = phi + e.M e/2,   dW/dt = -e.K_d e

P^T and M P take forces and accelerations to the manifold (see `manifold`). Gamma must see T r' frozen: letting grad_q act on it as well leaves
an error in dW/dt. S is an antisymmetric operator of one's own, as S_tau of (29) and (30): dW/dt does not see it. Bullo and Murray,
CIT-CDS 97-003, Theorem 4.2, (11), (13), (14), (29), (30).
"""

from __future__ import annotations

import random
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lie_codegen.control.manifold import PLACES, Manifold
from lie_codegen.control.manifold_formulas import read_formula, read_rows, symbols_of
from lie_codegen.errors import IncompatibleError, InputError
from lie_codegen.exact.positive_matrix import real_number
from lie_codegen.identifiers import check_identifier
from lie_codegen.kernel.arithmetic import Arithmetic
from lie_codegen.kernel.definition import kernel_factory
from lie_codegen.kernel.expressions import ExpressionEvaluator
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.linear import Vector, dot, matvec, minus, negative, plus
from lie_codegen.kernel.parameter import (
    Parameter,
    check_numbers,
    input_ports,
    input_symbols,
    is_input,
    parameter,
    sample_ports,
    symbol_values,
)
from lie_codegen.on_demand import sympy as sp

_COMPATIBLE = 1e-10


@kernel_factory()
def manifold_law(
    manifold: Manifold,
    *,
    phi: Any,
    transport: Any = None,
    K_d: Any = 1,
    S: Any = None,
    parameters: Mapping[str, Any] | None = None,
    name: str = "manifold_law",
) -> Kernel:
    """(q, q_dot, r, r_dot, r_ddot) -> (force, phi, W, W_dot) on a manifold.

    Args:
        manifold: of `lc.manifold`.
        phi: error function, a text or expression in q1 .. qN, r1 .. rN.
        transport: (N, N) rows of T in the same: r' at r to a velocity at q. On a product it is block diagonal; on spheres
            (q.r) 1 - r q^T. There is no default: T = -M^-1 d_1 phi (d_2 phi)^T/|d_1 phi|^2 always exists and is singular at q = r.
        K_d: dissipation: a number, N entries, or rows of texts in q1 .. qN.
        S: rows of an antisymmetric matrix in q, v, r, w (v for q_dot, w for r_dot), whose force S e is added.
        parameters: numbers by name. They and K_d may be "input": an input of that name, behind the others; what is checked is checked
            at positive fractions.
        name: C identifier.

    Raises:
        InputError: no transport; phi is negative, or not zero at q = r; K_d is not positive; S is not antisymmetric.
        IncompatibleError: d_2 phi + T^T d_1 phi is not zero on the manifold, or T leaves its tangent spaces; with the residual.
        ShapeError, ExpressionError: shapes, or texts outside the grammar.
    """
    if not isinstance(manifold, Manifold):
        raise InputError(f"manifold_law takes a manifold of lc.manifold, got {type(manifold).__name__}")
    named = [
        parameter(Port(check_identifier(key, "parameter"), (), any_sign=True), value, real_number)
        for key, value in (parameters or {}).items()
    ]
    inputs = input_ports(named)
    if is_input(K_d):
        inputs = (Port("K_d", (manifold.size,) * 2, description="dissipation, symmetric"), *inputs)
    pair = _pair(manifold, phi, transport, K_d, S, named)
    _check(manifold, pair.at_numbers(inputs))
    N = manifold.size

    def sampler(rng: random.Random) -> tuple[Any, ...]:
        draw = np.random.default_rng(rng.randrange(2**31))
        at, ref = manifold.places(2, draw)
        flat = draw.normal(size=(3, N))
        vectors = [manifold.along(at, flat[0]), manifold.along(ref, flat[1]), flat[2]]
        return (
            at.tolist(),
            vectors[0].tolist(),
            ref.tolist(),
            vectors[1].tolist(),
            vectors[2].tolist(),
            *sample_ports(inputs, rng),
        )

    return Kernel(
        name=name,
        namespace=manifold.name,
        inputs=(
            Port("q", (N,), description="configuration, on the manifold"),
            Port("q_dot", (N,), "1/s", description="its velocity"),
            Port("r", (N,), description="reference, on the manifold"),
            Port("r_dot", (N,), "1/s"),
            Port(
                "r_ddot", (N,), "1/s^2", description="second derivative in R^N, its part across the manifold included"
            ),
            *inputs,
        ),
        outputs=(
            Port("force", (N,), description="force F of nabla_q' q' = M^-1 (F - dV), a covector on the manifold"),
            Port("phi", (), description="configuration error"),
            Port("W", (), description="phi + e.M e/2"),
            Port("W_dot", (), "1/s", description="-e.K_d e"),
        ),
        body=_body(manifold, pair, inputs),
        formula="F = P^T(-d_1 phi - K_d e) + M P D(T r')/dt + dV; e = q' - T r'",
        source="Bullo and Murray, CIT-CDS 97-003, Theorem 4.2, with the signs of (9) mended",
        sampler=sampler,
    )


@dataclass(frozen=True)
class _Pair:
    phi: sp.Expr
    T: sp.ImmutableMatrix
    K_d: sp.ImmutableMatrix
    S: sp.ImmutableMatrix | None

    def at_numbers(self, inputs: Sequence[Port]) -> _Pair:
        """With numbers in place of the inputs."""
        values = check_numbers(inputs)
        S = None if self.S is None else self.S.xreplace(values)
        return _Pair(self.phi.xreplace(values), self.T.xreplace(values), self.K_d.xreplace(values), S)


def _body(manifold: Manifold, pair: _Pair, inputs: Sequence[Port]) -> Callable[..., tuple[Any, ...]]:
    """The law over any arithmetic; what is differentiated is differentiated here, once."""
    q, r = manifold.q, symbols_of("r", manifold.size)
    v, w = symbols_of("v", manifold.size), symbols_of("w", manifold.size)
    slope = [sp.diff(pair.phi, x) for x in q]
    moved = list(pair.T * sp.Matrix(w))
    by_q = [[sp.diff(entry, x) for x in q] for entry in moved]
    by_r = [[sp.diff(entry, x) for x in r] for entry in moved]

    def body(
        ops: Arithmetic, at: Vector, speed: Vector, ref: Vector, rate: Vector, turn: Vector, *given: Any
    ) -> tuple[Any, ...]:
        values = dict(zip([*q, *v, *r, *w], [*at, *speed, *ref, *rate], strict=True)) | symbol_values(inputs, given)
        evaluate = ExpressionEvaluator(ops, values)

        def rows(matrix: Any) -> list[Vector]:
            return [[0 if entry == 0 else evaluate(entry) for entry in row] for row in matrix]

        point = manifold.at(ops, at)
        nu = [evaluate(entry) for entry in moved]
        T = rows(pair.T.tolist())
        error = minus(speed, nu)
        change = plus(matvec(rows(by_q), speed), matvec(rows(by_r), rate), matvec(T, turn))
        damping = matvec(rows(pair.K_d.tolist()), error)
        pull = plus(negative([evaluate(entry) for entry in slope]), negative(damping))
        # The potential's own force acts on the body, so that the law gives it back: W counts phi alone.
        pull = plus(pull, [evaluate(sp.diff(manifold.potential, x)) for x in q])
        if pair.S is not None:
            pull = plus(pull, matvec(rows(pair.S.tolist()), error))
        # M P (a + M^-1 g) = P^T (M a + g): one projection for all forces, and no system with M to solve
        forward = plus(matvec(point.M, change), point.christoffel(speed, nu))
        force = point.cotangent(plus(pull, forward))
        value = evaluate(pair.phi)
        energy = value + dot(error, matvec(point.M, error)) / 2
        return force, value, energy, -dot(error, damping)

    return body


def _pair(manifold: Manifold, phi: Any, transport: Any, K_d: Any, S: Any, parameters: Sequence[Parameter]) -> _Pair:
    N = manifold.size
    names: dict[str, sp.Expr] = {"pi": sp.pi}
    names |= {each.port.name: input_symbols(each.port) if each.value is None else each.value for each in parameters}
    of_q = names | {s.name: s for s in manifold.q}
    both = of_q | {s.name: s for s in symbols_of("r", N)}
    moving = both | {s.name: s for letter in "vw" for s in symbols_of(letter, N)}
    if transport is None:
        raise InputError(
            "manifold_law: give transport=, the (N, N) rows of T in q1.., r1..: it is a choice, and the one that always exists is singular at "
            "q = r; on a sphere it is (q.r) 1 - r q^T, on a product block diagonal, in coordinates with phi of q - r the identity"
        )
    T = read_rows(transport, N, both, "transport")
    operator = None if S is None else read_rows(S, N, moving, "S")
    if operator is not None and any(sp.simplify(x) != 0 for x in (operator + operator.T).flat()):
        raise InputError("manifold_law: S is not antisymmetric, so that its force would change dW/dt")
    damping = input_symbols(Port("K_d", (N, N))) if is_input(K_d) else read_rows(K_d, N, of_q, "K_d")
    return _Pair(read_formula(phi, both, "phi"), T, damping, operator)


def _check(manifold: Manifold, pair: _Pair) -> None:
    """At fifty pairs of places.

    Raises:
        InputError, IncompatibleError: as `manifold_law`.
    """
    N = manifold.size
    q, r = manifold.q, symbols_of("r", N)
    first = sp.lambdify([q, r], [sp.diff(pair.phi, x) for x in q])
    second = sp.lambdify([q, r], [sp.diff(pair.phi, x) for x in r])
    phi, transport = sp.lambdify([q, r], pair.phi), sp.lambdify([q, r], pair.T)
    damping = sp.lambdify([q], pair.K_d)
    rng = np.random.default_rng(0)
    places = manifold.places(2 * PLACES, rng)
    worst, out, size = 0.0, 0.0, 1e-300
    for a, b in zip(places[:PLACES], places[PLACES:], strict=True):
        one, two = np.array(first(a, b), dtype=float), np.array(second(a, b), dtype=float)
        T = np.array(transport(a, b), dtype=float)
        x = manifold.along(b, rng.normal(size=N))
        # The reference moves along the manifold, so that (A2) is asked along x, tangent at r, alone; what d_2 phi is across does not matter.
        size = max(size, float(np.linalg.norm(one) * np.linalg.norm(x)), float(np.linalg.norm(two) * np.linalg.norm(x)))
        worst = max(worst, abs(float((two + T.T @ one) @ x)))
        image = T @ x
        out = max(
            out, float(np.linalg.norm(image - manifold.along(a, image))) / max(1e-300, float(np.linalg.norm(image)))
        )
        value, home = float(phi(a, b)), float(phi(a, a))
        scale = max(1.0, abs(value))
        if value < -1e-9 * scale or abs(home) > 1e-9 * scale:
            where = np.round(a, 6).tolist()
            what = (
                f"phi = {value:.6g} at q = {where}, r = {np.round(b, 6).tolist()}"
                if value < 0
                else f"phi(q, q) = {home:.6g} at q = {where}"
            )
            raise InputError(f"manifold_law: {what}; an error function is zero at q = r and positive elsewhere")
        D = np.array(damping(a), dtype=float)
        if np.linalg.eigvalsh((D + D.T) / 2)[0] <= 0 or np.max(np.abs(D - D.T)) > 1e-12 * np.max(np.abs(D)):
            raise InputError(
                f"manifold_law: K_d is not symmetric and positive definite at q = {np.round(a, 6).tolist()}"
            )
    if worst > _COMPATIBLE * size:
        raise IncompatibleError(
            f"manifold_law: phi and the transport are not compatible (A2): d_2 phi + T^T d_1 phi = {worst:.3g} along the reference at fifty "
            "pairs of places, not 0"
        )
    if out > 1e-9:
        raise IncompatibleError(
            f"manifold_law: T r' is not tangent at q: a part of {out:.3g} of it leaves the manifold"
        )
