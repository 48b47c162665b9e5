"""Attitude control without a rate sensor and without the inertia, from one or two directions (Geyer, section 9).

    torque = -sum g_i y_i x y^_i - sum r_i y_i x y_i^d,   X^' = X^ hat(G s),   s = sum g_i y_i x y^_i,   y^_i = X^^T z_i,  y_i^d = X_d^T z_i
    V = omega.I omega/2 + sum r_i (1 - y_i.y_i^d) + sum g_i (1 - y_i.y^_i),   V' = -s^T G s

The filter X^ takes the place of the rates. With one direction the torque is perpendicular to y, so that p = y.I omega is conserved exactly: the
spin is never damped, and the body settles where r (1 - y.y_d) + p^2/(2 y.I y) is least, off the target unless p = 0 or y_d is a principal axis
d with r > p^2 (I_j - I_d)/I_d^2 for the other two. `offset` says p and that angle beforehand.
"""

from __future__ import annotations

import random
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from lie_codegen.arrays import Array
from lie_codegen.control.attitude_ports import random_rotation
from lie_codegen.control.guarded_law import on_group_alone
from lie_codegen.errors import InputError, ShapeError
from lie_codegen.exact.positive_matrix import as_floats, body_inertia, positive_matrix, positive_number
from lie_codegen.groups.catalogue_load import GroupLike, as_group
from lie_codegen.groups.maps.admission import admitted
from lie_codegen.groups.maps.matrices import matrix_port
from lie_codegen.kernel.arithmetic import Arithmetic
from lie_codegen.kernel.definition import doubles, kernel_factory
from lie_codegen.kernel.kernel import Kernel, Port
from lie_codegen.kernel.linear import (
    Matrix,
    Vector,
    cross,
    matvec,
    minus,
    negative,
    plus,
    scaled,
    transpose,
)
from lie_codegen.kernel.parameter import input_ports, parameter, sample_inputs, values_of
from lie_codegen.on_demand import scipy


class PointingOffset(float):
    """The angle [rad] by which one direction misses its target in the end, with why.

    Attributes:
        momentum, p: y.I omega, which the law keeps for ever [N m s].
        spin: rate of the turn about y that is left [rad/s].
        y: (3,) where the direction settles, in the body.
    """

    momentum: float
    spin: float
    y: Array

    @property
    def p(self) -> float:
        """The momentum about y."""
        return self.momentum

    @property
    def offset(self) -> float:
        """The angle itself."""
        return float(self)


@dataclass(frozen=True, eq=False, repr=False)
class OutputFeedback(Kernel):
    """(X_hat, y) -> (force, u_hat), with what one direction leaves undone.

    Attributes:
        directions: (k, 3) unit z_i.
        targets: (k, 3) unit y_i^d.
        r: (k,) gains towards the targets; () for an input.
    """

    directions: tuple[tuple[float, ...], ...] = field(default=(), repr=False)
    targets: tuple[tuple[float, ...], ...] = field(default=(), repr=False)
    r: tuple[float, ...] = field(default=(), repr=False)

    @property
    def kernel(self) -> Kernel:
        """The law itself."""
        return self

    def offset(self, X: ArrayLike, xi: ArrayLike, *, inertia: Any) -> PointingOffset:
        """The pointing offset of a body that starts at X with velocity xi; 0 with two directions or more.

        The amended potential r (1 - y.y_d) + p^2/(2 y.I y) is minimised from where y is and from 40 other places; the least minimum is given.

        Raises:
            ShapeError, InputError, NotOnGroupError: a state or an inertia that is none; r is an input.
        """
        if not self.r:
            raise InputError("offset depends on r, which is an input of this law: make one with that number")
        here = admitted(as_group("so3", "offset"), X, "X").X
        omega, metric = np.asarray(xi, dtype=float), as_floats(body_inertia(inertia))
        if omega.shape != (3,):
            raise ShapeError(f"offset: xi has shape {omega.shape}; give (3,)")
        y, target, r = here.T @ np.array(self.directions[0]), np.array(self.targets[0]), self.r[0]
        momentum = float(y @ metric @ omega)
        if len(self.directions) > 1:
            return _offset(0.0, momentum, 0.0, target)

        def amended(x: Array) -> float:
            e = x / np.linalg.norm(x)
            return float(r * (1 - e @ target) + momentum**2 / (2 * (e @ metric @ e)))

        rng = np.random.default_rng(0)
        starts = [y, target, *rng.normal(size=(40, 3))]
        found = [
            scipy.optimize.minimize(amended, x / np.linalg.norm(x), method="BFGS", options={"gtol": 1e-12})
            for x in starts
        ]
        best = min(found, key=lambda each: float(each.fun)).x
        e = best / np.linalg.norm(best)
        angle = float(np.arctan2(np.linalg.norm(np.cross(e, target)), e @ target))
        return _offset(angle, momentum, abs(momentum) / float(e @ metric @ e), e)


def _offset(angle: float, momentum: float, spin: float, y: Array) -> PointingOffset:
    made = PointingOffset(angle)
    made.momentum, made.spin, made.y = momentum, spin, y
    return made


