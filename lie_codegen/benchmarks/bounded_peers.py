"""What a user would write or install for bounded steering: GRAPE in forty lines, qutip-qtrl, CasADi with ipopt, crocoddyl."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.benchmarks.bounded_cases import BoundedCase
from lie_codegen.benchmarks.bounded_crocoddyl import crocoddyl
from lie_codegen.errors import ComputationError
from lie_codegen.flow.batched_exponential import expm

#: One start: (target, seed) -> constant controls (N, m), or None where it failed.
Start = Callable[[Array, int], Array | None]

_REACHED = 1e-9


def grape(case: BoundedCase) -> Start:
    """Infidelity and its exact gradient by eigenvectors, L-BFGS-B within the bounds, from random controls."""
    from scipy.optimize import minimize

    if not case.unitary:
        raise ComputationError("of gates alone")
    d, (n, m) = case.group.degree, (case.pieces, len(case.directions))
    h = case.duration / n
    drift, controls = 1j * case.group.hat(case.drift), 1j * case.group.hat(case.directions)

    def start(target: Array, seed: int) -> Array | None:
        def infidelity(x: Array) -> tuple[float, Array]:
            u = x.reshape(n, m)
            values, vectors = np.linalg.eigh(drift + np.tensordot(u, controls, 1))
            phases = np.exp(-1j * h * values)
            inverse = np.conj(np.swapaxes(vectors, 1, 2))
            steps = (vectors * phases[:, None]) @ inverse
            gaps = values[:, :, None] - values[:, None]
            near = np.abs(gaps) < 1e-9
            ratio = np.where(
                near, -1j * h * phases[:, :, None], (phases[:, :, None] - phases[:, None]) / np.where(near, 1, gaps)
            )
            slopes = (
                vectors[:, None]
                @ (ratio[:, None] * (inverse[:, None] @ controls @ vectors[:, None]))
                @ inverse[:, None]
            )
            before, after = np.empty_like(steps), np.empty_like(steps)
            X = np.eye(d, dtype=complex)
            for k in range(n):
                before[k], X = X, X @ steps[k]
            tail = np.eye(d, dtype=complex)
            for k in range(n - 1, -1, -1):
                after[k], tail = tail, steps[k] @ tail
            overlap = np.vdot(target, X) / d
            moved = np.einsum("ij,kil,kmlp,kpj->km", np.conj(target), before, slopes, after, optimize=True) / d
            if case.up_to_phase:
                return float(1 - abs(overlap) ** 2), -2 * np.real(np.conj(overlap) * moved).ravel()
            return float(1 - overlap.real), -np.real(moved).ravel()

        rng = np.random.default_rng(seed)
        first = 0.3 * case.bound * rng.uniform(-1, 1, n * m)
        box = [(-case.bound, case.bound)] * (n * m)
        options = {"maxiter": 500, "ftol": 1e-15, "gtol": 1e-12}
        done = minimize(infidelity, first, jac=True, method="L-BFGS-B", bounds=box, options=options)
        return np.asarray(done.x.reshape(n, m)) if done.fun < _REACHED else None

    return start


def qutip(case: BoundedCase) -> Start:
    """qutip-qtrl's pulse optimiser (GRAPE, L-BFGS-B), phase free."""
    import qutip_qtrl.pulseoptim as optimiser
    from qutip import Qobj

    if not case.up_to_phase:
        raise ComputationError("of gates up to a phase alone (its option for a fixed phase fails, version 0.1)")
    drift = Qobj(1j * case.group.hat(case.drift))
    controls = [Qobj(1j * matrix) for matrix in case.group.hat(case.directions)]
    one = Qobj(np.eye(case.group.degree))

    def start(target: Array, seed: int) -> Array | None:
        np.random.seed(seed)  # qutip draws from the global generator
        # U' = -i H U: the target's inverse order does not matter for the comparison, its transpose serves
        result = optimiser.optimize_pulse_unitary(
            drift,
            controls,
            one,
            Qobj(target),
            num_tslots=case.pieces,
            evo_time=case.duration,
            amp_lbound=-case.bound,
            amp_ubound=case.bound,
            fid_err_targ=_REACHED,
            max_iter=500,
            phase_option="PSU",
            init_pulse_type="RND",
            pulse_scaling=0.3 * case.bound,
        )
        # it plays the pieces from the right; ours is the left-invariant order
        return np.asarray(result.final_amps)[::-1] if result.fid_err < _REACHED else None

    return start


