"""Euler's equations as an instance of second-order averaging with one phase: slow variables (Omega, k), or (Omega, k, tau)."""

from __future__ import annotations

import random
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.averaging.phase_kernels import phase_kernels
from lie_codegen.averaging.phase_routine import Clock, Node, Nodes, phase_routine
from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.definition import kernel_factory
from lie_codegen.kernel.elliptic import LARGEST_MODULUS, jacobi, ladder
from lie_codegen.kernel.expressions import ExpressionEvaluator
from lie_codegen.kernel.kernel import Kernel
from lie_codegen.kernel.routine import Routine
from lie_codegen.kernel.saved import Saved
from lie_codegen.rigid_body.euler_variational import (
    CN,
    DN,
    K_INTEGRAL,
    K_MODULUS,
    OMEGA,
    S_MEAN,
    SN,
    ZETA,
    EulerPerturbation,
)
from lie_codegen.rigid_body.principal_body import TAU

#: Fourier coefficients of elliptic functions fall like nome^(m/2): 32 phases to k = .9 as 64 to .99.
NODES = Nodes(((0.9, 32), (0.99, 64), (float("inf"), 128)), 1)
#: Where runs of averaged equations end: the averaged rates have the singularity 1/log at k = 1.
MARGIN = 0.999
_SMALLEST = 1e-9


class SecondOrder(NamedTuple):
    """The terms of order eps^2: Omega' [rad/s^3], k' [1/s^2] and phi' [1/s^2], in the zero-mean gauge."""

    F2_Omega: Array
    F2_k: Array
    G2: Array


class NearIdentity(NamedTuple):
    """Omega = mean + eps W_Omega, k = mean + eps W_k, phi = mean + eps V."""

    W_Omega: Array
    W_k: Array
    V: Array


@dataclass(frozen=True, eq=False, repr=False)
class MeanMotion(Saved):
    """Mean variables along a run.

    Attributes:
        Omega, k, phi: (N,) each.
    """

    Omega: Array
    k: Array
    phi: Array

    def __iter__(self) -> Iterator[Array]:
        return iter((self.Omega, self.k, self.phi))

    def __getitem__(self, index: int) -> Array:
        return (self.Omega, self.k, self.phi)[index]


@dataclass(frozen=True, eq=False, repr=False)
class EulerSolution(Saved):
    """Perturbed Euler's equations solved by averaging.

    Attributes:
        t: (N,) times; fewer than were asked for where the status is not "ok".
        Omega, k, phi: (N,) osculating: mean variables with eps W and eps V added.
        omega: (N, 3) [rad/s] from them, in the user's axes.
        mean: the mean variables.
        status: "ok"; "separatrix" where k reaches its margin; or what else ended the run or spoiled its start.
        t_end: where it ended.
        order: of the averaging.
    """

    t: Array
    Omega: Array
    k: Array
    phi: Array
    omega: Array
    mean: MeanMotion
    status: str
    t_end: float
    order: int


def phase_system(perturbation: EulerPerturbation) -> tuple[Node, Clock, int]:
    """F and G of Table 2, Lambda, and the number of slow variables: 2, or 3 with tau, whose rate is 1."""
    expressions, autonomous = perturbation.variational, perturbation.is_autonomous

    def values(ops: Arithmetic, x: Sequence[Scalar], phi: Scalar | None) -> ExpressionEvaluator:
        steps = ladder(ops, x[1])
        known = {OMEGA: x[0], K_MODULUS: x[1], K_INTEGRAL: steps.K, S_MEAN: steps.S}
        if not autonomous:
            known[TAU] = x[2]
        if phi is not None:
            at = jacobi(ops, phi, steps)
            known |= {SN: at.sn, CN: at.cn, DN: at.dn, ZETA: at.z}
        return ExpressionEvaluator(ops, known)

    def node(ops: Arithmetic, x: Sequence[Scalar], phi: Scalar) -> tuple[list[Scalar], Scalar]:
        evaluate = values(ops, x, phi)
        by_omega, by_k, by_phi = (evaluate(each) for each in expressions)
        return [by_omega, by_k, *([] if autonomous else [ops.constant(1)])], by_phi

    def clock(ops: Arithmetic, x: Sequence[Scalar]) -> Scalar:
        return values(ops, x, None)(perturbation.frequency)

    return node, clock, 2 if autonomous else 3


def phase_loop(perturbation: EulerPerturbation, namespace: str, nodes: Nodes = NODES) -> Routine:
    """The loop over phases; see `phase_routine`."""
    body = perturbation.body
    key = f"{body.inertia} {body.axes} {body.signs} {perturbation.terms} {nodes}"
    name = f"{namespace}_loop_{'_'.join(str(count) for _, count in nodes.levels)}"
    return phase_routine(name, namespace, *phase_system(perturbation), nodes, key)


@kernel_factory()
def second_order_kernels(perturbation: EulerPerturbation, namespace: str) -> tuple[Kernel, ...]:
    """terms, near_identity, mean_rate and actual_rate of (Omega, k) and phi; tau is a third slow variable of rate 1."""

    def sample(rng: random.Random) -> list[float]:
        return [rng.uniform(0.5, 2), rng.uniform(0.1, 0.85), *([] if perturbation.is_autonomous else [0.0])]

    node, clock, n = phase_system(perturbation)
    return phase_kernels(phase_loop(perturbation, namespace), node, clock, n, namespace, 1.0, sample)


def inside(x: Array) -> Array:
    """Slow variables with k within (0, 1): a step of the map to mean variables may leave it."""
    kept = np.array(x, dtype=float)
    kept[1] = min(max(kept[1], _SMALLEST), LARGEST_MODULUS)
    return kept
