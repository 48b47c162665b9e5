"""lie-codegen bench neighbours: exp and log of SE(3) where users look first, time and error, near the identity and near half a turn.

Errors are relative, of the rotation's part and of the translation's apart, against 60 digits: exp and log at angles down to 1e-14 and at
zero, log at half a turn less 0.1 down to half a turn less 1e-14. A library that gives NaN or another branch has an error of 1 or more.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.benchmarks.peers import jax_modules, need
from lie_codegen.benchmarks.rows import AbsentError
from lie_codegen.benchmarks.timing import interleaved
from lie_codegen.groups.build import build

#: (w, v), or (v, w) where a library has the translation first: its own inverse.
_SWAP = [3, 4, 5, 0, 1, 2]
_ANGLES = (0.0, *(10.0**-k for k in range(1, 15)))
_BATCH = 4_096
One = Callable[[Array], Array]


@dataclass(frozen=True)
class Neighbour:
    """Functions of one library, in our order of coordinates.

    Attributes:
        exp: (6,) -> (4, 4).
        log: back; None where a library has none.
        many: (N, 6) -> (N, 4, 4); None where a library has no batches.
    """

    exp: One
    log: One | None = None
    many: One | None = None


@dataclass(frozen=True)
class NeighbourRow:
    """What was measured of one library.

    Attributes:
        who: the library.
        exp_ns, log_ns: a call with numpy arrays in and out.
        batch_ns: exp of a sample in a batch of 4,096.
        exp_near, log_near: worst error near the identity.
        log_cut: worst error of log near half a turn.
        note: why there are no numbers.
    """

    who: str
    exp_ns: float = float("nan")
    log_ns: float = float("nan")
    batch_ns: float = float("nan")
    exp_near: float = float("nan")
    log_near: float = float("nan")
    log_cut: float = float("nan")
    note: str = ""


def ours() -> Neighbour:
    """Generated C."""
    lib = build("se3")
    out = np.empty((_BATCH, 4, 4))
    return Neighbour(lib.exp, lib.log, lambda x: lib.exp.batch(x, out=out))


def jaxlie() -> Neighbour:
    """Jitted, in double precision."""
    jax, _ = jax_modules()
    SE3, order = need("jaxlie").SE3, np.array(_SWAP)
    exp = jax.jit(lambda x: SE3.exp(x[order]).as_matrix())
    log = jax.jit(lambda X: SE3.from_matrix(X).log()[order])
    many = jax.jit(jax.vmap(exp))
    return Neighbour(lambda x: np.asarray(exp(x)), lambda X: np.asarray(log(X)), lambda x: np.asarray(many(x)))


def pinocchio() -> Neighbour:
    """Its bindings of C++, exp6 and log6."""
    pin = need("pinocchio")
    return Neighbour(lambda x: pin.exp6(x[_SWAP]).homogeneous, lambda X: pin.log6(pin.SE3(X)).vector[_SWAP])


def gtsam() -> Neighbour:
    """Its bindings of C++, Pose3."""
    Pose3 = need("gtsam").Pose3
    return Neighbour(lambda x: Pose3.Expmap(x).matrix(), lambda X: Pose3.Logmap(Pose3(X)))


def scipy() -> Neighbour:
    """RigidTransform by exponential coordinates."""
    from scipy.spatial import transform

    if not hasattr(transform, "RigidTransform"):
        raise AbsentError("this SciPy has no RigidTransform")
    T = transform.RigidTransform
    return Neighbour(
        lambda x: T.from_exp_coords(x).as_matrix(), lambda X: T.from_matrix(X).as_exp_coords(), lambda x: T.from_exp_coords(x).as_matrix()
    )  # fmt: skip


def liecasadi() -> Neighbour:
    """Functions of CasADi, called with numpy arrays."""
    import casadi as ca

    lie, x, X = need("liecasadi"), ca.SX.sym("x", 6), ca.SX.sym("X", 4, 4)
    log = ca.Function("log", [X], [lie.SE3.from_matrix(X).log().vec[_SWAP]])
    return _of_casadi(x, lie.SE3Tangent(x[_SWAP]).exp().as_matrix(), lambda X: np.asarray(log(X).full().ravel()))


def cyecca() -> Neighbour:
    """Likewise; a logarithm of matrices it has none."""
    import casadi as ca

    lie, x = need("cyecca.lie"), ca.SX.sym("x", 6)
    return _of_casadi(x, lie.se3.elem(x[_SWAP]).exp(lie.SE3Quat).to_Matrix(), None)


def _of_casadi(x: Any, exp: Any, log: One | None) -> Neighbour:
    import casadi as ca

    one = ca.Function("exp", [x], [exp])
    many = one.map(_BATCH)
    return Neighbour(lambda x: one(x).full(), log, lambda x: many(x.T).full().reshape(4, -1, 4).swapaxes(0, 1))


LIBRARIES: Mapping[str, Callable[[], Neighbour]] = {
    "lie_codegen": ours, "pinocchio": pinocchio, "gtsam": gtsam, "scipy RigidTransform": scipy, "jaxlie, jit": jaxlie,
    "liecasadi f(numpy)": liecasadi, "cyecca f(numpy)": cyecca,
}  # fmt: skip


def bench_neighbours(
    rounds: int = 15, say: Callable[[str], None] = lambda text: None, libraries: Sequence[str] = tuple(LIBRARIES)
) -> list[NeighbourRow]:
    """Each library compared with 60 digits, then all timed in turn."""
    x = np.array([0.1, 0.2, 0.3, 0.4, 0.5, 0.6])
    batch = np.tile(np.random.default_rng(0).uniform(-1, 1, (64, 6)), (_BATCH // 64, 1))
    X, images = exact_exp(x), np.array([exact_exp(row) for row in batch[:64]])
    taking: dict[str, Neighbour] = {}
    rows: dict[str, NeighbourRow] = {}
    for name in libraries:
        say(name)
        try:
            made = LIBRARIES[name]()
            _same(made.exp(x), X)
            if made.log is not None:
                _same(made.log(X), x)
            if made.many is not None:
                _same(made.many(batch)[:64], images)
        except AbsentError as reason:
            rows[name] = NeighbourRow(name, note=str(reason))
        except Exception as error:  # whatever a foreign library raises, the others go on
            rows[name] = NeighbourRow(name, note=f"{type(error).__name__}: {str(error).partition(chr(10))[0][:120]}")
        else:
            taking[name] = made
    say("times")
    calls = (
        interleaved({name: _work(each.exp, x) for name, each in taking.items()}, 1, rounds),
        interleaved({name: _work(each.log, X) for name, each in taking.items() if each.log}, 1, rounds),
        interleaved({n: _work(each.many, batch) for n, each in taking.items() if each.many}, _BATCH, rounds),
    )
    for name, each in taking.items():
        exp, log, many = (found[name].nanoseconds.low if name in found else float("nan") for found in calls)
        rows[name] = NeighbourRow(name, exp, log, many, *errors(each))
    return [rows[name] for name in libraries]


def _work(function: One, given: Array) -> Callable[[], Array]:
    return lambda: function(given)


def _same(found: Array, wanted: Array) -> None:
    if np.shape(found) != wanted.shape or not np.max(np.abs(found - wanted)) < 1e-7:
        raise AbsentError("computes something else")


def errors(library: Neighbour) -> tuple[float, float, float]:
    """The worst of exp and of log near the identity, and of log near half a turn."""
    axis, v = np.array([2.0, -3.0, 6.0]) / 7, np.array([0.3, -0.5, 0.4])
    near = [np.append(angle * axis, v) for angle in _ANGLES]
    cut = [np.append((np.pi - angle) * axis, v) for angle in _ANGLES[1:]]
    images = [exact_exp(x) for x in near]
    exps = [_error(library.exp(x)[:3], X[:3], 3, 1) for x, X in zip(near, images, strict=True)]
    if library.log is None:
        return max(exps), float("nan"), float("nan")
    logs = [_error(library.log(X), x, 3, 0) for x, X in zip(near, images, strict=True)]
    cuts = [_error(library.log(exact_exp(x)), x, 3, 0) for x in cut]
    return max(exps), max(logs), max(cuts)


def _error(found: Array, wanted: Array, place: int, axis: int) -> float:
    """Relative, of the parts before and behind the place apart; 1 of what is no number."""
    parts = [np.split(np.asarray(each), [place], axis=axis) for each in (found, wanted)]
    worst = 0.0
    for got, right in zip(*parts, strict=True):
        size = np.max(np.abs(right))
        off = float(np.max(np.abs(got - right)) / (size if size > 0 else 1.0))
        worst = max(worst, off if np.isfinite(off) else 1.0)
    return worst


def exact_exp(x: Array) -> Array:
    """The double nearest to exp of (w, v) of SE(3), by the series of the 4 x 4 matrix in 60 digits."""
    import mpmath as mp

    with mp.workdps(60):
        w1, w2, w3, v1, v2, v3 = (mp.mpf(float(each)) for each in x)
        A = mp.matrix([[0, -w3, w2, v1], [w3, 0, -w1, v2], [-w2, w1, 0, v3], [0, 0, 0, 0]])
        return np.array(mp.expm(A, method="taylor").tolist(), dtype=float)


def table(rows: Sequence[NeighbourRow]) -> str:
    """The rows as text."""
    lines = [
        f"{'SE(3)':22} {'exp, ns':>9} {'log, ns':>9} {'batch, ns':>10} {'exp near 1':>11} {'log near 1':>11} {'log near pi':>12}"
    ]
    for row in rows:
        if row.note:
            lines.append(f"{row.who:22} -  {row.note}")
            continue
        numbers = (
            f"{row.exp_ns:9.0f} {row.log_ns:9.0f} {row.batch_ns:10.1f}",
            f"{row.exp_near:11.1e} {row.log_near:11.1e} {row.log_cut:12.1e}",
        )
        lines.append(f"{row.who:22} {' '.join(numbers)}".replace("nan", "  -"))
    return "\n".join(lines)
