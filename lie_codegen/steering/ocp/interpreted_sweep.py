"""Sweeps in numpy: the quadratic model of a stage, backwards with box programs, forwards with feedback."""

from __future__ import annotations

import numpy as np

from lie_codegen.arrays import Array
from lie_codegen.steering.ocp.box_program import box_program
from lie_codegen.steering.ocp.interpreted_merit import InterpretedMerit, Run


class InterpretedSweep(InterpretedMerit):
    """Backward and forward sweeps."""

    def end_model(self, run: Run) -> tuple[float, Array, Array]:
        N, nx = self.data.intervals, self.sizes.nx
        x, p, t, rho = run.space["x"][N], run.row(N), self._time(run, N), float(run.space["rho"])
        value, v, P = self.model.end_cost_model(x, p, t, nx, exact=run.exact)
        c, C = self.model.end_jacobian(x, p, t, nx)
        lam, below = run.space["lambda_end"][: len(c)], np.arange(len(c)) < self.sizes.end_path
        a = np.where(below, np.maximum(0, lam + rho * c), lam + rho * c)
        value += float(np.sum(np.where(below, (a * a - lam * lam) / (2 * rho), lam * c + rho * c * c / 2)))
        active = C[~below | (a > 0)]
        v, P = v + a @ C, P + rho * active.T @ active
        if run.exact and len(c):
            P = P + self.model.end_hessian(x, p, t, a, nx)
        return value, v, P

    def stage_model(self, run: Run, k: int, P: Array, v: Array) -> tuple[float, Array, Array]:
        nx, m, model = self.sizes.nx, self.sizes.m, self.model
        x, u, p, t = run.space["x"][k], run.space["u"][k], run.row(k), self._time(run, k)
        nv, value = nx + m, 0.0
        Q, q, W, w = np.zeros((nv, nv)), np.zeros(nv), np.zeros((nv, nv)), np.zeros(nv)
        W[:nx, :nx], w[:nx] = P, v
        stages = model.linear_stages(x, u, p, t, self.h)
        loads = np.zeros((len(stages.k), nx))
        for c, weight in model.nodes:
            if c == 0:
                cost, g, H = model.cost_model(x, u, p, t, exact=run.exact)
                value, q, Q = value + weight * cost, q + weight * g, Q + weight * H
            elif c == 1:
                ahead = run.space["x"][k + 1]
                cost, g, H = model.cost_model(ahead, u, run.row(k + 1), t + self.h, exact=run.exact)
                value, w, W = value + weight * cost, w + weight * g, W + weight * H
            else:
                inner, J, place = model.reached(x, stages, self.h, model.inner)
                cost, g, H = model.cost_model(inner, u, p, t + c * self.h, exact=run.exact)
                value += weight * cost
                q, Q = q + weight * J.T @ g, Q + weight * J.T @ H @ J
                if run.exact:
                    curve, asked = model.end_curvature(place, weight * g[:nx], self.h)
                    Q, loads = Q + curve, loads + asked
        # The value one step on, (w, W), is pulled back through the step: J^T W J alone is Gauss-Newton, the exact form adds w times the second derivative of the step.
        _, J, place = model.reached(x, stages, self.h, model.b)
        q, Q = q + J.T @ w, Q + J.T @ W @ J
        if run.exact:
            curve, asked = model.end_curvature(place, w[:nx], self.h)
            Q = Q + curve + model.stage_curvature(x, u, p, t, self.h, stages, loads + asked)
        g, G = model.path_jacobian(x, u, p, t, nv)
        lam, rho = run.space["lambda"][k][: len(g)], float(run.space["rho"])
        # Augmented Lagrangian of g <= 0: (max(0, lambda + rho g)^2 - lambda^2) / (2 rho), whose second derivative lives where it is pressed.
        a = np.where(model.given(k), 0, np.maximum(0, lam + rho * g))
        value += float(np.sum(np.where(model.given(k), 0, a * a - lam * lam))) / (2 * rho)
        pressed = G[a > 0]
        q, Q = q + a @ G, Q + rho * pressed.T @ pressed
        if run.exact and len(g):
            Q = Q + model.path_hessian(x, u, p, t, a, nv)
        return value, Q, q

    def _backward(self, run: Run, shift: float) -> tuple[float, float, Array, Array] | None:
        """Gain, merit, Hessian and gradient at the first state; None where a block is not positive definite."""
        space, nx, m = run.space, self.sizes.nx, self.sizes.m
        value, v, P = self.end_model(run)
        gain = 0.0
        for k in range(self.data.intervals - 1, -1, -1):
            cost, Q, q = self.stage_model(run, k, P, v)
            value += cost
            Quu, Qux, qu = Q[nx:, nx:], Q[nx:, :nx], q[nx:]
            u = space["u"][k]
            found = box_program(Quu + shift * np.eye(m), qu, self.low - u, self.high - u)
            if found is None:
                return None
            kappa, free, solve = found
            K = np.zeros((m, nx))
            K[free] = -solve(Qux[free])
            # For any feedback u + kappa + K dx: where a bound holds a control kappa is no Newton step, and the shorter forms for one do not hold.
            gain -= float(kappa @ (qu + Quu @ kappa / 2))
            v = q[:nx] + K.T @ (qu + Quu @ kappa) + Qux.T @ kappa
            P = Q[:nx, :nx] + Qux.T @ K + K.T @ Qux + K.T @ Quu @ K
            P = (P + P.T) / 2
            space["K"][k], space["kappa"][k] = K, kappa
            if not (np.isfinite(v).all() and np.isfinite(P).all()):
                return None
        return gain, value, P, v

    def _forward(self, run: Run, alpha: float) -> float:
        space, total = run.space, 0.0
        for k in range(self.data.intervals):
            d = self.model.difference(space["x"][k], space["x_new"][k])
            u = space["u"][k] + alpha * space["kappa"][k] + space["K"][k] @ d
            space["u_new"][k] = np.minimum(np.maximum(u, self.low), self.high)
            x, u = space["x_new"][k], space["u_new"][k]
            space["x_new"][k + 1] = self.model.step(x, u, run.row(k), self._time(run, k), self.h)
            total += self._interval_cost(run, k, x, u, space["x_new"][k + 1]) + self._path_terms(run, k, x, u)
            if not np.isfinite(total):
                return float("nan")
        return float(total + self._end_terms(run, space["x_new"][self.data.intervals]))

    def _take_new(self, run: Run) -> None:
        run.space["x"], run.space["u"] = run.space["x_new"].copy(), run.space["u_new"].copy()
