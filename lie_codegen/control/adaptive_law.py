"""Tracking with an inertia that is not known: every feedforward is linear in it, f_FF = Y(xi, nu, nu') a.

    f = -d phi - K_d xi_e + Y a^,   a^' = -Gamma Y^T xi_e,   V = W + |a - a^|^2/(2 Gamma),   V' = -xi_e.K_d xi_e

xi_e and, from within the level, phi go to zero. a^ converges under excitation alone: with a reference at rest it stays where it is, with one that
turns about an axis only some of its entries do. W needs the true inertia, so phi alone is an output. Bullo and Murray, CIT-CDS 97-003, section
4.3 (adaptive control by standard techniques), (29).
"""

from __future__ import annotations

import random
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.control.claims import check_claims
from lie_codegen.control.compatibility import check_compatibility
from lie_codegen.control.error_catalogue import gain, law_error
from lie_codegen.control.error_derivatives import ErrorDerivatives
from lie_codegen.control.error_inputs import input_parameters
from lie_codegen.control.guarded_law import on_group_alone
from lie_codegen.control.physical_inertia import kept_physical
from lie_codegen.control.reference_kernels import ReferenceBody
from lie_codegen.control.reference_motion import Reference
from lie_codegen.control.tracking_law import FEEDFORWARDS, feedforward_force, motion_ports
from lie_codegen.errors import InputError, ShapeError
from lie_codegen.exact.positive_matrix import positive_matrix, real_number, symmetric_matrix
from lie_codegen.groups.catalogue_load import GroupLike, as_group
from lie_codegen.groups.derivation import derivation_of
from lie_codegen.groups.maps.matrices import GroupMatrices, random_element
from lie_codegen.groups.units import force_units
from lie_codegen.kernel.arithmetic import Arithmetic, FloatArithmetic
from lie_codegen.kernel.definition import kernel_factory
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.linear import Vector, constant_matrix, dot, matvec, minus, negative, plus, scaled
from lie_codegen.kernel.parameter import input_ports, parameter, refuse_input, sample_inputs, values_of
from lie_codegen.on_demand import sympy as sp


@dataclass(frozen=True, eq=False, repr=False)
class AdaptiveLaw(Kernel):
    """(X, xi, X_d, xi_d, xi_d_dot, a) -> (force, a_dot, phi).

    Attributes:
        basis: (m) symmetric matrices B_k with I = sum a_k B_k.
        guess: (m,) the first guess of a.
        feedforward: its name.
    """

    basis: tuple[sp.ImmutableMatrix, ...] = field(default=(), repr=False)
    guess: tuple[float, ...] = ()
    feedforward: str = ""

    @property
    def kernel(self) -> Kernel:
        """The law itself."""
        return self

    @property
    def start(self) -> dict[str, tuple[float, ...]]:
        """Where its state starts."""
        return {"a": self.guess}

    def inertia(self, a: ArrayLike) -> Array:
        """(n, n) sum a_k B_k."""
        matrices = np.array([m.tolist() for m in self.basis], dtype=float)
        return np.asarray(np.einsum("k,kij->ij", np.asarray(a, dtype=float), matrices))

    def excitation(self, reference: Reference, t: ArrayLike) -> Array:
        """(m,) singular values of the integral of Y^T Y over the reference, largest first: as many parameters are found as do not vanish.

        Y is taken on the reference itself, xi = nu = xi_d.
        """
        times, ops = np.asarray(t, dtype=float), FloatArithmetic()
        evaluate, total = ReferenceBody(reference), np.zeros((len(self.basis), len(self.basis)))
        for step, time in zip(np.gradient(times), times, strict=True):
            _, xi, rate = evaluate(ops, float(time))
            turned = rate  # [xi, nu] = 0 for nu = xi
            real = derivation_of(reference.group).real
            columns = [
                feedforward_force(
                    ops, real, constant_matrix(ops, B), self.feedforward, xi, list(xi), list(rate), list(turned)
                )
                for B in self.basis
            ]
            Y = np.array(columns, dtype=float).T
            total += step * Y.T @ Y
        return np.asarray(np.linalg.svd(total, compute_uv=False))


