"""One interval of the transcription, with derivatives written by hand where they are short on a group.

A stage is w = (S, v, s, h, r): the state S = (X, and xi to second order), the controls v, the duration s where it is free, the
motion h that the goal leaves free, and the change r of the controls. Over an interval X_next = X exp(Theta(q)), q = w without X, and
    dX_next = X_next hat(K dq),   K = J(Theta) dTheta/dq,   J(Theta) = I - ad/2 + ad^2/6 - ...,
    d2X_next = X_next (hat(K dq)^2 + hat(dJ[dTheta] dTheta) + hat(J d2Theta)).
First derivatives are those of the step to rounding; in the second ones dJ keeps its leading term [d, [Theta, d]] / 6, of
relative error |Theta|^2, and to second order Theta and xi are those of the midpoint rule: a Hessian shapes the steps of the
solver, not its solution.
"""

from __future__ import annotations

from itertools import combinations_with_replacement
from typing import Any

import numpy as np

from lie_codegen.groups.maps.element_pattern import pack, unpack
from lie_codegen.groups.maps.rkmk import times_taylor_exp
from lie_codegen.groups.matrix_group import MatrixGroup
from lie_codegen.kernel.brackets import bracket
from lie_codegen.kernel.casadi_arithmetic import CasadiArithmetic
from lie_codegen.kernel.linear import matmul
from lie_codegen.mechanics.driven_step import driven_increments
from lie_codegen.on_demand import casadi as ca
from lie_codegen.steering.transcription.stage_functions import StageFunctions, Symbols, named_function, symbols
from lie_codegen.steering.transcription.structure import Structure
from lie_codegen.steering.transcription.tangent import ad_matrix, push, pushed, wedge

_OPS = CasadiArithmetic(routines=False)
_EXPONENTIAL_DEGREE = 9
_SLOPE_DEGREE = 7


def interval(structure: Structure) -> StageFunctions:
    """The next (S, v, s, h), and the cost of the interval."""
    at, group, size = symbols(structure), structure.group, structure.size
    S, q = at.parts["X"], at.w[size:]
    duration = at.parts["s"] if structure.free_time else ca.SX(1)
    h, v, r = duration / structure.intervals, at.parts["v"], at.parts["r"]
    theta, change = _increments(structure, at, h)
    simple, simple_change = _midpoint(structure, at, h) if structure.second_order else (theta, change)
    E = times_taylor_exp(group, _OPS, _identity(group), ca.vertsplit(theta), _EXPONENTIAL_DEGREE)
    X = unpack(group, ca.vertsplit(S))
    moved = ca.vertcat(*[ca.SX(entry) for entry in pack(group, matmul(X, E))])
    rest = [v + r, at.parts["s"], at.parts["h"]]
    others, simple_others = ca.vertcat(*change, *rest), ca.vertcat(*simple_change, *rest)
    energy = ca.dot(at.parts["weights"], v * v + v * (v + r) + (v + r) ** 2) * h / 3
    cost = h + 1e-6 * energy if structure.free_time else energy
    rows = ca.vertcat(moved, others)

    ad = ad_matrix(group, theta)
    T = ca.jacobian(theta, q)
    K = T
    for order in range(_SLOPE_DEGREE, 1, -1):
        K = T - (ad @ K) / order
    moves = ca.horzcat(*[pushed(group, moved, matrix) for matrix in group.basis])
    carried = ca.jacobian(moved, S)
    jacobian = ca.vertcat(ca.horzcat(carried, moves @ K), ca.jacobian(others, at.w))

    factor, multipliers = ca.SX.sym("factor"), ca.SX.sym("multipliers", rows.numel())
    lam, mu = multipliers[:size], multipliers[size:]
    gradient, curve = _curvature(structure, at, (simple, T, K, ad), (moved, carried), lam)
    more = ca.hessian(factor * cost + ca.dot(mu, simple_others), at.w)[0]
    slope = ca.gradient(factor * cost + ca.dot(mu, others), at.w)
    inputs = {"w": at.w, "p": at.p}
    weighted = {**inputs, "factor": factor, "multipliers": multipliers}
    return StageFunctions(
        value=named_function("interval_value", inputs, [rows]),
        slope=named_function("interval_slope", inputs, [rows, jacobian]),
        curve=named_function("interval_curve", weighted, [ca.densify(gradient + slope), _symmetric(curve + more)]),
        rows=rows.numel(),
        cost=named_function("interval_cost", inputs, [cost]),
        steepness=named_function("interval_steepness", inputs, [ca.densify(ca.gradient(cost, at.w))]),
    )


def _symmetric(H: Any) -> Any:
    """H with its pattern made symmetric: a structural zero of one half may be a rounding error in the other."""
    return ca.triu2symm(ca.triu(H + 0 * H.T)) if H.sparsity() != H.sparsity().T else ca.triu2symm(ca.triu(H))


