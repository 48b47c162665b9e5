"""The model's functions in CasADi's interpreter, and the steps that are chained from their stages."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.steering.ocp.elements import pack_element
from lie_codegen.steering.ocp.model_sizes import Model
from lie_codegen.steering.ocp.problem_data import QUADRATURES, ProblemData


class Stages(NamedTuple):
    """Of each stage of a step: its argument and that by (d, u), its derivative by its own arguments, its slope and that by (d, u)."""

    y: list[Array]
    Y: list[Array]
    S: list[Array]
    k: list[Array]
    K: list[Array]


class Place(NamedTuple):
    """Where stages lead by weights: the total and its derivative, Ad(exp(-total)), the right Jacobian."""

    weights: tuple[float, ...]
    total: Array
    slope: Array
    Ad: Array
    right: Array


class InterpretedModel:
    """Numbers in, numbers out."""

    def __init__(self, data: ProblemData, model: Model) -> None:
        self.data, self.sizes = data, model.sizes
        self.functions = {function.name(): function for function in model.functions}
        self.second_order = "model_move_hessian" in self.functions
        self.a, self.b, self.c = data.tableau
        self.inner = data.inner_weights
        h = data.duration / data.intervals
        self.nodes = tuple((c, weight * h) for c, weight in QUADRATURES[data.quadrature])
        self.needs_control = np.array(model.needs_control, dtype=bool)

    def _run(self, name: str, *arguments: Any) -> list[Array]:
        function = self.functions[name]
        padded = [a if np.size(a) else np.zeros(function.numel_in(i)) for i, a in enumerate(arguments)]
        results = function.call([np.asarray(a, dtype=float) for a in padded])
        return [np.array(result.full()).ravel() for result in results]

    def packed(self, X: Array, z: Array) -> Array:
        """A state as stored."""
        return np.concatenate([pack_element(self.data, X), z])

    def given(self, k: int) -> Array:
        """Rows of g that no control can change: at the start those of the state alone."""
        return ~self.needs_control if k == 0 else np.zeros(len(self.needs_control), dtype=bool)

    def step(self, x: Array, u: Array, p: Array, t: float, h: float, weights: tuple[float, ...] | None = None) -> Array:
        """x_{k+1}, or what the stages reach by other weights."""
        k, total = np.zeros(self.sizes.nx), np.zeros(self.sizes.nx)
        for a, b, c in zip(self.a, weights or self.b, self.c, strict=True):
            k = self._run("model_stage", x, h * a * k, u, p, t + c * h)[0]
            total = total + h * b * k
        return self._run("model_move", x, total)[0]

    def linear_stages(self, x: Array, u: Array, p: Array, t: float, h: float) -> Stages:
        """The stages of a step with their derivatives by (d, u)."""
        n, nx, m = self.sizes.dim, self.sizes.nx, self.sizes.m
        y, Y = np.zeros(nx), np.zeros((nx, nx + m))
        found = Stages([], [], [], [], [])
        k, K = np.zeros(nx), np.zeros((nx, nx + m))
        for a, c in zip(self.a, self.c, strict=True):
            y, Y = h * a * k, h * a * K
            k, flat = self._run("model_stage_jacobian", x, y, u, p, t + c * h)
            S = flat.reshape(nx, 2 * n + nx - n + m)
            K = np.hstack([S[:, :n], S[:, 2 * n :]]) + S[:, n : n + nx] @ Y
            for kept, value in zip(found, (y, Y, S, k, K), strict=True):
                kept.append(value)
        return found

    def reached(self, x: Array, stages: Stages, h: float, weights: tuple[float, ...]) -> tuple[Array, Array, Place]:
        """The state that the stages reach by weights, (nv, nv) the derivative of (it, u) by (d, u), and what its second order needs."""
        n, nx, m = self.sizes.dim, self.sizes.nx, self.sizes.m
        total = sum((h * b * k for b, k in zip(weights, stages.k, strict=True)), np.zeros(nx))
        slope = sum((h * b * K for b, K in zip(weights, stages.K, strict=True)), np.zeros((nx, nx + m)))
        Ad, right = (flat.reshape(n, n) for flat in self._run("model_move_jacobian", total))
        J = np.zeros((nx + m, nx + m))
        J[:n], J[n:nx] = right @ slope[:n], slope[n:]
        J[:n, :n] += Ad
        J[n:, n:] += np.eye(nx - n + m)
        return self._run("model_move", x, total)[0], J, Place(weights, total, slope, Ad, right)

    def end_curvature(self, place: Place, mu: Array, h: float) -> tuple[Array, Array]:
        """Of the Hessian of mu . F at a place, (nv, nv) the part of the end of the chain, and (stages, nx) what mu asks of the stages."""
        n, nx, m = self.sizes.dim, self.sizes.nx, self.sizes.m
        weights, total, slope, Ad, right = place
        direct = np.hstack([np.eye(n), np.zeros((n, nx - n + m))])
        S, C = (flat.reshape(n, n) for flat in self._run("model_move_hessian", total, mu))
        mixed = direct.T @ Ad.T @ C @ right @ slope[:n] / 2
        nu = np.concatenate([right.T @ mu[:n], mu[n:]])
        return slope[:n].T @ S @ slope[:n] + mixed + mixed.T, h * np.outer(weights, nu)

    def stage_curvature(self, x: Array, u: Array, p: Array, t: float, h: float, stages: Stages, loads: Array) -> Array:
        """(nv, nv) the stages' part of those Hessians."""
        n, nx, m = self.sizes.dim, self.sizes.nx, self.sizes.m
        direct = np.hstack([np.eye(n), np.zeros((n, nx - n + m))])
        H, back = np.zeros((nx + m, nx + m)), np.zeros(nx)
        others = np.hstack([np.zeros((nx - n + m, n)), np.eye(nx - n + m)])
        for s in range(len(self.a) - 1, -1, -1):
            weights = loads[s] + back
            size = 2 * n + nx - n + m
            time = t + self.c[s] * h
            curve = self._run("model_stage_hessian", x, stages.y[s], u, p, time, weights)[0].reshape(size, size)
            rest = others.copy()
            rest[: nx - n] += stages.Y[s][n:]
            L = np.vstack([direct, stages.Y[s][:n], rest])
            H = H + L.T @ curve @ L
            back = h * self.a[s] * stages.S[s][:, n : n + nx].T @ weights
        return np.asarray(H)

    def difference(self, x: Array, other: Array) -> Array:
        """(nx,) d with x (+) d = other."""
        return self._run("model_difference", x, other)[0]

    def cost(self, x: Array, u: Array, p: Array, t: float) -> float:
        """l."""
        return float(self._run("model_cost", x, u, p, t)[0][0])

    def cost_model(self, x: Array, u: Array, p: Array, t: float, *, exact: bool) -> tuple[float, Array, Array]:
        """l, its gradient and its Hessian (or J'J of residuals)."""
        value, g, H = self._run("model_cost_exact" if exact else "model_cost_square", x, u, p, t)
        return float(value[0]), g, H.reshape(len(g), len(g))

    def end_cost(self, x: Array, p: Array, t: float) -> float:
        """phi."""
        return float(self._run("model_end_cost", x, p, t)[0][0])

    def end_cost_model(self, x: Array, p: Array, t: float, nx: int, *, exact: bool) -> tuple[float, Array, Array]:
        """phi, its gradient and its Hessian."""
        value, v, P = self._run("model_end_cost_exact" if exact else "model_end_cost_square", x, p, t)
        return float(value[0]), v, P.reshape(nx, nx)

    def path(self, x: Array, u: Array, p: Array, t: float) -> Array:
        """g."""
        return self._run("model_path", x, u, p, t)[0] if self.sizes.path else np.zeros(0)

    def path_jacobian(self, x: Array, u: Array, p: Array, t: float, nv: int) -> tuple[Array, Array]:
        """g and its derivative."""
        if not self.sizes.path:
            return np.zeros(0), np.zeros((0, nv))
        g, G = self._run("model_path_jacobian", x, u, p, t)
        return g, G.reshape(len(g), nv)

    def path_hessian(self, x: Array, u: Array, p: Array, t: float, a: Array, nv: int) -> Array:
        """Hessian of a . g."""
        return self._run("model_path_hessian", x, u, p, t, a)[0].reshape(nv, nv)

    def end(self, x: Array, p: Array, t: float) -> Array:
        """What holds at the end: g of the state alone, then e."""
        return self._run("model_end", x, p, t)[0] if self._ends() else np.zeros(0)

    def end_jacobian(self, x: Array, p: Array, t: float, nx: int) -> tuple[Array, Array]:
        """It and its derivative."""
        if not self._ends():
            return np.zeros(0), np.zeros((0, nx))
        c, C = self._run("model_end_jacobian", x, p, t)
        return c, C.reshape(len(c), nx)

    def end_hessian(self, x: Array, p: Array, t: float, a: Array, nx: int) -> Array:
        """Hessian of a times it."""
        return self._run("model_end_hessian", x, p, t, a)[0].reshape(nx, nx)

    def _ends(self) -> int:
        return self.sizes.end_path + self.sizes.end
