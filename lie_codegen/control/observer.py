"""Observers on a group from vectors that the body sees, and the bias of its rate sensor.

Outputs y_i = X^-1 c_i: directions c = z (on SE(n) (z, 0)), landmarks c = (p, 1). The sensor of velocity shows u_y = u + b.

    f = sum k_i |X^ y_i - c_i|^2/2,   grad_a = sum k_i (A_a X^ y_i).(X^ y_i - c_i)
    X^' = X^ hat(u_y - b^ - k_P Ad_(X^^-1) grad),   b^' = k_I Ad_(X^)^T grad,   V' = -k_P |grad|^2,  V = f + |b - b^|^2/(2 k_I)

On a complex group the vectors are those of the algebra, seen as y = Ad_(X^-1) c: on SU(2), whose elements are unit quaternions, R(X)^T c. Ad is a
representation as X is, with A_a v = [e_a, v], and the same formulas hold; X and -X are not told apart, so X^ comes to one of the two.

On SO(3) this is X^' = X^ hat(omega_y - b^ + k_P s), b^' = -k_I s with s = sum k_i y_i x y^_i, y^_i = X^^T z_i; the order in s is the sign error
to expect. Without bias the path of X^ X^-1 does not depend on u. The step is X^ <- X^ exp(h (...)), which stays on the group.
"""

from __future__ import annotations

import random
from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.control.guarded_law import on_group_alone
from lie_codegen.control.observed_vectors import (
    acting_matrices,
    known_value,
    not_negative,
    observed_vectors,
    rank_of_outputs,
    vector_weights,
)
from lie_codegen.door import guard_methods
from lie_codegen.errors import InputError
from lie_codegen.exact.positive_matrix import positive_number
from lie_codegen.groups.catalogue_load import GroupLike, as_group
from lie_codegen.groups.derivation import derivation_of
from lie_codegen.groups.maps.exponential import exp_matrix
from lie_codegen.groups.maps.matrices import GroupMatrices, matrix_port, random_element, real_rows, velocity_units
from lie_codegen.groups.matrix_pattern import RealMatrices
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.brackets import bracket
from lie_codegen.kernel.definition import kernel_factory
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.linear import Matrix, Vector, dot, matmul, matvec, minus, number, plus, scaled
from lie_codegen.kernel.parameter import input_ports, parameter, sample_inputs, values_of
from lie_codegen.kernel.structural_zeros import is_zero
from lie_codegen.on_demand import scipy


