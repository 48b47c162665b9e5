"""Targets and states a little off the group: refused by an error of ours, projected with notice, or right within 1 % of the projected.

Independent of the package: elements come from scipy.linalg.expm, the nearest rotation from an SVD.
"""

from __future__ import annotations

import warnings
from collections.abc import Iterator
from typing import Any

import numpy as np
import scipy.linalg

import lie_codegen as lc
from lie_codegen.errors import LieCodegenError

#: Sizes of the noise.
SIZES = (1e-12, 1e-10, 1e-8, 1e-6, 1e-5, 3e-5, 1e-4, 1e-3)
METHODS = ("auto", "optimal", "circle", "direct", "swing_twist", "area_rule")
#: Statuses by which a plan claims to reach its target.
REACHED = {"SOLVED", "LOCAL", "EXTREMAL", "ADMISSIBLE"}


def nearest_rotation(X: Any) -> Any:
    """The rotation nearest to a matrix: U V^T of its SVD, with the sign of the determinant in the last."""
    U, _, V = np.linalg.svd(X)
    return U @ np.diag([1.0] * (len(X) - 1) + [np.linalg.det(U @ V)]) @ V


def rotations(rng: np.random.Generator, count: int) -> Iterator[tuple[float, Any]]:
    """(size of the noise, matrix near SO(3))."""
    for k in range(count):
        w = rng.normal(size=3)
        W = np.array([[0, -w[2], w[1]], [w[2], 0, -w[0]], [-w[1], w[0], 0]])
        size = SIZES[k % len(SIZES)]
        yield size, scipy.linalg.expm(W) + size * rng.normal(size=(3, 3))


def look_at_plan(size: float, X: Any, method: str) -> str | None:
    """What is wrong with the plan to X, or None."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            plan = lc.steer("so3", X, ["w1", "w2"], 1.0, method)
        except LieCodegenError:
            return None
        R = nearest_rotation(X)
        exact = lc.steer("so3", R, ["w1", "w2"], 1.0, method)
    if plan.status.name in REACHED and not plan.error <= 1e-5:
        return f"{method}, noise {size:g}: status {plan.status.name}, error {plan.error:.1e}"
    if size >= 1e-8 and not plan.projected > 0:
        return f"{method}, noise {size:g}: taken without notice (projected = {plan.projected})"
    if not abs(plan.cost - exact.cost) <= 0.01 * exact.cost + 1e-12:
        return f"{method}, noise {size:g}: cost {plan.cost:.6g}, of the projected {exact.cost:.6g}"
    return None


def look_at_law(size: float, X: Any, law: Any, others: tuple[Any, ...]) -> str | None:
    """What is wrong with a law's output at X, or None: NaN, or near the output at the nearest rotation."""
    got, exact = (np.atleast_1d(np.asarray(law(each, *others)[0], dtype=float)) for each in (X, nearest_rotation(X)))
    if np.isnan(got).all() or np.abs(got - exact).max() <= 0.01 * np.abs(exact).max() + 10 * size:
        return None
    return f"{law.name}, noise {size:g}: {got}, at the projected {exact}"


def hunt(count: int, seed: int = 0, methods: tuple[str, ...] = METHODS) -> tuple[int, list[str]]:
    """(targets and states tried, finds)."""
    rng = np.random.default_rng(seed)
    tried, found = 0, []
    for size, X in rotations(rng, count):
        for method in methods:
            tried += 1
            found += [why] if (why := look_at_plan(size, X, method)) else []
    inertia = [1, 2, 2.5]
    attitude = lc.build([lc.attitude_law("pd", inertia=inertia, k_p=4, k_d=3)], name="hunted")
    law = attitude[attitude.kernels[0]]
    for size, X in rotations(rng, 4 * count):
        tried += 1
        others = tuple(np.zeros(port.shape) + 0.1 for port in law.inputs[1:])
        found += [why] if (why := look_at_law(size, X, law, others)) else []
    return tried, found
