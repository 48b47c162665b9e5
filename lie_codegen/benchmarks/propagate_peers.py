"""The tools of the driven qubits in `lie-codegen bench propagate`, each in a process of its own (`turns.py`).

python -m lie_codegen.benchmarks.propagate_peers TOOL QUBITS MEMBERS RTOL
"""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.benchmarks.propagate_cases import Case, chain_case
from lie_codegen.benchmarks.rows import AbsentError
from lie_codegen.benchmarks.turns import answer, imported

if TYPE_CHECKING:
    from lie_codegen.groups.matrix_group import MatrixGroup
    from lie_codegen.signals.periodic_input import PeriodicInput

#: Gives the rows of X(T) of all members: (N, rows, d).
Call = Callable[[], Array]


def ours(case: Case, rtol: float) -> Call:
    """lc.propagator of the qubits, lc.simulate of the chains."""
    from lie_codegen.flow.propagator import propagator
    from lie_codegen.flow.simulate import simulate
    from lie_codegen.groups.catalogue_load import group
    from lie_codegen.signals.parametric_input import ParametricInput

    if case.qubits == 1:
        u = ParametricInput(("-s*cos(w*t)", "0", "-1"), ("s", "w"))
        U = propagator(group("su2"), u, duration=case.duration, rtol=rtol)
        if len(case.scales) == 1:
            return lambda: U(s=1.0, w=1.1).X[None, :1]
        return lambda: U.batch(s=case.scales, w=1.1).X[:, :1]
    G, chain = chain_input(case.qubits)
    return lambda: simulate(G, chain, t=[0, case.duration], rtol=rtol).X[-1][None]


def chain_input(qubits: int) -> tuple[MatrixGroup, PeriodicInput]:
    """The group of that many qubits and what drives them, as our own functions take them."""
    from lie_codegen.groups.catalogue_load import as_group
    from lie_codegen.groups.pauli import pauli
    from lie_codegen.signals.periodic_input import PeriodicInput

    G = as_group(pauli(qubits))  # type: ignore[arg-type]
    texts = dict.fromkeys(G.labels, "0")
    for k in range(qubits):
        place = ["I"] * qubits
        texts["".join([*place[:k], "Z", *place[k + 1 :]])] = "-1"
        texts["".join([*place[:k], "X", *place[k + 1 :]])] = f"-cos({11 + 2 * k}*t/10)"
    for k in range(qubits - 1):
        texts["".join(["I"] * k + ["Z", "Z"] + ["I"] * (qubits - k - 2))] = "-6/10"
    return G, PeriodicInput(tuple(texts.values()))


def real_form(case: Case) -> tuple[Array, Array, Array]:
    """(2d, 2d) matrices of Y' = (C + s sum_k cos(w_k t) D_k) Y, a column (re x, im x) for each row x of X, and Y(0)."""

    def real(A: Any) -> Array:
        M = np.asarray(A).T
        return np.block([[M.real, -M.imag], [M.imag, M.real]])

    d = len(case.constant)
    return real(case.constant), np.array([real(A) for A in case.driven]), np.eye(2 * d)[:, : case.rows]


def heyoka(case: Case, rtol: float) -> Call:
    """Taylor series compiled for the system; members eight at a time."""
    hk = imported("heyoka")
    C, D, start = real_form(case)
    size, rows = start.shape
    y = np.array(hk.make_vars(*[f"y{i}" for i in range(size * rows)])).reshape(size, rows)
    wave = [hk.cos(hk.expression(float(w)) * hk.time) * hk.par[0] for w in case.rates]
    system = []
    for i in range(size):
        for r in range(rows):
            terms = [float(C[i, j]) * y[j, r] for j in np.flatnonzero(C[i])]
            terms += [
                wave[k] * (float(D[k, i, j]) * y[j, r]) for k in range(len(wave)) for j in np.flatnonzero(D[k, i])
            ]
            system.append((y[i, r], hk.sum(terms)))
    compact, d, N, flat = case.qubits > 1, size // 2, len(case.scales), start.ravel()
    if N == 1:
        one = hk.taylor_adaptive(system, list(flat), tol=rtol, compact_mode=compact, pars=[1.0])

        def single() -> Array:
            one.time = 0.0
            one.state[:] = flat
            one.propagate_until(case.duration)
            Y = one.state.reshape(size, rows)
            return np.asarray(Y[:d] + 1j * Y[d:]).T[None]

        return single
    lanes = 8
    many = hk.taylor_adaptive_batch(system, np.repeat(flat[:, None], lanes, 1), tol=rtol, compact_mode=compact, pars=np.ones((1, lanes)))  # fmt: skip

    def batch() -> Array:
        found = np.empty((N, 1, d), complex)
        for first in range(0, N, lanes):
            scales = np.resize(case.scales[first : first + lanes], lanes)
            many.set_time([0.0] * lanes)
            many.state[:] = flat[:, None]
            many.pars[0] = scales
            many.propagate_until([case.duration] * lanes)
            found[first : first + lanes, 0] = (many.state[:d] + 1j * many.state[d:]).T[: N - first]
        return found

    return batch


def qutip(case: Case, rtol: float) -> Call:
    """sesolve by Verner's method of order 9."""
    qt = imported("qutip")
    if len(case.scales) > 1:
        raise AbsentError("one trajectory at a time")
    # x^T' = A^T x^T = -i (i A^T) x^T
    terms: list[Any] = [qt.Qobj(1j * case.constant.T)]
    for w, A in zip(case.rates, case.driven, strict=True):
        terms.append([qt.Qobj(1j * A.T), lambda t, w=w: np.cos(w * t)])
    H = qt.QobjEvo(terms)
    d = len(case.constant)
    start = qt.basis(d, 0) if case.rows == 1 else qt.qeye(d)
    options = {
        "method": "vern9",
        "rtol": rtol,
        "atol": rtol,
        "nsteps": 10**7,
        "store_final_state": True,
        "progress_bar": "",
    }
    return lambda: qt.sesolve(H, start, [0.0, case.duration], options=options).final_state.full().T[None]