@guard_methods
@dataclass(frozen=True, eq=False, repr=False)
class Observer(Kernel):
    """The step (X_hat, bias, u, y, h) -> (X_hat_next, bias_next), with what is known of it near rest at X = 1.

    Attributes:
        basis: (n, d, d) the matrices A_a that act on the vectors: of its group, or ad_a where it is complex.
        vectors: (k, d) the c_i.
        weights: (k,) k_i; () for an input.
        k_p, k_i: gains; NaN for an input.
    """

    basis: tuple[Any, ...] = field(default=(), repr=False)
    vectors: tuple[tuple[float, ...], ...] = field(default=(), repr=False)
    weights: tuple[float, ...] = field(default=(), repr=False)
    k_p: float = 0.0
    k_i: float = 0.0
    measured: int = field(default=0, repr=False)

    @property
    def kernel(self) -> Kernel:
        """The step itself."""
        return self

    @property
    def directions(self) -> tuple[tuple[float, ...], ...]:
        """The c of y = X^-1 c, for a loop."""
        return self.vectors

    @cached_property
    def moved(self) -> Array:
        """(k, n, d) A_a c_i: how the outputs change."""
        return np.asarray(np.einsum("aij,kj->kai", np.array(self.basis), np.array(self.vectors)))

    @cached_property
    def A(self) -> Array:
        """(n, n) Hessian of f at X^ = X = 1: sum k_i (A_a c_i).(A_b c_i); on SO(3) sum k_i (1 - z_i z_i^T).

        Raises:
            InputError: weights, k_p or k_i are inputs.
        """
        if not self.weights or np.isnan(self.k_p) or np.isnan(self.k_i):
            raise InputError(
                "observer: A, poles and covariance are of numbers; weights, k_p or k_i of this one are inputs"
            )
        return np.asarray(np.einsum("k,kai,kbi->ab", np.array(self.weights), self.moved, self.moved))

    @cached_property
    def poles(self) -> Array:
        """The roots of s^2 + k_P a s + k_I a, a the eigenvalues of A; -k_P a without bias."""
        values = np.linalg.eigvalsh(self.A)
        if self.k_i == 0:
            return np.asarray(-self.k_p * values, dtype=complex)
        return np.concatenate([np.roots([1, self.k_p * a, self.k_i * a]) for a in values]).astype(complex)

    def covariance(self, *, step: float, direction_noise: float, rate_noise: float = 0.0) -> Array:
        """(2n, 2n) steady covariance of (attitude error, bias error) at rest at X = 1, by the discrete Lyapunov equation.

            F = [[1 - h k_P A, h], [-h k_I A, 1]],   noise of the vectors sum k_i^2 sd^2 G_i G_i^T through [h k_P; h k_I],  h^2 sg^2 of the rate

        (n, n) without bias.

        Raises:
            InputError: the step is too long for these gains, or the vectors do not determine the state.
        """
        h, n = float(step), len(self.A)
        seen = self.moved[:, :, : self.measured]
        vectors = direction_noise**2 * np.einsum("k,kai,kbi->ab", np.array(self.weights) ** 2, seen, seen)
        if self.k_i == 0:
            F, G = np.eye(n) - h * self.k_p * self.A, h * self.k_p * np.eye(n)
            rate = h**2 * rate_noise**2 * np.eye(n)
        else:
            F = np.block([[np.eye(n) - h * self.k_p * self.A, h * np.eye(n)], [-h * self.k_i * self.A, np.eye(n)]])
            G = np.vstack([h * self.k_p * np.eye(n), h * self.k_i * np.eye(n)])
            rate = np.zeros((2 * n, 2 * n))
            rate[:n, :n] = h**2 * rate_noise**2 * np.eye(n)
        radius = float(np.max(np.abs(np.linalg.eigvals(F))))
        if radius >= 1 - 1e-12:
            raise InputError(
                f"observer: with step = {h:g} the error does not die out (spectral radius {radius:.6g}): no steady covariance; a shorter "
                "step, or more vectors"
            )
        return np.asarray(scipy.linalg.solve_discrete_lyapunov(F, G @ vectors @ G.T + rate))


