"""lie-codegen bench propagate: driven qubits and long runs against general solvers, error beside every time.

Every result is compared with a stored or closed-form value before it is timed; a ratio is given only between runs whose errors
agree within a factor 3, or where ours is the smaller.
"""

from __future__ import annotations

import time
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.flow.propagator import Propagator, propagator
from lie_codegen.flow.simulate import simulate
from lie_codegen.groups.catalogue_load import group
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.groups.pauli import pauli
from lie_codegen.signals.parametric_input import ParametricInput
from lie_codegen.signals.periodic_input import PeriodicInput

#: X_11 and X_12 of X' = X iH, H = sigma_z/2 + cos(1.1 t) sigma_x/2, at t = 50.
_QUBIT = np.array([-0.689657341175016 + 0.652294314113328j, 0.0267674604084 + 0.313318340673063j])
#: What is wanted: largest processor time of ours, and the smallest ratio to scipy's DOP853.
_QUBIT_RATIO, _BATCH_LIMIT, _LONG_LIMIT = 40.0, 0.05, 0.5


@dataclass(frozen=True)
class PropagateRow:
    """One way to one result.

    Attributes:
        what: the system.
        who: the tool.
        rtol: the tolerance asked for.
        seconds: processor time of a call, the least of several.
        error: against the stored value; NaN where there is none.
        build: processor time of the first call less that of a later one.
    """

    what: str
    who: str
    rtol: float
    seconds: float
    error: float
    build: float


def bench_propagate(say: Callable[[str], None] = lambda text: None) -> tuple[list[PropagateRow], list[str]]:
    """The rows, and the targets that were missed."""
    rows: list[PropagateRow] = []
    su2 = group("su2")
    u = ParametricInput(("-2*a*cos(w*t)", "0", "-1"), ("a", "w"))
    for rtol in (1e-6, 1e-9, 1e-12):
        say(f"one qubit, {rtol:g}")
        U = propagator(su2, u, duration=50.0, rtol=rtol)
        rows.append(_row("qubit", "lie_codegen", rtol, partial(_call, U), _qubit_error))
        rows.append(_row("qubit", "scipy DOP853", rtol, partial(_scipy_qubit, rtol), _qubit_error, repeats=3))
    say("1000 amplitudes")
    U = propagator(su2, u, duration=50.0, rtol=1e-10)
    amplitudes = np.linspace(0.1, 1, 1000)
    rows.append(_row("1000 qubits", "lie_codegen", 1e-10, lambda: U.batch(a=amplitudes, w=1.1).X, _nothing, repeats=5))
    say("rotating field")
    so3, field = group("so3"), PeriodicInput(("3*cos(t)/10", "3*sin(t)/10", "0"))
    rows.append(
        _row(
            "so3, T = 5e4",
            "lie_codegen",
            1e-11,
            lambda: simulate(so3, field, t=[0, 5e4], rtol=1e-11).X[-1],
            _field_error,
            3,
        )
    )
    for qubits in (2, 3):
        say(f"chain of {qubits} qubits")
        G = _chain_group(qubits)
        chain = _chain(G.labels, qubits)
        rows.append(
            _row(
                f"chain of {qubits}",
                "lie_codegen",
                1e-11,
                partial(_end, G, chain),
                _unitary,
                5,
            )
        )
    return rows, _missed(rows)


def _row(
    what: str, who: str, rtol: float, call: Callable[[], Array], error: Callable[[Array], float], repeats: int = 20
) -> PropagateRow:
    start = time.process_time()
    found = call()
    first = time.process_time() - start
    times = []
    for _ in range(repeats):
        start = time.process_time()
        call()
        times.append(time.process_time() - start)
    return PropagateRow(what, who, rtol, min(times), error(found), max(0.0, first - min(times)))


def _call(U: Propagator) -> Array:
    return np.asarray(U(a=0.5, w=1.1).X)


def _end(G: MatrixGroup, u: PeriodicInput) -> Array:
    return np.asarray(simulate(G, u, t=[0, 50.0]).X[-1])