def _increments(structure: Structure, at: Symbols, h: Any) -> tuple[Any, list[Any]]:
    """Theta, and the next xi to second order."""
    group = structure.group
    v, r = at.parts["v"], at.parts["r"]
    spread = ca.DM(np.eye(group.dim)[:, list(structure.controls)])
    if not structure.second_order:
        first = at.parts["drift"] + spread @ v
        turn = bracket(_OPS, group.algebra, ca.vertsplit(first), ca.vertsplit(spread @ r))
        return h * (first + spread @ (r / 2)) + h * h / 12 * ca.vertcat(*[ca.SX(t) for t in turn]), []
    n = group.dim
    J, inverse = ([ca.vertsplit(each[i * n : (i + 1) * n]) for i in range(n)] for each in _masses(at, n))
    f0, fm, f1 = (ca.vertsplit(ca.SX(spread @ each)) for each in (v, v + r / 2, v + r))
    xi = ca.vertsplit(at.parts["xi"])
    theta, change = driven_increments(group, _OPS, xi, J, inverse, f0, fm, f1, h)
    return ca.vertcat(*theta), [at.parts["xi"] + ca.vertcat(*change)]


def _midpoint(structure: Structure, at: Symbols, h: Any) -> tuple[Any, list[Any]]:
    """Theta and the next xi by the midpoint rule: short enough to be differentiated twice."""
    group, n = structure.group, structure.group.dim
    J, inverse = (ca.reshape(each, n, n) for each in _masses(at, n))
    spread = ca.DM(np.eye(n)[:, list(structure.controls)])

    def change(xi: Any, force: Any) -> Any:
        return inverse @ (wedge(group, J @ xi).T @ xi + spread @ force)

    v, xi = at.parts["v"], at.parts["xi"]
    middle = xi + h / 2 * change(xi, v)
    return h * middle, [xi + h * change(middle, v + at.parts["r"] / 2)]


def _masses(at: Symbols, n: int) -> tuple[Any, Any]:
    masses = at.parts["masses"]
    return masses[: n * n], masses[n * n :]


def _curvature(
    structure: Structure,
    at: Symbols,
    turning: tuple[Any, Any, Any, Any],
    moving: tuple[Any, Any],
    lam: Any,
) -> tuple[Any, Any]:
    """The gradient and the Hessian of lam . X_next by w."""
    group, size = structure.group, structure.size
    (theta, T, K, ad), (moved, carried) = turning, moving
    weights = ca.vertcat(*[ca.dot(lam, pushed(group, moved, A)) for A in group.basis])
    # lam . dX_next = weights . J(Theta) dTheta, so the gradient by Theta is J^T weights: Horner's rule on J's series.
    pulled = weights
    for order in range(_SLOPE_DEGREE, 1, -1):
        pulled = weights - (ad.T @ pulled) / order
    # exp(xi) = 1 + xi + xi^2 / 2: the square, a matrix off the algebra, curves lam . X_next even where Theta is linear in w.
    twice = ca.SX(group.dim, group.dim)
    for i, j in combinations_with_replacement(range(group.dim), 2):
        A, B = group.basis[i], group.basis[j]
        if np.any(both := (A @ B + B @ A) / 2):
            twice[i, j] = twice[j, i] = ca.dot(lam, pushed(group, moved, both))
    # log(exp(-Theta) exp(Theta + d)) = J d + [d, [Theta, d]]/12 + ...: weights on the bracket are a quadratic form in d, which the
    # sum with its transpose below makes symmetric. Brackets with more Thetas are left out: the gradient, which decides where
    # the solver ends, has no such error, and a step with a Hessian that is slightly off is only slightly longer or shorter.
    bent = wedge(group, weights) @ ad
    # The curvature of Theta itself, weighted by its gradient; that is held fixed, for its own change is in the other terms.
    fixed = ca.SX.sym("fixed", group.dim)
    q = at.w[size:]
    second = ca.substitute(ca.hessian(ca.dot(fixed, theta), q)[0], fixed, pulled)
    qq = K.T @ twice @ K + T.T @ ((bent + bent.T) / 12) @ T + second
    # X_next is linear in the entries of X: no second derivative there, and the mixed one is that of the carried columns.
    dual = ca.horzcat(*[carried.T @ (push(group, A)[0].T @ lam) for A in group.basis])
    Xq = dual @ K
    width = structure.width
    H = ca.SX(width, width)
    H[:size, size:] = Xq
    H[size:, :size] = Xq.T
    H[size:, size:] = qq
    return ca.vertcat(carried.T @ lam, K.T @ weights), H


def _identity(group: MatrixGroup) -> list[list[Any]]:
    return [[1 if i == j else 0 for j in range(group.degree)] for i in range(group.degree)]
