"""Attitude tracking from everywhere: two warped error functions and a jump between them where one is lower.

    phi = tr(K (1 - E))/2,  E = R_d^T R,   T_q(E) = E exp(q kappa phi(E) hat(u)),   Phi_q = phi o T_q,   q = +-1, |u| = 1
    d Phi_q = exp(q kappa phi u) d phi(T) + q kappa (d phi(T).u) d phi(E)

T_q is a diffeomorphism iff kappa |d phi.u| < 1, and sup |d phi.u| = (s_1 + s_2)/2, s the singular values of hat(u) K: kappa_max = 2/(s_1 + s_2).
In the eigenbasis of K, with A_i the pair sums: unwanted critical points E_i = F_i exp(-q kappa x_i u), F_i the half turns, at

    x = cos^2(kappa x/2) A_i + sin^2(kappa x/2) m_i,   m_i = A_j u_k^2 + A_k u_j^2,   gap_i = sin^2(kappa x_i) (A_i - m_i)

where the other Phi is lower by gap_i. The law jumps q -> -q where Phi_q - Phi_-q >= delta, 0 < delta < min gap: V falls by delta or more at each
jump, so there are at most V(0)/delta, none near the reference, and no unwinding, since the law knows R alone. The best u makes the least of
A_i - m_i largest: a linear program in u_i^2. Mayhew and Teel, Synergistic potential functions (2011); Berkane and Tayebi, Construction of
synergistic potential functions on SO(3) (2017).
"""

from __future__ import annotations

import random
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.control.attitude_ports import random_rotation
from lie_codegen.control.guarded_law import on_group_alone
from lie_codegen.control.tracking_law import FEEDFORWARDS, feedforward_force, motion_ports
from lie_codegen.control.warp import gap_matrix, levels, warp_of, warped_level
from lie_codegen.errors import InputError
from lie_codegen.exact.positive_matrix import as_floats, attitude_gain, body_inertia, positive_matrix
from lie_codegen.groups.catalogue_load import GroupLike, as_group
from lie_codegen.groups.derivation import GroupDerivation, derivation_of
from lie_codegen.groups.maps.exponential import exp_matrix
from lie_codegen.groups.units import force_units
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.brackets import bracket
from lie_codegen.kernel.definition import kernel_factory
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.linear import (
    Matrix,
    Vector,
    constant_matrix,
    dot,
    matmul,
    matvec,
    minus,
    negative,
    plus,
    scaled,
    transpose,
)
from lie_codegen.kernel.parameter import Parameter, input_ports, parameter, refuse_input, sample_inputs, values_of


@dataclass(frozen=True, eq=False, repr=False)
class HybridLaw(Kernel):
    """(X, xi, X_d, xi_d, xi_d_dot, q) -> (force, q_next), with the numbers of its jump.

    Attributes:
        gaps: (3,) how much lower the other function is at the unwanted critical points, by ascending eigenvalue of K_p.
        hysteresis: delta of the jump.
        direction: (3,) u in body axes.
        kappa, kappa_max: the warp, and the largest for which it is a diffeomorphism.
    """

    gaps: tuple[float, ...] = ()
    hysteresis: float = 0.0
    direction: tuple[float, ...] = ()
    kappa: float = 0.0
    kappa_max: float = 0.0
    gain: tuple[tuple[float, ...], ...] = field(default=(), repr=False)

    @property
    def kernel(self) -> Kernel:
        """The law itself."""
        return self

    @property
    def start(self) -> dict[str, float]:
        """Where its state starts."""
        return {"q": 1.0}

    @property
    def gap(self) -> float:
        """The least gap: the hysteresis must stay below it."""
        return min(self.gaps)

    def potential(self, E: ArrayLike, q: int = 1) -> float:
        """Phi_q(E)."""
        K, R = np.array(self.gain), np.asarray(E, dtype=float)
        angle = q * self.kappa * np.trace(K @ (np.eye(3) - R)) / 2
        u = np.array(self.direction)
        w = np.array([[0, -u[2], u[1]], [u[2], 0, -u[0]], [-u[1], u[0], 0]])
        turn = np.eye(3) + np.sin(angle) * w + (1 - np.cos(angle)) * w @ w
        return float(np.trace(K @ (np.eye(3) - R @ turn)) / 2)

    def unwanted(self, q: int = 1) -> Array:
        """(3, 3, 3) the critical points of Phi_q other than the reference, which the law leaves by a jump."""
        K = np.array(self.gain)
        _, axes = np.linalg.eigh(K)
        u = axes.T @ np.array(self.direction)
        A, m = levels(np.linalg.eigvalsh(K), u)
        found = []
        for i in range(3):
            x = warped_level(self.kappa, A[i], m[i])
            half = 2 * np.outer(axes[:, i], axes[:, i]) - np.eye(3)
            w = np.array(self.direction)
            W = np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])
            angle = -q * self.kappa * x
            found.append(half @ (np.eye(3) + np.sin(angle) * W + (1 - np.cos(angle)) * W @ W))
        return np.array(found)