def ipopt(case: BoundedCase) -> Start:
    """CasADi's Opti, multiple shooting by Runge-Kutta steps, least energy, ipopt; all entries of the end, minimal rank left to ipopt."""
    import casadi as ca

    d, m, n = case.group.degree, len(case.directions), case.pieces
    if case.unitary:

        def embedded(A: Array) -> Array:
            """Complex matrices as real ones of twice the size."""
            return np.block([[A.real, -A.imag], [A.imag, A.real]])

        d *= 2
    else:

        def embedded(A: Array) -> Array:
            return A

    drift = embedded(case.group.hat(case.drift))
    controls = [embedded(matrix) for matrix in case.group.hat(case.directions)]
    opti = ca.Opti()
    U = opti.variable(m, n)
    goal, phase = opti.parameter(d, d), opti.variable()
    x, u = ca.SX.sym("x", d, d), ca.SX.sym("u", m)
    A = ca.DM(drift) + sum(u[i] * ca.DM(controls[i]) for i in range(m))
    steps, X = 4, x
    h = case.duration / n / steps
    for _ in range(steps):
        k1 = X @ A
        k2 = (X + h / 2 * k1) @ A
        k3 = (X + h / 2 * k2) @ A
        k4 = (X + h * k3) @ A
        X = X + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    step = ca.Function("step", [x, u], [X])
    states: list[Any] = [ca.DM.eye(d)]
    for k in range(n):
        states.append(opti.variable(d, d))
        opti.subject_to(ca.vec(states[k + 1] - step(states[k], U[:, k])) == 0)
    half = d // 2
    if case.up_to_phase:
        c, s = ca.cos(phase), ca.sin(phase)
        turned = ca.vertcat(
            c * goal[:half, :half] - s * goal[half:, :half], s * goal[:half, :half] + c * goal[half:, :half]
        )
        miss = states[n][:, :half] - turned
    else:
        opti.subject_to(phase == 0)
        miss = states[n][:, :half] - goal[:, :half] if case.unitary else states[n] - goal
    opti.subject_to(ca.vec(miss) == 0)
    opti.subject_to(opti.bounded(-case.bound, ca.vec(U), case.bound))
    opti.minimize(ca.sumsqr(U) * case.duration / n)
    quiet: dict[str, Any] = {"print_level": 0, "max_iter": 150, "sb": "yes"}
    options: dict[str, Any] = {"expand": True, "print_time": False}
    opti.solver("ipopt", options, quiet)

    def start(target: Array, seed: int) -> Array | None:
        rng = np.random.default_rng(seed)
        first = 0.3 * case.bound * rng.uniform(-1, 1, (m, n))
        opti.set_value(goal, embedded(target))
        opti.set_initial(U, first)
        opti.set_initial(phase, 0.0)
        X = np.eye(case.group.degree, dtype=case.group.basis.dtype)
        pieces = expm(case.group.hat(case.duration / n * (case.drift + first.T @ case.directions)))
        for k in range(n):
            X = X @ pieces[k]
            opti.set_initial(states[k + 1], embedded(X))
        try:
            found = opti.solve()
        except RuntimeError:  # whatever ipopt gave up for
            return None
        return np.asarray(found.value(U)).reshape(m, n).T

    return start


PEERS: dict[str, Callable[[BoundedCase], Start]] = {
    "GRAPE in forty lines": grape,
    "qutip-qtrl GRAPE": qutip,
    "CasADi + ipopt": ipopt,
    "crocoddyl, box-FDDP": crocoddyl,
}