@kernel_factory(group=as_group, target=doubles)
def output_feedback_law(
    group: GroupLike = "so3",
    *,
    directions: Any,
    target: Any = None,
    target_directions: Any = None,
    r: Any = 1,
    g: Any = 1,
    G: Any = 1,
    name: str = "output_feedback",
) -> OutputFeedback:
    """(X_hat, y) -> (force, u_hat): attitude control from directions alone; X_hat is a state of the law, X_hat' = X_hat hat(u_hat).

    Args:
        group: SO(3).
        directions: (k, 3) inertial directions z, of any length.
        target: (3, 3) X_d: y^d = X_d^T z.
        target_directions: (k, 3) y^d instead.
        r, g: (k,) gains, numbers for all; [N m].
        G: gain of the filter, a number, a diagonal or a (3, 3) matrix [1/(N m s)]. r, g and G may be "input": an input of that name,
            behind the others.
        name: C identifier.

    Raises:
        ShapeError, InputError: another group, directions or gains that do not fit, no target.
    """
    group = as_group(group, "output_feedback_law")
    if (group.degree, group.dim) != (3, 3) or group.is_complex:
        raise InputError(f"output_feedback_law is one of SO(3), not of {group.name}")
    z = _units(directions, "directions")
    if (target is None) == (target_directions is None):
        raise InputError("output_feedback_law: give target=X_d or target_directions=")
    if target is not None:
        wanted = z @ admitted(group, target, "target").X
    else:
        wanted = _units(target_directions, "target_directions")
    if wanted.shape != z.shape:
        raise ShapeError(f"output_feedback_law: {len(wanted)} target directions for {len(z)} directions")
    count = len(z)
    parameters = (
        parameter(
            Port("r", (count,), "N m", description="gains towards the targets"),
            r,
            lambda value, name: _gains(value, count, name),
        ),
        parameter(
            Port("g", (count,), "N m", description="gains towards the filter"),
            g,
            lambda value, name: _gains(value, count, name),
        ),
        parameter(
            Port("G", (3, 3), "1/(N m s)", description="gain of the filter, symmetric"),
            G,
            lambda value, name: positive_matrix(value, 3, name),
        ),
    )

    def body(ops: Arithmetic, X_hat: Matrix, y: Matrix, *given: Any) -> tuple[Any, ...]:
        far, near, filter_gain = values_of(ops, parameters, given)
        s: Vector = [0, 0, 0]
        pull: Vector = [0, 0, 0]
        turned = transpose(X_hat)
        for k, row in enumerate(y):
            seen = matvec(turned, [ops.constant(float(x)) for x in z[k]])
            s = plus(s, scaled(near[k], cross(row, seen)))
            pull = plus(pull, scaled(far[k], cross(row, [ops.constant(float(x)) for x in wanted[k]])))
        return minus(negative(s), pull), matvec(filter_gain, s)

    def sampler(rng: random.Random) -> tuple[Any, ...]:
        R = np.array(random_rotation(rng))
        return random_rotation(rng), (z @ R).tolist(), *sample_inputs(parameters, rng)

    made = OutputFeedback(
        name=name,
        namespace=group.name,
        inputs=(
            matrix_port(group, "X_hat", "state of the filter"),
            Port("y", z.shape, description="measured directions R' z, one a row"),
            *input_ports(parameters),
        ),
        outputs=(
            Port("force", (3,), "N m", description="body torque"),
            Port("u_hat", (3,), "rad/s", description="velocity of the filter, X_hat' = X_hat hat(u_hat)"),
        ),
        body=body,
        formula="f = -sum g y x y^ - sum r y x y_d, u^ = G sum g y x y^",
        source="Geyer, The Attitude Control Problem, section 9; V' = -s^T G s",
        sampler=sampler,
        directions=tuple(tuple(map(float, row)) for row in z),
        targets=tuple(tuple(map(float, row)) for row in wanted),
        r=tuple(float(each) for each in parameters[0].value or ()),
    )
    return on_group_alone(made, group, ("X_hat",))  # type: ignore[return-value]


def _units(rows: Any, name: str) -> Array:
    array = np.atleast_2d(np.asarray(doubles(rows) if isinstance(rows, list | tuple) else rows, dtype=float))
    if array.ndim != 2 or array.shape[1] != 3 or not np.all(np.isfinite(array)):
        raise ShapeError(f"output_feedback_law: {name} has shape {array.shape}; give (k, 3) finite numbers")
    lengths = np.linalg.norm(array, axis=1, keepdims=True)
    if np.any(lengths == 0):
        raise InputError(f"output_feedback_law: a row of {name} is zero")
    return np.asarray(array / lengths)


def _gains(value: Any, count: int, name: str) -> list[Any]:
    rows = value.tolist() if hasattr(value, "tolist") else value
    many = list(rows) if isinstance(rows, list | tuple) else [rows] * count
    if len(many) != count:
        raise ShapeError(f"output_feedback_law: {len(many)} gains {name} for {count} directions")
    return [positive_number(each, f"{name}[{i}]") for i, each in enumerate(many)]