@kernel_factory(group=as_group)
def hybrid_law(
    group: GroupLike = "so3",
    *,
    inertia: Any,
    K_p: Any,
    K_d: Any,
    kappa: Any = None,
    direction: Any = None,
    hysteresis: Any = None,
    feedforward: str = "levi_civita",
    name: str = "hybrid_law",
) -> HybridLaw:
    """(X, xi, X_d, xi_d, xi_d_dot, q) -> (force, q_next): tracking from every attitude, q = +-1 a state that is held between calls.

    The jump is made before the torque of the same call, so that q_next is what the torque was computed with.

    Args:
        group: SO(3).
        inertia: of the body, K_d: dissipation; either may be "input": an input of that name, behind the others.
        K_p: gain of phi, its eigenvalues distinct.
        kappa: of the warp; nine tenths of kappa_max if not given.
        direction: (3,) u in body axes; the best one if not given.
        hysteresis: delta; half of the gap if not given. It must exceed what noise does to Phi.
        feedforward: as `tracking_law`.
        name: C identifier.

    Raises:
        InputError: equal eigenvalues of K_p, for which the gap is zero; a kappa, a direction or a hysteresis out of its bounds, with them.
    """
    group = as_group(group, "hybrid_law")
    real = derivation_of(group).real
    if group.dim != 3 or real.rigid is None:
        raise InputError(f"hybrid_law is one of SO(3) with the axes as its basis, not of {group.name}")
    if feedforward not in FEEDFORWARDS:
        raise InputError(f"feedforward {feedforward!r} is not known; choose one of {', '.join(FEEDFORWARDS)}")
    for what, value in (("K_p", K_p), ("kappa", kappa), ("direction", direction), ("hysteresis", hysteresis)):
        refuse_input(
            value,
            f"hybrid_law: {what}",
            "the gap, below which the jump must stay, is computed from it when the law is made",
        )
    K, parameters = attitude_gain(K_p, 3, "K_p"), _parameters(inertia, K_d)
    gain = as_floats(K)
    u, warp, most, gaps = warp_of(gain, kappa, direction)
    delta = _hysteresis(hysteresis, min(gaps))
    derivation = derivation_of(group)

    def body(
        ops: Arithmetic, X: Matrix, xi: Vector, X_d: Matrix, xi_d: Vector, xi_d_dot: Vector, q: Scalar, *given: Any
    ) -> tuple[Any, ...]:
        metric, D = values_of(ops, parameters, given)
        E, axis = matmul(transpose(X_d), X), [ops.constant(x) for x in u]
        pull, chosen = _pull(ops, derivation, constant_matrix(ops, K), E, gap_matrix(X, X_d), axis, warp, delta, q)
        nu = matvec(transpose(E), xi_d)
        turned = matvec(transpose(E), xi_d_dot)
        nu_dot = minus(turned, bracket(ops, group.algebra, xi, nu))
        forward = feedforward_force(ops, real, metric, feedforward, xi, nu, nu_dot, turned)
        damping = matvec(D, minus(xi, nu))
        return plus(negative(pull), negative(damping), forward), chosen

    def sampler(rng: random.Random) -> tuple[Any, ...]:
        vectors = [[rng.uniform(-1, 1) for _ in range(3)] for _ in range(3)]
        return (
            random_rotation(rng),
            vectors[0],
            random_rotation(rng),
            vectors[1],
            vectors[2],
            rng.choice([-1.0, 1.0]),
            *sample_inputs(parameters, rng),
        )

    made = HybridLaw(
        name=name,
        namespace=group.name,
        inputs=(
            *motion_ports(group),
            Port("q", (), description="which of the two functions: 1 or -1, held between calls"),
            *input_ports(parameters),
        ),
        outputs=(
            Port("force", (3,), force_units(group), description="body torque"),
            Port("q_next", (), description="q after the jump, which the torque uses"),
        ),
        body=body,
        formula="f = -d Phi_q - K_d xi_e + f_FF; q -> -q where Phi_q - Phi_-q >= delta",
        source="Mayhew and Teel 2011; Berkane and Tayebi 2017",
        sampler=sampler,
        gaps=gaps,
        hysteresis=delta,
        direction=u,
        kappa=warp,
        kappa_max=most,
        gain=tuple(tuple(float(x) for x in row) for row in gain),
    )
    return on_group_alone(made, group, ("X", "X_d"))  # type: ignore[return-value]


