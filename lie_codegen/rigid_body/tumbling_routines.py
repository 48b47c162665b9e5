"""What a tumbling body's kernels are made of: its torques over any arithmetic, and the loops over the torus of its free motion."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.averaging.phase_routine import no_tangent
from lie_codegen.kernel.arithmetic import Arithmetic, FloatArithmetic
from lie_codegen.kernel.elliptic import DEPTH
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.plain_data import Definition
from lie_codegen.kernel.routine import Routine
from lie_codegen.rigid_body.rotation_formulas import about_third, apply, multiply, transpose
from lie_codegen.rigid_body.rotation_kernels import TERMS
from lie_codegen.rigid_body.torque_model import BODY, TorqueModel, motion_of, point_of
from lie_codegen.rigid_body.torus_map import NODES as TORUS_NODES
from lie_codegen.rigid_body.torus_map import SMALLEST_DIVISOR, torus_series
from lie_codegen.rigid_body.tumbling_tangent import LitArc, average_tangent, plate_share


def average_routine(model: TorqueModel, namespace: str) -> Routine:
    """(H, D, environment, paper, inertia, nodes) -> mean X N, D', mean omega.N, k, Lambda, L, r3, c."""
    r, k, A, w = Port("r", (3,)), Port("k", ()), Port("A", (3, 3)), Port("w", (3,))
    H, D, phi, e = Port("H", (3,)), Port("D", ()), Port("phi", ()), Port("e", (model.size,))
    paper, inertia = BODY
    moduli = Port("moduli", (DEPTH,))
    N = Port("N", (3,))

    def smooth(ops: Arithmetic, C: Any, alpha: Any, A: Any, w: Any, e: Any, paper: Any) -> tuple[Any, ...]:
        X = multiply(C, about_third(ops, alpha, A))
        inward = transpose(paper)
        N = apply(inward, model.smooth(ops, multiply(X, inward), apply(paper, w), e))
        return N, apply(X, N)

    names = {each: f"{namespace}_{each}" for each in ("start", "node", "smooth")}
    helpers = [
        Kernel("start", namespace, (H, D, inertia),
               (Port("C", (3, 3)), Port("L", ()), r, k, Port("rate", ()), Port("c", ()), moduli), motion_of),
        Kernel("node", namespace, (r, moduli, phi), (Port("l", (3,)), A), point_of),
    ]  # fmt: skip
    if model.has_smooth:
        helpers.append(
            Kernel(
                "smooth",
                namespace,
                (Port("C", (3, 3)), Port("alpha", ()), A, w, e, paper),
                (N, Port("XN", (3,))),
                smooth,
            )
        )
    plates = model.plates()
    views = tuple(Definition(numbers=tuple(map(repr, numbers)), place=place) for numbers, place in plates)
    settings = (
        ("key", model.key), ("depth", DEPTH), ("environment", model.size), ("plates", views), ("turns", model.turns), ("start", names["start"]), ("node", names["node"]),
        ("smooth", names["smooth"] if model.has_smooth else ""),
    )  # fmt: skip

    def twin(values: Sequence[float]) -> Array:
        return _twin(model, np.asarray(values, dtype=float))

    return Routine(
        f"{namespace}_average",
        17 + model.size,
        10,
        "tumbling_average.c.jinja",
        settings,
        tuple(helpers),
        twin,
        average_tangent(model, namespace, smooth, views),
    )