@kernel_factory(group=as_group)
def adaptive_law(
    group: GroupLike,
    *,
    error: Any,
    gains: Mapping[str, Any],
    rate: Any = 1,
    start: Any = None,
    basis: Sequence[Any] | None = None,
    feedforward: str = "basic",
    project: bool = False,
    name: str = "adaptive_law",
) -> AdaptiveLaw:
    """(X, xi, X_d, xi_d, xi_d_dot, a) -> (force, a_dot, phi): tracking that adapts the inertia it uses.

    Args:
        group, error, gains, feedforward: as `tracking_law`; gains hold K_d and what the error function needs.
        rate: Gamma, positive: a number, a diagonal or an (m, m) matrix. It and every gain may be "input": an input of that name, behind
            the others.
        start: (m,) first guess of a; of the identity if not given.
        basis: (m) symmetric (n, n) matrices B_k, I = sum a_k B_k; if not given all symmetric ones: the diagonal, then the entries above it
            row by row, on SO(3) (xx, yy, zz, xy, xz, yz).
        project: on SO(3), keep a among the inertias of rigid bodies: where the least eigenvalue of tr(I)/2 1 - I, the covariance of the
            mass, comes down to a hundredth of the first guess's, a_dot moves along that boundary.
        name: C identifier.

    Raises:
        InputError: as `tracking_law`; a first guess that is no inertia; `project` on another group than SO(3) has no effect.
    """
    group = as_group(group, "adaptive_law")
    if feedforward not in FEEDFORWARDS:
        raise InputError(f"feedforward {feedforward!r} is not known; choose one of {', '.join(FEEDFORWARDS)}")
    refuse_input(start, "adaptive_law: start", "it is where the state a starts; a closed loop takes another as start")
    refuse_input(basis, "adaptive_law: basis", "the number of parameters and the feedforward's columns follow from it")
    pair, n = law_error(group, error, gains), group.dim
    check_compatibility(pair)
    check_claims(pair)
    matrices = _basis(basis, n)
    m = len(matrices)
    parameters = (
        parameter(
            Port("K_d", (n, n), description="dissipation, symmetric"),
            gain(gains, "K_d", "an adaptive law"),
            lambda value, what: positive_matrix(value, n, what),
        ),
        parameter(
            Port("rate", (m, m), description="Gamma of the adaptation, symmetric"),
            rate,
            lambda value, what: positive_matrix(value, m, what),
        ),
        *input_parameters(pair),
    )
    a0 = _start(start, matrices, n)
    real = derivation_of(group).real
    physical = project and group.dim == 3 and group.degree == 3

    def body(
        ops: Arithmetic, X: Any, xi: Vector, X_d: Any, xi_d: Vector, xi_d_dot: Vector, a: Vector, *given: Any
    ) -> tuple[Any, ...]:
        K_d, Gamma, *rest = values_of(ops, parameters, given)
        read = GroupMatrices(ops, real).read
        at = ErrorDerivatives(ops, pair, real, read(X), read(X_d), rest)
        phi, slope = at.differential(1)
        nu, nu_dot, turned = at.transported_rates(xi, xi_d, xi_d_dot)
        xi_e = minus(xi, nu)
        columns = [
            feedforward_force(ops, real, constant_matrix(ops, B), feedforward, xi, nu, nu_dot, turned) for B in matrices
        ]
        forward = plus(*[scaled(x, column) for x, column in zip(a, columns, strict=True)])
        force = plus(negative(slope), negative(matvec(K_d, xi_e)), forward)
        drift = negative(matvec(Gamma, [dot(column, xi_e) for column in columns]))
        if physical:
            drift = kept_physical(ops, matrices, Gamma, a, drift, a0)
        return force, drift, phi

    data = derivation_of(group).wei_norman

    def sampler(rng: random.Random) -> tuple[Any, ...]:
        vectors = [[rng.uniform(-1, 1) for _ in range(n)] for _ in range(3)]
        X, X_d = random_element(group, data, rng), random_element(group, data, rng)
        return X, vectors[0], X_d, vectors[1], vectors[2], [float(x) for x in a0], *sample_inputs(parameters, rng)

    made = AdaptiveLaw(
        name=name,
        namespace=group.name,
        inputs=(
            *motion_ports(group),
            Port("a", (m,), description="parameters of the inertia, a state of the law"),
            *input_ports(parameters),
        ),
        outputs=(
            Port("force", (n,), force_units(group), description="body force"),
            Port("a_dot", (m,), description="rate of a"),
            Port("phi", (), "J", description="configuration error"),
        ),
        body=body,
        formula=f"f = -d_1 phi - K_d xi_e + Y a, a' = -Gamma Y^T xi_e; error {pair.name}, feedforward {feedforward}",
        source="Bullo and Murray, CIT-CDS 97-003, (29), section 4.3",
        sampler=sampler,
        basis=matrices,
        guess=tuple(float(x) for x in a0),
        feedforward=feedforward,
    )
    return on_group_alone(made, group, ("X", "X_d"))  # type: ignore[return-value]


def _basis(basis: Sequence[Any] | None, n: int) -> tuple[sp.ImmutableMatrix, ...]:
    if basis is None:
        places = [(i, i) for i in range(n)] + [(i, j) for i in range(n) for j in range(i + 1, n)]
        return tuple(sp.ImmutableMatrix(n, n, lambda r, c, p=p: int((r, c) in (p, p[::-1]))) for p in places)
    most = n * (n + 1) // 2
    if isinstance(basis, str) or len(basis) > most:
        raise InputError(
            f"adaptive_law: basis takes up to {most} symmetric {n} x {n} matrices, so many are independent"
        )
    made = tuple(symmetric_matrix(each, n, f"basis[{k}]") for k, each in enumerate(basis))
    if not made or sp.Matrix([list(each) for each in made]).rank() < len(made):
        raise InputError("adaptive_law: the matrices of the basis are linearly dependent, or there are none")
    return made


def _start(start: Any, matrices: tuple[sp.ImmutableMatrix, ...], n: int) -> list[sp.Expr]:
    if start is None:
        flat = np.array([[float(x) for x in m] for m in matrices])
        found = np.linalg.lstsq(flat.T, np.eye(n).ravel(), rcond=None)[0]
        start = np.round(found, 12)
    rows = start.tolist() if hasattr(start, "tolist") else list(start)
    if len(rows) != len(matrices):
        raise ShapeError(f"adaptive_law: start has {len(rows)} entries for {len(matrices)} parameters")
    exact = [real_number(x, f"start[{k}]") for k, x in enumerate(rows)]
    total = sum((x * m for x, m in zip(exact, matrices, strict=True)), sp.zeros(n, n))
    positive_matrix(total, n, "the inertia of start")
    return exact
