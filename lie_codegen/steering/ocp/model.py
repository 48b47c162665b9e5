"""The functions that the solver's core needs of a problem, as CasADi SX functions of dense columns.

Derivatives are by the local coordinates d = (eta, zeta) of x (+) d = (X exp(eta^), z + zeta). At d = 0 the retraction is its
2-jet, X (I + E + E^2 / 2) with E = hat(eta), a polynomial; so no exponential and no logarithm is differentiated. A Runge-Kutta
stage is emitted once, with its derivatives, and chained in C. Its end X exp(eta) exp(Theta + omega) has the 2-jet

    log(exp(-Theta) exp(eta) exp(Theta + omega)) = a + b + [a, b] / 2 + (D J_r(Theta)[omega]) omega / 2,
    a = Ad(exp(-Theta)) eta,  b = J_r(Theta) omega,

by the series of Baker, Campbell and Hausdorff, since d/ds log(exp(-Theta) exp(Theta + s omega)) is J_r(Theta + s omega) omega to
that order. (The same as lambda . vee(D - D^2 / 2) with D = M - I: without D^2 / 2 the Hessian would be wrong.)
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from lie_codegen.groups.derivation import derivation_of
from lie_codegen.groups.maps.element_pattern import pack, packed_size, unpack
from lie_codegen.groups.maps.exponential import exp_matrix, jacobian
from lie_codegen.groups.maps.log_routine import vee
from lie_codegen.groups.maps.logarithm import candidate
from lie_codegen.groups.maps.matrices import GroupMatrices
from lie_codegen.groups.maps.rkmk import hat_body
from lie_codegen.kernel.brackets import ad_star, bracket_form, dexp_inverse
from lie_codegen.kernel.casadi_arithmetic import CasadiArithmetic
from lie_codegen.kernel.complex_scalar import Complex
from lie_codegen.kernel.linear import matmul
from lie_codegen.on_demand import casadi as ca
from lie_codegen.steering.ocp.model_sizes import Model, Sizes
from lie_codegen.steering.ocp.problem_data import ProblemData, total_square
from lie_codegen.steering.ocp.terms import Point

_OPS = CasadiArithmetic(routines=False)
#: Terms of the series of J_r' lambda: to 1e-12 for |ad theta| <= 1, and curvature alone depends on it.
_SERIES = 16


class ModelBuilder:
    """Symbols of a problem, and the functions made of them."""

    def __init__(self, data: ProblemData) -> None:
        self.data = data
        self.group = data.group
        self.exact = derivation_of(data.group)
        n, q, m = data.group.dim, data.states.size, data.inputs.size
        self.n, self.q, self.m = n, q, m
        self.size = packed_size(data.group)
        self.x = ca.SX.sym("x", self.size + q)
        self.y = ca.SX.sym("y", n + q)
        self.u = ca.SX.sym("u", m)
        self.p = ca.SX.sym("p", max(1, data.parameters.size))
        self.t = ca.SX.sym("t")
        self.eta = ca.SX.sym("eta", n)

    def build(self, *, second_order: bool) -> Model:
        """All functions."""
        functions = [*self._steps(second_order), *self._costs(second_order), *self._conditions(second_order)]
        sizes = Sizes(
            self.n, self.q, self.size, self.m, self.data.parameters.size, self._path.numel(), self._lasting, self._ends
        )
        return Model(sizes, tuple(functions), tuple(self._needs_control), self._row_names())

    # points

    def _moved(self) -> Any:
        """X (I + E + E^2 / 2)."""
        X = unpack(self.group, ca.vertsplit(self.x)[: self.size])
        E = hat_body(self.group, _OPS, ca.vertsplit(self.eta))
        d = self.group.degree
        square = matmul(E, E)
        jet = [[_add(int(i == j), _add(E[i][j], _half(square[i][j]))) for j in range(d)] for i in range(d)]
        return matmul(X, jet)

    def _point(self, X: Any, z: Sequence[Any], *, end: bool = False) -> Point:
        values: dict[str, Sequence[Any]] = {"state": list(z), "parameter": ca.vertsplit(self.p)[: self._count()]}
        if not end:
            values["input"] = ca.vertsplit(self.u)
        return Point(_OPS, X, values, self.t)

    def _count(self) -> int:
        return self.data.parameters.size

    def _z(self) -> list[Any]:
        return ca.vertsplit(self.x)[self.size :] if self.q else []

    # functions

    def _function(self, name: str, inputs: Sequence[Any], outputs: dict[str, Any]) -> Any:
        """Dense columns, the 2-jet taken at eta = 0."""
        values = [ca.densify(ca.SX(value)) for value in outputs.values()]
        values = ca.substitute(values, [self.eta], [ca.SX.zeros(self.n)])
        flat = [ca.densify(ca.vec(value.T)) for value in values]  # row by row, as C reads matrices
        return ca.Function(name, inputs, flat, _names(inputs), list(outputs), {"cse": True})

    def _steps(self, second_order: bool) -> list[Any]:
        data, n, q = self.data, self.n, self.q
        theta, change = ca.vertsplit(self.y)[:n], ca.vertsplit(self.y)[n:]
        X = self._moved()
        if not data.is_invariant:
            X = matmul(X, exp_matrix(_OPS, self.exact, theta))
        z = [a + b for a, b in zip(self._z(), change, strict=True)]
        at = self._point(X, z)
        xi = data.xi(at)
        if data.integrator == "rkmk4" and not data.is_invariant:
            xi = dexp_inverse(_OPS, self.group.algebra, theta, xi)
        k = ca.vertcat(*[ca.SX(entry) for entry in (*xi, *data.rate(at))])
        # z enters as x's own and as the change of y: one derivative serves both
        zsym = self.x[self.size :]
        arguments = ca.vertcat(self.eta, self.y[:n], zsym, self.u)
        inputs = [self.x, self.y, self.u, self.p, self.t]
        slope = ca.jacobian(k, arguments)
        functions = [
            self._function("model_stage", inputs, {"k": k}),
            self._function("model_stage_jacobian", inputs, {"k": k, "S": slope}),
        ]
        mu = ca.SX.sym("mu", n + q)
        if second_order:
            curve = ca.hessian(ca.dot(mu, k), arguments)[0]
            functions.append(self._function("model_stage_hessian", [*inputs, mu], {"H": curve}))
        return functions + self._moves(mu, second_order)

    def _moves(self, mu: Any, second_order: bool) -> list[Any]:
        n = self.n
        theta = ca.vertsplit(self.y)[:n]
        X = unpack(self.group, ca.vertsplit(self.x)[: self.size])
        moved = [ca.SX(entry) for entry in pack(self.group, matmul(X, exp_matrix(_OPS, self.exact, theta)))]
        z = [a + b for a, b in zip(self._z(), ca.vertsplit(self.y)[n:], strict=True)]
        matrices = GroupMatrices(_OPS, self.exact.real)
        forward = matrices.read(exp_matrix(_OPS, self.exact, theta))
        backward = matrices.read(exp_matrix(_OPS, self.exact, [-c for c in theta]))
        units = [[int(i == j) for j in range(n)] for i in range(n)]
        Ad = ca.horzcat(*[_column(matrices.Ad(backward, forward, unit)) for unit in units])
        right = _matrix(jacobian(_OPS, self.exact, theta, "right", inverse=False))
        other = ca.SX.sym("other", self.x.numel())
        Y = unpack(self.group, ca.vertsplit(other)[: self.size])
        inverse = matrices.write(matrices.inverse(matrices.read(X)))
        log = self._local(matmul(inverse, Y))
        d = ca.vertcat(_column(log), other[self.size :] - self.x[self.size :])
        functions = [
            self._function("model_move", [self.x, self.y], {"next": ca.vertcat(*moved, *z)}),
            self._function("model_move_jacobian", [self.y], {"Ad": Ad, "right": right}),
            self._function("model_difference", [self.x, other], {"d": d}),
        ]
        if second_order:
            weights = mu[:n]
            pulled = self._pulled_back(weights, right)
            # (lambda . J_r(theta) omega) differentiated once by each: the quadratic form is its symmetric part
            by_theta = ca.jacobian(pulled, self.y[:n])
            C = _matrix(bracket_form(_OPS, self.group.algebra, ca.vertsplit(weights)))
            outputs = {"S": (by_theta + by_theta.T) / 2, "C": C}
            functions.append(self._function("model_move_hessian", [self.y, mu], outputs))
        return functions

    def _pulled_back(self, weights: Any, right: Any) -> Any:
        """J_r(theta)' lambda; where J_r has no closed form by sum_k (-ad*)^k lambda / (k + 1)!, a tenth of the derivatives."""
        if self.exact.adjoint_pattern is not None:
            return right.T @ weights
        theta = ca.vertsplit(self.y)[: self.n]
        power: list[Any] = ca.vertsplit(weights)
        total, factorial = list(power), 1.0
        for k in range(1, _SERIES + 1):
            power = ad_star(_OPS, self.group.algebra, theta, power)
            factorial *= k + 1
            total = [a + b * ((-1) ** k / factorial) for a, b in zip(total, power, strict=True)]
        return ca.vertcat(*[ca.SX(entry) for entry in total])

    def _local(self, M: Any) -> Any:
        """Local coordinates of M near the identity: its logarithm, where that has a closed form; else D - D^2/2 + D^3/3, D = M - I.

        The feedback only needs a chart that agrees with the logarithm to second order; the line search looks after the rest.
        """
        if self.exact.log_structure.is_closed:
            return candidate(_OPS, self.exact, M)
        d = range(self.group.degree)
        D = [[_add(-1 if i == j else 0, M[i][j]) for j in d] for i in d]
        square = matmul(D, D)
        cube = matmul(square, D)
        series = [[D[i][j] - _half(square[i][j]) + cube[i][j] * (1 / 3) for j in d] for i in d]
        return vee(_OPS, self.exact, series)

    def _costs(self, second_order: bool) -> list[Any]:
        data = self.data
        functions: list[Any] = []
        for name, parts, end in (
            ("model_cost", data.stage_cost, False),
            ("model_end_cost", data.terminal_cost, True),
        ):
            at = self._point(self._moved(), self._z(), end=end)
            scalar, residual = data.cost(parts, at, "terminal_cost" if end else "stage_cost")
            r = _column(residual)
            plain = ca.SX(scalar)
            value = plain + ca.SX(total_square(residual)) / 2
            variables = ca.vertcat(self.eta, self.x[self.size :], *([] if end else [self.u]))
            inputs = [self.x, *([] if end else [self.u]), self.p, self.t]
            curve, gradient = ca.hessian(plain, variables)
            slope = ca.jacobian(r, variables)
            square = slope.T @ slope if residual else 0
            pulled = slope.T @ r if residual else 0
            functions += [
                self._function(name, inputs, {"value": value}),
                self._function(
                    f"{name}_square", inputs, {"value": value, "gradient": gradient + pulled, "H": curve + square}
                ),
            ]
            if second_order:
                H, g = ca.hessian(value, variables)
                functions.append(self._function(f"{name}_exact", inputs, {"value": value, "gradient": g, "H": H}))
        return functions

    def _conditions(self, second_order: bool) -> list[Any]:
        data = self.data
        at = self._point(self._moved(), self._z())
        self._path = _column(data.rows(data.constraints, at))
        states = ca.vertcat(self.eta, self.x[self.size :])
        variables = ca.vertcat(states, self.u)
        inputs = [self.x, self.u, self.p, self.t]
        functions: list[Any] = []
        self._needs_control = list(ca.which_depends(self._path, self.u, 1, True)) if self._path.numel() else []
        if self._path.numel():
            functions += self._rows("model_path", "g", self._path, inputs, variables, second_order)
        at = self._point(self._moved(), self._z(), end=True)
        lasting, ends = data.rows(data.lasting, at), data.rows(data.terminal, at)
        self._lasting, self._ends = len(lasting), len(ends)
        if lasting or ends:
            column = _column([*lasting, *ends])
            functions += self._rows("model_end", "c", column, [self.x, self.p, self.t], states, second_order)
        return functions

    def _row_names(self) -> tuple[str, ...]:
        """A condition's name for each of its rows, numbered where it has several."""
        data = self.data
        path, end = self._point(self._moved(), self._z()), self._point(self._moved(), self._z(), end=True)
        names: list[str] = []
        for conditions, at in ((data.constraints, path), (data.lasting, end), (data.terminal, end)):
            for each in conditions:
                count = len(data.rows((each,), at))
                names += [each.name] if count == 1 else [f"{each.name}[{i}]" for i in range(count)]
        return tuple(names)

    def _rows(
        self, name: str, output: str, column: Any, inputs: list[Any], variables: Any, second_order: bool
    ) -> list[Any]:
        slope = ca.jacobian(column, variables)
        functions = [
            self._function(name, inputs, {output: column}),
            self._function(f"{name}_jacobian", inputs, {output: column, output.upper(): slope}),
        ]
        if second_order:
            a = ca.SX.sym("a", column.numel())
            curve = ca.hessian(ca.dot(a, column), variables)[0]
            functions.append(self._function(f"{name}_hessian", [*inputs, a], {"H": curve}))
        return functions


def _names(symbols: Sequence[Any]) -> list[str]:
    """x_0 -> x: what the symbols of a column were called."""
    return [ca.vertsplit(symbol)[0].name().rsplit("_", 1)[0] for symbol in symbols]


def _column(entries: Sequence[Any]) -> Any:
    return ca.vertcat(*[ca.SX(entry) for entry in entries]) if entries else ca.SX(0, 1)


def _matrix(rows: Sequence[Sequence[Any]]) -> Any:
    return ca.vertcat(*[ca.horzcat(*[ca.SX(entry) for entry in row]) for row in rows])


def _add(a: Any, b: Any) -> Any:
    if isinstance(a, int) and a == 0:
        return b
    if isinstance(b, int) and b == 0:
        return a
    return a + b


def _half(a: Any) -> Any:
    if isinstance(a, int) and a == 0:
        return 0
    return a * 0.5 if isinstance(a, Complex) else a / 2