def diffrax(case: Case, rtol: float) -> Call:
    """Dopri8 with a PID controller, jitted; members by vmap."""
    jax = imported("jax")
    jax.config.update("jax_enable_x64", True)
    dfx, jnp = imported("diffrax"), imported("jax.numpy")
    C, D, start = (jnp.asarray(each) for each in real_form(case))
    rates, d = jnp.asarray(case.rates), len(case.constant)

    def solve(scale: Any) -> Any:
        def rate(t: Any, y: Any, args: Any) -> Any:
            return C @ y + scale * (jnp.tensordot(jnp.cos(rates * t), D, 1) @ y)

        run = dfx.diffeqsolve(
            dfx.ODETerm(rate), dfx.Dopri8(), 0.0, case.duration, 0.05, start, max_steps=10**6,
            stepsize_controller=dfx.PIDController(rtol=rtol, atol=rtol), saveat=dfx.SaveAt(t1=True),
        )  # fmt: skip
        return run.ys[-1]

    many = jax.jit(jax.vmap(solve))
    scales = jnp.asarray(case.scales)

    def call() -> Array:
        y = np.asarray(many(scales))
        return np.swapaxes(y[:, :d] + 1j * y[:, d:], 1, 2)

    return call


def dynamiqs(case: Case, rtol: float) -> Call:
    """sesolve by Dopri8 in double precision, which it jits; members as a batch, all columns of a chain as another."""
    dq, jnp = imported("dynamiqs"), imported("jax.numpy")
    dq.set_precision("double")
    dq.set_progress_meter(False)
    d, scales = len(case.constant), jnp.asarray(case.scales)

    def wave(w: float) -> Callable[[Any], Any]:
        return lambda t: scales * jnp.cos(w * t) if len(scales) > 1 else jnp.cos(w * t)

    H = dq.constant(1j * case.constant.T)
    for w, A in zip(case.rates, case.driven, strict=True):
        H = H + dq.modulated(wave(w), 1j * A.T)
    columns = np.eye(d, dtype=complex)[: case.rows, :, None]
    start, method = columns[0] if case.rows == 1 else columns, dq.method.Dopri8(rtol=rtol, atol=rtol)

    def call() -> Array:
        end = dq.sesolve(H, start, [0.0, case.duration], method=method, save_states=False).final_state
        return np.asarray(end.to_numpy()).reshape(len(scales), case.rows, d)

    return call


def scipy(case: Case, rtol: float) -> Call:
    """solve_ivp, DOP853."""
    return _solve_ivp(case, rtol, _python_rate(case))


def numba(case: Case, rtol: float) -> Call:
    """The same with the right side compiled by numba."""
    nb = imported("numba")
    A0, D, rates = (
        np.ascontiguousarray(case.constant.T),
        np.ascontiguousarray(np.swapaxes(case.driven, 1, 2)),
        case.rates,
    )

    rows = case.rows

    @nb.njit  # type: ignore[untyped-decorator]
    def rate(t: float, y: Any) -> Any:
        d = A0.shape[0]
        out = np.zeros(len(y), np.complex128)
        for i in range(d):
            for j in range(d):
                value = A0[i, j]
                for k in range(len(rates)):
                    if D[k, i, j] != 0:
                        value += np.cos(rates[k] * t) * D[k, i, j]
                if value != 0:
                    for r in range(rows):
                        out[i * rows + r] += value * y[j * rows + r]
        return out

    return _solve_ivp(case, rtol, rate)


def _python_rate(case: Case) -> Callable[[float, Any], Any]:
    A0, D, rates = case.constant.T, np.swapaxes(case.driven, 1, 2), case.rates
    if case.qubits == 1:  # scalars are faster than small matrices

        def scalar(t: float, y: Any) -> list[complex]:
            off = 1j * np.cos(1.1 * t) / 2
            return [0.5j * y[0] + off * y[1], off * y[0] - 0.5j * y[1]]

        return scalar
    d = len(A0)
    return lambda t, y: ((A0 + np.tensordot(np.cos(rates * t), D, 1)) @ y.reshape(d, -1)).ravel()


def _solve_ivp(case: Case, rtol: float, rate: Callable[[float, Any], Any]) -> Call:
    from scipy.integrate import solve_ivp

    if len(case.scales) > 1:
        raise AbsentError("one trajectory at a time")
    d = len(case.constant)
    start = np.ascontiguousarray(np.eye(d, dtype=complex)[:, : case.rows]).ravel()

    def call() -> Array:
        end = solve_ivp(rate, (0, case.duration), start, method="DOP853", rtol=rtol, atol=rtol).y[:, -1]
        return np.asarray(end.reshape(d, -1).T[None])

    return call


TOOLS: Mapping[str, Callable[[Case, float], Call]] = {
    "lie_codegen": ours, "heyoka": heyoka, "qutip vern9": qutip, "dynamiqs Dopri8": dynamiqs, "diffrax Dopri8": diffrax, "scipy DOP853": scipy,
    "scipy + numba": numba,
}  # fmt: skip


if __name__ == "__main__":
    answer(lambda: (TOOLS[sys.argv[1]](chain_case(*map(int, sys.argv[2:4])), float(sys.argv[4])), np.asarray))