def _parameters(inertia: Any, K_d: Any) -> tuple[Parameter, ...]:
    return (
        parameter(Port("inertia", (3, 3), description="of the body, symmetric"), inertia, body_inertia),
        parameter(
            Port("K_d", (3, 3), description="dissipation, symmetric"),
            K_d,
            lambda value, what: positive_matrix(value, 3, what),
        ),
    )


def _hysteresis(given: Any, gap: float) -> float:
    """delta: at a critical point the other function is lower by the gap, so that a delta below it makes the law jump there."""
    delta = gap / 2 if given is None else float(given)
    if not 0 < delta < gap:
        raise InputError(
            f"hybrid_law: hysteresis = {delta:g} must lie between 0 and the gap {gap:.6g}: above it the law can stay"
        )
    return delta


def _pull(
    ops: Arithmetic,
    derivation: GroupDerivation,
    K: Matrix,
    E: Matrix,
    difference: Matrix,
    axis: Vector,
    kappa: float,
    delta: float,
    q: Scalar,
) -> tuple[Vector, Scalar]:
    """(d Phi_q, q) after the jump: of both functions the one that is taken.

    Both are computed in every call, for C without branches; the derivative is that of the one chosen, so only its parts are selected, and the
    chain rule d Phi_q = exp(q kappa phi u) d phi(T) + q kappa (d phi(T).u) d phi(E) is applied once.
    """
    phi, slope = _trace(K, E, difference)
    sign = ops.where(ops.less(q, 0), ops.constant(-1), ops.constant(1))
    here = _warped(ops, derivation, K, E, phi, axis, kappa, sign)
    there = _warped(ops, derivation, K, E, phi, axis, kappa, -sign)
    stays = ops.less(here[0] - there[0], ops.constant(delta))
    chosen = ops.where(stays, sign, -sign)
    turn = [[ops.where(stays, a, b) for a, b in zip(r, s, strict=True)] for r, s in zip(here[2], there[2], strict=True)]
    at = [ops.where(stays, a, b) for a, b in zip(here[1], there[1], strict=True)]
    return plus(matvec(turn, at), scaled(chosen * ops.constant(kappa) * dot(at, axis), slope)), chosen


def _trace(K: Matrix, E: Matrix, difference: Matrix) -> tuple[Scalar, Vector]:
    """phi = tr(K D^T D)/4, D = R - R_d, which does not cancel near the reference, and d phi = skew(K E)^."""
    phi = dot([x for row in matmul(difference, K) for x in row], [x for row in difference for x in row]) / 4
    return phi, _slope(K, E)


def _slope(K: Matrix, E: Matrix) -> Vector:
    """d/ds tr(K (1 - E exp(s hat a)))/2 = -tr(K E hat a)/2, a component each."""
    M = matmul(K, E)
    return [(M[2][1] - M[1][2]) / 2, (M[0][2] - M[2][0]) / 2, (M[1][0] - M[0][1]) / 2]


def _warped(
    ops: Arithmetic,
    derivation: GroupDerivation,
    K: Matrix,
    E: Matrix,
    phi: Scalar,
    axis: Vector,
    kappa: float,
    sign: Scalar,
) -> tuple[Scalar, Vector, Matrix]:
    """Phi_q, d phi at T_q(E), and the turn exp(q kappa phi u)."""
    turn = exp_matrix(ops, derivation, scaled(sign * ops.constant(kappa) * phi, axis))
    T = matmul(E, turn)
    value = dot([x for row in K for x in row], [(1 if i == j else 0) - T[i][j] for j in range(3) for i in range(3)]) / 2
    return value, _slope(K, T), turn