def _chain_group(qubits: int) -> MatrixGroup:
    found = pauli(qubits)
    return found if isinstance(found, MatrixGroup) else group("su2")


def _qubit_error(X: Array) -> float:
    return float(np.max(np.abs(X[0] - _QUBIT)))


def _nothing(X: Array) -> float:
    return float("nan")


def _unitary(X: Array) -> float:
    """|X X^H - 1|: there is no stored value of these."""
    return float(np.max(np.abs(X @ X.conj().T - np.eye(len(X)))))


def _field_error(X: Array) -> float:
    """X(T) = exp(T (0.3 e_1 + e_3)^) exp(-T e_3^), the angles reduced in extended precision."""
    from scipy.linalg import expm

    so3, T = group("so3"), np.longdouble(5e4)
    turn = 2 * np.longdouble("3.14159265358979323846264338328")
    rate = np.sqrt(np.longdouble("1.09"))
    axis = np.array([0.3, 0, 1]) / np.sqrt(1.09)
    exact = expm(so3.hat(axis) * float(np.fmod(T * rate, turn))) @ expm(so3.hat([0, 0, -float(np.fmod(T, turn))]))
    return float(np.max(np.abs(X - exact)))


def _scipy_qubit(rtol: float) -> Array:
    from scipy.integrate import solve_ivp

    def rate(t: float, y: Array) -> list[complex]:
        off = 1j * np.cos(1.1 * t) / 2
        return [0.5j * y[0] + off * y[1], off * y[0] - 0.5j * y[1]]

    start = np.array([1, 0], complex)
    return np.asarray(solve_ivp(rate, (0, 50), start, method="DOP853", rtol=rtol, atol=rtol).y[:, -1][None])


def _chain(labels: tuple[str, ...], qubits: int) -> PeriodicInput:
    """H = sum sigma_z/2 + ZZ neighbours * 3/10 + a drive cos((1.1 + k/5) t) sigma_x / 2 on each: -2 h_P on the basis -i P/2."""
    texts = dict.fromkeys(labels, "0")
    for k in range(qubits):
        place = ["I"] * qubits
        texts["".join([*place[:k], "Z", *place[k + 1 :]])] = "-1"
        texts["".join([*place[:k], "X", *place[k + 1 :]])] = f"-cos({11 + 2 * k}*t/10)"
    for k in range(qubits - 1):
        place = ["I"] * qubits
        texts["".join([*place[:k], "Z", "Z", *place[k + 2 :]])] = "-6/10"
    return PeriodicInput(tuple(texts.values()))


def _missed(rows: list[PropagateRow]) -> list[str]:
    by = {(row.what, row.who, row.rtol): row for row in rows}
    missed = []
    ours, theirs = by["qubit", "lie_codegen", 1e-12], by["qubit", "scipy DOP853", 1e-12]
    if ours.error <= 3 * theirs.error and theirs.seconds < _QUBIT_RATIO * ours.seconds:
        missed.append(
            f"qubit at 1e-12: {theirs.seconds / ours.seconds:.0f} times faster than scipy, wanted {_QUBIT_RATIO:g}"
        )
    if by["1000 qubits", "lie_codegen", 1e-10].seconds > _BATCH_LIMIT:
        missed.append("1000 qubits take longer than wanted")
    long = by["so3, T = 5e4", "lie_codegen", 1e-11]
    if long.seconds > _LONG_LIMIT or long.error > 1e-10:
        missed.append("the rotating field over 5e4 takes longer, or errs more, than wanted")
    return missed


def table(rows: list[PropagateRow], missed: list[str]) -> str:
    """The rows as text."""
    lines = [f"{'system':16} {'tool':14} {'rtol':>8} {'ms':>10} {'error':>9} {'build ms':>9}"]
    lines += [
        f"{r.what:16} {r.who:14} {r.rtol:8.0e} {1e3 * r.seconds:10.3f} {r.error:9.1e} {1e3 * r.build:9.1f}"
        for r in rows
    ]
    return "\n".join([*lines, *(f"missed: {text}" for text in missed)])