@kernel_factory(group=as_group)
def observer(
    group: GroupLike,
    *,
    directions: Any = None,
    points: Any = None,
    outputs: Any = None,
    weights: Any = None,
    k_p: Any = 1,
    k_i: Any = 0,
    reduced: bool = False,
    name: str = "observer",
) -> Observer:
    """(X_hat, bias, u, y, h) -> (X_hat_next, bias_next), y one row a vector: first the directions, then the points.

    Args:
        group: SO(n) with directions, SE(n) with directions and points, any real group with outputs, a complex one with directions.
        directions: (k, n) inertial vectors z, taken as given: y = R^T z. On a complex group (k, dim) vectors of the algebra, y = Ad_(X^-1) z.
        points: (k, n) inertial positions p of landmarks: y = R^T (p - position), p as the body sees it.
        outputs: (k, d) vectors c of any group: y = X^-1 c.
        weights: (k,) k_i, positive; 1 if not given.
        k_p: k_P [1/s]; k_i: k_I [1/s^2], 0 for no bias. weights, k_p and k_i may be "input": an input of that name, behind the others;
            `A`, `poles` and `covariance` are of numbers.
        reduced: take vectors that do not determine the state, as one direction: the heading is then not observed.
        name: C identifier.

    Returns:
        The observer: `.kernel` of one step, `.A` and `.poles` of its linear error, `.covariance(step=, direction_noise=)`, `.directions`; it goes into
        `lc.closed_loop(observer=)`.

    Raises:
        ShapeError, InputError: vectors or weights that do not fit; vectors that do not determine the state.
    """
    group = as_group(group, "observer")
    if group.is_complex and (points is not None or outputs is not None):
        raise InputError(
            f"observer: {group.name} is complex: what a body sees of it are vectors of the algebra, y = Ad_(X^-1) z; give directions"
        )
    acting = acting_matrices(group)
    d = acting.shape[1]
    rigid = outputs is None and not np.any(acting[:, d - 1, :])
    seen = d - 1 if rigid else d
    vectors = observed_vectors(directions, points, outputs, d, rigid=rigid)
    count = len(vectors)
    parameters = (
        parameter(
            Port("weights", (count,), description="k_i of the vectors"),
            weights,
            lambda value, _: vector_weights(value, count),
        ),
        parameter(Port("k_p", (), "1/s", description="gain of the estimate"), k_p, positive_number),
        parameter(Port("k_i", (), "1/s^2", description="gain of the bias"), k_i, not_negative),
    )
    floats = tuple(tuple(float(x) for x in c) for c in vectors)
    rank, n = rank_of_outputs(acting, floats), group.dim
    if rank < n and not reduced:
        raise InputError(
            f"observer: {count} vector(s) determine {rank} of {n} components on {group.name}: "
            + ("of one direction the turn about it is not seen" if count == 1 else "another vector is needed")
            + "; reduced=True takes what there is"
        )
    derivation, real = derivation_of(group), derivation_of(group).real

    def body(
        ops: Arithmetic, X_hat: Any, bias: Vector, u: Vector, y: Matrix, h: Scalar, *given: Any
    ) -> tuple[Any, ...]:
        matrices = GroupMatrices(ops, real)
        k, p, i_gain = values_of(ops, parameters, given)
        X = matrices.read(X_hat)
        correction, rate = corrections(ops, real, X, y, [[number(ops, x) for x in c] for c in vectors], k, seen)
        velocity = minus(minus(u, bias), scaled(p, correction))
        turn = exp_matrix(ops, derivation, scaled(h, velocity))
        moved = matrices.write(matmul(X, real_rows(turn) if group.is_complex else turn))
        return moved, list(bias) if is_zero(i_gain) else plus(bias, scaled(h * i_gain, rate))

    def sampler(rng: random.Random) -> tuple[Any, ...]:
        X = random_element(group, derivation_of(group).wei_norman, rng)
        flat = [[rng.uniform(-0.1, 0.1) for _ in range(n)] for _ in range(2)]
        y = [[rng.uniform(-1, 1) for _ in range(seen)] for _ in range(count)]
        return X, *flat, y, rng.uniform(0, 0.05), *sample_inputs(parameters, rng)

    made = Observer(
        name=name,
        namespace=group.name,
        inputs=(
            matrix_port(group, "X_hat", "estimate"),
            Port("bias", (n,), velocity_units(group), description="estimate of the bias"),
            Port("u", (n,), velocity_units(group), description="measured body velocity, bias included"),
            Port("y", (count, seen), description="measured vectors, one a row"),
            Port("h", (), "s", description="step"),
            *input_ports(parameters),
        ),
        outputs=(matrix_port(group, "X_hat_next"), Port("bias_next", (n,), velocity_units(group))),
        body=body,
        formula="X^ <- X^ exp(h (u - b^ - k_P Ad_(X^^-1) grad)), b^ <- b^ + h k_I Ad_(X^)^T grad",
        source="gradient observer on a group; V' = -k_P |grad|^2",
        sampler=sampler,
        basis=tuple(tuple(map(tuple, matrix)) for matrix in acting.tolist()),
        vectors=floats,
        weights=tuple(float(w) for w in parameters[0].value or ()),
        k_p=known_value(parameters[1]),
        k_i=known_value(parameters[2]),
        measured=seen,
    )
    return on_group_alone(made, group, ("X_hat",))  # type: ignore[return-value]


def corrections(
    ops: Arithmetic,
    real: RealMatrices,
    X: Matrix,
    y: Matrix,
    vectors: Sequence[Sequence[Scalar]],
    weights: Sequence[Scalar],
    seen: int,
) -> tuple[Vector, Vector]:
    """Ad_(X^-1) grad and Ad_X^T grad."""
    matrices, n = GroupMatrices(ops, real), real.group.dim
    units = [[int(a == b) for b in range(n)] for a in range(n)]
    grad: Vector = [0] * n
    inverse = matrices.inverse(X)
    basis = [] if real.group.is_complex else [matrices.hat(unit) for unit in units]
    for c, row, weight in zip(vectors, y, weights, strict=True):
        if real.group.is_complex:
            v = matrices.Ad(X, inverse, row)
            turned = [bracket(ops, real.group.algebra, unit, v) for unit in units]
        else:
            # On SE(n) the last entry, 0 of a direction and 1 of a point, is no measurement.
            v = matvec(X, [*row[:seen], *c[seen:]])
            turned = [matvec(A, v) for A in basis]
        off = scaled(weight, minus(v, c))
        grad = plus(grad, [dot(each, off) for each in turned])
    back = matrices.Ad(inverse, X, grad)
    columns = [matrices.Ad(X, inverse, unit) for unit in units]
    return back, [dot(column, grad) for column in columns]