def torus_routine(model: TorqueModel, namespace: str) -> Routine:
    """(H, D, phi, alpha hat, m, series of alpha, environment, paper, inertia) -> W of (H, D), largest |N| on the torus."""
    A, w, e, N = Port("A", (3, 3)), Port("w", (3,)), Port("e", (model.size,)), Port("N", (3,))
    paper, inertia = BODY
    moduli = Port("moduli", (DEPTH,))
    H, D, r, k = Port("H", (3,)), Port("D", ()), Port("r", (3,)), Port("k", ())

    def sample(ops: Arithmetic, C: Any, alpha: Any, A: Any, w: Any, e: Any, paper: Any) -> tuple[Any, ...]:
        X, inward = multiply(C, about_third(ops, alpha, A)), transpose(paper)
        N = apply(inward, model.total(ops, multiply(X, inward), apply(paper, w), e))
        return N, apply(X, N)

    helpers = (
        Kernel("torus_start", namespace, (H, D, inertia),
               (Port("C", (3, 3)), Port("L", ()), r, k, Port("rate", ()), Port("c", ()), moduli), motion_of),
        Kernel("torus_node", namespace, (r, moduli, Port("phi", ())), (Port("l", (3,)), A), point_of),
        Kernel("torus_sample", namespace, (Port("C", (3, 3)), Port("alpha", ()), A, w, e, paper),
               (N, Port("XN", (3,))), sample),
    )  # fmt: skip

    def twin(values: Sequence[float]) -> Array:
        ops: Any = FloatArithmetic()
        H, D, phi, hat, m = list(values[:3]), *(float(each) for each in values[3:7])
        b, rest = np.asarray(values[7 : 7 + TERMS]), list(values[7 + TERMS :])
        e, axes = rest[: model.size], np.reshape(rest[model.size : model.size + 9], (3, 3))
        moments = np.asarray(rest[model.size + 9 :])
        C, L, r, _, rate, _, moduli = motion_of(ops, H, D, moments.tolist())

        def at(phi: float, alpha: float) -> tuple[Array, Array]:
            l, A = point_of(ops, r, moduli, phi)  # noqa: E741
            w = L * np.array(l) / moments
            N, moved = (np.array(each) for each in sample(ops, C, alpha, A, w.tolist(), e, axes.tolist()))
            return np.append(moved, 2 * np.sum((moments - moments[2]) * w * N)), N

        def samples(phi: Array, alpha: Array) -> tuple[Array, Array]:
            found = [at(float(p), float(a)) for p, a in zip(phi.ravel(), alpha.ravel(), strict=True)]
            return tuple(np.array(each).reshape((*phi.shape, -1)) for each in zip(*found, strict=True))  # type: ignore[return-value]

        series = torus_series(samples, float(rate), m, b)
        return np.append(series.correction(phi, hat), series.torque)

    cosines = tuple(repr(float(each)) for each in np.cos(2 * np.pi * np.arange(TORUS_NODES) / TORUS_NODES))
    settings = (
        ("key", model.key), ("depth", DEPTH), ("environment", model.size), ("nodes", TORUS_NODES), ("terms", TERMS), ("cosines", cosines),
        ("smallest", repr(SMALLEST_DIVISOR)), ("start", helpers[0].symbol), ("node", helpers[1].symbol), ("sample", helpers[2].symbol),
    )  # fmt: skip
    return Routine(
        f"{namespace}_torus", 19 + TERMS + model.size, 5, "tumbling_torus.c.jinja", settings, helpers, twin, no_tangent
    )


def _twin(model: TorqueModel, values: Array) -> Array:
    """The averages by Python."""
    ops: Any = FloatArithmetic()
    H, D, e = values[:3].tolist(), float(values[3]), values[4 : 4 + model.size].tolist()
    paper, inertia = values[4 + model.size : 13 + model.size].reshape(3, 3), values[13 + model.size : 16 + model.size]
    C, L, r, k, rate, c, moduli = motion_of(ops, H, D, inertia.tolist())
    count = int(values[-1]) or model.phases(k)
    total, inward = np.zeros(4), paper.T
    weights = 2 * (inertia - inertia[2])
    for j in range(count):
        direction, A = (np.array(each) for each in point_of(ops, r, moduli, j / count))
        w = L * direction / inertia

        def add(alpha: float, N: Array, weight: float, A: Array = A, w: Array = w, total: Array = total) -> None:
            X = np.array(C) @ np.array(about_third(ops, alpha, A.tolist()))
            total[:] += weight / count * np.append(X @ N, weights @ (w * N))

        if model.has_smooth:
            for i in range(model.turns):
                alpha = 2 * np.pi * i / model.turns
                X = np.array(C) @ np.array(about_third(ops, alpha, A.tolist())) @ inward
                N = inward @ np.array(model.smooth(ops, X.tolist(), (paper @ w).tolist(), e))
                add(alpha, N, 1 / model.turns)
        for numbers, place in model.plates():
            n, centre, d = A @ inward @ numbers[:3], A @ inward @ numbers[3:6], np.array(C).T @ e[place : place + 3]
            arc = LitArc.of(n[2] * d[2], complex(n[0] * d[0] + n[1] * d[1], n[0] * d[1] - n[1] * d[0]))
            moved, slope = plate_share(n, centre, d, A @ (weights * w), *arc.means, numbers[6:])
            total += np.append(np.array(C) @ moved, slope) / count
    power = (2 * np.dot(H, total[:3]) - total[3]) / (2 * inertia[2])  # D = H.H - 2 I3 T
    return np.concatenate([total, [power, k, rate, L, r[2], c]])
