"""Kernels of the elliptic functions and integrals, with their derivatives."""

from __future__ import annotations

import random
from typing import Any

from lie_codegen.kernel.arithmetic import Arithmetic, Scalar
from lie_codegen.kernel.definition import kernel_factory
from lie_codegen.kernel.elliptic import jacobi, jacobi_derivatives, ladder
from lie_codegen.kernel.kernel import Kernel, Port

NAMESPACE = "elliptic"
_SOURCE = "Whittaker and Watson, Modern Analysis, 22.42 and 22.73 (Gauss transformation)"
_PHI = Port("phi", (), "1", description="phase u / (4 K(k)), period 1")
_K = Port("k", (), "1", description="modulus, 0 <= k <= 0.999999 (not the parameter m = k^2)")


@kernel_factory()
def elliptic_kernels(namespace: str = NAMESPACE) -> tuple[Kernel, ...]:
    """jacobi, jacobi_derivative, K, E, K_derivative and E_derivative as kernels: fixed depth, branch-free.

    `jacobi(phi, k)` gives sn, cn, dn and Jacobi's Zeta at u = 4 K(k) phi; `jacobi_derivative(phi, k)` their
    derivatives in phi (k fixed) and in k (phi fixed), each (4,) in that order; `K(k)` and `E(k)` the complete
    integrals, `K_derivative(k)` and `E_derivative(k)` their derivatives in k.

    Absolute error 2e-15 for |u| < 6 and 2e-14 for |u| <= 40 over k in [0, 0.999999]; K and E are exact to a few
    units of rounding. Beyond k = 0.999999 the digits of 1 - k are lost by the input itself; for |k| > 1 the
    result is NaN.

    Args:
        namespace: prefix of the C symbols.

    Raises:
        IdentifierError: namespace is no C identifier.
    """
    return (
        Kernel(
            "jacobi", namespace, (_PHI, _K), tuple(Port(name, (), "1") for name in ("sn", "cn", "dn", "zeta")),
            _jacobi_body, "sn, cn, dn and Zeta at u = 4 K(k) phi", _SOURCE, _sample_phase,
        ),
        Kernel(
            "jacobi_derivative", namespace, (_PHI, _K),
            (
                Port("by_phi", (4,), "1", description="d(sn, cn, dn, zeta)/dphi at fixed k"),
                Port("by_k", (4,), "1", description="d(sn, cn, dn, zeta)/dk at fixed phi"),
            ),
            _derivative_body, "derivatives of sn, cn, dn and Zeta in phi and in k", _SOURCE, _sample_phase,
        ),
        Kernel("K", namespace, (_K,), (Port("K", (), "1"),), _first_body, "complete integral, first kind", _SOURCE,
               _sample_modulus),
        Kernel("E", namespace, (_K,), (Port("E", (), "1"),), _second_body, "complete integral, second kind", _SOURCE,
               _sample_modulus),
        Kernel("K_derivative", namespace, (_K,), (Port("dK", (), "1"),), _first_derivative_body,
               "dK/dk = k K (1 - S) / (1 - k^2), S = (1 - E / K) / k^2", _SOURCE, _sample_modulus),
        Kernel("E_derivative", namespace, (_K,), (Port("dE", (), "1"),), _second_derivative_body,
               "dE/dk = -k K S, S = (1 - E / K) / k^2", _SOURCE, _sample_modulus),
    )  # fmt: skip


def _jacobi_body(ops: Arithmetic, phi: Scalar, k: Scalar) -> tuple[Scalar, ...]:
    at = jacobi(ops, phi, ladder(ops, k))
    return at.sn, at.cn, at.dn, k * k * at.z


def _derivative_body(ops: Arithmetic, phi: Scalar, k: Scalar) -> tuple[Any, ...]:
    steps = ladder(ops, k)
    by_phi, by_k = jacobi_derivatives(steps, jacobi(ops, phi, steps))
    return list(by_phi), list(by_k)


def _first_body(ops: Arithmetic, k: Scalar) -> tuple[Scalar, ...]:
    return (ladder(ops, k).K,)


def _second_body(ops: Arithmetic, k: Scalar) -> tuple[Scalar, ...]:
    return (ladder(ops, k).E,)


def _first_derivative_body(ops: Arithmetic, k: Scalar) -> tuple[Scalar, ...]:
    steps = ladder(ops, k)
    return (k * steps.K * (1 - steps.S) / (steps.complement * steps.complement),)


def _second_derivative_body(ops: Arithmetic, k: Scalar) -> tuple[Scalar, ...]:
    steps = ladder(ops, k)
    return (-k * steps.K * steps.S,)


def _sample_phase(rng: random.Random) -> tuple[Any, ...]:
    return rng.uniform(-1, 1), rng.uniform(0, 0.99)


def _sample_modulus(rng: random.Random) -> tuple[Any, ...]:
    return (rng.uniform(0, 0.99),)
